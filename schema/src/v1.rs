//! The types of `/api/v1`. Metres, radians; instants are RFC 3339 in UTC; ids are UUIDs.

mod alignment;
mod building;
mod contribution;
mod event;
mod features;
mod gdb;
mod gdb_log;
mod import;
mod jsonfg;
mod level;
mod model_change;
mod model_file;
mod patch;
mod plan;
mod pose;
mod receipt;
mod revert;
mod robot;
mod sensor;
mod session;
mod site;
mod token;

pub use alignment::{
    Alignment, AlignmentCandidate, AlignmentDoubt, Alignments, NewAlignment, UnalignedFrame,
};
pub use building::{BuildingImport, BuildingReport};
pub use contribution::{
    Contribution, ContributionEntry, ContributionPage, ContributionRecord, ContributionState,
    EvidencePatch, FixBasis, ObservedCluster, ObservedEnd, ObservedSegment, PoseEstimate,
    Provenance, TilePatch,
};
pub use event::LevelEvent;
pub use features::{
    Chain, ChainKind, Cluster, EndKind, Facing, Segment, SensorClass, SolidInterval,
};
pub use gdb::{
    Door, DoorKind, GdbBox, GdbCylinder, GdbObject, GdbPlacement, GdbPolyhedron, GdbPrism,
    GdbPrototype, GdbSolid, ObjectKind,
};
pub use gdb_log::{
    FindingSeverity, GdbAnswer, GdbEdit, GdbEdited, GdbEntry, GdbEntryKind, GdbEntryPage,
    GdbFinding, GdbFindings, GdbPreview,
};
pub use import::{Import, ImportPage, ImportReport};
pub use jsonfg::{
    CollectionWord, FeatureWord, GdbCollection, GdbFeature, Geometry, PrototypeCollection,
    PrototypeFeature,
};
pub use level::{Bounds, Counts, LevelDescription, NewLevel};
pub use model_change::{
    Dismissal, ModelChange, ModelChangeAnswer, ModelChangeAnswered, ModelChangeKind,
    ModelChangeState, ModelChanges, Motion, NewModelChangeAnswer, OpenStretch,
};
pub use model_file::{GdbDocument, KindCount, LeftOut, ModelFormat, ModelImport, ModelReport};
pub use patch::{
    Patch, PriorTile, RasterChanges, Removed, TileAddress, TileEvidence, TilePlace, VectorPatch,
};
pub use plan::{
    GdbPlan, Landmark, LandmarkKind, LandmarkSource, LandmarkSupport, LandmarkTable, PlanCorner,
    PlanObject, PlanOpening, PlanOpeningSide,
};
pub use pose::UncertainPose;
pub use receipt::{Receipt, UploadAnswer};
pub use revert::{
    ChangeCounts, ChangeKind, ChangedFeature, FeatureKind, NewRevert, Revert, RevertPage,
    RevertPreview, RevertRecord, RobotShare, Undone,
};
pub use robot::{FixKind, LastPose, NewRobot, RobotDescription, RobotFix, RobotState, RobotUpdate};
pub use sensor::{RangeCorrection, SensorKind, SensorMount, SensorProfile};
pub use session::{NewSession, SessionDescription};
pub use site::{NewSite, SiteDescription};
pub use token::{IssuedToken, NewToken, Scope};
