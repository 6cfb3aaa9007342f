//! Landmarks of faces of walls: where two meet, where one ends, where one has a doorway. Whose faces they are, looks' or
//! the map's, is said by who makes them.

use nalgebra::Matrix2;

use super::grid::Grid;
use super::{Landmark, LandmarkKind, ObservedLandmark};
use crate::geometry::{Covariance, Line, Point, offset_variance, tangent};
use crate::vector::{EndKind, Facing, ObservedSegment};

/// When walls make a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacesConfig {
    /// Shorter walls make none, metres.
    pub length_min: f64,
    /// Walls that meet under less are taken for one: sine of the angle.
    pub sine_min: f64,
    /// How far an end may be from where its wall's line meets the other's, metres, besides three deviations.
    pub reach: f64,
    /// Widths of doorways, metres.
    pub doorway: (f64, f64),
    /// How far the two sides of a doorway may be off one line, metres, and turned, sine.
    pub doorway_off: (f64, f64),
    /// Share of a doorway that must have been looked through.
    pub seen_through: f64,
}

impl FacesConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        length_min: 0.25,
        sine_min: 0.35,
        reach: 0.15,
        doorway: (0.65, 1.30),
        doorway_off: (0.15, 0.09),
        seen_through: 0.6,
    };
}

/// A landmark, and which faces make it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub(super) landmark: Landmark,
    /// The angle of free space at a corner, radians; the width of a doorway, metres; 0 for an end.
    pub(super) extent: f64,
    /// The walls of the face before and the one after it, free space on the left; the same twice for an end.
    pub(super) walls: [usize; 2],
    /// Of an end: whether it is where its face begins.
    pub(super) is_tail: bool,
}

/// One side of a wall, with free space on its left.
#[derive(Debug, Clone)]
pub(super) struct Face {
    /// The number of its wall, by whoever asks.
    wall: usize,
    /// Unit vector from tail to head.
    direction: Point,
    tail: End,
    head: End,
    /// Along which coordinates count, and the covariance of its (rho, alpha).
    tangent: Point,
    covariance: Covariance<2>,
    /// Stretches of its line that were looked through, by that coordinate, metres.
    open: Vec<(f64, f64)>,
    /// Whether beams of many looks passed its physical ends, so that nothing is between two such ends of two walls: in maps.
    is_of_map: bool,
}

#[derive(Debug, Clone, Copy)]
struct End {
    at: Point,
    kind: EndKind,
    along_sd: f64,
}

impl Face {
    /// A face of the wall numbered `wall`, on a line with the covariance of its (rho, alpha); each end with its coordinate
    /// along the line, its kind and the deviation of that coordinate.
    pub(super) fn new<F: Copy>(
        wall: usize,
        line: &Line<F>,
        covariance: Covariance<2>,
        facing: Facing,
        [low, high]: [(f64, EndKind, f64); 2],
        open: Vec<(f64, f64)>,
    ) -> Self {
        let end = |(along, kind, along_sd): (f64, EndKind, f64)| End {
            at: line.at(along),
            kind,
            along_sd,
        };
        let tangent = tangent(line.alpha());
        let (low, high) = (end(low), end(high));
        let (direction, tail, head) = match facing {
            Facing::Origin => (tangent, low, high),
            Facing::Away => (-tangent, high, low),
        };
        Self { wall, direction, tail, head, tangent, covariance, open, is_of_map: false }
    }

    /// The same of a map.
    pub(super) fn of_map(self) -> Self {
        Self { is_of_map: true, ..self }
    }

    fn length(&self) -> f64 {
        (self.head.at - self.tail.at).norm()
    }

    /// A quarter turn to the left: towards free space.
    fn normal(&self) -> Point {
        Point::new(-self.direction.y, self.direction.x)
    }

    /// Variance of the line's offset at a point of it: that of `rho - along * alpha`.
    fn offset_variance(&self, p: &Point) -> f64 {
        offset_variance(&self.covariance, self.tangent.dot(p)).max(1e-8)
    }

    fn direction_variance(&self) -> f64 {
        self.covariance.matrix()[(1, 1)]
    }

    /// Metres between two points of the line that were looked through.
    fn open_between(&self, a: &Point, b: &Point) -> f64 {
        let (a, b) = (self.tangent.dot(a), self.tangent.dot(b));
        let (low, high) = (a.min(b), a.max(b));
        self.open.iter().map(|(from, to)| (to.min(high) - from.max(low)).max(0.0)).sum()
    }
}

/// The landmarks that one look shows, in the robot frame.
pub fn landmarks_of_look(
    segments: &[ObservedSegment],
    config: &FacesConfig,
) -> Vec<ObservedLandmark> {
    let faces = segments.iter().enumerate().map(|(wall, segment)| {
        let end = |i: usize, along: f64| (along, segment.ends[i].kind, segment.ends[i].sd);
        let open = segment.seen_through.iter().map(|gap| (gap.from_m(), gap.to_m()));
        Face::new(
            wall,
            &segment.line.line,
            segment.line.covariance,
            segment.facing,
            [end(0, segment.from), end(1, segment.to)],
            open.collect(),
        )
    });
    landmarks(faces.collect(), config).into_iter().map(|found| found.landmark).collect()
}

/// The landmarks that faces make: corners, closest first, then doorways and ends, face by face.
pub(super) fn landmarks(mut faces: Vec<Face>, config: &FacesConfig) -> Vec<Found> {
    faces.retain(|face| face.length() >= config.length_min);
    let tails: Vec<Point> = faces.iter().map(|face| face.tail.at).collect();
    let by_tail = Grid::new(&tails, 1.0);
    let mut found = Vec::new();
    let (mut heads_met, mut tails_met) = (vec![false; faces.len()], vec![false; faces.len()]);
    // Corners: of each head the closest tail that meets it, closest pairs first.
    let mut meetings: Vec<(f64, usize, usize, Found)> = Vec::new();
    for (a, first) in faces.iter().enumerate() {
        for b in by_tail.near(&first.head.at, 4.0 * config.reach) {
            let b = b as usize;
            if let Some((off, corner)) =
                (a != b).then(|| corner(first, &faces[b], config)).flatten()
            {
                meetings.push((off, a, b, corner));
            }
        }
    }
    meetings.sort_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    for (_, a, b, corner) in meetings {
        if !heads_met[a] && !tails_met[b] {
            (heads_met[a], tails_met[b]) = (true, true);
            found.push(corner);
        }
    }
    for (a, first) in faces.iter().enumerate() {
        let near = by_tail.near(&first.head.at, config.doorway.1 + config.reach);
        let doorway = near.filter(|b| *b as usize != a);
        found.extend(doorway.filter_map(|b| self::doorway(first, &faces[b as usize], config)));
        if first.head.kind == EndKind::Jump && !heads_met[a] {
            found.push(wall_end(first, false));
        }
        if first.tail.kind == EndKind::Jump && !tails_met[a] {
            found.push(wall_end(first, true));
        }
    }
    found
}

/// Where the head of one face meets the tail of another, if it does, and how far their ends are off.
fn corner(a: &Face, b: &Face, config: &FacesConfig) -> Option<(f64, Found)> {
    let (n, m) = (a.normal(), b.normal());
    let sine = a.direction.perp(&b.direction);
    if sine.abs() < config.sine_min {
        return None;
    }
    // About the head, for the origin may be far: n.(x - o) = 0, m.(x - o) = m.(tail - o).
    let o = a.head.at;
    let inverse = Matrix2::new(m.y, -n.y, -m.x, n.x) / n.perp(&m);
    let at = o + inverse * Point::new(0.0, m.dot(&(b.tail.at - o)));
    let off = |end: &End| (end.at - at).norm();
    let fits = |end: &End| off(end) <= config.reach + 3.0 * end.along_sd.min(config.reach);
    if !fits(&a.head) || !fits(&b.tail) {
        return None;
    }
    let offsets = Covariance::from_variances([a.offset_variance(&at), b.offset_variance(&at)]);
    let bisector = n + m;
    // Walls that turn right have free space outside of the corner.
    let kind = if sine < 0.0 { LandmarkKind::ConvexCorner } else { LandmarkKind::ConcaveCorner };
    let landmark = Landmark {
        kind,
        at,
        direction: bisector.y.atan2(bisector.x),
        covariance: offsets.transformed(&inverse),
        direction_sd: 0.5 * (a.direction_variance() + b.direction_variance()).sqrt(),
    };
    // Free space is on the left: a turn to the left narrows it.
    let extent = std::f64::consts::PI - sine.atan2(a.direction.dot(&b.direction));
    let found = Found { landmark, extent, walls: [a.wall, b.wall], is_tail: false };
    Some((off(&a.head) + off(&b.tail), found))
}

/// The doorway between the head of one face and the tail of the next on one line.
fn doorway(a: &Face, b: &Face, config: &FacesConfig) -> Option<Found> {
    let gap = b.tail.at - a.head.at;
    let width = gap.dot(&a.direction);
    let fits = width >= config.doorway.0
        && width <= config.doorway.1
        && gap.dot(&a.normal()).abs() <= config.doorway_off.0
        && a.direction.dot(&b.direction) > 0.0
        && a.direction.perp(&b.direction).abs() <= config.doorway_off.1;
    let open = a.open_between(&a.head.at, &b.tail.at).max(b.open_between(&a.head.at, &b.tail.at));
    let are_ends = [a.head.kind, b.tail.kind] == [EndKind::Jump; 2];
    let are_of_map = a.is_of_map && b.is_of_map && a.wall != b.wall;
    if !fits || (open < config.seen_through * width && !(are_of_map && are_ends)) {
        return None;
    }
    let at = (a.head.at + b.tail.at) * 0.5;
    let along = 0.25 * (a.head.along_sd.powi(2) + b.tail.along_sd.powi(2));
    let across = 0.5 * (a.offset_variance(&at) + b.offset_variance(&at));
    let direction = a.normal();
    let landmark = Landmark {
        kind: LandmarkKind::Doorway,
        at,
        direction: direction.y.atan2(direction.x),
        covariance: along_and_across(&a.direction, along, across),
        direction_sd: (0.5 * (a.direction_variance() + b.direction_variance())).sqrt(),
    };
    Some(Found { landmark, extent: width, walls: [a.wall, b.wall], is_tail: false })
}

/// A free end, which opens along its wall outwards.
fn wall_end(face: &Face, is_tail: bool) -> Found {
    let (end, outwards) =
        if is_tail { (&face.tail, -face.direction) } else { (&face.head, face.direction) };
    let landmark = Landmark {
        kind: LandmarkKind::WallEnd,
        at: end.at,
        direction: outwards.y.atan2(outwards.x),
        covariance: along_and_across(
            &face.direction,
            end.along_sd.powi(2),
            face.offset_variance(&end.at),
        ),
        direction_sd: face.direction_variance().sqrt(),
    };
    Found { landmark, extent: 0.0, walls: [face.wall; 2], is_tail }
}

/// A covariance from its variances along a unit vector and across it.
fn along_and_across(u: &Point, along: f64, across: f64) -> Covariance<2> {
    Covariance::from_variances([along, across]).transformed(&Matrix2::new(u.x, -u.y, u.y, u.x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;
    use crate::geometry::{Interval, UncertainLine, difference};
    use crate::vector::ObservedEnd;
    use LandmarkKind::{Doorway, WallEnd};

    /// A wall from `a` to `b` with free space on its left, as seen from the origin's side or not.
    fn wall(a: Point, b: Point, kinds: [EndKind; 2]) -> ObservedSegment {
        let u = (b - a).normalize();
        let n = Point::new(-u.y, u.x);
        let covariance = Covariance::from_variances([1e-4, 1e-5]);
        let (line, _) = UncertainLine::normal_form(n.dot(&a), n.y.atan2(n.x), covariance);
        let (from, to) = (line.line.along(&a), line.line.along(&b));
        let is_up = from < to;
        let end = |kind| ObservedEnd { kind, sd: 0.02 };
        let [first, last] = if is_up { kinds } else { [kinds[1], kinds[0]] };
        ObservedSegment {
            line,
            from: from.min(to),
            to: from.max(to),
            facing: if is_up { Facing::Origin } else { Facing::Away },
            ends: [end(first), end(last)],
            points: 50,
            seen_through: Vec::new(),
        }
    }

    const CORNERS: [EndKind; 2] = [EndKind::Corner; 2];

    #[test]
    fn rooms_have_concave_corners_and_pillars_convex_ones_at_any_angle() {
        let mut chance = Chance(4);
        for _ in 0..200 {
            let turn = std::f64::consts::TAU * chance.share();
            let at = Point::new(9.0 * chance.share() - 4.0, 9.0 * chance.share() - 4.0);
            let (sin, cos) = turn.sin_cos();
            let place = |x: f64, y: f64| at + Point::new(cos * x - sin * y, sin * x + cos * y);
            for (inside, kind) in
                [(true, LandmarkKind::ConcaveCorner), (false, LandmarkKind::ConvexCorner)]
            {
                let mut ring = [place(0.0, 0.0), place(3.0, 0.0), place(3.0, 2.0), place(0.0, 2.0)];
                if !inside {
                    ring.reverse();
                }
                let walls: Vec<ObservedSegment> =
                    (0..4).map(|i| wall(ring[i], ring[(i + 1) % 4], CORNERS)).collect();
                let found = landmarks_of_look(&walls, &FacesConfig::STANDARD);
                assert_eq!(found.len(), 4);
                let middle = place(1.5, 1.0);
                for landmark in found {
                    assert_eq!(landmark.kind, kind);
                    assert!(ring.iter().any(|c| (c - landmark.at).norm() < 1e-9));
                    let inwards = middle - landmark.at;
                    // The bisector of a corner of a rectangle is at 45 degrees to its walls.
                    let open = if inside { inwards } else { -inwards };
                    let off = difference(open.y.atan2(open.x), landmark.direction).abs();
                    assert!(off < 0.3, "{off}");
                }
            }
        }
    }

    #[test]
    fn what_a_corner_claims_is_true() {
        let mut chance = Chance(6);
        let (a, b, c) = (Point::new(1.0, 2.0), Point::new(4.0, 2.5), Point::new(3.5, 5.0));
        let config = FacesConfig::STANDARD;
        let walls = [wall(a, b, CORNERS), wall(b, c, CORNERS)];
        let (mut nees, runs) = (0.0, 2000);
        for _ in 0..runs {
            let noisy: Vec<ObservedSegment> = walls
                .iter()
                .map(|w| {
                    let line = &w.line.line;
                    let rho = line.rho() + 0.01 * chance.normal();
                    let alpha = line.alpha() + 1e-5_f64.sqrt() * chance.normal();
                    let (line, _) = UncertainLine::normal_form(rho, alpha, w.line.covariance);
                    ObservedSegment { line, ..w.clone() }
                })
                .collect();
            let found = landmarks_of_look(&noisy, &config);
            let error = found[0].at - b;
            nees += crate::geometry::mahalanobis_sq(&error, &found[0].covariance) / f64::from(runs);
        }
        assert!((nees - 2.0).abs() < 5.0 * (4.0 / f64::from(runs)).sqrt(), "{nees}");
    }

    #[test]
    fn a_gap_that_was_looked_through_is_a_doorway_and_others_are_not() {
        let p = Point::new;
        let ends = [EndKind::Occluded, EndKind::Jump];
        let mut left = wall(p(-3.0, 2.0), p(-0.4, 2.0), ends);
        let right = wall(p(0.5, 2.0), p(3.0, 2.0), [EndKind::Jump, EndKind::Occluded]);
        let kinds = |walls: &[ObservedSegment]| -> Vec<LandmarkKind> {
            landmarks_of_look(walls, &FacesConfig::STANDARD).iter().map(|l| l.kind).collect()
        };
        assert_eq!(kinds(&[left.clone(), right.clone()]), [WallEnd, WallEnd]);
        let u = left.line.line.along(&p(-0.4, 2.0));
        let v = left.line.line.along(&p(0.5, 2.0));
        left.seen_through = vec![Interval::from_metres(u.min(v), u.max(v))];
        let with = landmarks_of_look(&[left.clone(), right.clone()], &FacesConfig::STANDARD);
        let doorway = with.iter().find(|l| l.kind == Doorway);
        assert!(doorway.is_some_and(|d| (d.at - p(0.05, 2.0)).norm() < 1e-9), "{with:?}");
        let far = wall(p(1.5, 2.0), p(4.0, 2.0), [EndKind::Jump, EndKind::Occluded]);
        assert!(!kinds(&[left, far]).contains(&Doorway), "too wide");
    }
}
