//! A robot finds itself on lines of a map, weighing them by what the map claims of them.
//!
//! Gauss-Newton on the (rho, alpha) of the observed lines. What the map's lines may share with each
//! other cannot be averaged out by looking at more of them: it goes into the pose's covariance once,
//! as large as it is on the worst of the lines that were used.

use mapfold_map::geometry::{
    Covariance, Level, Pose, Robot, UncertainPose, difference, mahalanobis_sq, tangent,
    unit_normal, wrap,
};
use mapfold_map::level::LevelMap;
use mapfold_map::vector::{Facing, ObservedSegment};
use nalgebra::{Matrix2, Matrix2x3, Matrix3, SMatrix, Vector2, Vector3};

/// A line of a map as a robot uses it: in normal form about the level's origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct MapLine {
    pub(super) rho: f64,
    pub(super) alpha: f64,
    pub(super) facing: Facing,
    /// Covariance of (rho, alpha) that is this line's own.
    pub(super) independent: Matrix2<f64>,
    /// Covariance of (rho, alpha) that other lines may share.
    pub(super) dependent: Matrix2<f64>,
    /// Coordinates of its ends along it.
    pub(super) span: (f64, f64),
}

impl MapLine {
    pub(super) fn of(map: &LevelMap) -> impl Iterator<Item = Self> {
        map.segments.values().filter_map(|segment| {
            Some(Self {
                rho: segment.line.rho(),
                alpha: segment.line.alpha(),
                facing: segment.facing,
                independent: *segment.independent.matrix(),
                dependent: *segment.dependent.matrix(),
                span: (segment.solid.first()?.span.from_m(), segment.solid.last()?.span.to_m()),
            })
        })
    }

    /// The line as a robot at `pose` sees it: (rho, alpha) in the robot frame, the sign of the turn
    /// that brought it to normal form, and the lever along the line. `None` from behind.
    fn seen_from(&self, pose: &Pose<Level, Robot>) -> Option<Expected> {
        let across = self.rho - unit_normal(self.alpha).dot(&pose.position());
        let sign = match self.facing {
            Facing::Origin if across > 0.0 => 1.0,
            Facing::Away if across < 0.0 => -1.0,
            _ => return None,
        };
        let turn = if sign < 0.0 { std::f64::consts::PI } else { 0.0 };
        Some(Expected {
            rho: sign * across,
            alpha: wrap(self.alpha - pose.heading() + turn),
            sign,
            along: tangent(self.alpha).dot(&pose.position()),
        })
    }
}

struct Expected {
    rho: f64,
    alpha: f64,
    sign: f64,
    along: f64,
}

impl Expected {
    fn j_pose(&self, line: &MapLine) -> Matrix2x3<f64> {
        let n = unit_normal(line.alpha) * -self.sign;
        Matrix2x3::new(n.x, n.y, 0.0, 0.0, 0.0, -1.0)
    }

    fn j_line(&self) -> Matrix2<f64> {
        Matrix2::new(self.sign, -self.sign * self.along, 0.0, 1.0)
    }

    fn residual(&self, seen: &ObservedSegment) -> Vector2<f64> {
        let line = &seen.line.line;
        Vector2::new(line.rho() - self.rho, difference(line.alpha(), self.alpha))
    }
}

/// A pairing is out of the question beyond these, metres and radians.
const PAIRING_MAX: (f64, f64) = (0.35, 0.12);
const STEPS: usize = 6;

/// The pose from which `segments` would be seen on these lines; `None` if they do not fix all
/// three of its components well.
pub(super) fn fix(
    lines: &[MapLine],
    segments: &[ObservedSegment],
    guess: &Pose<Level, Robot>,
) -> Option<UncertainPose<Level, Robot>> {
    let pairs: Vec<(&MapLine, &ObservedSegment)> =
        segments.iter().filter_map(|s| Some((pair(lines, s, guess)?, s))).collect();
    let mut pose = *guess;
    let mut found = None;
    for _ in 0..STEPS {
        let (step, covariance) = solve(&pairs, &pose)?;
        pose = Pose::new(pose.x + step.x, pose.y + step.y, pose.heading() + step.z);
        found = Some(covariance);
    }
    let covariance = found?;
    // A wrong pairing shows in what is left over.
    if pairs.iter().any(|(line, seen)| left_over(line, seen, &pose).is_none_or(|d| d > LEFT_MAX)) {
        return None;
    }
    // Parallel walls alone leave one direction open.
    let worst = covariance[(0, 0)].max(covariance[(1, 1)]).sqrt();
    if worst > 0.3 {
        return None;
    }
    Some(UncertainPose { pose, covariance: Covariance::new(covariance).ok()? })
}

/// 99.9 % of chi-square with two degrees of freedom.
const LEFT_MAX: f64 = 13.82;

/// The squared Mahalanobis distance of an observed line from where a pose would have it.
fn left_over(line: &MapLine, seen: &ObservedSegment, pose: &Pose<Level, Robot>) -> Option<f64> {
    let expected = line.seen_from(pose)?;
    let j = expected.j_line();
    let residual = expected.residual(seen);
    let spread =
        seen.line.covariance.matrix() + j * (line.independent + line.dependent) * j.transpose();
    Some((residual.transpose() * inverse(&spread)? * residual)[(0, 0)])
}

fn pair<'a>(
    lines: &'a [MapLine],
    seen: &ObservedSegment,
    guess: &Pose<Level, Robot>,
) -> Option<&'a MapLine> {
    let moved = |t: f64| guess.act(&seen.line.line.at(t));
    let ends = (moved(seen.from), moved(seen.to));
    let cost = |line: &MapLine| {
        let expected = line.seen_from(guess)?;
        let residual = expected.residual(seen);
        if residual.x.abs() > PAIRING_MAX.0 || residual.y.abs() > PAIRING_MAX.1 {
            return None;
        }
        let along = |p| tangent(line.alpha).dot(p);
        let (a, b) = (along(&ends.0), along(&ends.1));
        if a.max(b).min(line.span.1) - a.min(b).max(line.span.0) < 0.1 {
            return None;
        }
        let spread = Covariance::from_variances([0.01, 0.001]) + seen.line.covariance;
        Some(mahalanobis_sq(&residual, &spread))
    };
    lines
        .iter()
        .filter_map(|line| Some((cost(line)?, line)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, line)| line)
}

/// The inverse of a covariance or of an information; `None` unless it is positive definite.
pub(super) fn inverse<const N: usize>(of: &SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>> {
    nalgebra::Cholesky::new(*of).map(|factor| factor.inverse())
}

/// One step of Gauss-Newton and the covariance of its outcome.
fn solve(
    pairs: &[(&MapLine, &ObservedSegment)],
    pose: &Pose<Level, Robot>,
) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let mut information = Matrix3::zeros();
    let mut weighted = Vector3::zeros();
    let mut parts = Vec::new();
    let (mut shared_offset, mut shared_angle) = (0.0_f64, 0.0_f64);
    for (line, seen) in pairs {
        let Some(expected) = line.seen_from(pose) else { continue };
        let (h, j) = (expected.j_pose(line), expected.j_line());
        let own = seen.line.covariance.matrix() + j * line.independent * j.transpose();
        let shared = j * line.dependent * j.transpose();
        let inverse = inverse(&(own + shared))?;
        information += h.transpose() * inverse * h;
        weighted += h.transpose() * inverse * expected.residual(seen);
        parts.push((h.transpose() * inverse, own));
        shared_offset = shared_offset.max(shared[(0, 0)]);
        shared_angle = shared_angle.max(shared[(1, 1)]);
    }
    let total = inverse(&information)?;
    let mut covariance =
        Matrix3::from_diagonal(&Vector3::new(shared_offset, shared_offset, shared_angle));
    for (gain, own) in parts {
        let k = total * gain;
        covariance += k * own * k.transpose();
    }
    Some((total * weighted, (covariance + covariance.transpose()) * 0.5))
}
