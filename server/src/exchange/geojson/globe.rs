//! Longitude and latitude (WGS 84, degrees) as metres about a place: to the east and to the north on the plane that touches the
//! ellipsoid there.
//!
//! With the radii of curvature of the ellipsoid, M along the meridian and N across it: `x = (lon - lon0) N cos(lat0)`,
//! `y = (lat - lat0) M`. Within a kilometre that is off by less than 0.1 per thousand up to 70 degrees of latitude.

use super::document::Position;

/// Semi-major axis of the ellipsoid, metres, and the square of its first eccentricity.
const AXIS_M: f64 = 6_378_137.0;
const ECCENTRICITY_SQ: f64 = 0.006_694_379_990_14;
/// A building is not longer, metres.
pub(super) const EXTENT_MAX_M: f64 = 10_000.0;

/// A place on the globe, and what a degree is there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Globe {
    /// Longitude and latitude of the origin, degrees.
    pub(super) origin: Position,
    /// Metres of a degree to the east and to the north.
    degree_m: Position,
}

impl Globe {
    /// About the middle of all positions; `None` if they are none on the globe, or so far apart that no building is there.
    pub(super) fn about(positions: impl Iterator<Item = Position>) -> Option<Self> {
        let none = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (low, high) = positions.fold(none, |(low, high), p| {
            ([0, 1].map(|k| low[k].min(p[k])), [0, 1].map(|k| high[k].max(p[k])))
        });
        let is_there = low[0] >= -180.0 && high[0] <= 180.0 && low[1] >= -85.0 && high[1] <= 85.0;
        if !is_there || low[0] > high[0] {
            return None;
        }
        let origin = [0, 1].map(|k| f64::midpoint(low[k], high[k]));
        let (sin, cos) = origin[1].to_radians().sin_cos();
        let shrunk = 1.0 - ECCENTRICITY_SQ * sin * sin;
        let across = AXIS_M / shrunk.sqrt();
        let along = AXIS_M * (1.0 - ECCENTRICITY_SQ) / shrunk.powf(1.5);
        let degree_m = [across * cos, along].map(f64::to_radians);
        let extent = [0, 1].map(|k| (high[k] - low[k]) * degree_m[k]);
        (extent[0].hypot(extent[1]) <= EXTENT_MAX_M).then_some(Self { origin, degree_m })
    }

    /// Metres to the east and to the north of the origin.
    pub(super) fn metres(&self, position: Position) -> Position {
        [0, 1].map(|k| (position[k] - self.origin[k]) * self.degree_m[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_degree_is_as_long_as_tables_say() {
        // Of WGS 84 at 45 degrees: 78 846.8 m of longitude and 111 131.8 m of latitude.
        let globe = Globe::about([[10.0, 45.0]].into_iter()).unwrap();
        let [east, north] = globe.metres([10.01, 45.01]);
        assert!((east - 788.468).abs() < 0.01 && (north - 1111.318).abs() < 0.01, "{east} {north}");
    }

    #[test]
    fn what_spans_countries_is_no_building() {
        assert!(Globe::about([[0.0, 0.0], [12.0, 7.0]].into_iter()).is_none());
        assert!(Globe::about([[0.0, 0.0], [200.0, 7.0]].into_iter()).is_none());
        assert!(Globe::about(std::iter::empty()).is_none());
    }
}
