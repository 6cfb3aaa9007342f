//! The server's answer to a contribution.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::ContributionState;
use crate::problem::Problem;

/// The contribution is on disk. The same id gets the same receipt, however often it is sent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Receipt {
    /// The contribution.
    pub id: Uuid,
    /// Its place in the level's log.
    pub revision: i64,
    /// When the server took it, RFC 3339.
    pub received_at: String,
    /// Folded or held, as it was taken; whether it was reverted since is in the log.
    pub state: ContributionState,
    /// SHA-256 of its canonical CBOR, lower-case hexadecimal.
    pub digest: String,
}

/// The answer to one contribution of an array: either `{"receipt": ..}` or `{"problem": ..}`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum UploadAnswer {
    /// It is on disk.
    Receipt(Receipt),
    /// It is not.
    Problem(Problem),
}
