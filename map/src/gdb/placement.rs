//! Where an object stands in the level, in three dimensions.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::exact::micrometres;

/// A point in space, in metres; z is the height above the level's floor.
pub type Point3 = Vector3<f64>;

/// A quaternion shorter than this has no direction.
const QUATERNION_MIN: f64 = 1e-6;

/// `level_from_object`: how an object's own coordinates lie in the level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// The origin of the object, in the level, metres.
    pub position: Point3,
    /// How it is turned.
    pub rotation: UnitQuaternion<f64>,
}

impl Placement {
    /// Upright, as nearly everything stands: turned about the vertical only, by `yaw`
    /// (counter-clockwise, radians).
    pub fn upright(position: Point3, yaw: f64) -> Self {
        Self { position, rotation: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw) }
    }

    /// Turned by a quaternion, `[w, x, y, z]`, which is made a unit; `None` if it is too short for that.
    pub fn turned(position: Point3, quaternion: [f64; 4]) -> Option<Self> {
        let [w, x, y, z] = quaternion;
        let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), QUATERNION_MIN)?;
        Some(Self { position, rotation })
    }

    /// Whether it is turned about the vertical only.
    pub fn is_upright(&self) -> bool {
        self.rotation.i == 0.0 && self.rotation.j == 0.0
    }

    /// The point `p` of the object in the level.
    pub fn point(&self, p: &Point3) -> Point3 {
        self.rotation * p + self.position
    }

    /// The object's own coordinates are the level's.
    pub fn identity() -> Self {
        Self { position: Point3::zeros(), rotation: UnitQuaternion::identity() }
    }

    /// The point `p` of the object in the level, in micrometres; `None` beyond 10 km from its origin.
    pub(super) fn grid_point(&self, p: &Point3) -> Option<[i64; 3]> {
        let q = self.point(p);
        Some([micrometres(q.x)?, micrometres(q.y)?, micrometres(q.z)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn a_quarter_turn_is_exact_on_the_grid() {
        let placement = Placement::upright(Point3::new(10.0, 0.0, 1.0), FRAC_PI_2);
        let p = placement.grid_point(&Point3::new(2.0, 0.5, 0.25));
        assert_eq!(p, Some([9_500_000, 2_000_000, 1_250_000]));
    }

    #[test]
    fn what_is_out_of_reach_or_no_number_has_no_place() {
        let placement = Placement::identity();
        assert_eq!(placement.grid_point(&Point3::new(1.1e4, 0.0, 0.0)), None);
        assert_eq!(placement.grid_point(&Point3::new(f64::NAN, 0.0, 0.0)), None);
    }
}
