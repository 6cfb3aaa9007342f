//! A pose with its covariance, and what its error has in common with errors of the map.
//!
//! A wall of the map is where it is claimed to be up to an error that is the same at every look. Whoever treats
//! it as fresh noise claims millimetres after a hundred looks. So errors of the map are *considered* (Schmidt
//! 1966): the filter keeps how the pose's error goes together with each of them, counts that in when it weighs
//! what is seen next, and never estimates the errors themselves. They are in units of their own deviation, so
//! that what one of them is worth may change from place to place.

use std::collections::BTreeMap;

use mapfold_map::gdb::{ObjectId, PlanPoint};
use mapfold_map::geometry::{
    Covariance, Level, Pose, Robot, UncertainPose, difference, mahalanobis_sq,
};
use mapfold_map::landmarks::LandmarkKind;
use mapfold_map::level::FeatureId;
use nalgebra::{Cholesky, Matrix3, SMatrix, SVector, Vector3};

/// A wall that looks are held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum WallName {
    /// A segment of the map.
    Mapped(FeatureId),
    /// A surface of the a-priori model, by its owner and where it begins.
    Planned(ObjectId, PlanPoint),
}

/// An error of the map that stays as it is: three independent components of unit variance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum MapError {
    /// What all that was mapped may have in common.
    Shared,
    /// Of one wall alone.
    Wall(WallName),
    /// Of where an object of the model stands.
    Object(ObjectId),
    /// Of one landmark alone, by its kind and its place in millimetres.
    Landmark(LandmarkKind, [i64; 2]),
}

/// Errors of the map that are kept in mind; of more, those that were met longest ago are taken for new.
const ERRORS_MAX: usize = 256;

/// Something seen, linearised about the pose: `innovation = -j_pose e_pose - sum j e_map + noise`, with the
/// errors of the pose and the map being truth less estimate negated, as usual.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Measurement<const N: usize> {
    /// What was seen less what was expected.
    pub(super) innovation: SVector<f64, N>,
    /// Derivative of what is expected by (x, y, heading).
    pub(super) j_pose: SMatrix<f64, N, 3>,
    /// Derivatives of what is expected by the map's errors, each error once.
    pub(super) j_errors: Vec<(MapError, SMatrix<f64, N, 3>)>,
    /// Covariance of the sensor's own noise.
    pub(super) noise: SMatrix<f64, N, N>,
}

impl<const N: usize> Measurement<N> {
    /// Only its component along a combination of its rows.
    pub(super) fn along(&self, by: &SVector<f64, N>) -> Measurement<1> {
        let row = by.transpose();
        Measurement {
            innovation: row * self.innovation,
            j_pose: row * self.j_pose,
            j_errors: self.j_errors.iter().map(|(error, j)| (*error, row * j)).collect(),
            noise: row * self.noise * by,
        }
    }
}

/// How the pose's error goes together with one of the map's.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Kept {
    cross: Matrix3<f64>,
    met: u64,
}

/// Squared Mahalanobis distance between two poses.
pub(super) fn apart_sq(a: &UncertainPose<Level, Robot>, b: &UncertainPose<Level, Robot>) -> f64 {
    mahalanobis_sq(&step_to(a, b), &(a.covariance + b.covariance))
}

/// From one pose to another, component by component.
pub(super) fn step_to(
    from: &UncertainPose<Level, Robot>,
    to: &UncertainPose<Level, Robot>,
) -> Vector3<f64> {
    let (from, to) = (&from.pose, &to.pose);
    let turn = difference(to.heading(), from.heading());
    Vector3::new(to.x - from.x, to.y - from.y, turn)
}

/// A pose that would count for less than the rest of this is left out.
const WEIGHT_MAX: f64 = 0.99;

/// The share of `a` in the intersection of two poses with these informations: where `ln det(w a + (1 - w) b)`, which is
/// concave, is greatest.
fn own_weight(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..20 {
        let weight = f64::midpoint(low, high);
        let rises = Cholesky::new(a * weight + b * (1.0 - weight))
            .is_none_or(|factor| factor.solve(&(a - b)).trace() > 0.0);
        if rises { low = weight } else { high = weight }
    }
    f64::midpoint(low, high)
}

/// The filter's state.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Filter {
    level_from_robot: UncertainPose<Level, Robot>,
    kept: BTreeMap<MapError, Kept>,
    updates: u64,
}

impl Filter {
    pub(super) fn new(level_from_robot: UncertainPose<Level, Robot>) -> Self {
        Self { level_from_robot, kept: BTreeMap::new(), updates: 0 }
    }

    pub(super) fn pose(&self) -> &UncertainPose<Level, Robot> {
        &self.level_from_robot
    }

    /// Carries the pose on by a step of the robot's own frame.
    pub(super) fn moved(&mut self, step: &UncertainPose<Robot, Robot>) {
        let (j, _) = self.level_from_robot.pose.j_compose(&step.pose);
        for kept in self.kept.values_mut() {
            kept.cross = j * kept.cross;
        }
        self.level_from_robot = self.level_from_robot.compose(step);
    }

    /// Allows for an error of the last step, ahead, aside and in heading, with these deviations.
    pub(super) fn slip(&mut self, sds: &[f64; 3]) {
        let slip = Covariance::from_variances(sds.map(|sd| sd * sd));
        let by = UncertainPose { pose: Pose::identity(), covariance: slip };
        self.moved(&by);
    }

    fn cross(&self, error: MapError) -> Matrix3<f64> {
        self.kept.get(&error).map_or_else(Matrix3::zeros, |kept| kept.cross)
    }

    /// Covariance of the pose with what is expected, and covariance of the innovation.
    fn spread<const N: usize>(
        &self,
        of: &Measurement<N>,
    ) -> (SMatrix<f64, 3, N>, SMatrix<f64, N, N>) {
        let h = &of.j_pose;
        let mut with_pose = self.level_from_robot.covariance.matrix() * h.transpose();
        let mut own = of.noise;
        let mut mixed = SMatrix::<f64, N, N>::zeros();
        for (error, j) in &of.j_errors {
            let cross = self.cross(*error) * j.transpose();
            with_pose += cross;
            mixed += j * j.transpose() + cross.transpose() * h.transpose();
        }
        own += h * with_pose + mixed;
        (with_pose, (own + own.transpose()) * 0.5)
    }

    /// The normalised square of the innovation, chi-square with `N` degrees of freedom, and the logarithm of
    /// its covariance's determinant; `None` if that is singular.
    pub(super) fn deviation<const N: usize>(&self, of: &Measurement<N>) -> Option<(f64, f64)> {
        let (_, spread) = self.spread(of);
        let covariance = Covariance::new(spread).ok()?;
        let off_sq = mahalanobis_sq(&of.innovation, &covariance);
        let factor = Cholesky::new(spread)?;
        let ln_determinant = (0..N).map(|i| 2.0 * factor.l()[(i, i)].ln()).sum();
        off_sq.is_finite().then_some((off_sq, ln_determinant))
    }

    /// Takes in a pose whose error may have anything in common with this one's, as both come from the same look and the
    /// same map: covariance intersection (Julier and Uhlmann 1997), `P^-1 = w A^-1 + (1 - w) B^-1` with the `w` that makes `P`
    /// smallest.
    pub(super) fn intersect(&mut self, other: &UncertainPose<Level, Robot>) {
        let own = self.level_from_robot;
        let informations = (own.covariance.information(), other.covariance.information());
        let (Some(a), Some(b)) = informations else { return };
        let weight = own_weight(&a, &b);
        if weight >= WEIGHT_MAX {
            return;
        }
        if weight <= 1.0 - WEIGHT_MAX {
            *self = Self::new(*other);
            return;
        }
        self.level_from_robot.covariance = own.covariance.scaled(1.0 / weight);
        self.update(&Measurement {
            innovation: step_to(&own, other),
            j_pose: Matrix3::identity(),
            j_errors: Vec::new(),
            noise: *other.covariance.scaled(1.0 / (1.0 - weight)).matrix(),
        });
    }

    /// Takes a measurement in, in Joseph's form. Leaves all as it was if the numbers do not allow it.
    pub(super) fn update<const N: usize>(&mut self, of: &Measurement<N>) {
        let (with_pose, spread) = self.spread(of);
        let Some(factor) = Cholesky::new(spread) else { return };
        let gain = factor.solve(&with_pose.transpose()).transpose();
        let a = Matrix3::identity() - gain * of.j_pose;
        let mut covariance = a * self.level_from_robot.covariance.matrix() * a.transpose()
            + gain * of.noise * gain.transpose();
        for (error, j) in &of.j_errors {
            let mixed = a * self.cross(*error) * j.transpose() * gain.transpose();
            covariance += gain * j * j.transpose() * gain.transpose() - mixed - mixed.transpose();
        }
        let Ok(covariance) = Covariance::new((covariance + covariance.transpose()) * 0.5) else {
            return;
        };
        let step = gain * of.innovation;
        let Pose { x, y, .. } = self.level_from_robot.pose;
        let pose = Pose::new(x + step.x, y + step.y, self.level_from_robot.pose.heading() + step.z);
        self.level_from_robot = UncertainPose { pose, covariance };
        self.updates += 1;
        for kept in self.kept.values_mut() {
            kept.cross = a * kept.cross;
        }
        for (error, j) in &of.j_errors {
            let met = self.updates;
            let kept = self.kept.entry(*error).or_insert(Kept { cross: Matrix3::zeros(), met });
            kept.cross -= gain * j;
            kept.met = met;
        }
        while self.kept.len() > ERRORS_MAX {
            let oldest = self.kept.iter().min_by_key(|(_, kept)| kept.met).map(|(error, _)| *error);
            oldest.map(|error| self.kept.remove(&error));
        }
    }
}
