//! Landmarks: what a robot finds itself by, and finding itself.
//!
//! A landmark is a corner of walls, a free end of a wall or a doorway, with the direction that it opens
//! to. A single one tells little; the distances, directions and kinds within a group of them tell a place.
//! [`LandmarkTable`] holds a level's landmarks so that structures of them are found fast; [`locate()`] holds
//! what a robot sees against it and answers with a [`Fix`]: one pose, several that cannot be told apart, or
//! none. Never a confident guess: one pose is answered only if all others together are a thousand times
//! less likely.
//!
//! Of many landmarks [`select`] chooses those that are good to find oneself by.
//!
//! Landmarks come from walls, those of one look ([`landmarks_of_look`]) or of the map ([`landmarks_of_map`], one for each
//! thing, from however many sides it was seen); those of
//! the a-priori model come from `gdb`, and what the model knows the map need not tell again ([`told_by`]).
//! Knows nothing of scans.

mod both_sides;
mod faces;
mod fit;
mod goodness;
mod grid;
mod hypothesis;
mod learned;
mod locate;
mod pairs;
mod same;
mod selection;
mod sight;
mod table;

use crate::geometry::{Covariance, Point, difference};

pub use both_sides::BothSidesConfig;
pub use faces::{FacesConfig, landmarks_of_look};
pub use fit::{Correspondence, FitError, PoseFit, fit_pose};
pub use goodness::{Applied, Goodness, GoodnessConfig, Traits};
pub use learned::{LearnedConfig, LearnedId, LearnedLandmark, landmarks_of_map};
pub use locate::{Candidate, Fix, LocateConfig, locate};
pub use same::{SameConfig, told_by};
pub use selection::{Selectable, Selected, select, select_by_goodness};
pub use sight::{Obstacles, Sight};
pub use table::LandmarkTable;

/// What a landmark is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum LandmarkKind {
    /// A corner that juts out into free space.
    ConvexCorner,
    /// A corner of a room.
    ConcaveCorner,
    /// Where a wall ends freely.
    WallEnd,
    /// The middle of a doorway.
    Doorway,
}

impl LandmarkKind {
    /// All kinds, in their canonical order.
    pub const ALL: [Self; 4] =
        [Self::ConvexCorner, Self::ConcaveCorner, Self::WallEnd, Self::Doorway];

    /// Whether it looks the same from the opposite side.
    pub fn is_two_sided(self) -> bool {
        self == Self::Doorway
    }

    /// By how much two directions of landmarks of this kind differ, radians: those of a doorway count
    /// modulo half a turn.
    pub fn turn(self, a: f64, b: f64) -> f64 {
        let turn = difference(a, b);
        if self.is_two_sided() && turn.abs() > std::f64::consts::FRAC_PI_2 {
            turn - std::f64::consts::PI.copysign(turn)
        } else {
            turn
        }
    }
}

/// A landmark of a level, or as a robot sees it: in the frame of the one or the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landmark {
    /// What it is.
    pub kind: LandmarkKind,
    /// Where it is, metres.
    pub at: Point,
    /// The direction that it opens to, radians: of a corner the bisector into free space, of a free end along
    /// its wall outwards, of a doorway across its wall (of both directions either).
    pub direction: f64,
    /// Covariance of the place.
    pub covariance: Covariance<2>,
    /// Standard deviation of the direction, radians.
    pub direction_sd: f64,
}

/// A landmark as a robot sees it, in the robot frame; its covariance is the sensor's alone.
pub type ObservedLandmark = Landmark;

impl Landmark {
    /// The larger standard deviation of its place, metres.
    pub fn place_sd(&self) -> f64 {
        let c = self.covariance.matrix();
        let (half_sum, half_gap) = (0.5 * (c[(0, 0)] + c[(1, 1)]), 0.5 * (c[(0, 0)] - c[(1, 1)]));
        (half_sum + half_gap.hypot(c[(0, 1)])).max(0.0).sqrt()
    }
}
