//! How well a pose can be known at all from the ranges of one scan (Censi 2007): the bound of Cramer and Rao.
//!
//! A range along a beam of direction `a` to a wall of normal `n` at incidence `b` changes with the robot's place by
//! `-n / cos b` and with its heading by the wall's slope along the beam.

use nalgebra::{Cholesky, Matrix3, Vector3};

use crate::plane::Point;
use crate::simulation::World;

/// Standard deviations of x and y that no unbiased estimate is better than, metres, for beams of these directions
/// with the deviation that `sd` says of a range and the cosine of its incidence; `None` if the place cannot be told.
pub(super) fn limit_m(
    world: &World,
    (at, heading): (Point, f64),
    bearings: &[f64],
    reach_m: f64,
    sd: impl Fn(f64, f64) -> f64,
) -> Option<[f64; 2]> {
    // Slopes by small steps: the simulator knows no normals.
    const STEP: f64 = 1e-5;
    let mut information = Matrix3::zeros();
    for bearing in bearings {
        let range = |at: Point, angle: f64| world.cast(at, angle, reach_m);
        let angle = heading + bearing;
        let Some((middle, cosine)) = range(at, angle) else { continue };
        let moved = [
            range(Point::new(at.x + STEP, at.y), angle),
            range(Point::new(at.x, at.y + STEP), angle),
            range(at, angle + STEP),
        ];
        let slopes = moved.map(|moved| moved.map(|(range, _)| (range - middle) / STEP));
        let [Some(x), Some(y), Some(turn)] = slopes else { continue };
        // At an edge, a step leads to another wall.
        if x.abs().max(y.abs()) > 1.05 / cosine.max(0.05) {
            continue;
        }
        let slope = Vector3::new(x, y, turn) / sd(middle, cosine);
        information += slope * slope.transpose();
    }
    let covariance = Cholesky::new(information)?.inverse();
    Some([covariance[(0, 0)].sqrt(), covariance[(1, 1)].sqrt()])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Piece;

    #[test]
    fn a_room_of_10_by_6_m_gives_the_published_millimetres() {
        let corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 6.0), (0.0, 6.0), (0.0, 0.0)];
        let corners = corners.map(|(x, y)| Point::new(x, y));
        let walls = corners.windows(2).map(|ends| Piece { a: ends[0], b: ends[1] }).collect();
        let world = World { name: "a room", walls, way: Vec::new() };
        let bearings: Vec<f64> = (0..360).map(|i| (f64::from(i) + 0.5).to_radians()).collect();
        let [x, y] =
            limit_m(&world, (Point::new(5.0, 3.0), 0.0), &bearings, 20.0, |_, _| 0.02).unwrap();
        // 1.6 and 1.1 mm.
        assert!((1.4e-3..1.8e-3).contains(&x) && (0.9e-3..1.3e-3).contains(&y), "{x} {y}");
    }
}
