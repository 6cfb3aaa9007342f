//! The pose from landmarks that were told apart: weighted least squares with covariance.
//!
//! `q_i = R p_i + t + e_i` with `p_i` in the robot frame and `q_i` in the level frame,
//! `cov(e_i) = C_map,i + R C_obs,i R^T`. Starts from the closed form for scalar weights (Horn 1987, in the
//! plane) and takes Gauss-Newton steps with the full covariances.

use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};

use super::{Landmark, ObservedLandmark};
use crate::geometry::{Covariance, Level, Pose, Robot, UncertainPose, mahalanobis_sq};

/// Steps of Gauss-Newton; from the closed form two suffice for a micrometre.
const STEPS: usize = 3;

/// A landmark that was seen, and the one of the level that it is.
#[derive(Debug, Clone, Copy)]
pub struct Correspondence<'a> {
    /// As seen, in the robot frame.
    pub seen: &'a ObservedLandmark,
    /// As known, in the level frame.
    pub known: &'a Landmark,
}

/// Why landmarks give no pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FitError {
    /// Fewer than two.
    #[error("a pose needs two landmarks at least")]
    TooFew,
    /// All of them in one place.
    #[error("the landmarks lie too close together to tell a heading")]
    NoHeading,
}

/// A pose and how well its landmarks agree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseFit {
    /// The pose and its covariance.
    pub level_from_robot: UncertainPose<Level, Robot>,
    /// Sum of the squared residuals, each in its own covariance: chi-square with `2 n - 3` degrees of
    /// freedom.
    pub chi_sq: f64,
}

impl Correspondence<'_> {
    /// Residual `q - (R p + t)` at a pose, and its covariance without that of the pose.
    pub(super) fn residual(&self, pose: &Pose<Level, Robot>) -> (Vector2<f64>, Covariance<2>) {
        let residual = self.known.at - pose.act(&self.seen.at);
        (residual, self.known.covariance + turned(&self.seen.covariance, pose))
    }
}

/// A covariance of the robot frame in the level frame.
fn turned(covariance: &Covariance<2>, pose: &Pose<Level, Robot>) -> Covariance<2> {
    let (sin, cos) = pose.heading().sin_cos();
    covariance.transformed(&nalgebra::Matrix2::new(cos, -sin, sin, cos))
}

/// The pose that brings what was seen closest to what is known.
///
/// # Errors
/// Fewer than two landmarks, or no heading in them.
pub fn fit_pose(pairs: &[Correspondence<'_>]) -> Result<PoseFit, FitError> {
    if pairs.len() < 2 {
        return Err(FitError::TooFew);
    }
    let mut pose = closed_form(pairs).ok_or(FitError::NoHeading)?;
    let mut information = Matrix3::zeros();
    for _ in 0..STEPS {
        let mut gradient = Vector3::zeros();
        information = Matrix3::zeros();
        for pair in pairs {
            let (residual, covariance) = pair.residual(&pose);
            let Some(weight) = covariance.information() else { return Err(FitError::NoHeading) };
            let jacobian: Matrix2x3<f64> = pose.j_point_pose(&pair.seen.at);
            information += jacobian.transpose() * weight * jacobian;
            gradient += jacobian.transpose() * weight * residual;
        }
        let step = information.cholesky().ok_or(FitError::NoHeading)?.solve(&gradient);
        pose = Pose::new(pose.x + step[0], pose.y + step[1], pose.heading() + step[2]);
    }
    let covariance = information.cholesky().and_then(|c| {
        let inverse = c.inverse();
        Covariance::new((inverse + inverse.transpose()) * 0.5).ok()
    });
    let covariance = covariance.ok_or(FitError::NoHeading)?;
    let chi_sq = pairs
        .iter()
        .map(|pair| {
            let (residual, covariance) = pair.residual(&pose);
            mahalanobis_sq(&residual, &covariance)
        })
        .sum();
    Ok(PoseFit { level_from_robot: UncertainPose { pose, covariance }, chi_sq })
}

/// `heading = atan2(sum w (a x b), sum w a.b)` about the weighted means; `None` if the places coincide.
fn closed_form(pairs: &[Correspondence<'_>]) -> Option<Pose<Level, Robot>> {
    let weight = |pair: &Correspondence<'_>| {
        let trace = pair.seen.covariance.matrix().trace() + pair.known.covariance.matrix().trace();
        1.0 / trace.max(1e-12)
    };
    let total: f64 = pairs.iter().map(weight).sum();
    let mean = |of: &dyn Fn(&Correspondence<'_>) -> Vector2<f64>| {
        pairs.iter().map(|pair| of(pair) * weight(pair)).sum::<Vector2<f64>>() / total
    };
    let (seen, known) = (mean(&|pair| pair.seen.at), mean(&|pair| pair.known.at));
    let (mut cross, mut dot) = (0.0, 0.0);
    for pair in pairs {
        let (a, b) = (pair.seen.at - seen, pair.known.at - known);
        cross += weight(pair) * a.perp(&b);
        dot += weight(pair) * a.dot(&b);
    }
    let heading = (cross != 0.0 || dot != 0.0).then(|| cross.atan2(dot))?;
    let (sin, cos) = heading.sin_cos();
    let shift = known - Vector2::new(cos * seen.x - sin * seen.y, sin * seen.x + cos * seen.y);
    Some(Pose::new(shift.x, shift.y, heading))
}

#[cfg(test)]
mod tests {
    use super::super::LandmarkKind;
    use super::*;
    use crate::chance::Chance;
    use crate::geometry::{Point, difference};

    fn landmark(x: f64, y: f64, sds: [f64; 2]) -> Landmark {
        Landmark {
            kind: LandmarkKind::ConcaveCorner,
            at: Point::new(x, y),
            direction: 0.0,
            covariance: Covariance::from_variances(sds.map(|sd| sd * sd)),
            direction_sd: 0.05,
        }
    }

    #[test]
    fn without_noise_the_pose_is_exact_at_any_heading() {
        for degrees in (-180..=180).step_by(15) {
            let pose: Pose<Level, Robot> = Pose::new(3.0, -7.0, f64::from(degrees).to_radians());
            let seen =
                [(1.0, 0.5), (4.0, -2.0), (-0.3, 3.0)].map(|(x, y)| landmark(x, y, [0.02; 2]));
            let known = seen.map(|l| {
                let at = pose.act(&l.at);
                landmark(at.x, at.y, [0.01, 0.03])
            });
            for count in [2, 3] {
                let pairs: Vec<_> = seen[..count]
                    .iter()
                    .zip(&known)
                    .map(|(seen, known)| Correspondence { seen, known })
                    .collect();
                let fit = fit_pose(&pairs).unwrap().level_from_robot.pose;
                assert!((fit.position() - pose.position()).norm() < 1e-9);
                assert!(difference(fit.heading(), pose.heading()).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn too_few_or_one_place_give_no_pose() {
        let one = landmark(1.0, 1.0, [0.01; 2]);
        let pair = Correspondence { seen: &one, known: &one };
        assert_eq!(fit_pose(&[pair]), Err(FitError::TooFew));
        assert_eq!(fit_pose(&[pair, pair]), Err(FitError::NoHeading));
    }

    #[test]
    fn what_it_claims_is_true() {
        // Both errors oblique to the axes, of different size; 2000 runs: NEES 3 +- 5 standard errors.
        let mut chance = Chance(8);
        let (mut nees, mut chi, runs) = (0.0, 0.0, 2000);
        for _ in 0..runs {
            let pose: Pose<Level, Robot> =
                Pose::new(chance.normal(), chance.normal(), 6.0 * chance.share() - 3.0);
            let mut around = |p: Point, sds: [f64; 2]| {
                p + Point::new(sds[0] * chance.normal(), sds[1] * chance.normal())
            };
            let places = [(2.0, 1.0), (-1.0, 3.0), (4.0, -1.0), (0.5, -2.5), (3.0, 3.0)];
            let pairs: Vec<(Landmark, Landmark)> = places
                .iter()
                .map(|(x, y)| {
                    let truth = Point::new(*x, *y);
                    let (seen, known) = (around(truth, [0.03, 0.01]), pose.act(&truth));
                    let known = around(known, [0.02, 0.05]);
                    (
                        landmark(seen.x, seen.y, [0.03, 0.01]),
                        landmark(known.x, known.y, [0.02, 0.05]),
                    )
                })
                .collect();
            let pairs: Vec<_> =
                pairs.iter().map(|(seen, known)| Correspondence { seen, known }).collect();
            let fit = fit_pose(&pairs).unwrap();
            let found = fit.level_from_robot.pose;
            let error = Vector3::new(
                found.x - pose.x,
                found.y - pose.y,
                difference(found.heading(), pose.heading()),
            );
            nees += mahalanobis_sq(&error, &fit.level_from_robot.covariance) / f64::from(runs);
            chi += fit.chi_sq / f64::from(runs);
        }
        let standard_error = |dof: f64| (2.0 * dof / f64::from(runs)).sqrt();
        assert!((nees - 3.0).abs() < 5.0 * standard_error(3.0), "{nees}");
        assert!((chi - 7.0).abs() < 5.0 * standard_error(7.0), "{chi}");
    }
}
