//! One contribution as a file of the outbox.
//!
//! ```text
//! "MFOUTBOX"          8 bytes
//! version             u32, little-endian, 1
//! id                  16 bytes
//! frame               16 bytes
//! content digest      32 bytes, SHA-256 of the canonical CBOR
//! length of the CBOR  u32, little-endian
//! checksum            32 bytes, SHA-256 of all that is above and below
//! payload             the canonical CBOR, zstd
//! ```

use std::io::Read as _;

use mapfold_schema::codec;
use mapfold_schema::v1;
use sha2::{Digest, Sha256};
use uuid::Uuid;

use crate::sync::encoded::{ContentDigest, EncodedContribution};

const MAGIC: &[u8; 8] = b"MFOUTBOX";
const VERSION: u32 = 1;
const CHECKSUM_AT: usize = 80;
const HEAD_LENGTH: usize = CHECKSUM_AT + 32;
/// Fast, because each is packed again together with others before it is sent.
const ZSTD_LEVEL: i32 = 1;

/// Why a file is not a contribution that may be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum Damage {
    #[error("it is not a file of an outbox")]
    Foreign,
    #[error("it is of format version {0}, and this program knows {VERSION}")]
    Version(u32),
    #[error("it is cut short")]
    Short,
    #[error("its checksum does not fit")]
    Checksum,
    #[error("its content cannot be unpacked")]
    Packing,
    #[error("its content is not what its digest says")]
    Content,
}

/// What the head of a record says; the checksum over all of the file has been found right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct RecordHead {
    pub(super) id: Uuid,
    pub(super) frame: Uuid,
    pub(super) digest: ContentDigest,
    pub(super) cbor_bytes: u32,
}

/// A contribution as a file. `None` if it is longer than four gigabytes.
pub(super) fn write(contribution: &EncodedContribution) -> Option<std::io::Result<Vec<u8>>> {
    let length = u32::try_from(contribution.cbor.len()).ok()?;
    let payload = match zstd::bulk::compress(&contribution.cbor, ZSTD_LEVEL) {
        Ok(payload) => payload,
        Err(error) => return Some(Err(error)),
    };
    let mut bytes = Vec::with_capacity(HEAD_LENGTH + payload.len());
    bytes.extend_from_slice(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(contribution.id.as_bytes());
    bytes.extend(contribution.frame.as_bytes());
    bytes.extend(contribution.digest);
    bytes.extend(length.to_le_bytes());
    debug_assert_eq!(bytes.len(), CHECKSUM_AT);
    let checksum = checksum(&bytes, &payload);
    bytes.extend(checksum);
    bytes.extend_from_slice(&payload);
    Some(Ok(bytes))
}

fn checksum(head: &[u8], payload: &[u8]) -> [u8; 32] {
    Sha256::new().chain_update(head).chain_update(payload).finalize().into()
}

/// Checks a file as a whole and reads its head.
pub(super) fn read_head(bytes: &[u8]) -> Result<RecordHead, Damage> {
    if !bytes.starts_with(MAGIC) {
        return Err(Damage::Foreign);
    }
    let mut rest = &bytes[MAGIC.len()..];
    let version = u32::from_le_bytes(take(&mut rest)?);
    if version != VERSION {
        return Err(Damage::Version(version));
    }
    let head = RecordHead {
        id: Uuid::from_bytes(take(&mut rest)?),
        frame: Uuid::from_bytes(take(&mut rest)?),
        digest: take(&mut rest)?,
        cbor_bytes: u32::from_le_bytes(take(&mut rest)?),
    };
    let expected: [u8; 32] = take(&mut rest)?;
    if checksum(&bytes[..CHECKSUM_AT], rest) == expected { Ok(head) } else { Err(Damage::Checksum) }
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], Damage> {
    let (taken, left) = rest.split_first_chunk().ok_or(Damage::Short)?;
    *rest = left;
    Ok(*taken)
}

/// Reads a file to its end: what comes out is, byte for byte, what was put in.
pub(super) fn read(bytes: &[u8]) -> Result<EncodedContribution, Damage> {
    let RecordHead { id, frame, digest, cbor_bytes } = read_head(bytes)?;
    let length = u64::from(cbor_bytes);
    let mut cbor = Vec::new();
    let decoder = zstd::stream::read::Decoder::with_buffer(&bytes[HEAD_LENGTH..]);
    // One byte more than there should be, so that too much is noticed and no more is unpacked.
    let read = decoder.and_then(|decoder| decoder.take(length + 1).read_to_end(&mut cbor));
    if read.is_err() {
        return Err(Damage::Packing);
    }
    if cbor.len() as u64 != length || ContentDigest::from(Sha256::digest(&cbor)) != digest {
        return Err(Damage::Content);
    }
    Ok(EncodedContribution { id, frame, digest, cbor })
}

/// Whether the content is a contribution at all, and the one that its head says. What this program
/// wrote always is; a file made by somebody else, with a checksum of its own, need not be.
pub(super) fn is_consistent(contribution: &EncodedContribution) -> bool {
    let decoded: Result<v1::Contribution, _> = codec::from_cbor(&contribution.cbor);
    decoded.is_ok_and(|c| c.id == contribution.id && c.frame == contribution.frame)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::sync::tests::contribution;

    fn record() -> (EncodedContribution, Vec<u8>) {
        let encoded = EncodedContribution::of(&contribution(3)).unwrap();
        let bytes = write(&encoded).unwrap().unwrap();
        (encoded, bytes)
    }

    #[test]
    fn what_was_written_is_read() {
        let (encoded, bytes) = record();
        assert_eq!(read(&bytes), Ok(encoded.clone()));
        assert!(is_consistent(&encoded));
        let head = read_head(&bytes).unwrap();
        assert_eq!((head.id, head.frame, head.digest), (encoded.id, encoded.frame, encoded.digest));
    }

    #[test]
    fn every_flipped_bit_and_every_cut_is_noticed() {
        let (_, bytes) = record();
        for bit in 0..bytes.len() * 8 {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(read_head(&flipped).is_err(), "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert!(read_head(&bytes[..length]).is_err(), "cut to {length}");
        }
        let mut longer = bytes;
        longer.push(0);
        assert_eq!(read_head(&longer), Err(Damage::Checksum));
    }

    #[test]
    fn another_version_and_another_format_are_told_from_damage() {
        let (_, mut bytes) = record();
        bytes[8] = 2;
        assert_eq!(read_head(&bytes), Err(Damage::Version(2)));
        assert_eq!(read_head(b"\x28\xb5\x2f\xfd and so on"), Err(Damage::Foreign));
        assert_eq!(read_head(&[]), Err(Damage::Foreign));
    }

    /// A file whose checksum is right, but whose content was never ours.
    fn forged(digest: ContentDigest, cbor_bytes: u32, payload: &[u8]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend([7; 32]);
        bytes.extend(digest);
        bytes.extend(cbor_bytes.to_le_bytes());
        let checksum = checksum(&bytes, payload);
        bytes.extend(checksum);
        bytes.extend_from_slice(payload);
        bytes
    }

    #[test]
    fn a_right_checksum_over_wrong_content_does_not_help() {
        let zeros = vec![0; 1 << 20];
        let digest = Sha256::digest(&zeros).into();
        let packed = zstd::bulk::compress(&zeros, 3).unwrap();
        assert_eq!(read(&forged(digest, 100, &packed)), Err(Damage::Content));
        assert_eq!(read(&forged(digest, u32::MAX, &packed)), Err(Damage::Content));
        assert_eq!(read(&forged([0; 32], 1 << 20, &packed)), Err(Damage::Content));
        assert_eq!(read(&forged(digest, 1 << 20, b"no zstd")), Err(Damage::Packing));
        let read = read(&forged(digest, 1 << 20, &packed)).unwrap();
        assert!(!is_consistent(&read));
    }

    proptest! {
        #[test]
        fn no_bytes_at_all_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            prop_assert!(read(&bytes).is_err());
            let with_magic = [MAGIC.as_slice(), &VERSION.to_le_bytes(), &bytes].concat();
            prop_assert!(read(&with_magic).is_err());
        }
    }
}
