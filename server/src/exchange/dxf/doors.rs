//! Swings of doors as doorways: an arc about the hinge, from where the leaf is closed to where it is open.

use mapfold_map::geometry::Point;

use super::super::paired::Wall;

/// Least and greatest angle of a swing, radians.
const SWING: [f64; 2] = [std::f64::consts::FRAC_PI_6, 2.2];
/// Least and greatest width of a leaf, metres.
const WIDTH_M: [f64; 2] = [0.4, 2.5];
/// How far the end of a wall may be from the hinge or the other jamb, metres.
const JAMB_M: f64 = 0.35;
/// Sine of the largest angle between a doorway and the wall that it is in.
const STRAIGHT: f64 = 0.1;

/// A doorway found: its clear stretch along the middle of the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Swing {
    pub(super) ends: [Point; 2],
    /// How thick the wall is.
    pub(super) thickness: f64,
    /// How far the leaf opens, radians.
    pub(super) opens: f64,
}

/// The doorway of an arc; `None` if it is no swing of a door.
pub(super) fn swing(centre: Point, arc: &[Point], walls: &[Wall]) -> Option<Swing> {
    let (first, last) = (*arc.first()?, *arc.last()?);
    let width = (first - centre).norm();
    let (a, b) = (first - centre, last - centre);
    let opens = a.perp(&b).abs().atan2(a.dot(&b));
    if !(WIDTH_M[0]..=WIDTH_M[1]).contains(&width) || !(SWING[0]..=SWING[1]).contains(&opens) {
        return None;
    }
    // Closed, the leaf lies in line with a wall that ends at one of the jambs.
    let fits = [first, last].into_iter().flat_map(|closed| {
        let fits = walls.iter().filter_map(move |wall| in_line(wall, centre, closed));
        fits.map(move |(gap, wall)| (gap, closed, wall))
    });
    let (_, closed, wall) = fits.min_by(|p, q| p.0.total_cmp(&q.0))?;
    let step = wall.ends[1] - wall.ends[0];
    let along = step / step.norm();
    // Onto the middle of the wall.
    let onto = |p: Point| wall.ends[0] + along * along.dot(&(p - wall.ends[0]));
    Some(Swing { ends: [onto(centre), onto(closed)], thickness: wall.thickness, opens })
}

/// How far the jambs are from the ends of a wall that the closed leaf is in line with.
fn in_line(wall: &Wall, hinge: Point, closed: Point) -> Option<(f64, &Wall)> {
    let step = wall.ends[1] - wall.ends[0];
    let length = step.norm();
    let (along, leaf) = (step / length, closed - hinge);
    if along.perp(&leaf).abs() > STRAIGHT * leaf.norm() {
        return None;
    }
    let off = along.perp(&(hinge - wall.ends[0])).abs();
    let ends = [0.0, length];
    let gap = |p: Point| {
        let t = along.dot(&(p - wall.ends[0]));
        ends.iter().map(|end| (t - end).abs()).fold(f64::INFINITY, f64::min)
    };
    let gap = gap(hinge).min(gap(closed));
    (off <= wall.thickness / 2.0 + JAMB_M / 2.0 && gap <= JAMB_M).then_some((gap + off, wall))
}
