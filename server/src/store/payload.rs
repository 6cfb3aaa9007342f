//! The two columns that hold a contribution: its features, and its evidence.
//!
//! They are apart because a level is opened from stored tiles, which hold all evidence already:
//! only the features of its log are read then.

use mapfold_schema::codec;
use mapfold_schema::v1;

/// Evidence is runs of small numbers; a higher level gains little and costs the robots' patience.
const ZSTD_LEVEL: i32 = 1;
/// More than the largest body that the server takes.
const EVIDENCE_BYTES_MAX: usize = 256 << 20;

/// A contribution as it stands in its row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Payload {
    /// CBOR of the contribution without its evidence.
    pub features: Vec<u8>,
    /// zstd of the CBOR of its evidence.
    pub evidence: Vec<u8>,
}

/// A contribution that does not go into a row, or a row that does not hold one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PayloadError {
    /// CBOR cannot hold it (none that was decoded).
    #[error(transparent)]
    Encode(#[from] codec::EncodeError),
    /// The bytes are not what was written.
    #[error(transparent)]
    Decode(#[from] codec::DecodeError),
    /// The evidence cannot be compressed or expanded.
    #[error("the evidence cannot be compressed or expanded: {0}")]
    Zstd(String),
}

/// Takes a contribution apart.
///
/// # Errors
/// A contribution that CBOR cannot hold (none that was decoded), or no memory for it.
pub fn split(mut contribution: v1::Contribution) -> Result<Payload, PayloadError> {
    let evidence = codec::to_cbor(&std::mem::take(&mut contribution.evidence))?;
    let evidence = zstd::bulk::compress(&evidence, ZSTD_LEVEL)
        .map_err(|e| PayloadError::Zstd(e.to_string()))?;
    Ok(Payload { features: codec::to_cbor(&contribution)?, evidence })
}

/// Puts a contribution together again.
///
/// # Errors
/// Columns that [`split`] did not write.
pub fn join(features: &[u8], evidence: &[u8]) -> Result<v1::Contribution, PayloadError> {
    let mut contribution = without_evidence(features)?;
    let evidence = zstd::bulk::decompress(evidence, EVIDENCE_BYTES_MAX)
        .map_err(|e| PayloadError::Zstd(e.to_string()))?;
    contribution.evidence = codec::from_cbor(&evidence)?;
    Ok(contribution)
}

/// A contribution as if it had no evidence.
///
/// # Errors
/// A column that [`split`] did not write.
pub fn without_evidence(features: &[u8]) -> Result<v1::Contribution, PayloadError> {
    Ok(codec::from_cbor(features)?)
}
