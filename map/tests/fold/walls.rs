//! What the fold makes of walls, doors and things.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_map::geometry::{Covariance, Interval, Point, Pose, UncertainPose};
use mapfold_map::level::{Contribution, Level, LevelConfig, Provenance};
use mapfold_map::raster::{Cell, EvidencePatch, SensorClass, TILE_CELLS, TilePatch};
use mapfold_map::vector::{ObservedEnd, Segment};

use crate::world::{Chance, NOISE, Noise, id, looks, observe};

pub(crate) const EXACT: Noise =
    Noise { position: 0.005, heading: 0.001, offset: 0.002, angle: 0.001 };

pub(crate) fn look(
    number: u64,
    walls: &[(Point, Point)],
    from: Point,
    noise: Noise,
) -> Contribution {
    let mut chance = Chance(number + 1000);
    let truth = Pose::new(from.x, from.y, chance.uniform(-3.0, 3.0));
    Contribution {
        id: id(1, number),
        robot: Arc::from("ada"),
        observed_at_us: number as i64,
        level_from_robot: UncertainPose {
            pose: truth,
            covariance: Covariance::from_variances([
                noise.position.powi(2),
                noise.position.powi(2),
                noise.heading.powi(2),
            ]),
        },
        provenance: Provenance::SharedMap,
        segments: walls.iter().map(|(a, b)| observe(*a, *b, &truth, noise, &mut chance)).collect(),
        clusters: Vec::new(),
        evidence: Vec::new(),
    }
}

pub(crate) fn folded(looks: &[Contribution]) -> Level {
    let mut level = Level::new(LevelConfig::standard(0.05));
    level.fold(looks);
    level
}

fn only(level: &Level) -> &Segment {
    assert_eq!(level.map().segments.len(), 1, "{:#?}", level.map().segments);
    level.map().segments.values().next().unwrap()
}

#[test]
fn looks_at_one_wall_become_one_segment_that_counts_them() {
    let wall = (Point::new(30.0, 12.0), Point::new(34.0, 15.0));
    let looks: Vec<_> = (0..9).map(|i| look(i, &[wall], Point::new(33.0, 10.0), EXACT)).collect();
    let level = folded(&looks);
    let segment = only(&level);
    assert_eq!(segment.looks, 9);
    assert_eq!(segment.solid.len(), 1);
    // Each end is drawn in by two standard deviations of its place, here 23 mm.
    assert!((segment.solid[0].span.length() - 4970).abs() < 25);
    for end in [wall.0, wall.1] {
        assert!(segment.line.across(&end).abs() < 0.01);
    }
}

#[test]
fn a_look_that_is_unsure_where_a_wall_ends_does_not_lengthen_it() {
    let wall = (Point::new(1.0, 3.0), Point::new(4.0, 3.0));
    let too_long = (wall.0, Point::new(4.3, 3.0));
    let mut looks: Vec<_> = (0..5).map(|i| look(i, &[wall], Point::new(2.0, 1.0), EXACT)).collect();
    let mut unsure = look(9, &[too_long], Point::new(2.0, 1.0), EXACT);
    unsure.segments[0].ends = unsure.segments[0].ends.map(|end| ObservedEnd { sd: 0.2, ..end });
    looks.push(unsure);
    assert!((solid(&folded(&looks)) - 3000).abs() < 60);
}

#[test]
fn opposite_faces_of_a_thin_wall_stay_two() {
    let front = (Point::new(1.0, 3.0), Point::new(5.0, 3.0));
    let back = (Point::new(1.0, 3.08), Point::new(5.0, 3.08));
    let level = folded(&[
        look(0, &[front], Point::new(3.0, 1.0), EXACT),
        look(1, &[(back.1, back.0)], Point::new(3.0, 5.0), EXACT),
    ]);
    assert_eq!(level.map().segments.len(), 2);
}

#[test]
fn a_wall_through_the_origin_of_the_level_is_one_wall() {
    let wall = (Point::new(-2.0, 0.001), Point::new(2.0, -0.001));
    let looks: Vec<_> = (0..6).map(|i| look(i, &[wall], Point::new(0.3, 2.0), EXACT)).collect();
    assert_eq!(only(&folded(&looks)).looks, 6);
}

/// A look that saw no wall, only gave `steps` of evidence to the cells from x0 to x1 and y0 to y1.
pub(crate) fn area(
    number: u64,
    x: [f64; 2],
    y: [f64; 2],
    steps: i16,
    class: SensorClass,
) -> Contribution {
    let mut cells: BTreeMap<_, Box<[i16; TILE_CELLS]>> = BTreeMap::new();
    let count = |[from, to]: [f64; 2]| ((to - from) / 0.05).round() as i32;
    for column in 0..count(x) {
        for row in 0..count(y) {
            let centre = |from: f64, i: i32| from + 0.025 + 0.05 * f64::from(i);
            let p = Point::new(centre(x[0], column), centre(y[0], row));
            let (tile, offset) = Cell::holding(&p, 0.05).tile();
            cells.entry(tile).or_insert_with(|| Box::new([0; TILE_CELLS]))[offset] = steps;
        }
    }
    let tiles = cells.into_iter().map(|(t, c)| (t, TilePatch::from_cells(&c))).collect();
    Contribution {
        segments: Vec::new(),
        evidence: vec![EvidencePatch { class, tiles }],
        ..look(number, &[], Point::new(3.0, 1.0), EXACT)
    }
}

#[test]
fn a_doorway_that_robots_look_through_is_open_and_closes_when_the_evidence_is_taken_out() {
    let wall = (Point::new(1.0, 3.0), Point::new(5.0, 3.0));
    let looks = [
        look(0, &[wall], Point::new(3.0, 1.0), EXACT),
        area(1, [2.0, 2.9], [2.5, 3.5], -200, SensorClass::Scanner),
    ];
    let mut level = folded(&looks);
    let segment = only(&level).clone();
    assert_eq!(segment.solid.len(), 2);
    let gap = segment.solid[1].span.from - segment.solid[0].span.to;
    assert!((gap - 900).abs() <= 100, "the gap is {gap} mm");
    level.unfold(&looks[1..]);
    assert_eq!(only(&level).solid.len(), 1);
}

#[test]
fn all_pieces_of_a_wall_in_one_look_have_a_say_in_its_line() {
    // Two pieces of one wall on either side of the robot, whose lines lie a little apart.
    let pieces = [
        (Point::new(1.0, 3.0), Point::new(2.97, 3.0)),
        (Point::new(3.03, 3.01), Point::new(5.0, 3.01)),
    ];
    for provenance in [Provenance::SharedMap, Provenance::Datum] {
        let seen =
            look(0, &pieces, Point::new(3.0, 1.0), Noise { offset: 0.01, angle: 0.008, ..EXACT });
        let level = folded(&[Contribution { provenance, ..seen.clone() }]);
        let segments = seen.segments.iter().rev().cloned().collect();
        let turned = folded(&[Contribution { provenance, segments, ..seen.clone() }]);
        let at = |level: &Level| only(level).line.across(&Point::new(3.0, 3.0));
        let (one, other) = (at(&level), at(&turned));
        assert!((one - other).abs() < 1e-3, "{provenance:?}: {one} or {other}");
    }
}

#[test]
fn what_a_look_saw_through_is_not_bridged_and_several_open_what_others_claim() {
    let pieces = [
        (Point::new(1.0, 3.0), Point::new(2.97, 3.0)),
        (Point::new(3.03, 3.0), Point::new(5.0, 3.0)),
    ];
    let from = Point::new(3.0, 1.0);
    let whole = folded(&[look(0, &pieces, from, EXACT)]);
    assert!((solid(&whole) - 4000).abs() < 59, "a gap of 6 cm is closed");
    // The gap as the first piece's line has it, from the side on which the gap lies.
    let through = |number| {
        let mut look = look(number, &pieces, from, EXACT);
        for (i, segment) in look.segments.iter_mut().enumerate() {
            let (from, to) = (
                Interval::from_metres(segment.to, segment.to + 0.06),
                Interval::from_metres(segment.from - 0.06, segment.from),
            );
            // Seen from below, lines run from right to left.
            segment.seen_through = vec![if i == 0 { to } else { from }];
        }
        look
    };
    let pieces_of = |level: &Level| only(level).solid.len();
    let slit = folded(&[through(0)]);
    assert_eq!((pieces_of(&whole), pieces_of(&slit)), (1, 2));
    let long = (Point::new(1.0, 3.0), Point::new(5.0, 3.0));
    let bold = |n: u64| (10..10 + n).map(move |i| look(i, &[long], from, EXACT));
    let one: Vec<_> = bold(2).chain([through(0)]).collect();
    assert_eq!(pieces_of(&folded(&one)), 1, "one look may err");
    let two: Vec<_> = bold(2).chain([through(0), through(1)]).collect();
    assert_eq!(pieces_of(&folded(&two)), 2);
}

#[test]
fn a_door_survives_a_hundred_looks_from_both_sides() {
    // A wall of 10 cm with a door of 0.8 m.
    let faces = |y: f64| {
        [(Point::new(1.0, y), Point::new(2.6, y)), (Point::new(3.4, y), Point::new(5.0, y))]
    };
    let mut chance = Chance(5);
    let looks: Vec<Contribution> = (0..100)
        .map(|i| {
            let below = i % 2 == 0;
            let (y, robot) = if below { (3.0, 1.0) } else { (3.1, 5.1) };
            let mut walls = faces(y);
            if !below {
                walls = walls.map(|(a, b)| (b, a));
            }
            let from = Point::new(chance.uniform(1.5, 4.5), robot);
            let mut look = look(i, &walls, from, NOISE);
            let pose = &mut look.level_from_robot.pose;
            *pose = Pose::new(
                pose.x + chance.normal(NOISE.position),
                pose.y + chance.normal(NOISE.position),
                pose.heading() + chance.normal(NOISE.heading),
            );
            look
        })
        .collect();
    let level = folded(&looks);
    let mut counts = [0, 0];
    for segment in level.map().segments.values().filter(|s| s.looks >= 10) {
        let side = usize::from(segment.line.at(segment.solid[0].span.from_m()).y > 3.05);
        counts[side] += segment.looks;
    }
    // Which of the two faces a wall is shows in its facing, however near they are.
    assert!(counts.iter().sum::<u32>() >= 100, "{counts:?}");
    for segment in level.map().segments.values() {
        for piece in &segment.solid {
            let at = |t: f64| segment.line.at(t).x;
            let (a, b) = (at(piece.span.from_m()), at(piece.span.to_m()));
            let (low, high) = (a.min(b), a.max(b));
            // The frame is where it is to 15 cm: three deviations of the looks that saw most of it.
            assert!(high < 2.75 || low > 3.25, "a piece from {low} to {high} narrows the door");
        }
    }
    let facings: std::collections::BTreeSet<_> =
        level.map().segments.values().filter(|s| s.looks >= 10).map(|s| s.facing).collect();
    assert_eq!(facings.len(), 2, "two faces stay two");
}

#[test]
fn a_wall_far_from_the_origin_is_no_worse_than_one_close_by() {
    let error = |distance: f64| {
        let (mut offset, mut claimed) = (0.0, 0.0);
        for run in 0..40 {
            let mut chance = Chance(run);
            let shift = Point::new(0.6 * distance, 0.8 * distance);
            let wall = (shift + Point::new(-1.0, 0.3), shift + Point::new(1.0, 0.9));
            let looks: Vec<Contribution> = (0..8)
                .map(|i| {
                    let from = shift + Point::new(chance.uniform(-1.0, 1.0), -2.0);
                    let mut look = look(100 * run + i, &[wall], from, NOISE);
                    let pose = &mut look.level_from_robot.pose;
                    *pose = Pose::new(
                        pose.x + chance.normal(NOISE.position),
                        pose.y + chance.normal(NOISE.position),
                        pose.heading() + chance.normal(NOISE.heading),
                    );
                    look
                })
                .collect();
            let level = folded(&looks);
            let segment = level.map().segments.values().max_by_key(|s| s.looks).unwrap();
            let middle = (wall.0 + wall.1) * 0.5;
            offset += segment.line.across(&middle).powi(2);
            let lever = -segment.line.along(&middle);
            let total = (segment.independent + segment.dependent)
                .transformed(&nalgebra::Matrix2::new(1.0, lever, 0.0, 1.0));
            claimed += total.matrix()[(0, 0)];
        }
        ((offset / 40.0).sqrt(), (claimed / 40.0).sqrt())
    };
    let (near, far) = (error(5.0), error(500.0));
    assert!((far.0 / near.0 - 1.0).abs() < 1e-6, "{near:?} {far:?}");
    assert!((far.1 / near.1 - 1.0).abs() < 1e-6, "{near:?} {far:?}");
}

#[test]
fn sonar_alone_opens_no_wall() {
    let wall = (Point::new(1.0, 3.0), Point::new(5.0, 3.0));
    let level = folded(&[
        look(0, &[wall], Point::new(3.0, 1.0), EXACT),
        area(1, [2.0, 2.9], [2.5, 3.5], -200, SensorClass::Sonar),
    ]);
    assert_eq!(only(&level).solid.len(), 1);
}

/// A wall along y = 3 with hits from four looks, and free evidence behind it from `through` more.
fn looked_through(through: u64) -> Vec<Contribution> {
    let wall = (Point::new(1.0, 3.0), Point::new(5.0, 3.0));
    let scanner = SensorClass::Scanner;
    let hits = (0..4).map(|i| look(i, &[wall], Point::new(3.0, 1.0), EXACT));
    let marked = (4..8).map(|i| area(i, [1.0, 5.0], [2.95, 3.05], 85, scanner));
    let freed = (8..8 + through).map(|i| area(i, [2.0, 3.0], [3.05, 3.5], -40, scanner));
    hits.chain(marked).chain(freed).collect()
}

#[test]
fn what_many_looks_went_through_is_open_although_others_hit_it() {
    let gap = |looks: &[Contribution]| 4000 - solid(&folded(looks));
    assert_eq!(gap(&looked_through(1)) / 100, 0, "one look of five may err");
    assert!((gap(&looked_through(2)) - 1000).abs() <= 100);
}

#[test]
fn a_wall_ends_where_nearly_all_looks_say_it_does() {
    let wall = |to| (Point::new(1.0, 3.0), Point::new(to, 3.0));
    let looks = |bold: u64| -> Vec<Contribution> {
        let sober = (0..8).map(|i| look(i, &[wall(4.0)], Point::new(3.0, 1.0), EXACT));
        let bold = (8..8 + bold).map(|i| look(i, &[wall(4.6)], Point::new(3.0, 1.0), EXACT));
        sober.chain(bold).collect()
    };
    // Ends are drawn in by two standard deviations.
    assert!((solid(&folded(&looks(1))) - 3000).abs() < 60, "one of nine errs outwards");
    assert!((solid(&folded(&looks(6))) - 3600).abs() < 60, "six of fourteen saw more");
    // What lies farther from there than they all reach, others may just not have seen.
    let far = [looks(0), vec![look(8, &[wall(9.0)], Point::new(3.0, 1.0), EXACT)]].concat();
    assert!((solid(&folded(&far)) - 7000).abs() < 60);
}

#[test]
fn free_space_behind_a_thin_partition_is_that_of_its_other_face() {
    let back = (Point::new(5.0, 3.05), Point::new(1.0, 3.05));
    let mut looks = looked_through(3);
    looks.extend((20..23).map(|i| look(i, &[back], Point::new(3.0, 5.0), EXACT)));
    assert!((solid(&folded(&looks)) - 8000).abs() < 200);
}

/// Total length of what is published, millimetres.
fn solid(level: &Level) -> i64 {
    level.map().segments.values().flat_map(|s| &s.solid).map(|i| i.span.length()).sum()
}

#[test]
fn two_walls_with_a_door_between_them_are_not_bridged() {
    let walls = [
        (Point::new(1.0, 3.0), Point::new(3.0, 3.0)),
        (Point::new(3.9, 3.0), Point::new(6.0, 3.0)),
    ];
    let looks: Vec<_> = (0..5).map(|i| look(i, &walls, Point::new(3.4, 1.0), EXACT)).collect();
    let level = folded(&looks);
    let lengths: Vec<i64> = level
        .map()
        .segments
        .values()
        .flat_map(|s| s.solid.iter().map(|i| i.span.length()))
        .collect();
    assert_eq!(lengths.len(), 2);
    assert!(lengths.iter().all(|l| *l < 2200));
}

#[test]
fn a_room_seen_from_inside_by_many_has_four_walls() {
    let level = folded(&looks(3, 60, NOISE));
    let long = level
        .map()
        .segments
        .values()
        .filter(|s| s.solid.iter().any(|i| i.span.length() > 3000))
        .count();
    assert_eq!(long, 8, "two rooms of four walls");
    // The wall between the rooms is 12 cm thick and seen from both sides.
    assert!(level.map().segments.len() <= 12, "{} segments", level.map().segments.len());
}

#[test]
fn a_long_wall_seen_piece_by_piece_is_not_published_twice() {
    let looks: Vec<_> = (0..20)
        .map(|i| {
            let x = i as f64;
            let wall = (Point::new(x, 3.0), Point::new(x + 4.0, 3.0));
            look(i, &[wall], Point::new(x + 2.0, 1.0), EXACT)
        })
        .collect();
    let level = folded(&looks);
    let total: i64 =
        level.map().segments.values().flat_map(|s| s.solid.iter().map(|i| i.span.length())).sum();
    assert!((total - 23_000).abs() < 300, "{total} mm of a wall of 23 m");
}
