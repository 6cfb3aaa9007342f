//! Sites: plants or buildings, the unit of tenancy and permissions.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A site to be made.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewSite {
    /// Slug: lower-case letters, digits and hyphens.
    pub site: String,
    /// Name for people; the slug if absent.
    #[serde(default)]
    pub name: Option<String>,
}

/// A site as it is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct SiteDescription {
    /// Slug.
    pub site: String,
    /// Name for people.
    pub name: String,
    /// Slugs of its levels.
    pub levels: Vec<String>,
}
