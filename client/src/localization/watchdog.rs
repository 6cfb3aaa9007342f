//! When a tracked pose is no longer to be believed.

use mapfold_map::geometry::{
    Covariance, Level, Point, Robot, UncertainPose, chi_square_quantile, unit_normal,
};
use nalgebra::Matrix2;

/// What it takes to be lost.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WatchdogConfig {
    /// Looks in a row that contradict the pose.
    pub contradictions: u32,
    /// What a look contradicts with: its innovations taken together beyond this quantile of chi-square, given
    /// as that of the standard normal distribution (99.9 %).
    pub quantile_sds: f64,
    /// Or walls that fit nowhere although walls are known there: more of them than this share, by length, of all
    /// that tells where the robot is in some direction. The long sides of a corridor fit wherever along it the robot is.
    pub refused_share: f64,
    /// Less wall than this proves nothing, metres.
    pub wall_min: f64,
    /// Metres driven without anything that fits.
    pub blind_max: f64,
    /// Standard deviation of the heading, radians: beyond, first-order covariances are wrong.
    pub heading_sd_max: f64,
    /// Standard deviation of the place in its worst direction, metres.
    pub place_sd_max: f64,
}

impl WatchdogConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        contradictions: 5,
        quantile_sds: 3.0902,
        refused_share: 0.5,
        wall_min: 0.5,
        blind_max: 5.0,
        heading_sd_max: 15.0 * std::f64::consts::PI / 180.0,
        place_sd_max: 1.0,
    };
}

/// Why a robot is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lost {
    /// Look after look contradicts the pose: it was wrong, or the robot has been carried away.
    Contradicted,
    /// Nothing that fits was seen for too long a way.
    Blind,
    /// The pose is too uncertain to go on from.
    Uncertain,
}

/// Where a tracked robot is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tracking {
    /// There.
    Tracked(UncertainPose<Level, Robot>),
    /// Not known any more; it stays so.
    Lost(Lost),
}

/// What one look came to, as far as it matters here.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Verdict {
    /// Sum of the squared innovations of what was used, and their degrees of freedom.
    pub(super) off_sq: f64,
    pub(super) freedom: usize,
    /// How much of what was seen was used, and refused: `sum length n n^T` over walls with the normals `n`, metres.
    used: Matrix2<f64>,
    refused: Matrix2<f64>,
}

/// Directions in which walls are weighed, in half a turn.
const DIRECTIONS: u32 = 12;

impl Verdict {
    /// A wall of some length was used.
    pub(super) fn use_wall(&mut self, length: f64, normal: &Point) {
        self.used += normal * normal.transpose() * length;
    }

    /// A wall of some length was refused.
    pub(super) fn refuse_wall(&mut self, length: f64, normal: &Point) {
        self.refused += normal * normal.transpose() * length;
    }

    /// Whether more than a share of what tells the place in some direction was refused.
    fn refuses(&self, config: &WatchdogConfig) -> bool {
        (0..DIRECTIONS).any(|i| {
            let d = unit_normal(f64::from(i) * std::f64::consts::PI / f64::from(DIRECTIONS));
            let [used, refused] = [&self.used, &self.refused].map(|of| (d.transpose() * of * d).x);
            refused >= config.wall_min && refused > config.refused_share * (used + refused)
        })
    }
}

/// Counts what speaks against the pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Watchdog {
    contradictions: u32,
    blind: f64,
    lost: Option<Lost>,
}

impl Watchdog {
    /// Looks in a row that have contradicted the pose so far.
    pub(super) fn contradictions(&self) -> u32 {
        self.contradictions
    }

    pub(super) fn lost(&self) -> Option<Lost> {
        self.lost
    }

    /// The robot has driven so far, and its pose has come to this covariance.
    pub(super) fn moved(&mut self, way: f64, covariance: &Covariance<3>, config: &WatchdogConfig) {
        self.blind += way;
        let c = covariance.matrix();
        let (half_sum, half_gap) = (0.5 * (c[(0, 0)] + c[(1, 1)]), 0.5 * (c[(0, 0)] - c[(1, 1)]));
        let place_sd = (half_sum + half_gap.hypot(c[(0, 1)])).max(0.0).sqrt();
        if self.blind > config.blind_max {
            self.is_lost(Lost::Blind);
        } else if covariance.sd(2) > config.heading_sd_max || place_sd > config.place_sd_max {
            self.is_lost(Lost::Uncertain);
        }
    }

    /// The robot has looked.
    pub(super) fn looked(&mut self, verdict: &Verdict, config: &WatchdogConfig) {
        let Verdict { off_sq, freedom, .. } = *verdict;
        if freedom > 0 {
            self.blind = 0.0;
        }
        let is_off = freedom > 0 && off_sq > chi_square_quantile(freedom, config.quantile_sds);
        if is_off || verdict.refuses(config) {
            self.contradictions += 1;
        } else if freedom > 0 {
            self.contradictions = 0;
        }
        if self.contradictions >= config.contradictions {
            self.is_lost(Lost::Contradicted);
        }
    }

    /// The first reason counts.
    fn is_lost(&mut self, why: Lost) {
        self.lost.get_or_insert(why);
    }
}
