//! What the fold makes of walls that meet: rooms, obstacles, polylines.

use std::f64::consts::TAU;
use std::sync::Arc;

use mapfold_map::geometry::Point;
use mapfold_map::level::{Contribution, Level, LevelConfig};
use mapfold_map::raster::SensorClass;
use mapfold_map::vector::{Chain, ChainId, ChainKind};
use proptest::prelude::*;

use crate::walls::{EXACT, area, folded, look};
use crate::world::{Chance, Noise, id};

fn points(list: &[(f64, f64)]) -> Vec<Point> {
    list.iter().map(|(x, y)| Point::new(*x, *y)).collect()
}

/// The edges of a ring.
fn walls(ring: &[Point]) -> Vec<(Point, Point)> {
    (0..ring.len()).map(|i| (ring[i], ring[(i + 1) % ring.len()])).collect()
}

/// Looks at each of `walls` from two metres before its middle (on the left of it), a wall a look.
fn looks_at(walls: &[(Point, Point)], noise: Noise) -> Vec<Contribution> {
    (0..)
        .zip(walls)
        .map(|(number, (a, b))| {
            let way = (b - a).normalize();
            let from = (a + b) * 0.5 + Point::new(-way.y, way.x) * 2.0;
            look(number, &[(*a, *b)], from, noise)
        })
        .collect()
}

fn only(level: &Level) -> &Chain {
    let chains = &level.map().chains;
    assert_eq!(chains.len(), 1, "{chains:#?}");
    chains.values().next().unwrap()
}

fn signed_area(ring: &[Point]) -> f64 {
    walls(ring).iter().map(|(a, b)| a.perp(b)).sum::<f64>() * 0.5
}

fn at(chain: &Chain) -> Vec<Point> {
    chain.vertices.iter().map(|vertex| vertex.at).collect()
}

const SQUARE: [(f64, f64); 4] = [(30.0, 12.0), (36.0, 12.0), (36.0, 16.0), (30.0, 16.0)];

#[test]
fn a_room_scanned_from_inside_is_one_polygon_of_its_size() {
    for seed in 0..8 {
        let square = points(&SQUARE);
        let from = Point::new(33.0 + 0.1 * seed as f64, 14.0);
        let noise = Noise { position: 0.01, heading: 0.002, ..EXACT };
        let looks: Vec<_> =
            (0..3).map(|i| look(10 * seed + i, &walls(&square), from, noise)).collect();
        let level = folded(&looks);
        let room = only(&level);
        assert_eq!(room.kind, ChainKind::Room);
        assert_eq!(room.vertices.len(), 4);
        let sd = room
            .vertices
            .iter()
            .map(|vertex| (0.5 * vertex.covariance.matrix().trace()).sqrt())
            .fold(0.0, f64::max);
        assert!(sd < 0.03, "{sd}");
        let error = (signed_area(&at(room)) - 24.0).abs();
        assert!(error < 20.0 * 3.0 * sd, "{error} square metres at {sd}");
        for vertex in &room.vertices {
            let nearest =
                square.iter().map(|p| (p - vertex.at).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 4.0 * sd, "{nearest} at {sd}");
        }
        assert_eq!(room.looks, 3);
        assert_eq!(room.segments.len(), 4);
    }
}

#[test]
fn a_box_seen_from_all_sides_is_an_obstacle_that_runs_the_other_way() {
    let mut ring = points(&SQUARE);
    ring.reverse();
    let level = folded(&looks_at(&walls(&ring), EXACT));
    let obstacle = only(&level);
    assert_eq!(obstacle.kind, ChainKind::Obstacle);
    assert_eq!(obstacle.vertices.len(), 4);
    assert!((signed_area(&at(obstacle)) + 24.0).abs() < 0.3);
}

/// The square room with a door of 0.9 m in its lower wall.
fn with_a_door() -> Vec<(Point, Point)> {
    let [a, b, c, d] = SQUARE.map(|(x, y)| Point::new(x, y));
    let (from, to) = (Point::new(32.0, 12.0), Point::new(32.9, 12.0));
    vec![(to, b), (b, c), (c, d), (d, a), (a, from)]
}

#[test]
fn a_room_with_a_door_is_a_polyline_that_is_open_there() {
    let level = folded(&looks_at(&with_a_door(), EXACT));
    let line = only(&level);
    assert_eq!(line.kind, ChainKind::Polyline);
    assert_eq!(line.vertices.len(), 6);
    // Free space on the left: the way leads from the door's right post round to its left post.
    let ends = [line.vertices[0].at, line.vertices[5].at];
    assert!((ends[0] - Point::new(32.9, 12.0)).norm() < 0.06, "{ends:?}");
    assert!((ends[1] - Point::new(32.0, 12.0)).norm() < 0.06, "{ends:?}");
}

#[test]
fn a_door_of_which_only_the_evidence_knows_opens_the_polygon_and_closes_it_again() {
    let mut looks = looks_at(&walls(&points(&SQUARE)), EXACT);
    looks.push(area(9, [32.0, 32.9], [11.5, 12.5], -200, SensorClass::Scanner));
    let mut level = folded(&looks);
    assert_eq!(only(&level).kind, ChainKind::Polyline);
    level.unfold(&looks[4..]);
    assert_eq!(only(&level).kind, ChainKind::Room);
}

#[test]
fn walls_in_a_row_go_on_as_one_unless_scanners_look_through_between_them() {
    let walls = [
        (Point::new(1.0, 3.0), Point::new(3.0, 3.0)),
        (Point::new(3.16, 3.0), Point::new(6.0, 3.0)),
    ];
    let mut looks: Vec<_> =
        (0..2).map(|i| look(i, &[walls[i as usize]], Point::new(3.0, 1.0), EXACT)).collect();
    let joined = folded(&looks);
    assert_eq!(joined.map().segments.len(), 2);
    assert_eq!(only(&joined).vertices.len(), 3);
    assert!((only(&joined).vertices[1].at.x - 3.08).abs() < 0.05);
    looks.push(area(2, [3.0, 3.2], [2.8, 3.2], -200, SensorClass::Scanner));
    assert!(folded(&looks).map().chains.is_empty());
    // Evidence that comes later opens it just so, and taking it out closes it.
    let mut level = joined.clone();
    let changes = level.fold(&looks[2..]);
    assert!(level.map().chains.is_empty());
    assert_eq!(changes.chains.len(), 1);
    level.unfold(&looks[2..]);
    assert_eq!(level.map(), joined.map());
}

#[test]
fn walls_that_face_different_ways_do_not_meet() {
    // One wall is seen from below and the other, above it, from the left: what is free for one lies
    // behind the other.
    let corner = Point::new(3.0, 3.0);
    let level = folded(&[
        look(0, &[(Point::new(0.0, 3.0), corner)], Point::new(1.5, 1.0), EXACT),
        look(1, &[(corner, Point::new(3.0, 6.0))], Point::new(1.0, 4.5), EXACT),
    ]);
    assert_eq!(level.map().segments.len(), 2);
    assert!(level.map().chains.is_empty(), "{:?}", level.map().chains);
}

#[test]
fn a_lone_wall_is_no_chain() {
    let level = folded(&looks_at(&[(Point::new(1.0, 3.0), Point::new(5.0, 3.0))], EXACT));
    assert!(level.map().chains.is_empty());
}

/// The id that the chain with a vertex near `p` has.
fn id_near(level: &Level, p: Point) -> ChainId {
    let near = |chain: &Arc<Chain>| chain.vertices.iter().any(|v| (v.at - p).norm() < 0.1);
    *level.map().chains.iter().find(|(_, chain)| near(chain)).unwrap().0
}

#[test]
fn a_chain_keeps_its_identity_while_it_is_seen_again_and_grows() {
    // A corridor with a bend: its longest wall first, so that the best-ranked piece is there.
    let bend = points(&[(0.0, 0.0), (9.0, 0.0), (9.0, 4.0), (12.0, 4.0), (12.0, 6.0)]);
    let walls: Vec<_> = bend.windows(2).map(|p| (p[0], p[1])).collect();
    let looks = looks_at(&walls, EXACT);
    let mut level = folded(&looks[..2]);
    let (corner, id) = (bend[1], id_near(&level, bend[1]));
    for next in &looks[2..] {
        level.fold([next]);
        assert_eq!(id_near(&level, corner), id, "it grows at its end");
    }
    for number in 20..26 {
        let again = look(
            number,
            &[(bend[0], bend[1])],
            Point::new(5.0, 2.5),
            Noise { offset: 0.01, ..EXACT },
        );
        level.fold([&again]);
        assert_eq!(id_near(&level, corner), id, "it is seen again");
    }
    // The other side of a door in the longest wall is another chain, or none: this one keeps its name.
    level.fold([&area(40, [2.0, 2.9], [-0.5, 0.5], -200, SensorClass::Scanner)]);
    assert_eq!(id_near(&level, corner), id, "a door opens at its other end");
}

#[test]
fn a_chain_that_would_cross_itself_is_cut_where_it_is_joined_worst() {
    // Walls wound into a pentagram: every corner joins, every wall crosses two others.
    let star: Vec<Point> = (0..5)
        .map(|i| {
            let angle = TAU * 2.0 * f64::from(i) / 5.0;
            Point::new(20.0, 20.0) + Point::new(angle.cos(), angle.sin()) * 4.0
        })
        .collect();
    let level = folded(&looks_at(&walls(&star), EXACT));
    assert_eq!(level.map().segments.len(), 5);
    let chains: Vec<_> = level.map().chains.values().collect();
    // No two edges of a pentagram with one between them can stay in one chain.
    assert!(chains.len() == 2 && chains.iter().all(|chain| chain.segments.len() == 2));
    assert!(chains.iter().all(|chain| chain.kind == ChainKind::Polyline));
}

/// Short walls strewn over a small place: many of their ends could meet in many ways.
fn strewn(seed: u64, count: u64) -> Vec<Contribution> {
    let mut chance = Chance(seed);
    (0..count)
        .map(|number| {
            let walls: Vec<_> = (0..=chance.bits() % 4)
                .map(|_| {
                    // Ends on a lattice, a little off: corners are common.
                    let mut end = || {
                        let place = |v: f64| v.floor() * 1.5 + 5.0;
                        let p = Point::new(
                            place(chance.uniform(0.0, 4.0)),
                            place(chance.uniform(0.0, 4.0)),
                        );
                        p + Point::new(chance.normal(0.05), chance.normal(0.05))
                    };
                    (end(), end())
                })
                .filter(|(a, b)| (a - b).norm() > 0.5)
                .collect();
            let from = Point::new(chance.uniform(4.0, 11.0), chance.uniform(4.0, 11.0));
            if chance.bits().is_multiple_of(4) {
                let (x, y) = (chance.uniform(4.0, 10.0), chance.uniform(4.0, 10.0));
                let free = area(number, [x, x + 1.0], [y, y + 1.0], -120, SensorClass::Scanner);
                return Contribution { id: id(seed, number), ..free };
            }
            Contribution { id: id(seed, number), ..look(number, &walls, from, EXACT) }
        })
        .collect()
}

/// Whether two edges cross. Pieces of one wall lie on one line, where sides are chance: they cross only
/// if their extents overlap.
fn cross(a: (Point, Point), b: (Point, Point)) -> bool {
    let (a_min, a_max) = (a.0.inf(&a.1), a.0.sup(&a.1));
    let (b_min, b_max) = (b.0.inf(&b.1), b.0.sup(&b.1));
    if (0..2).any(|i| a_max[i] < b_min[i] || b_max[i] < a_min[i]) {
        return false;
    }
    let side = |p: (Point, Point), q: Point| (p.1 - p.0).perp(&(q - p.0)) > 0.0;
    side(a, b.0) != side(a, b.1) && side(b, a.0) != side(b, a.1)
}

fn assert_valid(level: &Level) {
    let mut used = std::collections::BTreeSet::new();
    for (id, chain) in &level.map().chains {
        assert!(chain.segments.contains(&id.segment));
        let is_closed = chain.kind.is_closed();
        let (count, edges) = (chain.vertices.len(), chain.segments.len());
        assert_eq!(edges, if is_closed { count } else { count - 1 });
        assert!(edges >= if is_closed { 3 } else { 2 });
        let ring = walls(&at(chain));
        for (i, edge) in ring[..edges].iter().enumerate() {
            assert!((edge.1 - edge.0).norm() > 1e-3);
            assert!(used.insert((edge.0.x.to_bits(), edge.0.y.to_bits(), edge.1.x.to_bits())));
            for (j, other) in ring[..edges].iter().enumerate().skip(i + 2) {
                let touch = is_closed && i == 0 && j == edges - 1;
                assert!(touch || !cross(*edge, *other), "{id:?} meets itself: {edge:?} {other:?}");
            }
        }
        let area = signed_area(&at(chain));
        match chain.kind {
            ChainKind::Polyline => {}
            ChainKind::Room => assert!(area > 0.0),
            ChainKind::Obstacle => assert!(area < 0.0),
        }
        for vertex in &chain.vertices {
            let c = vertex.covariance.matrix();
            assert!(c[(0, 0)] > 0.0 && c[(1, 1)] > 0.0 && c.determinant() >= 0.0);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn chains_of_strewn_walls_are_valid_and_do_not_depend_on_the_way_there(
        seed: u64,
        batch in 1_usize..7,
        out in 1_u64..59,
    ) {
        let looks = strewn(seed, 60);
        let at_once = folded(&looks);
        prop_assert!(!at_once.map().chains.is_empty());
        assert_valid(&at_once);
        let mut chance = Chance(seed ^ 5);
        let mut level = Level::new(LevelConfig::standard(0.05));
        for some in chance.shuffled(looks.clone()).chunks(batch) {
            level.fold(some);
        }
        prop_assert_eq!(level.map(), at_once.map());
        let (removed, kept): (Vec<_>, Vec<_>) =
            looks.into_iter().partition(|_| chance.bits() % 60 < out);
        for some in removed.chunks(batch) {
            level.unfold(some);
        }
        let never = folded(&kept);
        prop_assert_eq!(level.map(), never.map());
    }
}
