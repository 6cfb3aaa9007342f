//! Lines of walls, of drawings or the borders of cells, as walls: where two parallel lines face each other at the thickness of a wall, what is between them is one;
//! what is left over is a thin wall.

use mapfold_map::geometry::Point;

use super::incoming::Found;

/// How lines become walls.
#[derive(Debug, Clone, Copy)]
pub(super) struct WallConfig {
    /// Thinnest wall of two lines, metres: what is closer was drawn twice.
    pub(super) thickness_min_m: f64,
    /// Thickest wall of two lines, metres: outer walls of old houses; corridors are wider.
    pub(super) thickness_max_m: f64,
    /// Sine of the largest angle between the two lines of a wall: rounding of drawings.
    pub(super) parallel_sine: f64,
    /// Shortest wall of two lines, and shortest line that is a wall by itself, metres.
    pub(super) length_min_m: f64,
    /// Thickness of a wall that is one line, metres.
    pub(super) thin_m: f64,
}

impl WallConfig {
    pub(super) const STANDARD: Self = Self {
        thickness_min_m: 0.04,
        thickness_max_m: 0.6,
        parallel_sine: 0.01,
        length_min_m: 0.05,
        thin_m: 0.05,
    };
}

/// Times that two lines are held against each other; beyond, lines are taken one by one.
const COMPARED_MAX: usize = 50_000_000;
/// Pairs of parallel lines near each other, each as often as it was met.
const PAIRS_MAX: usize = 2_000_000;
/// Squares that lines may stand in; with more, squares are larger.
const SQUARES_MAX: f64 = 2_000_000.0;
/// Stretches that a line may be broken into; of one that is in more pieces, no more is paired.
const FREE_MAX: usize = 256;
/// Leftovers times walls that are compared with each other.
const EXPLAINED_MAX: usize = 50_000_000;
/// How far beside a wall that is explained by it, metres.
const BESIDE_M: f64 = 0.02;

/// An upright wall: from end to end along its middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wall {
    pub(super) ends: [Point; 2],
    pub(super) thickness: f64,
    pub(super) heights: Option<[f64; 2]>,
    /// Whether it is of two lines.
    pub(super) is_double: bool,
    /// The line of the file that one of its lines is from.
    pub(super) line: usize,
}

/// A line of a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WallLine {
    pub(super) ends: [Point; 2],
    pub(super) heights: Option<[f64; 2]>,
    /// The line of the file that it is from.
    pub(super) line: usize,
}

/// What became of the lines.
#[derive(Debug, Default)]
pub(super) struct Walls {
    pub(super) found: Vec<Wall>,
    /// Lines too short to be a wall.
    pub(super) short: usize,
    /// Whether there were too many to look at all pairs.
    pub(super) is_crowded: bool,
}

impl Walls {
    /// Tells which lines did not become walls.
    pub(super) fn tell(&self, found: &mut Found) {
        if self.is_crowded {
            let words =
                "so many lines of walls lie close to each other that not all were taken in pairs";
            found.warnings.push(words.to_owned());
        }
        for _ in 0..self.short {
            found.leave_out("lines of walls", "they are too short");
        }
    }
}

/// A line with what of it is not used yet, as stretches along it.
struct Line {
    from: Point,
    along: Point,
    length: f64,
    heights: Option<[f64; 2]>,
    free: Vec<[f64; 2]>,
    /// Of the file.
    number: usize,
}

/// Two lines that may be one wall.
struct Candidate {
    distance: f64,
    overlap: f64,
    lines: [usize; 2],
}

pub(super) fn walls(lines: &[WallLine], config: &WallConfig) -> Walls {
    let mut found = Walls::default();
    let mut all: Vec<Line> = Vec::new();
    for line in lines {
        let step = line.ends[1] - line.ends[0];
        let length = step.norm();
        if length.is_nan() || length < config.length_min_m / 5.0 {
            found.short += 1;
            continue;
        }
        let (from, along) = (line.ends[0], step / length);
        let (heights, free) = (line.heights, vec![[0.0, length]]);
        all.push(Line { from, along, length, heights, free, number: line.line });
    }
    let (candidates, is_crowded) = candidates(&all, config);
    found.is_crowded = is_crowded;
    for Candidate { lines: [a, b], distance, .. } in &candidates {
        pair(&mut all, *a, *b, *distance, config, &mut found.found);
    }
    let mut double = found.found.len();
    if double.saturating_mul(all.len()) > EXPLAINED_MAX {
        (double, found.is_crowded) = (0, true);
    }
    for line in &all {
        for [from, to] in &line.free {
            let ends = [line.from + line.along * *from, line.from + line.along * *to];
            if to - from < config.length_min_m {
                found.short += usize::from(to - from >= line.length * 0.999);
            } else if !is_explained(&found.found[..double], ends) {
                let (thickness, heights) = (config.thin_m, line.heights);
                found.found.push(Wall {
                    ends,
                    thickness,
                    heights,
                    is_double: false,
                    line: line.number,
                });
            }
        }
    }
    found
}

/// Pairs that may be walls, thin ones first, and of the same thickness long ones first.
fn candidates(lines: &[Line], config: &WallConfig) -> (Vec<Candidate>, bool) {
    let Some(pairs) = neighbours(lines, config) else { return (Vec::new(), true) };
    let facing = |(a, b): (u32, u32)| facing(lines, a as usize, b as usize, config);
    let mut candidates: Vec<Candidate> = pairs.into_iter().filter_map(facing).collect();
    candidates.sort_by(|a: &Candidate, b| {
        let thickness = |c: &Candidate| (c.distance * 100.0).round() as i64;
        thickness(a)
            .cmp(&thickness(b))
            .then(b.overlap.total_cmp(&a.overlap))
            .then(a.lines.cmp(&b.lines))
    });
    (candidates, false)
}

/// Parallel lines that come as near to each other as the faces of a wall, by place: `None` if there are too many.
///
/// Each line stands in the squares of points along it, no farther apart than half a square. So no point of it is more
/// than a quarter of a square from one of them, and two lines that come nearer than that to each other have squares that
/// touch.
fn neighbours(lines: &[Line], config: &WallConfig) -> Option<Vec<(u32, u32)>> {
    let mut side = 4.0 * config.thickness_max_m;
    let points = |line: &Line, side: f64| (2.0 * line.length / side).ceil();
    while lines.iter().map(|line| points(line, side) + 1.0).sum::<f64>() > SQUARES_MAX {
        side *= 2.0;
    }
    let mut places: Vec<((i64, i64), u32)> = Vec::new();
    for (number, line) in lines.iter().enumerate() {
        let steps = points(line, side);
        for k in 0..=steps as u32 {
            let p = line.from + line.along * (line.length * f64::from(k) / steps);
            places
                .push((((p.x / side).floor() as i64, (p.y / side).floor() as i64), number as u32));
        }
    }
    places.sort_unstable();
    places.dedup();
    let square = |at: (i64, i64)| {
        let from = places.partition_point(|(place, _)| *place < at);
        let here = &places[from..];
        &here[..here.partition_point(|(place, _)| *place == at)]
    };
    let (mut pairs, mut compared) = (Vec::new(), 0_usize);
    for own in places.chunk_by(|a, b| a.0 == b.0) {
        let (x, y) = own[0].0;
        // Those before look at this one.
        let others = [(x, y + 1), (x + 1, y - 1), (x + 1, y), (x + 1, y + 1)].map(square);
        for (k, (_, a)) in own.iter().enumerate() {
            let with = own[k + 1..].iter().chain(others.into_iter().flatten());
            for (_, b) in with.filter(|(_, b)| b != a) {
                compared += 1;
                let [first, second] = [a, b].map(|k| &lines[*k as usize]);
                if first.along.perp(&second.along).abs() <= config.parallel_sine {
                    pairs.push((*a.min(b), *a.max(b)));
                }
            }
            if compared > COMPARED_MAX || pairs.len() > PAIRS_MAX {
                return None;
            }
        }
    }
    pairs.sort_unstable();
    pairs.dedup();
    Some(pairs)
}

/// Whether two lines face each other at the thickness of a wall.
fn facing(lines: &[Line], a: usize, b: usize, config: &WallConfig) -> Option<Candidate> {
    let (first, second) = (&lines[a], &lines[b]);
    if first.along.perp(&second.along).abs() > config.parallel_sine
        || first.heights != second.heights
    {
        return None;
    }
    let [from, to] = overlap(first, second);
    let middle = f64::midpoint(from, to);
    let at = |t: f64| first.along.perp(&(first.from + first.along * t - second.from));
    let distance = at(middle).abs();
    let is_wall = (config.thickness_min_m..=config.thickness_max_m).contains(&distance)
        && to - from >= config.length_min_m.max(distance / 2.0);
    is_wall.then_some(Candidate { distance, overlap: to - from, lines: [a, b] })
}

/// The stretch of one line that another lies beside.
fn overlap(line: &Line, other: &Line) -> [f64; 2] {
    let ends = [other.from, other.from + other.along * other.length];
    let [p, q] = ends.map(|end| line.along.dot(&(end - line.from)));
    [p.min(q).max(0.0), p.max(q).min(line.length)]
}

/// Makes walls of what two lines have free beside each other, and takes it from them.
fn pair(
    lines: &mut [Line],
    a: usize,
    b: usize,
    distance: f64,
    config: &WallConfig,
    walls: &mut Vec<Wall>,
) {
    if lines[a].free.len().max(lines[b].free.len()) > FREE_MAX {
        return;
    }
    let (along, from_a) = (lines[a].along, lines[a].from);
    let to_b = |t: f64| lines[b].along.dot(&(from_a + along * t - lines[b].from));
    let (zero, one) = (to_b(0.0), to_b(1.0) - to_b(0.0));
    let on_a = |[p, q]: [f64; 2]| {
        let (p, q) = ((p - zero) / one, (q - zero) / one);
        [p.min(q), p.max(q)]
    };
    let free_b: Vec<[f64; 2]> = lines[b].free.iter().map(|stretch| on_a(*stretch)).collect();
    let shortest = config.length_min_m.max(distance / 2.0);
    let mut taken = Vec::new();
    for p in &lines[a].free {
        for q in &free_b {
            let both = [p[0].max(q[0]), p[1].min(q[1])];
            if both[1] - both[0] < shortest {
                continue;
            }
            // One face of a corner or a junction goes on by the thickness of the wall that it meets.
            let further = |from: f64, to: f64| to - from <= config.thickness_max_m;
            let lower = p[0].min(q[0]);
            let lower = if further(lower, both[0]) { lower } else { both[0] };
            let upper = p[1].max(q[1]);
            let upper = if further(both[1], upper) { upper } else { both[1] };
            taken.push([lower, upper]);
        }
    }
    let side = along.perp(&(lines[b].from - from_a)).signum();
    let aside = Point::new(-along.y, along.x) * (side * distance / 2.0);
    for [lower, upper] in taken {
        let ends = [lower, upper].map(|t| from_a + along * t + aside);
        walls.push(Wall {
            ends,
            thickness: distance,
            heights: lines[a].heights,
            is_double: true,
            line: lines[a].number,
        });
        take(&mut lines[a].free, [lower, upper]);
        let [p, q] = [lower, upper].map(|t| zero + one * t);
        take(&mut lines[b].free, [p.min(q), p.max(q)]);
    }
}

/// Takes a stretch from what is free.
fn take(free: &mut Vec<[f64; 2]>, [from, to]: [f64; 2]) {
    let rest =
        |stretch: &[f64; 2]| [[stretch[0], stretch[1].min(from)], [stretch[0].max(to), stretch[1]]];
    *free = free.iter().flat_map(rest).filter(|[p, q]| q - p > 1e-9).collect();
}

/// Whether a line lies within the walls of two lines, or along their surfaces: caps at their ends, and what was drawn
/// twice.
fn is_explained(walls: &[Wall], ends: [Point; 2]) -> bool {
    let points = [ends[0], (ends[0] + ends[1]) / 2.0, ends[1]];
    points.iter().all(|p| walls.iter().any(|wall| is_within(wall, p)))
}

fn is_within(wall: &Wall, p: &Point) -> bool {
    let step = wall.ends[1] - wall.ends[0];
    let length = step.norm();
    let (along, from) = (step / length, p - wall.ends[0]);
    (-BESIDE_M..=length + BESIDE_M).contains(&along.dot(&from))
        && along.perp(&from).abs() <= wall.thickness / 2.0 + BESIDE_M
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(ends: &[[f64; 4]]) -> Vec<WallLine> {
        let line = |[a, b, c, d]: &[f64; 4]| WallLine {
            ends: [Point::new(*a, *b), Point::new(*c, *d)],
            heights: None,
            line: 1,
        };
        ends.iter().map(line).collect()
    }

    /// Whether some wall covers a point.
    fn covers(walls: &[Wall], x: f64, y: f64) -> bool {
        walls.iter().any(|wall| is_within(wall, &Point::new(x, y)))
    }

    #[test]
    fn two_lines_are_a_wall_with_a_gap_for_a_door_and_caps_are_no_walls() {
        let drawn = [
            [0.0, 0.0, 2.0, 0.0],
            [3.0, 0.0, 6.0, 0.0],
            [6.0, 0.2, 3.0, 0.2],
            [2.0, 0.2, 0.0, 0.2],
            [2.0, 0.0, 2.0, 0.2],
            [3.0, 0.2, 3.0, 0.0],
        ];
        let found = walls(&lines(&drawn), &WallConfig::STANDARD).found;
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found.iter().all(|wall| wall.is_double && (wall.thickness - 0.2).abs() < 1e-12));
        let lengths: f64 = found.iter().map(|w| (w.ends[1] - w.ends[0]).norm()).sum();
        assert!((lengths - 5.0).abs() < 1e-12);
    }

    #[test]
    fn corners_and_junctions_close() {
        // A room of 4 by 3 m with walls of 0.2 m around it, and a wall of 0.1 m across.
        let drawn = [
            [0.0, 0.0, 4.4, 0.0],
            [4.4, 0.0, 4.4, 3.4],
            [4.4, 3.4, 0.0, 3.4],
            [0.0, 3.4, 0.0, 0.0],
            [0.2, 0.2, 2.0, 0.2],
            [2.1, 0.2, 4.2, 0.2],
            [4.2, 0.2, 4.2, 3.2],
            [4.2, 3.2, 2.1, 3.2],
            [2.0, 3.2, 0.2, 3.2],
            [0.2, 3.2, 0.2, 0.2],
            [2.0, 0.2, 2.0, 3.2],
            [2.1, 3.2, 2.1, 0.2],
        ];
        let found = walls(&lines(&drawn), &WallConfig::STANDARD);
        assert!(found.found.iter().all(|wall| wall.is_double), "{:?}", found.found);
        for (x, y) in [(0.1, 0.1), (4.3, 0.1), (4.3, 3.3), (0.1, 3.3), (2.05, 0.1), (2.05, 1.7)] {
            assert!(covers(&found.found, x, y), "{x} {y}: {:?}", found.found);
        }
        for (x, y) in [(1.0, 1.0), (3.0, 2.0), (0.5, 0.5), (2.3, 0.5)] {
            assert!(!covers(&found.found, x, y), "{x} {y}");
        }
    }

    #[test]
    fn a_line_by_itself_is_a_thin_wall() {
        let found =
            walls(&lines(&[[0.0, 0.0, 3.0, 1.0], [0.0, 2.0, 3.0, 3.0]]), &WallConfig::STANDARD);
        assert_eq!(found.found.len(), 2);
        assert!(
            found.found.iter().all(|wall| !wall.is_double && (wall.thickness - 0.05).abs() < 1e-12)
        );
    }

    /// Corridors of a vast building: every pair of faces is far from all others, however long the list of lines.
    #[test]
    fn lines_of_a_vast_building_meet_their_neighbours_only() {
        let mut drawn = Vec::new();
        for k in 0..3000 {
            let (x, y) = (f64::from(k % 60) * 10.0, f64::from(k / 60) * 8.0);
            drawn.push([x, y, x + 9.0, y]);
            drawn.push([x + 9.0, y + 0.15, x, y + 0.15]);
        }
        let found = walls(&lines(&drawn), &WallConfig::STANDARD);
        assert!(!found.is_crowded);
        assert_eq!(found.found.len(), 3000);
        assert!(found.found.iter().all(|wall| (wall.thickness - 0.15).abs() < 1e-9));
    }

    #[test]
    fn too_many_lines_in_one_place_are_not_compared_one_by_one() {
        let many: Vec<[f64; 4]> =
            (0..20_000).map(|k| [0.0, f64::from(k) * 1e-5, 1.0, 0.0]).collect();
        let found = walls(&lines(&many), &WallConfig::STANDARD);
        assert!(found.is_crowded);
    }
}
