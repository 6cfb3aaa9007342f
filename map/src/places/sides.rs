//! Which sides of walls are near a place. A wall that was hit shows the side from which it was seen: where the map has a
//! wall that turns another side there, it is another wall.

use std::f64::consts::TAU;

use crate::geometry::{Point, difference};

/// Directions are told apart in so many sectors, one bit of a [`Sides`] each.
const SECTORS: u32 = 16;
/// A side that is turned by less than this from the middle of a sector is one of it, radians.
const TURNED: f64 = 0.65;
/// A wall is near within this, metres.
pub(super) const NEAR_M: f64 = 0.2;

/// Sides of walls, by the directions in which they face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Sides(u16);

/// How a side that was seen compares with those that are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Compared {
    /// It is one of them, or none is known.
    Agrees,
    /// Only walls are known that turn their other side there.
    Behind,
    /// Only walls are known that stand across.
    Across,
}

fn bit(sector: u32) -> u16 {
    1 << (sector % SECTORS)
}

fn sector(direction: f64) -> u32 {
    // A direction just below a whole turn rounds to the first sector again.
    (direction.rem_euclid(TAU) / TAU * f64::from(SECTORS)).round() as u32
}

impl Sides {
    /// The side that faces along a vector, of any length.
    pub(super) fn facing(facing: &Point) -> Self {
        let direction = facing.y.atan2(facing.x);
        let is_alike = |of: &u32| {
            let middle = f64::from(*of) * TAU / f64::from(SECTORS);
            difference(middle, direction).abs() < TURNED
        };
        Self((0..SECTORS).filter(is_alike).map(bit).fold(0, |all, one| all | one))
    }

    /// These and those.
    pub(super) fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Compares with them a side that was seen to face along a vector.
    pub(super) fn compared(self, facing: &Point) -> Compared {
        let seen = sector(facing.y.atan2(facing.x));
        if self.0 == 0 || self.0 & bit(seen) != 0 {
            Compared::Agrees
        } else if self.0 & bit(seen + SECTORS / 2) != 0 {
            Compared::Behind
        } else {
            Compared::Across
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn towards(degrees: f64) -> Point {
        let (sin, cos) = degrees.to_radians().sin_cos();
        Point::new(2.0 * cos, 2.0 * sin)
    }

    #[test]
    fn a_side_is_met_from_before_it_from_behind_or_across() {
        for turned in (0..360).step_by(7).map(f64::from) {
            let known = Sides::facing(&towards(turned));
            for (off, compared) in [
                (0.0, Compared::Agrees),
                (25.0, Compared::Agrees),
                (-25.0, Compared::Agrees),
                (180.0, Compared::Behind),
                (156.0, Compared::Behind),
                (90.0, Compared::Across),
                (-90.0, Compared::Across),
            ] {
                assert_eq!(known.compared(&towards(turned + off)), compared, "{turned} {off}");
            }
        }
    }

    #[test]
    fn a_corner_has_two_sides_and_nothing_known_agrees_with_all() {
        let corner = Sides::facing(&towards(0.0)).with(Sides::facing(&towards(90.0)));
        assert_eq!(corner.compared(&towards(90.0)), Compared::Agrees);
        assert_eq!(corner.compared(&towards(180.0)), Compared::Behind);
        assert_eq!(Sides::default().compared(&towards(10.0)), Compared::Agrees);
    }
}
