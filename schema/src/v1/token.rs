//! Bearer tokens.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a token allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
pub enum Scope {
    /// Read maps.
    #[serde(rename = "map:read")]
    MapRead,
    /// Upload contributions, as the robot that the token names.
    #[serde(rename = "map:contribute")]
    MapContribute,
    /// Edit maps.
    #[serde(rename = "map:edit")]
    MapEdit,
    /// Publish versions.
    #[serde(rename = "map:publish")]
    MapPublish,
    /// Everything, on every site.
    #[serde(rename = "admin")]
    Admin,
}

/// A token to be made for a robot.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewToken {
    /// What it allows; `map:read` and `map:contribute` if absent.
    #[serde(default)]
    pub scopes: Option<Vec<Scope>>,
}

/// A new token. The secret is shown this once.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct IssuedToken {
    /// Public identity, for `token revoke`.
    pub id: String,
    /// What goes into `Authorization: Bearer`.
    pub token: String,
    /// What it allows.
    pub scopes: Vec<Scope>,
}
