//! What robots found against the published GDB, and what operators answer.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::{GdbEntry, ObjectKind};

/// What has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ModelChangeKind {
    /// An object is gone.
    Missing,
    /// Beams pass where an object should be closed.
    Opened,
    /// An object stands elsewhere.
    Moved,
    /// A thing that the model does not know.
    New,
}

/// What an operator has said of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ModelChangeState {
    /// Nothing yet.
    Open,
    /// It is taken over into the draft, which is to be published yet.
    Accepted,
    /// It is not to be told of any more.
    Dismissed,
}

/// A rigid motion on the floor: turned about the level's origin, then shifted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Motion {
    /// Shift to the right.
    pub x_m: f64,
    /// Shift up.
    pub y_m: f64,
    /// Turn, counter-clockwise.
    pub heading_rad: f64,
    /// How far the middle of the object is from where it should be.
    pub distance_m: f64,
}

/// A stretch of surface that is seen through.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OpenStretch {
    /// Where it begins; the object is on the right of the way to its end.
    pub from_m: [f64; 2],
    /// Where it ends.
    pub to_m: [f64; 2],
    /// How thick the object is there; 0 for a sheet.
    pub depth_m: f64,
}

/// Who dismissed a change.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Dismissal {
    /// Public id of the token.
    pub author: String,
    /// When.
    pub at: String,
    /// Why, in the author's words.
    pub comment: String,
}

/// A difference between the published model and what robots found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ModelChange {
    /// Which one: the same for as long as it is the same thing.
    pub id: String,
    /// What it is.
    pub kind: ModelChangeKind,
    /// What was said of it.
    pub state: ModelChangeState,
    /// The object of the model; none for a new thing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<Uuid>,
    /// What the object is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object_kind: Option<ObjectKind>,
    /// What people call the object; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Where: the convex hull of what is missing, open or new, or of where the object stands now,
    /// counter-clockwise.
    pub hull_m: Vec<[f64; 2]>,
    /// Of a moved object: the motion from where the model has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// Of an opened object: where.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stretches: Vec<OpenStretch>,
    /// Surface of the object that scanners have looked at.
    pub probed_m: f64,
    /// Surface of it that they look through.
    pub through_m: f64,
    /// Segments of the vector map that show it.
    pub segments: Vec<String>,
    /// Clusters of the vector map that show it.
    pub clusters: Vec<String>,
    /// Distinct looks at the one of them that was seen most.
    pub looks: u32,
    /// Who saw them.
    pub robots: Vec<String>,
    /// When they were last seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_seen: Option<String>,
    /// Who dismissed it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dismissal: Option<Dismissal>,
}

/// `GET L/changes`: all that robots found against the published model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ModelChanges {
    /// The revision of the map.
    pub revision: i64,
    /// The publication that it was held against; 0 if nothing is published, and then there are no changes.
    pub publication: i64,
    /// The height that the model was cut at.
    pub height_m: f64,
    /// The changes, by identity.
    pub changes: Vec<ModelChange>,
}

/// What an operator makes of a change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ModelChangeAnswer {
    /// The draft of the model is to say so.
    Accept,
    /// It is not to be told of any more.
    Dismiss,
    /// A dismissal is taken back.
    Reopen,
}

/// `POST L/changes/{id}`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewModelChangeAnswer {
    /// What is to become of it.
    pub answer: ModelChangeAnswer,
    /// Why, for those who read the log; at most 500 bytes.
    #[serde(default)]
    pub comment: String,
    /// Of a new thing that is accepted: what it is; `other` if absent.
    #[serde(default)]
    pub kind: Option<ObjectKind>,
    /// Of a new thing or an opening that is accepted: what people are to call it.
    #[serde(default)]
    pub name: Option<String>,
    /// Of a new thing or an opening that is accepted: how high it is; 1 and 2.1 if absent.
    #[serde(default)]
    pub upper_m: Option<f64>,
}

/// What became of a change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ModelChangeAnswered {
    /// The change as it is now.
    pub change: ModelChange,
    /// The entry of the log that accepting it made; none if the draft says so already.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub entry: Option<GdbEntry>,
}
