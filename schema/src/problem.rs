//! RFC 9457 problems: what every refused request is answered with.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::border::Violation;

/// Media type of a problem.
pub const PROBLEM_JSON: &str = "application/problem+json";

/// A refused request, in words that a person can act on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Problem {
    /// Stable URI of the kind of problem: `urn:mapfold:problem:<code>`.
    #[serde(rename = "type")]
    pub kind: String,
    /// The kind in words.
    pub title: String,
    /// The HTTP status.
    pub status: u16,
    /// What happened here and what to do about it.
    pub detail: String,
    /// The kind as a stable `snake_case` name.
    pub code: String,
    /// What is wrong with the body, place by place.
    #[serde(default)]
    pub errors: Vec<Violation>,
    /// Identity of the request, as in the server's log.
    #[serde(default)]
    pub request_id: Option<String>,
    /// Whether the same request may succeed later.
    #[serde(default)]
    pub retryable: bool,
}

impl Problem {
    /// A problem of the kind `code`.
    pub fn new(status: u16, code: &str, title: &str, detail: impl Into<String>) -> Self {
        Self {
            kind: format!("urn:mapfold:problem:{code}"),
            title: title.to_owned(),
            status,
            detail: detail.into(),
            code: code.to_owned(),
            errors: Vec::new(),
            request_id: None,
            retryable: matches!(status, 429 | 502..=504 | 507),
        }
    }
}
