//! Sessions of the operators' page.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::Scope;

/// A sign-in: the answer sets a cookie that scripts cannot read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewSession {
    /// A token, as it goes into `Authorization: Bearer`.
    pub token: String,
}

/// Who is signed in.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct SessionDescription {
    /// Public identity of the token.
    pub id: String,
    /// What it allows.
    pub scopes: Vec<Scope>,
    /// The only site that it reaches; all if absent.
    #[serde(default)]
    pub site: Option<String>,
    /// The robot that it speaks for, if it speaks for one.
    #[serde(default)]
    pub robot: Option<String>,
    /// When it ends, RFC 3339; never if absent.
    #[serde(default)]
    pub expires_at: Option<String>,
}
