//! Maps in frames of their own, aligned by the part that they share; and not where nothing tells.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_map::alignment::{Alignment, AlignmentConfig, Chart, Doubt, align, moved};
use mapfold_map::geometry::{
    Covariance, Interval, Level, Line, Odom, Point, Pose, UncertainPose, difference,
};
use mapfold_map::level::{Contribution, ContributionId, FeatureId, LevelMap, Provenance};
use mapfold_map::raster::{
    Cell, EvidencePatch, EvidenceRun, LogOdds, SensorClass, TILE_CELLS, Tile, TileIndex, TileKey,
    TilePatch,
};
use mapfold_map::vector::{EndKind, Facing, Segment, SolidInterval};
use proptest::prelude::*;

const RESOLUTION: f64 = 0.05;
const CONFIG: AlignmentConfig = AlignmentConfig::STANDARD;

/// A room's outline, counter-clockwise.
type Outline = Vec<Point>;

/// A corridor along x with niches `(from, to, depth)` below and above, all of them before `length`.
fn corridor(x: f64, length: f64, below: &[(f64, f64, f64)], above: &[(f64, f64, f64)]) -> Outline {
    let mut outline = vec![(0.0, 0.0)];
    for (from, to, depth) in below {
        outline.extend([(*from, 0.0), (*from, -depth), (*to, -depth), (*to, 0.0)]);
    }
    outline.extend([(length, 0.0), (length, 3.0)]);
    for (from, to, depth) in above.iter().rev() {
        outline.extend([(*to, 3.0), (*to, 3.0 + depth), (*from, 3.0 + depth), (*from, 3.0)]);
    }
    outline.push((0.0, 3.0));
    outline.into_iter().map(|(dx, y)| Point::new(x + dx, y)).collect()
}

fn uneven(x: f64) -> Outline {
    corridor(
        x,
        30.0,
        &[
            (3.0, 4.5, 1.2),
            (8.0, 8.8, 0.8),
            (12.0, 14.5, 2.0),
            (16.0, 16.9, 1.0),
            (25.0, 27.0, 1.0),
        ],
        &[
            (1.2, 2.0, 0.9),
            (6.0, 9.0, 2.5),
            (12.3, 13.0, 0.6),
            (15.2, 17.0, 1.7),
            (21.0, 22.0, 1.0),
        ],
    )
}

fn is_inside(outline: &Outline, p: &Point) -> bool {
    let edges = outline.iter().zip(outline.iter().cycle().skip(1));
    let crossings = edges.filter(|(a, b)| {
        (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)
    });
    crossings.count() % 2 == 1
}

/// What robots would draw of the part of some rooms between two x, in a frame `frame_from_world`.
fn map(
    rooms: &[Outline],
    (low, high): (f64, f64),
    frame_from_world: &Pose<Level, Level>,
) -> LevelMap {
    let world_from_frame = frame_from_world.inverse();
    let mut map = LevelMap::default();
    let mut tiles: BTreeMap<TileIndex, Box<[i32; TILE_CELLS]>> = BTreeMap::new();
    let near =
        [(-0.07, 0.0), (0.07, 0.0), (0.0, -0.07), (0.0, 0.07)].map(|(x, y)| Point::new(x, y));
    for outline in rooms {
        // Finer than the cells, so that none is missed however they are turned.
        let span = |of: fn(&Point) -> f64| {
            let low = outline.iter().map(of).fold(f64::INFINITY, f64::min) - 0.1;
            let high = outline.iter().map(of).fold(f64::NEG_INFINITY, f64::max) + 0.1;
            ((low / 0.03) as i32..(high / 0.03) as i32).map(|i| f64::from(i) * 0.03)
        };
        for (x, y) in span(|p| p.x).flat_map(|x| span(|p| p.y).map(move |y| (x, y))) {
            let cell = Cell::holding(&frame_from_world.act(&Point::new(x, y)), RESOLUTION);
            let centre = world_from_frame.act(&cell.centre(RESOLUTION));
            if !(low..high).contains(&centre.x) {
                continue;
            }
            let value = match is_inside(outline, &centre) {
                true => -300,
                false if near.iter().any(|off| is_inside(outline, &(centre + off))) => 300,
                false => continue,
            };
            let (tile, offset) = cell.tile();
            tiles.entry(tile).or_insert_with(|| Box::new([0; TILE_CELLS]))[offset] = value;
        }
        for (a, b) in outline.iter().zip(outline.iter().cycle().skip(1)) {
            let is_seen = |p: &Point| (low..high).contains(&p.x);
            if is_seen(a) && is_seen(b) {
                let index = map.segments.len() as u16;
                let id = FeatureId { contribution: ContributionId([1; 16]), index };
                let wall = segment(&frame_from_world.act(a), &frame_from_world.act(b));
                map.segments.insert(id, Arc::new(wall));
            }
        }
    }
    let class = SensorClass::Scanner;
    let keyed = |(tile, cells)| (TileKey { class, tile }, Arc::new(Tile::new(cells)));
    map.tiles = tiles.into_iter().map(keyed).collect();
    map
}

/// A wall that three looks saw from the left.
fn segment(from: &Point, to: &Point) -> Segment {
    let way = (to - from).normalize();
    // The viewer is on the left: with the origin, if the normal points to the right.
    let right = Point::new(way.y, -way.x);
    let (line, is_flipped) = Line::normal_form(right.dot(from), right.y.atan2(right.x));
    let ends = [line.along(from), line.along(to)];
    let span = Interval::from_metres(ends[0].min(ends[1]), ends[0].max(ends[1]));
    let covariance = Covariance::from_variances([1e-5, 1e-6]);
    Segment {
        line,
        independent: covariance,
        dependent: covariance,
        facing: if is_flipped { Facing::Away } else { Facing::Origin },
        solid: vec![SolidInterval { span, ends: [EndKind::Corner; 2], existence: LogOdds(900) }],
        looks: 3,
        robots: vec!["ada".into()],
        first_seen_us: 0,
        last_seen_us: 0,
    }
}

fn chart(map: &LevelMap) -> Chart {
    Chart::of_map(map, RESOLUTION, &CONFIG)
}

/// Aligns a part of some rooms in a frame with a part of others on the level.
fn aligned(
    level: (&[Outline], (f64, f64)),
    own: (&[Outline], (f64, f64)),
    odom_from_level: &Pose<Level, Level>,
) -> Alignment {
    let level = chart(&map(level.0, level.1, &Pose::identity()));
    align(&level, &chart(&map(own.0, own.1, odom_from_level)), &CONFIG)
}

fn off(found: &Pose<Level, Odom>, odom_from_level: &Pose<Level, Level>, at: &Point) -> (f64, f64) {
    let there = odom_from_level.act(at);
    let turned = difference(found.heading(), -odom_from_level.heading()).abs();
    ((found.act(&there) - at).norm(), turned)
}

#[test]
fn maps_that_share_a_part_are_aligned_by_it() {
    let rooms = [uneven(0.0)];
    for (x, y, heading) in [(40.0, -7.0, 2.1), (-3.0, 0.2, -0.7), (0.0, 0.0, 3.1)] {
        let away = Pose::new(x, y, heading);
        let found = aligned((&rooms, (-1.0, 20.0)), (&rooms, (10.0, 31.0)), &away);
        let best = found.aligned().unwrap_or_else(|| panic!("{found:?}"));
        let (metres, radians) = off(&best.level_from_odom.pose, &away, &Point::new(15.0, 1.5));
        assert!(metres < 0.04 && radians < 0.005, "{metres} {radians} {best:?}");
        assert!((0.3..0.7).contains(&best.overlap), "{best:?}");
        assert!(best.agreement() > 0.97 && best.residual < 0.05, "{best:?}");
        let [x, y, heading] = best.level_from_odom.covariance.matrix().diagonal().into();
        assert!([x, y, heading].iter().all(|variance| *variance > 0.0), "{best:?}");
    }
}

#[test]
fn either_map_onto_the_other_is_the_same() {
    let rooms = [uneven(0.0)];
    let away = Pose::new(5.0, -7.0, 1.1);
    let level = chart(&map(&rooms, (-1.0, 20.0), &Pose::identity()));
    let own = chart(&map(&rooms, (10.0, 31.0), &away));
    let pose = |found: Alignment| {
        found.aligned().unwrap_or_else(|| panic!("{found:?}")).level_from_odom.pose
    };
    let there = pose(align(&level, &own, &CONFIG));
    let back = pose(align(&own, &level, &CONFIG));
    let at = Point::new(15.0, 1.5);
    let back: Pose<Odom, Level> = Pose::new(back.x, back.y, back.heading());
    assert!((there.act(&back.act(&at)) - at).norm() < 0.04, "{there:?} {back:?}");
}

#[test]
fn a_place_that_the_level_has_twice_is_not_told() {
    let rooms = [uneven(0.0), uneven(50.0)];
    let away = Pose::new(5.0, -7.0, 1.1);
    let found = aligned((&rooms, (-1.0, 100.0)), (&rooms[..1], (10.0, 31.0)), &away);
    assert!(found.doubts.contains(&Doubt::RunnerUp), "{:?}", found.doubts);
    for x in [0.0, 50.0] {
        let away = away.compose(&Pose::new(-x, 0.0, 0.0));
        let at = Point::new(x + 15.0, 1.5);
        let is = |pose: &Pose<Level, Odom>| off(pose, &away, &at).0 < 0.1;
        assert!(found.candidates.iter().any(|c| is(&c.level_from_odom.pose)), "{x} {found:?}");
    }
}

#[test]
fn maps_of_different_places_are_not_aligned() {
    let other = corridor(
        0.0,
        24.0,
        &[(1.0, 3.7, 1.5), (9.0, 9.7, 2.2), (20.0, 21.3, 1.4)],
        &[(4.0, 5.1, 2.1), (11.0, 15.0, 1.1), (18.4, 19.0, 1.9)],
    );
    let away = Pose::new(5.0, -7.0, 1.1);
    let all = (-1.0, 31.0);
    let found = aligned((&[uneven(0.0)], all), (&[other], all), &away);
    assert!(found.aligned().is_none(), "{found:?}");
    let nothing = chart(&LevelMap::default());
    let own = chart(&map(&[uneven(0.0)], all, &away));
    assert!(align(&nothing, &own, &CONFIG).candidates.is_empty());
    assert!(align(&own, &nothing, &CONFIG).candidates.is_empty());
}

#[test]
fn a_corridor_whose_ends_nobody_saw_is_not_aligned() {
    let rooms = [corridor(0.0, 60.0, &[], &[])];
    let found = aligned((&rooms, (5.0, 30.0)), (&rooms, (20.0, 55.0)), &Pose::new(3.0, 1.0, 0.4));
    assert!(found.aligned().is_none(), "{found:?}");
}

/// A contribution with some cells of evidence.
fn look(cells: &BTreeMap<TileIndex, TilePatch>) -> Contribution {
    Contribution {
        id: ContributionId([7; 16]),
        robot: "ada".into(),
        observed_at_us: 0,
        level_from_robot: UncertainPose {
            pose: Pose::new(1.0, 2.0, 0.5),
            covariance: Covariance::from_variances([1e-4, 1e-4, 1e-5]),
        },
        provenance: Provenance::Odometry,
        segments: vec![],
        clusters: vec![],
        evidence: vec![EvidencePatch { class: SensorClass::Scanner, tiles: cells.clone() }],
    }
}

fn alignment(x: f64, y: f64, heading: f64) -> UncertainPose<Level, Odom> {
    let covariance = Covariance::from_variances([1e-3, 1e-3, 1e-6]);
    UncertainPose { pose: Pose::new(x, y, heading), covariance }
}

/// What a contribution's evidence says, cell by cell.
fn told(look: &Contribution) -> BTreeMap<Cell, i16> {
    let tiles = look.evidence.iter().flat_map(|patch| &patch.tiles);
    let runs = tiles.flat_map(|(tile, patch)| patch.runs().iter().map(move |run| (tile, run)));
    runs.flat_map(|(tile, run)| run.range().map(move |at| (tile.cell(at), run.value))).collect()
}

proptest! {
    #[test]
    fn what_moves_by_whole_cells_and_quarter_turns_is_the_same_evidence(
        runs in prop::collection::btree_map(0_u16..4096, -50_i16..50, 1..30),
        (tile_x, tile_y) in (-3..3_i32, -3..3_i32),
        (columns, rows, turns) in (-200..200_i32, -200..200_i32, 0..4_i32),
    ) {
        let runs: Vec<EvidenceRun> = runs
            .into_iter()
            .filter(|(_, value)| *value != 0)
            .map(|(start, value)| EvidenceRun { start, length: 1, value })
            .collect();
        let tile = TileIndex { x: tile_x, y: tile_y };
        let own = look(&BTreeMap::from([(tile, TilePatch::new(runs).unwrap())]));
        let shift = |cells: i32| f64::from(cells) * RESOLUTION;
        let heading = f64::from(turns) * std::f64::consts::FRAC_PI_2;
        let pose = alignment(shift(columns), shift(rows), heading);
        let there = moved(&own, &pose, RESOLUTION);
        let expected: BTreeMap<Cell, i16> = told(&own)
            .into_iter()
            .map(|(cell, value)| {
                let at = pose.pose.act(&Point::new(
                    cell.centre(RESOLUTION).x,
                    cell.centre(RESOLUTION).y,
                ));
                (Cell::holding(&at, RESOLUTION), value)
            })
            .collect();
        prop_assert_eq!(told(&there), expected);
    }

    #[test]
    fn what_is_moved_lies_where_it_was_seen_and_is_as_uncertain_as_its_alignment(
        (x, y, heading) in (-50.0..50.0, -50.0..50.0, -3.1..3.1),
    ) {
        // A square of 40 cells.
        let row = |row: u16| EvidenceRun { start: row * 64 + 10, length: 40, value: 85 };
        let square = TilePatch::new((10..50).map(row).collect()).unwrap();
        let own = look(&BTreeMap::from([(TileIndex { x: 0, y: 0 }, square)]));
        let pose = alignment(x, y, heading);
        let there = moved(&own, &pose, RESOLUTION);
        let cells = told(&there);
        prop_assert!((1560..1640).contains(&cells.len()), "{}", cells.len());
        prop_assert!(cells.values().all(|value| *value == 85));
        let middle = pose.pose.act(&Point::new(1.5, 1.5));
        for cell in cells.keys() {
            prop_assert!((cell.centre(RESOLUTION) - middle).norm() < 1.5);
        }
        let before = own.level_from_robot.covariance.matrix();
        let after = there.level_from_robot.covariance.matrix();
        prop_assert!(after.trace() > before.trace() + 1.9e-3);
        prop_assert_eq!(there.provenance, Provenance::SharedMap);
        prop_assert_eq!(moved(&own, &pose, RESOLUTION), there);
    }
}
