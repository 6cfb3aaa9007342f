//! An observed segment moved to the level frame.

use nalgebra::{Matrix2, Matrix2x3, RowVector3, Vector2};

use super::leaders::Groupable;
use super::{Facing, ObservedEnd, ObservedSegment, VectorConfig};
use crate::geometry::{Covariance, Point, difference, tangent, unit_normal, wrap};
use crate::level::{Contribution, Provenance, RobotName};

/// A piece of wall as one look saw it, in the level frame, about its own middle: the offset of
/// the line from the middle (0) along the normal, and the angle of the normal, which points to where
/// the robot was.
#[derive(Debug, Clone)]
pub(super) struct Sighting {
    pub(super) alpha: f64,
    pub(super) normal: Point,
    pub(super) tangent: Point,
    pub(super) middle: Point,
    pub(super) half_length: f64,
    /// The ends at `middle - half_length * tangent` and `middle + half_length * tangent`.
    pub(super) ends: [ObservedEnd; 2],
    /// What this look saw through of the line, metres along it from the middle.
    seen_through: Vec<(f64, f64)>,
    /// Variance of the middle's place along the line from the pose's error, square metres.
    along_variance: f64,
    /// Covariance of (offset, alpha) from the sensor's errors in this look alone.
    pub(super) independent: Matrix2<f64>,
    /// Covariance of (offset, alpha) from the errors of this look's own fix on surveyed landmarks:
    /// its own as long as nobody has localized on the map that it is in.
    pub(super) own_fix: Matrix2<f64>,
    /// Covariance of (offset, alpha) from errors that other looks may share.
    pub(super) dependent: Matrix2<f64>,
    /// Whether the pose was found on surveyed landmarks only.
    pub(super) is_datum: bool,
    pub(super) robot: RobotName,
    pub(super) observed_at_us: i64,
    merit: f64,
}

/// Moves a covariance of (offset, alpha) by `lever` metres along the line.
pub(super) fn about(covariance: &Matrix2<f64>, lever: f64) -> Matrix2<f64> {
    let j = Matrix2::new(1.0, lever, 0.0, 1.0);
    j * covariance * j.transpose()
}

/// The trace with both components brought to one scale.
pub(super) fn scaled_trace(covariance: &Matrix2<f64>, config: &VectorConfig) -> f64 {
    let [offset, angle] = config.trace_scale;
    covariance[(0, 0)] / (offset * offset) + covariance[(1, 1)] / (angle * angle)
}

impl Sighting {
    /// Moves a segment of `look` to the level frame. The errors of the sensor and of the pose are kept
    /// apart; which part of the pose's error other looks share follows from its provenance.
    pub(super) fn new(
        segment: &ObservedSegment,
        look: &Contribution,
        config: &VectorConfig,
    ) -> Self {
        let pose = &look.level_from_robot.pose;
        let line = &segment.line.line;
        let along = (segment.from + segment.to) * 0.5;
        let middle = pose.act(&line.at(along));
        let alpha = wrap(line.alpha() + pose.heading());
        let normal = unit_normal(alpha);
        // Offset from the (fixed) middle: rho - n.m, so a turn of the line or of the robot by d
        // moves it by -along * d.
        let j_offset_line = Matrix2::new(1.0, -along, 0.0, 1.0);
        let j_offset_pose = Matrix2x3::new(normal.x, normal.y, -along, 0.0, 0.0, 1.0);
        let by_pose = |c: &Covariance<3>| *c.transformed(&j_offset_pose).matrix();
        let independent = *segment.line.covariance.transformed(&j_offset_line).matrix();
        let level_covariance = &look.level_from_robot.covariance;
        let mut dependent = by_pose(level_covariance);
        let mut own_fix = Matrix2::zeros();
        if look.provenance == Provenance::Datum {
            own_fix = dependent;
            let position = config.datum_position_sd * config.datum_position_sd;
            let heading = config.datum_heading_sd * config.datum_heading_sd;
            dependent = by_pose(&Covariance::from_variances([position, position, heading]));
        }
        let direction = tangent(alpha);
        let across = normal.dot(&(middle - pose.position()));
        let j_along_pose = RowVector3::new(direction.x, direction.y, across);
        let along_pose = level_covariance.transformed(&j_along_pose);
        let mut sighting = Self {
            alpha,
            normal,
            tangent: direction,
            middle,
            half_length: (segment.to - segment.from) * 0.5,
            ends: segment.ends,
            seen_through: segment
                .seen_through
                .iter()
                .map(|i| (i.from_m() - along, i.to_m() - along))
                .collect(),
            along_variance: along_pose.matrix()[(0, 0)],
            independent,
            own_fix,
            dependent,
            is_datum: look.provenance == Provenance::Datum,
            robot: look.robot.clone(),
            observed_at_us: look.observed_at_us,
            merit: 0.0,
        };
        if segment.facing == Facing::Origin {
            sighting.turn_round();
        }
        sighting.merit =
            2.0 * sighting.half_length / (1.0 + scaled_trace(&sighting.total(), config)).sqrt();
        sighting
    }

    /// The same line with the opposite normal: offsets change sign, and so do their
    /// correlations with the angle; what was the lower end becomes the upper.
    fn turn_round(&mut self) {
        let flip = Matrix2::new(-1.0, 0.0, 0.0, 1.0);
        self.alpha = wrap(self.alpha + std::f64::consts::PI);
        self.normal = -self.normal;
        self.tangent = -self.tangent;
        self.ends.swap(0, 1);
        for (from, to) in &mut self.seen_through {
            (*from, *to) = (-*to, -*from);
        }
        self.seen_through.reverse();
        self.independent = flip * self.independent * flip;
        self.own_fix = flip * self.own_fix * flip;
        self.dependent = flip * self.dependent * flip;
    }

    /// Covariance of (offset, alpha) from all errors.
    fn total(&self) -> Matrix2<f64> {
        self.independent + self.own_fix + self.dependent
    }

    /// The two ends in the level frame, in the order of `ends`.
    pub(super) fn end_points(&self) -> [Point; 2] {
        let half = self.tangent * self.half_length;
        [self.middle - half, self.middle + half]
    }

    /// The ends of what was surely seen: drawn in by `config.end_margin` standard deviations of
    /// their places, at most to a quarter of the length. Walls are the union of what looks have seen,
    /// so that otherwise the look that errs farthest outwards would decide where a wall ends.
    pub(super) fn sure_ends(&self, config: &VectorConfig) -> [Point; 2] {
        let [from, to] = self.ends.map(|end| {
            let sd = (end.sd * end.sd + self.along_variance).sqrt();
            self.half_length - (config.end_margin * sd).min(0.5 * self.half_length)
        });
        [self.middle - self.tangent * from, self.middle + self.tangent * to]
    }

    /// The ends of what this look saw through of the line.
    pub(super) fn openings(&self) -> impl Iterator<Item = [Point; 2]> {
        let at = |t: f64| self.middle + self.tangent * t;
        self.seen_through.iter().map(move |(from, to)| [at(*from), at(*to)])
    }

    /// Offset from `anchor` and lever from the own middle to it.
    pub(super) fn offset_about(&self, anchor: &Point) -> (f64, f64) {
        let arm = self.middle - anchor;
        (self.normal.dot(&arm), self.tangent.dot(&arm))
    }
}

impl Groupable for Sighting {
    type Config = VectorConfig;

    fn reach(&self) -> (Point, Point) {
        // Half of what may lie between two that pair; gaps and offsets are capped.
        const MARGIN: f64 = 0.25;
        let [a, b] = self.end_points();
        let margin = Point::new(MARGIN, MARGIN);
        (a.inf(&b) - margin, a.sup(&b) + margin)
    }

    fn merit(&self) -> f64 {
        self.merit
    }

    /// Chi-square gate on (offset, angle) about the middle of the overlap, on the overlap itself,
    /// and on facing (both normals point to where the robot was). The cost is the negative log
    /// likelihood, doubled.
    fn pairing(&self, follower: &Self, config: &VectorConfig) -> Option<f64> {
        let turn = difference(follower.alpha, self.alpha);
        if turn.abs() > config.angle_max {
            return None;
        }
        let [a, b] = follower.end_points();
        let (ta, tb) = (self.tangent.dot(&(a - self.middle)), self.tangent.dot(&(b - self.middle)));
        let low = ta.min(tb).max(-self.half_length);
        let high = ta.max(tb).min(self.half_length);
        if low - high > self.gap_allowed(follower, config) {
            return None;
        }
        let at = (low + high) * 0.5;
        let anchor = self.middle + self.tangent * at;
        let (offset, lever) = follower.offset_about(&anchor);
        if offset.abs() > config.offset_max {
            return None;
        }
        let noise = Matrix2::new(
            config.offset_noise * config.offset_noise,
            0.0,
            0.0,
            config.angle_noise * config.angle_noise,
        );
        let s = about(&self.total(), -at) + about(&follower.total(), lever) + noise;
        let determinant = s.determinant();
        if determinant <= 0.0 {
            return None;
        }
        let delta = Vector2::new(offset, turn);
        let adjugate = Matrix2::new(s[(1, 1)], -s[(0, 1)], -s[(1, 0)], s[(0, 0)]);
        let distance_sq = (delta.transpose() * adjugate * delta)[(0, 0)] / determinant;
        (distance_sq < config.gate).then(|| distance_sq + determinant.ln())
    }
}

impl Sighting {
    fn gap_allowed(&self, follower: &Self, config: &VectorConfig) -> f64 {
        let var = |s: &Self| s.ends[0].sd.max(s.ends[1].sd).powi(2);
        (2.0 * (var(self) + var(follower)).sqrt() + 0.05).min(config.gap_max)
    }
}
