//! From a row of the log back to the contribution that was folded.

use std::sync::Arc;

use mapfold_map::level::Contribution;
use mapfold_schema::border::{Limits, Target, Violation, check_contribution};
use mapfold_schema::v1::{self, ContributionState};

use crate::store::log::{FeaturesRow, LogRow};
use crate::store::payload::{self, PayloadError};
use crate::store::{StoreError, levels::LevelRow};

/// What stands in the log has passed the border once, perhaps under wider limits than today's.
const NO_LIMITS: Limits = Limits {
    coordinate_max_m: f64::MAX,
    segments_max: usize::MAX,
    clusters_max: usize::MAX,
    hull_points_max: usize::MAX,
    tiles_max: usize::MAX,
    evidence_max: i32::MAX,
    batch_max: usize::MAX,
};

/// A contribution with its place in the log.
#[derive(Debug, Clone)]
pub(crate) struct Logged {
    /// Its place.
    pub(crate) revision: i64,
    /// What has become of it.
    pub(crate) state: ContributionState,
    /// What it says.
    pub(crate) contribution: Arc<Contribution>,
}

impl Logged {
    /// Whether it is in the map.
    pub(crate) fn in_force(&self) -> bool {
        self.state == ContributionState::Folded
    }
}

/// What the contributions of a level were checked against, but for limits.
pub(crate) fn target(row: &LevelRow) -> Target {
    Target { frame: row.frame, resolution_m: row.resolution_m, limits: NO_LIMITS }
}

/// A whole row of the log.
///
/// # Errors
/// A row that does not hold what was accepted.
pub(crate) fn whole(row: &LogRow, target: &Target) -> Result<Logged, StoreError> {
    let wire = payload::join(&row.payload.features, &row.payload.evidence);
    logged(row.revision, row.state, wire, target)
}

/// A row of the log without its evidence.
///
/// # Errors
/// A row that does not hold what was accepted.
pub(crate) fn features(row: &FeaturesRow, target: &Target) -> Result<Logged, StoreError> {
    logged(row.revision, row.state, payload::without_evidence(&row.features), target)
}

fn logged(
    revision: i64,
    state: ContributionState,
    wire: Result<v1::Contribution, PayloadError>,
    target: &Target,
) -> Result<Logged, StoreError> {
    let corrupt = |detail: String| StoreError::Corrupt {
        table: "contributions",
        key: format!("revision {revision}"),
        detail,
    };
    let wire = wire.map_err(|e| corrupt(e.to_string()))?;
    let contribution = check_contribution(&wire, target).map_err(|wrong| {
        let first =
            wrong.first().map(|Violation { pointer, detail, .. }| format!("{pointer}: {detail}"));
        corrupt(first.unwrap_or_else(|| "is refused".to_owned()))
    })?;
    Ok(Logged { revision, state, contribution: Arc::new(contribution) })
}
