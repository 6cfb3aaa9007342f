//! A contribution that has passed the border, made ready for the log outside the level's task.

use std::sync::Arc;

use mapfold_map::level::Contribution;
use mapfold_schema::digest::content_digest;
use mapfold_schema::v1;
use uuid::Uuid;

use crate::store::contributions::NewContribution;
use crate::store::payload::{self, PayloadError};

/// A checked contribution and its row of the log.
#[derive(Debug, Clone)]
pub struct Accepted {
    pub(super) row: NewContribution,
    pub(super) checked: Arc<Contribution>,
}

impl Accepted {
    /// Encodes what was uploaded (`wire`) and keeps what the check made of it (`checked`).
    /// `received_at_us` is now, microseconds since 1970, the server's clock.
    ///
    /// # Errors
    /// A contribution that CBOR cannot hold (none that was decoded), or no memory for it.
    pub fn new(
        wire: v1::Contribution,
        checked: Contribution,
        received_at_us: i64,
    ) -> Result<Self, PayloadError> {
        let row = NewContribution {
            id: wire.id,
            digest: content_digest(&wire)?,
            robot: wire.robot.clone(),
            observed_at_us: checked.observed_at_us,
            received_at_us,
            emulated: wire.emulated,
            segment_count: count(wire.segments.len()),
            cluster_count: count(wire.clusters.len()),
            tile_count: count(wire.evidence.iter().map(|patch| patch.tiles.len()).sum()),
            frame: (wire.pose.provenance == v1::Provenance::OwnMap).then_some(wire.frame),
            pose: [wire.pose.x_m, wire.pose.y_m, wire.pose.heading_rad],
            pose_covariance: wire.pose.covariance,
            payload: payload::split(wire)?,
        };
        Ok(Self { row, checked: Arc::new(as_received(checked, received_at_us)) })
    }

    /// The robot's own frame that it is in; none if that is the level's.
    pub fn own_frame(&self) -> Option<Uuid> {
        self.row.frame
    }
}

/// A contribution as it is folded: nothing was seen after it came, whatever the robot's clock says.
/// Evidence from the future would stand above all that others see until then.
pub(super) fn as_received(mut contribution: Contribution, received_at_us: i64) -> Contribution {
    contribution.observed_at_us = contribution.observed_at_us.min(received_at_us);
    contribution
}

fn count(items: usize) -> u32 {
    u32::try_from(items).unwrap_or(u32::MAX)
}
