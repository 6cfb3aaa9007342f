//! The upload of contributions, and what counts as its answer.

use mapfold_schema::codec::CBOR;
use mapfold_schema::{route, v1};
use reqwest::Method;
use uuid::Uuid;

use super::answer::is_ours;
use super::exchange::Body;
use super::{Api, ApiError, LevelAddress, of_level};
use crate::sync::encoded::{EncodedContribution, cbor_array};

/// zstd's own default: further levels cost several times as much for a few per cent.
const ZSTD_LEVEL: i32 = 3;

/// Contributions packed for the wire, and how their receipts will be known.
#[derive(Debug, Clone)]
pub(in crate::sync) struct UploadBatch {
    packed: Vec<u8>,
    unpacked_bytes: usize,
    expected: Vec<(Uuid, String)>,
}

impl UploadBatch {
    /// Encodes and packs contributions.
    pub(super) fn of(contributions: &[v1::Contribution]) -> Result<Self, ApiError> {
        let encoded: Vec<EncodedContribution> =
            contributions.iter().map(EncodedContribution::of).collect::<Result<_, _>>()?;
        Self::pack(&encoded)
    }

    /// Packs contributions that are encoded already. Takes processor time.
    pub(in crate::sync) fn pack(contributions: &[EncodedContribution]) -> Result<Self, ApiError> {
        let array = cbor_array(contributions);
        Ok(Self {
            packed: zstd::bulk::compress(&array, ZSTD_LEVEL).map_err(ApiError::Pack)?,
            unpacked_bytes: array.len(),
            expected: contributions.iter().map(|c| (c.id, c.digest())).collect(),
        })
    }

    /// How many contributions there are in it.
    pub(in crate::sync) fn len(&self) -> usize {
        self.expected.len()
    }

    /// Its size before it was packed.
    pub(in crate::sync) fn unpacked_bytes(&self) -> usize {
        self.unpacked_bytes
    }
}

impl Api {
    /// Sends a batch; the answers are in its order.
    pub(in crate::sync) async fn upload(
        &self,
        level: &LevelAddress,
        batch: &UploadBatch,
    ) -> Result<Vec<v1::UploadAnswer>, ApiError> {
        let body = Body { media_type: CBOR, coding: Some("zstd"), bytes: batch.packed.clone() };
        let path = of_level(route::CONTRIBUTIONS, level)?;
        let answer = self.exchange(Method::POST, &path, Some(body)).await?;
        let answers: Vec<v1::UploadAnswer> = answer.decode()?;
        match flaw(&batch.expected, &answers) {
            None => Ok(answers),
            Some(what) => Err(answer.not_ours(&what)),
        }
    }
}

/// What keeps `answers` from being the answers to what was sent, if anything does. Only what names
/// the id and the content is believed: anybody can answer 201.
fn flaw(expected: &[(Uuid, String)], answers: &[v1::UploadAnswer]) -> Option<String> {
    if answers.len() != expected.len() {
        return Some(format!("{} answers to {} contributions", answers.len(), expected.len()));
    }
    expected.iter().zip(answers).find_map(|((id, digest), answer)| match answer {
        v1::UploadAnswer::Receipt(receipt) if receipt.id != *id => {
            Some(format!("a receipt for {} where one for {id} belongs", receipt.id))
        }
        v1::UploadAnswer::Receipt(receipt) if receipt.digest != *digest => {
            Some(format!("the receipt for {id} is for other content"))
        }
        v1::UploadAnswer::Problem(problem) if !is_ours(problem) => {
            Some(format!("a problem of the unknown kind {:?}", problem.kind))
        }
        _ => None,
    })
}
