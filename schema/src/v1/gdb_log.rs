//! Edits of the GDB and their publication: what is asked for, and what the log has.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::jsonfg::GdbFeature;

/// `PATCH L/gdb`: some objects put in the place of what they were, others taken away.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbEdit {
    /// New objects, and those that change, whole.
    #[serde(default)]
    pub put: Vec<GdbFeature>,
    /// Objects that are no more. One that is not there is none.
    #[serde(default)]
    pub remove: Vec<Uuid>,
}

/// Kinds of entries about the GDB.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum GdbEntryKind {
    /// Objects were put or removed: the draft is another.
    Edit,
    /// The draft was published.
    Publication,
}

/// An entry of a level's log about its GDB.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct GdbEntry {
    /// Its identity.
    pub id: Uuid,
    /// Its place in the level's log.
    pub revision: i64,
    /// What it does.
    pub kind: GdbEntryKind,
    /// The draft: after an edit the edit itself, of a publication the edit that is published. 0: the
    /// empty model.
    pub draft: i64,
    /// The revision of the site's library at that moment. A publication keeps it.
    pub library: i64,
    /// When the server took it.
    pub at: String,
    /// Public id of the token that asked for it.
    pub author: String,
    /// What for, in the author's words.
    pub comment: String,
    /// Objects that it put.
    pub put: u32,
    /// Objects that it removed.
    pub removed: u32,
}

/// A page of the entries about the GDB.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct GdbEntryPage {
    /// The entries, newest first.
    pub entries: Vec<GdbEntry>,
    /// `cursor` of the next page; absent on the last one.
    #[serde(default)]
    pub next: Option<String>,
}

/// The answer to an edit or a publication.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct GdbAnswer {
    /// The draft as it is now.
    pub draft: i64,
    /// The revision of the site's library.
    pub library: i64,
    /// What the log has of it; absent if all that was asked for was so already.
    #[serde(default)]
    pub entry: Option<GdbEntry>,
}

/// What an edit would change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GdbPreview {
    /// The draft that it would change.
    pub draft: i64,
    /// Objects that the model does not have now.
    pub new: u32,
    /// Objects that would be another.
    pub changed: u32,
    /// Objects that would be no more.
    pub removed: u32,
    /// What would be wrong with the model, at most 200 findings.
    pub findings: Vec<GdbFinding>,
    /// Whether there are more of them.
    pub more_findings: bool,
}

/// The answer to an edit that was made, or to one that was only asked about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
pub enum GdbEdited {
    /// What would change, for a preview.
    Preview(GdbPreview),
    /// It is so.
    Answer(GdbAnswer),
}

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FindingSeverity {
    /// Plans are made as if everything were right; somebody should have a look.
    Warning,
    /// Plans leave out what the finding is about, and the model cannot be published.
    Error,
}

/// Something wrong with a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GdbFinding {
    /// How bad it is.
    pub severity: FindingSeverity,
    /// Stable name of the fault.
    pub code: String,
    /// What is wrong and what to do.
    pub detail: String,
    /// In which object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<Uuid>,
    /// The other object, if it is between two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other: Option<Uuid>,
    /// In which prototype.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prototype: Option<String>,
    /// In which of its solids, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solid: Option<u32>,
    /// In which face of the polyhedron, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub face: Option<u32>,
    /// Where: in the level for what is between objects, else in the coordinates of the object or prototype.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_m: Option<[f64; 3]>,
}

/// `GET L/gdb/findings`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GdbFindings {
    /// The draft that they are about.
    pub draft: i64,
    /// The library that instances are taken from.
    pub library: i64,
    /// The findings: those in prototypes, in objects, between objects.
    pub findings: Vec<GdbFinding>,
}
