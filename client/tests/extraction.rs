//! Extraction against worlds of which the truth is known.
#![expect(clippy::unwrap_used, reason = "tests stop at the first surprise")]

#[path = "worlds/room.rs"]
mod room;

use std::f64::consts::{FRAC_PI_2, PI};

use mapfold_client::perception::{self, BeamUse, Config, Features};
use mapfold_client::sensor::{Scan, ScannerProfile, preset};
use mapfold_map::geometry::{Interval, Pose, UncertainLine, difference, tangent, unit_normal};
use mapfold_map::vector::{EndKind, Facing, ObservedSegment};
use nalgebra::Vector2;
use room::{Chance, Room};

const DEGREE: f64 = PI / 180.0;
const CLEAN: (f64, f64) = (0.0, 0.0);

fn profile() -> ScannerProfile {
    preset("sick-lms").unwrap().scanner.unwrap()
}

fn config() -> Config {
    Config::for_scanner(&profile())
}

fn square() -> Room {
    Room::polygon(&[(-3.0, -2.0), (4.0, -2.0), (4.0, 3.0), (-3.0, 3.0)])
}

#[test]
fn a_square_room_has_four_walls_wherever_the_scan_begins() {
    let mut chance = Chance(1);
    for turn in 0..90 {
        let heading = f64::from(turn) * 4.0 * DEGREE;
        let scan = square().scan((0.0, 0.0, heading), (360, DEGREE), (0.008, 0.0), &mut chance);
        assert!(scan.is_full_circle());
        let found = perception::extract(&scan, &config());
        assert_eq!(
            found.segments.len(),
            4,
            "heading {heading}: {:?}",
            found
                .segments
                .iter()
                .map(|s| (
                    s.line.line.rho(),
                    s.line.line.alpha().to_degrees(),
                    s.from,
                    s.to,
                    s.points,
                    s.ends
                ))
                .collect::<Vec<_>>()
        );
        let on_walls = found.beams.iter().filter(|b| matches!(b, BeamUse::Segment(_))).count();
        assert!(on_walls >= 356, "heading {heading}: {on_walls} of 360 beams explained");
        for wall in &found.segments {
            assert_eq!(wall.facing, Facing::Origin);
            let length = wall.to - wall.from;
            assert!((length - 7.0).abs() < 0.1 || (length - 5.0).abs() < 0.1, "length {length}");
        }
        // Also where the scan is cut open.
        assert!(found.segments.iter().flat_map(|s| s.ends).all(|e| e.kind == EndKind::Corner));
    }
}

#[test]
fn a_wall_across_the_seam_of_a_full_circle_is_one_wall() {
    // The scan begins and ends in the middle of the wall behind; some drivers repeat the first beam at
    // the end, some leave the last one out.
    for beams in [719, 720, 721] {
        let scan = square().scan((0.0, 0.0, 0.0), (beams, 0.5 * DEGREE), CLEAN, &mut Chance(1));
        let found = perception::extract(&scan, &config());
        let behind: Vec<_> = found
            .segments
            .iter()
            .filter(|s| difference(s.line.line.alpha(), PI).abs() < 1e-3)
            .collect();
        assert_eq!(behind.len(), 1, "{beams} beams");
        assert!((behind[0].to - behind[0].from - 5.0).abs() < 0.05);
        assert!((behind[0].line.line.rho() - 3.0).abs() < 1e-6);
    }
}

#[test]
fn a_wall_across_the_seam_is_one_wall_with_a_corner_near_it() {
    // The room's corner behind on the left lies 2 to 60 beams from where the scan begins and ends,
    // on either side of it: the seam falls within either of its walls, near their end.
    let mut chance = Chance(2);
    let corner = 3f64.atan2(-3.0);
    for beams in (-60_i32..=60).filter(|beams| beams.abs() > 1) {
        for _ in 0..3 {
            let heading = corner - PI + f64::from(beams) * 0.5 * DEGREE;
            let scan =
                square().scan((0.0, 0.0, heading), (720, 0.5 * DEGREE), (0.01, 0.0), &mut chance);
            assert!(scan.is_full_circle());
            let found = perception::extract(&scan, &config());
            assert_eq!(found.segments.len(), 4, "corner {beams} beams from the seam");
            for wall in &found.segments {
                let length = wall.to - wall.from;
                assert!(
                    (length - 7.0).abs() < 0.1 || (length - 5.0).abs() < 0.1,
                    "{beams}: {length}"
                );
                assert_eq!(wall.ends.map(|e| e.kind), [EndKind::Corner; 2], "{beams}");
            }
        }
    }
}

#[test]
fn a_wall_across_the_seam_is_one_wall_where_the_scan_has_gaps() {
    // A wall behind with an open door on one side of the seam and nothing beyond its ends: the
    // runs are many, and the one with the seam in it is still one wall.
    let room = Room {
        walls: vec![
            [(-2.0, -1.5), (-2.0, 0.6)],
            [(-2.0, 1.5), (-2.0, 3.0)],
            [(-4.0, -4.0), (-4.0, 4.0)],
        ],
        pillars: Vec::new(),
    };
    let mut chance = Chance(3);
    for _ in 0..50 {
        let scan = room.scan((0.0, 0.0, 0.0), (720, 0.5 * DEGREE), (0.01, 0.0), &mut chance);
        let found = perception::extract(&scan, &config());
        let near: Vec<_> = found.segments.iter().filter(|s| s.line.line.rho() < 3.0).collect();
        assert_eq!(near.len(), 2, "{near:#?}");
        let across = near.iter().find(|s| s.to - s.from > 1.8).expect("the wall with the seam");
        assert!((across.to - across.from - 2.1).abs() < 0.06);
        // The door is seen through from both of its jambs, once.
        assert!(
            across.seen_through.iter().any(|i| (850..1000).contains(&i.length())),
            "{across:#?}"
        );
    }
}

#[test]
fn noise_wider_than_a_near_wall_is_long_makes_no_walls_along_the_beams() {
    // A corner half a metre off, read with a noise of 8 cm: from beam to beam points lie 2 mm apart along the
    // walls and a hand's breadth along the beams.
    let profile = ScannerProfile { range_sd_m: 0.08, range_sd_per_m: 0.0, ..profile() };
    let config = Config::for_scanner(&profile);
    let room = Room::polygon(&[(-0.4, -0.5), (0.5, -0.5), (0.5, 0.4), (-0.4, 0.4)]);
    let mut chance = Chance(4);
    let (mut walls, mut along) = (0, 0);
    for _ in 0..200 {
        let scan = room.scan((0.0, 0.0, 0.3), (721, 0.25 * DEGREE), (0.08, 0.0), &mut chance);
        for wall in perception::extract(&scan, &config).segments {
            walls += 1;
            along += usize::from(wall.line.line.rho() < 0.15);
        }
    }
    assert!(walls > 200 && along == 0, "{along} of {walls} walls lie along the beams");
}

/// A part of a test's world that gives segments, clusters and gaps.
fn furnished() -> Room {
    let mut room = square();
    room.walls.push([(1.0, -2.0), (1.0, -1.0)]);
    room.pillars.push((2.0, 1.5, 0.12));
    room
}

fn noisy_scan(seed: u64) -> Scan {
    furnished().scan((0.2, 0.3, 0.4), (181, DEGREE), (0.01, 0.001), &mut Chance(seed))
}

#[test]
fn turning_the_sensor_turns_the_answer_and_nothing_else() {
    for (seed, turn) in [(1, 0.3), (2, -2.0), (3, 3.1), (4, FRAC_PI_2)] {
        let scan = noisy_scan(seed);
        let mut turned = scan.clone();
        turned.geometry.first_bearing += turn;
        let (a, b) =
            (perception::extract(&scan, &config()), perception::extract(&turned, &config()));
        same_but_turned(&a, &b, turn);
        // Mounting the same sensor turned on the robot is the same thing.
        let mut mounted = scan.clone();
        mounted.robot_from_sensor = Pose::new(0.0, 0.0, turn);
        same_but_turned(&a, &perception::extract(&mounted, &config()), turn);
    }
}

fn same_but_turned(a: &Features, b: &Features, turn: f64) {
    assert!(!a.segments.is_empty() && !a.clusters.is_empty());
    assert_eq!(a.beams, b.beams);
    for (a, b) in a.segments.iter().zip(&b.segments) {
        assert!((a.line.line.rho() - b.line.line.rho()).abs() < 1e-9);
        let off = difference(b.line.line.alpha(), a.line.line.alpha() + turn);
        assert!(off.abs() < 1e-9);
        assert!((a.from - b.from).abs() < 1e-9 && (a.to - b.to).abs() < 1e-9);
        assert_eq!((a.facing, a.points), (b.facing, b.points));
        assert_eq!(a.seen_through.len(), b.seen_through.len());
        for (a, b) in a.seen_through.iter().zip(&b.seen_through) {
            // The last bit may tip a millimetre.
            assert!((a.from - b.from).abs() <= 1 && (a.to - b.to).abs() <= 1);
        }
        for (a, b) in a.ends.iter().zip(b.ends) {
            assert_eq!(a.kind, b.kind);
            assert!((a.sd - b.sd).abs() < 1e-9);
        }
        let off = (a.line.covariance.matrix() - b.line.covariance.matrix()).amax();
        assert!(off < 1e-9 * a.line.covariance.matrix().amax().max(1e-3));
    }
    let turned = Pose::<(), ()>::new(0.0, 0.0, turn);
    for (a, b) in a.clusters.iter().zip(&b.clusters) {
        assert!((turned.act(&a.centroid) - b.centroid).norm() < 1e-9);
        assert_eq!((a.hull.len(), a.points), (b.hull.len(), b.points));
        for p in &a.hull {
            let p = turned.act(p);
            assert!(b.hull.iter().any(|q| (p - q).norm() < 1e-9));
        }
    }
}

#[test]
fn moving_the_sensor_on_the_robot_moves_the_answer() {
    let scan = noisy_scan(7);
    let mount = Pose::new(0.4, -0.2, 2.0);
    let mut mounted = scan.clone();
    mounted.robot_from_sensor = mount;
    let (a, b) = (perception::extract(&scan, &config()), perception::extract(&mounted, &config()));
    assert_eq!(a.segments.len(), b.segments.len());
    for (a, b) in a.segments.iter().zip(&b.segments) {
        // End points, seen in the robot frame, are the same points.
        let ends = |s: &ObservedSegment| [s.line.line.at(s.from), s.line.line.at(s.to)];
        for p in ends(a).map(|p| mount.act(&p)) {
            assert!(ends(b).iter().any(|q| (p - q).norm() < 1e-9));
        }
        let through = |s: &ObservedSegment| -> Vec<_> {
            let marks = s.seen_through.iter().flat_map(|i| [i.from_m(), i.to_m()]);
            marks.map(|t| s.line.line.at(t)).collect()
        };
        assert_eq!(through(a).len(), through(b).len());
        for p in through(a).iter().map(|p| mount.act(p)) {
            assert!(through(b).iter().any(|q| (p - q).norm() < 2e-3));
        }
        // The sensor sees the wall from its own side, wherever the robot's centre is.
        let sensor_side = b.line.line.across(&mount.position()) < 0.0;
        assert_eq!(b.facing == Facing::Origin, sensor_side);
    }
}

#[test]
fn line_parameters_are_as_uncertain_as_they_claim() {
    // Noise as the profile says, no shared error: the mean NEES of 1000 runs must lie in the 95 %
    // band of a chi-square distribution with 2 degrees of freedom, [1.878, 2.126].
    let mut profile = profile();
    profile.systematic_sd_m = 0.0;
    profile.range_sd_per_m = 0.0;
    let mut config = Config::for_scanner(&profile);
    // Beside a lone wall nothing stands that its points could be.
    config.hedge.foreign_share = 0.0;
    let (rho, alpha): (f64, f64) = (2.5, 0.6);
    let wall =
        [-1.0, 2.0].map(|t| unit_normal(alpha) * rho + tangent(alpha) * t).map(|p| (p.x, p.y));
    let room = Room { walls: vec![wall], pillars: Vec::new() };
    let mut chance = Chance(20_261_122);
    let mut sum = 0.0;
    for _ in 0..1000 {
        let noise = (profile.range_sd_m, profile.bearing_sd_rad);
        let scan = room.scan((0.0, 0.0, 0.0), (181, DEGREE), noise, &mut chance);
        let found = perception::extract(&scan, &config);
        assert_eq!(found.segments.len(), 1);
        sum += nees(&found.segments[0].line, rho, alpha);
    }
    let mean = sum / 1000.0;
    assert!((1.878..=2.126).contains(&mean), "mean NEES {mean}");
}

#[test]
fn a_bias_that_all_beams_share_is_covered_by_the_floor() {
    // Each look has its own bias of one systematic deviation: without the floor the NEES would be
    // several times too large; with it, at most 2 on average.
    let profile = profile();
    let config = Config::for_scanner(&profile);
    let mut bare = config.clone();
    bare.fit.systematic_sd = 0.0;
    let (rho, alpha): (f64, f64) = (2.5, -1.1);
    let wall =
        [-1.5, 1.0].map(|t| unit_normal(alpha) * rho + tangent(alpha) * t).map(|p| (p.x, p.y));
    let room = Room { walls: vec![wall], pillars: Vec::new() };
    let mut chance = Chance(5);
    let (mut with, mut without) = (0.0, 0.0);
    for _ in 0..400 {
        let noise = (profile.range_sd_m, profile.bearing_sd_rad);
        let mut scan = room.scan((0.0, 0.0, 0.0), (181, DEGREE), noise, &mut chance);
        let bias = profile.systematic_sd_m * chance.gauss();
        scan.ranges.iter_mut().for_each(|r| *r += bias);
        with += nees(&perception::extract(&scan, &config).segments[0].line, rho, alpha) / 400.0;
        without += nees(&perception::extract(&scan, &bare).segments[0].line, rho, alpha) / 400.0;
    }
    assert!(with < 2.2 && without > 8.0, "with floor {with}, without {without}");
}

fn nees(line: &UncertainLine<mapfold_map::geometry::Robot>, rho: f64, alpha: f64) -> f64 {
    let off = Vector2::new(line.line.rho() - rho, difference(line.line.alpha(), alpha));
    mapfold_map::geometry::mahalanobis_sq(&off, &line.covariance)
}

#[test]
fn an_open_door_stays_open_and_its_jambs_are_jumps() {
    // A wall 2 m ahead with a door of 0.9 m, a wall 5 m behind it.
    let room = Room {
        walls: vec![
            [(2.0, -3.0), (2.0, -0.45)],
            [(2.0, 0.45), (2.0, 3.0)],
            [(5.0, -3.0), (5.0, 3.0)],
        ],
        pillars: Vec::new(),
    };
    let (mut gap, mut variance) = (0.0, 0.0);
    let mut chance = Chance(9);
    for _ in 0..200 {
        let heading = 0.02 * (chance.unit() - 0.5);
        let scan = room.scan((0.0, 0.0, heading), (181, DEGREE), (0.01, 0.001), &mut chance);
        let found = perception::extract(&scan, &config());
        let near: Vec<_> = found.segments.iter().filter(|s| s.line.line.rho() < 3.0).collect();
        assert_eq!(near.len(), 2, "{near:#?}");
        // In the order of the beams: right of the door, then left of it.
        assert_eq!((near[0].ends[1].kind, near[1].ends[0].kind), (EndKind::Jump, EndKind::Jump));
        assert_eq!(
            (near[0].ends[0].kind, near[1].ends[1].kind),
            (EndKind::Occluded, EndKind::Occluded)
        );
        gap += (near[1].from - near[0].to) / 200.0;
        variance += (near[0].ends[1].sd.powi(2) + near[1].ends[0].sd.powi(2)) / 200.0;
        // Each piece says that the door beside it was seen through, from jamb to jamb.
        let door = |from: f64, to: f64| {
            move |i: &Interval| (i.from_m() - from).abs() < 0.01 && (i.to_m() - to).abs() < 0.03
        };
        assert!(near[0].seen_through.iter().any(door(near[0].to, near[1].from)), "{near:#?}");
        let [through] = near[1].seen_through.as_slice() else { panic!("{near:#?}") };
        assert!((through.to_m() - near[1].from).abs() < 0.01, "{near:#?}");
        assert!((through.from_m() - near[0].to).abs() < 0.03, "{near:#?}");
        let behind =
            found.segments.iter().find(|s| s.line.line.rho() > 4.0).expect("the wall behind");
        assert!(behind.seen_through.is_empty());
        assert_eq!(behind.ends.map(|e| e.kind), [EndKind::Occluded; 2]);
    }
    // Half a beam's spacing is added at each end: the door is as wide as it is, on average.
    let sd_of_mean = (variance / 200.0).sqrt();
    assert!((gap - 0.9).abs() < 4.0 * sd_of_mean, "door of {gap} m, sd {sd_of_mean}");
}

#[test]
fn a_wall_ends_where_the_view_goes_on_behind_a_stray_reading() {
    let room = Room {
        walls: vec![[(2.0, -3.0), (2.0, 0.45)], [(5.0, -6.0), (5.0, 6.0)]],
        pillars: Vec::new(),
    };
    let mut chance = Chance(10);
    for strays in 0..=2 {
        let mut scan = room.scan((0.0, 0.0, 0.0), (361, 0.5 * DEGREE), (0.005, 0.0), &mut chance);
        let edge = scan.ranges.iter().rposition(|range| *range < 4.0).unwrap();
        for stray in 1..=strays {
            // Behind the wall, but not so far that a surface could not reach there.
            scan.ranges[edge + stray] = 2.12 + 0.08 * stray as f64;
        }
        let found = perception::extract(&scan, &config());
        let wall = found.segments.iter().find(|s| s.line.line.rho() < 3.0).unwrap();
        assert_eq!(wall.ends[1].kind, EndKind::Jump, "{strays} strays");
        let off = (wall.to - 0.45).abs();
        assert!(off < 0.06 && off < 2.0 * wall.ends[1].sd, "{strays} strays: {off}");
    }
}

#[test]
fn a_pillar_is_a_cluster_and_its_hull_lies_on_it() {
    let mut room = square();
    room.pillars.push((1.5, 0.5, 0.12));
    let scan = room.scan((0.0, 0.0, 0.0), (361, 0.5 * DEGREE), (0.005, 0.0), &mut Chance(3));
    let found = perception::extract(&scan, &config());
    let on_it = found
        .clusters
        .iter()
        .find(|c| (c.centroid.x - 1.5).hypot(c.centroid.y - 0.5) < 0.15)
        .expect("the pillar");
    assert!(on_it.points >= 5);
    for p in &on_it.hull {
        let off = (p.x - 1.5).hypot(p.y - 0.5) - 0.12;
        assert!(off.abs() < 0.03, "{off}");
    }
}

#[test]
fn a_round_wall_gives_no_long_false_walls() {
    let room = Room { walls: Vec::new(), pillars: vec![(3.0, 0.0, 1.0)] };
    let scan = room.scan((0.0, 0.0, 0.0), (361, 0.5 * DEGREE), (0.003, 0.0), &mut Chance(4));
    for wall in perception::extract(&scan, &config()).segments {
        // Sagitta of the chord: what is called straight is straight to within the noise's reach.
        let length = wall.to - wall.from;
        assert!(length * length / 8.0 < 0.05, "a straight wall of {length} m on a circle of 1 m");
    }
}

#[test]
fn nonsense_gives_nothing_and_no_panic() {
    let geometry = noisy_scan(1).geometry;
    for ranges in [
        vec![],
        vec![0.0; 181],
        vec![f64::NAN; 181],
        vec![f64::INFINITY; 181],
        vec![1e308; 181],
        vec![-5.0; 181],
        vec![3.0],
        vec![3.0, 3.0],
    ] {
        let scan = Scan {
            geometry,
            ranges,
            range_max: 30.0,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        };
        let found = perception::extract(&scan, &config());
        assert!(found.segments.is_empty() && found.clusters.is_empty());
        assert_eq!(found.beams.len(), scan.ranges.len());
    }
}
