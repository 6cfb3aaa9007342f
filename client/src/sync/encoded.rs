//! A contribution as the bytes that its digest is of, made once and kept until it is acknowledged.

use mapfold_schema::codec::{self, EncodeError};
use mapfold_schema::v1;
use sha2::{Digest, Sha256};
use uuid::Uuid;

/// The content digest of a contribution: SHA-256 of its canonical CBOR.
pub(super) type ContentDigest = [u8; 32];

/// A contribution in canonical CBOR ([`codec::to_cbor`]).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EncodedContribution {
    pub(super) id: Uuid,
    pub(super) frame: Uuid,
    pub(super) digest: ContentDigest,
    pub(super) cbor: Vec<u8>,
}

impl EncodedContribution {
    /// Encodes a contribution.
    ///
    /// # Errors
    /// One that CBOR cannot hold (none that perception makes).
    pub fn of(contribution: &v1::Contribution) -> Result<Self, EncodeError> {
        let cbor = codec::to_cbor(contribution)?;
        let digest = Sha256::digest(&cbor).into();
        Ok(Self { id: contribution.id, frame: contribution.frame, digest, cbor })
    }

    /// Its id.
    pub fn id(&self) -> Uuid {
        self.id
    }

    /// The UUID of the level frame that it is in.
    pub fn frame(&self) -> Uuid {
        self.frame
    }

    /// Its canonical CBOR.
    pub fn cbor(&self) -> &[u8] {
        &self.cbor
    }

    /// The digest as receipts bear it: lower-case hexadecimal.
    pub fn digest(&self) -> String {
        hexadecimal(&self.digest)
    }
}

/// A CBOR array of the contributions: what [`codec::to_cbor`] makes of a slice of them, without
/// encoding any of them again.
pub(super) fn cbor_array(contributions: &[EncodedContribution]) -> Vec<u8> {
    let bytes: usize = contributions.iter().map(|c| c.cbor.len()).sum();
    let mut array = Vec::with_capacity(bytes + 9);
    array_header(contributions.len() as u64, &mut array);
    for contribution in contributions {
        array.extend_from_slice(&contribution.cbor);
    }
    array
}

/// The head of a CBOR array (RFC 8949, section 3): major type 4 and the shortest form of the count.
fn array_header(count: u64, to: &mut Vec<u8>) {
    const ARRAY: u8 = 4 << 5;
    match count {
        0..=23 => to.push(ARRAY | count as u8),
        24..=0xff => to.extend([ARRAY | 0x18, count as u8]),
        0x100..=0xffff => {
            to.push(ARRAY | 0x19);
            to.extend((count as u16).to_be_bytes());
        }
        0x1_0000..=0xffff_ffff => {
            to.push(ARRAY | 0x1a);
            to.extend((count as u32).to_be_bytes());
        }
        _ => {
            to.push(ARRAY | 0x1b);
            to.extend(count.to_be_bytes());
        }
    }
}

pub(super) fn hexadecimal(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 16] = b"0123456789abcdef";
    bytes
        .iter()
        .flat_map(|byte| [byte >> 4, byte & 15].map(|d| char::from(DIGITS[usize::from(d)])))
        .collect()
}

#[cfg(test)]
mod tests {
    use mapfold_schema::digest::content_digest;

    use super::*;
    use crate::sync::tests::contribution;

    #[test]
    fn the_digest_is_that_of_the_schema() {
        let contribution = contribution(7);
        let encoded = EncodedContribution::of(&contribution).unwrap();
        assert_eq!(encoded.digest(), content_digest(&contribution).unwrap());
    }

    #[test]
    fn an_array_of_encoded_contributions_is_what_the_codec_makes_of_them() {
        for count in [0, 1, 23, 24, 64, 255, 256, 300] {
            let plain: Vec<v1::Contribution> = (0..count).map(contribution).collect();
            let encoded: Vec<EncodedContribution> =
                plain.iter().map(|c| EncodedContribution::of(c).unwrap()).collect();
            assert_eq!(cbor_array(&encoded), codec::to_cbor(&plain).unwrap(), "{count}");
        }
    }

    #[test]
    fn long_arrays_have_the_head_that_the_standard_says() {
        for (count, head) in
            [(65_536, [0x9a, 0, 1, 0, 0].as_slice()), (1 << 32, &[0x9b, 0, 0, 0, 1, 0, 0, 0, 0])]
        {
            let mut bytes = Vec::new();
            array_header(count, &mut bytes);
            assert_eq!(bytes, head);
        }
    }
}
