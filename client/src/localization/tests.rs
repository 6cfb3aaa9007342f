//! A room, a corridor, and robots that are tracked in them.

mod jacobians;
mod statistics;

use mapfold_map::geometry::{
    Covariance, Interval, Level, Line, Point, Pose, Robot, UncertainLine, UncertainPose, tangent,
};
use mapfold_map::level::{ContributionId, FeatureId};
use mapfold_map::raster::LogOdds;
use mapfold_map::vector::{EndKind, Facing, ObservedEnd, ObservedSegment, Segment, SolidInterval};
use nalgebra::Matrix2;

use super::*;

/// A straight wall from one point to another with free space on its left: offset and angle of the normal that
/// points there, and the middle.
#[derive(Debug, Clone, Copy)]
struct Wall {
    a: Point,
    b: Point,
}

impl Wall {
    fn new(a: (f64, f64), b: (f64, f64)) -> Self {
        Self { a: Point::new(a.0, a.1), b: Point::new(b.0, b.1) }
    }

    fn middle(&self) -> Point {
        (self.a + self.b) * 0.5
    }

    fn length(&self) -> f64 {
        (self.b - self.a).norm()
    }

    fn normal(&self) -> Point {
        let along = (self.b - self.a) / self.length();
        Point::new(-along.y, along.x)
    }

    /// Hesse's form with the normal into free space, off by an offset at the middle and an angle.
    fn line(&self, offset: f64, turn: f64) -> (f64, f64) {
        let n = self.normal();
        let angle = n.y.atan2(n.x) + turn;
        let moved = self.middle() + n * offset;
        (mapfold_map::geometry::unit_normal(angle).dot(&moved), angle)
    }

    /// As a robot at a pose sees all of it, off by an offset and an angle of which `covariance` is claimed.
    fn seen(
        &self,
        pose: &Pose<Level, Robot>,
        off: (f64, f64),
        covariance: [f64; 2],
    ) -> ObservedSegment {
        let robot_from_level = pose.inverse();
        let local = Wall { a: robot_from_level.act(&self.a), b: robot_from_level.act(&self.b) };
        let (rho, angle) = local.line(off.0, off.1);
        let along = tangent(angle).dot(&local.middle());
        // From the middle to the foot point.
        let claimed =
            Covariance::from_variances(covariance).transformed(&Matrix2::new(1.0, along, 0.0, 1.0));
        let (line, turned) = UncertainLine::normal_form(rho, angle, claimed);
        let (s, t) = (line.line.along(&local.a), line.line.along(&local.b));
        ObservedSegment {
            line,
            from: s.min(t),
            to: s.max(t),
            facing: if turned { Facing::Origin } else { Facing::Away },
            ends: [ObservedEnd { kind: EndKind::Occluded, sd: 0.02 }; 2],
            points: 50,
            seen_through: Vec::new(),
        }
    }

    /// As a map knows it, off by an offset and an angle.
    fn mapped(&self, off: (f64, f64), independent: [f64; 2], dependent: [f64; 2]) -> Segment {
        let (rho, angle) = self.line(off.0, off.1);
        let (line, turned) = Line::normal_form(rho, angle);
        let along = tangent(angle).dot(&self.middle());
        let claimed = |variances| {
            let claimed = Covariance::from_variances(variances)
                .transformed(&Matrix2::new(1.0, along, 0.0, 1.0));
            let sign = if turned { -1.0 } else { 1.0 };
            claimed.transformed(&Matrix2::new(sign, 0.0, 0.0, 1.0))
        };
        Segment {
            line,
            independent: claimed(independent),
            dependent: claimed(dependent),
            facing: if turned { Facing::Origin } else { Facing::Away },
            solid: vec![SolidInterval {
                span: Interval::from_metres(line.along(&self.a), line.along(&self.b)),
                ends: [EndKind::Corner; 2],
                existence: LogOdds(500),
            }],
            looks: 9,
            robots: Vec::new(),
            first_seen_us: 0,
            last_seen_us: 0,
        }
    }
}

fn id(number: u8) -> FeatureId {
    FeatureId { contribution: ContributionId([number; 16]), index: 0 }
}

/// Walls that are known as they are, to a millimetre.
fn known(walls: &[Wall]) -> ReferenceWalls {
    let segments: Vec<Segment> =
        walls.iter().map(|w| w.mapped((0.0, 0.0), [1e-6; 2], [0.0; 2])).collect();
    ReferenceWalls::of_segments((0..).map(id).zip(&segments))
}

fn room() -> [Wall; 4] {
    let corners = [(-3.0, -2.0), (3.0, -2.0), (3.0, 2.0), (-3.0, 2.0)];
    [0, 1, 2, 3].map(|i| Wall::new(corners[i], corners[(i + 1) % 4]))
}

/// Far from the level's origin, and turned.
fn placed(wall: &Wall) -> Wall {
    let place: Pose<Level, Level> = Pose::new(40.0, -25.0, 0.7);
    Wall { a: place.act(&wall.a), b: place.act(&wall.b) }
}

fn fix(pose: Pose<Level, Robot>, sds: [f64; 3]) -> UncertainPose<Level, Robot> {
    UncertainPose { pose, covariance: Covariance::from_variances(sds.map(|sd| sd * sd)) }
}

fn tracked(tracker: &Tracker) -> UncertainPose<Level, Robot> {
    match tracker.state() {
        Tracking::Tracked(pose) => pose,
        Tracking::Lost(why) => panic!("{why:?}"),
    }
}

#[test]
fn a_robot_in_a_room_is_put_right_from_either_side_of_the_origin() {
    for shift in [false, true] {
        let walls = room().map(|w| if shift { placed(&w) } else { w });
        let reference = known(&walls);
        let place: Pose<Level, Level> =
            if shift { Pose::new(40.0, -25.0, 0.7) } else { Pose::identity() };
        let truth = place.compose::<Robot>(&Pose::new(0.5, -0.4, 2.8));
        let off = Pose::new(truth.x + 0.05, truth.y - 0.04, truth.heading() + 0.03);
        let mut tracker = Tracker::new(fix(off, [0.05, 0.05, 0.03]), TrackerConfig::STANDARD);
        for _ in 0..20 {
            let seen: Vec<_> =
                walls.iter().map(|w| w.seen(&truth, (0.0, 0.0), [1e-4, 1e-5])).collect();
            let report = tracker.seen(&seen, &reference, None);
            assert_eq!((report.walls.len(), report.refused), (4, 0));
        }
        let found = tracked(&tracker);
        assert!((found.pose.position() - truth.position()).norm() < 2e-3, "{found:?}");
        assert!((found.pose.heading() - truth.heading()).abs() < 1e-3);
        // Walls are no straighter than 5 mm: after twenty looks as after one.
        let sd = found.covariance.sd(0).max(found.covariance.sd(1));
        assert!(sd > 0.0034, "{sd}");
    }
}

#[test]
fn no_number_of_looks_makes_up_for_what_the_map_shares() {
    let walls = room();
    let segments: Vec<Segment> =
        walls.iter().map(|w| w.mapped((0.0, 0.0), [1e-6; 2], [9e-4, 4e-6])).collect();
    let reference = ReferenceWalls::of_segments((0..).map(id).zip(&segments));
    let truth = Pose::new(0.2, 0.3, 0.1);
    let mut tracker = Tracker::new(fix(truth, [0.3, 0.3, 0.03]), TrackerConfig::STANDARD);
    for _ in 0..300 {
        let seen: Vec<_> = walls.iter().map(|w| w.seen(&truth, (0.0, 0.0), [1e-4, 1e-5])).collect();
        tracker.seen(&seen, &reference, None);
    }
    let covariance = tracked(&tracker).covariance;
    let sds = [0, 1, 2].map(|i| covariance.sd(i));
    // The map's 3 cm, and little more.
    assert!(sds[..2].iter().all(|sd| (0.029..0.031).contains(sd)), "{sds:?}");
    assert!((0.002..0.004).contains(&sds[2]), "{sds:?}");
}

#[test]
fn a_corridor_tells_nothing_along_itself() {
    let walls = [Wall::new((60.0, 1.0), (-20.0, 1.0)), Wall::new((-20.0, -1.0), (60.0, -1.0))];
    let reference = known(&walls);
    let mut tracker =
        Tracker::new(fix(Pose::identity(), [1e-9, 1e-9, 1e-9]), TrackerConfig::STANDARD);
    for i in 1..=100 {
        tracker.moved(&Pose::new(0.2, 0.0, 0.0));
        let truth = Pose::new(0.2 * f64::from(i), 0.0, 0.0);
        // Of the walls the five metres ahead and behind.
        let seen = walls.map(|w| {
            let clip = |p: Point| Point::new(p.x.clamp(truth.x - 5.0, truth.x + 5.0), p.y);
            Wall { a: clip(w.a), b: clip(w.b) }.seen(&truth, (0.0, 0.0), [1e-4, 1e-6])
        });
        assert_eq!(tracker.seen(&seen, &reference, None).walls.len(), 2);
    }
    let covariance = tracked(&tracker).covariance;
    let odometry = TrackerConfig::STANDARD.odometry;
    let slips = TrackerConfig::STANDARD.slips;
    // What the wheels are known to err by, and at most what they may have slipped on the way.
    let usual = 20.0 * odometry.along.powi(2);
    let slipped = 20.0 * slips.per_metre * slips.sd[0].powi(2);
    let along = covariance.matrix()[(0, 0)];
    assert!((usual * (1.0 - 1e-6)..usual + slipped).contains(&along), "{along}");
    assert!(covariance.sd(1) < 0.01 && covariance.sd(2) < 0.005);
}

#[test]
fn certainty_between_looks_does_not_depend_on_the_size_of_the_steps() {
    let walls = room();
    let reference = known(&walls);
    let truth = Pose::new(0.2, 0.3, 0.1);
    let seen: Vec<_> = walls.iter().map(|w| w.seen(&truth, (0.0, 0.0), [1e-4, 1e-5])).collect();
    let after = |steps: u32| {
        let mut tracker = Tracker::new(fix(truth, [0.05, 0.05, 0.03]), TrackerConfig::STANDARD);
        tracker.seen(&seen, &reference, None);
        for _ in 0..steps {
            tracker.moved(&Pose::new(1.0 / f64::from(steps), 0.0, 0.0));
        }
        let there = truth.compose::<Robot>(&Pose::new(1.0, 0.0, 0.0));
        // Off by this and that, so that the order in which they are used is clear.
        let offs = [0.001, 0.004, 0.007, 0.01];
        let seen: Vec<_> = walls
            .iter()
            .zip(offs)
            .map(|(w, off)| w.seen(&there, (off, 0.0), [1e-4, 1e-5]))
            .collect();
        tracker.seen(&seen, &reference, None);
        *tracked(&tracker).covariance.matrix()
    };
    assert!((after(1) - after(200)).amax() < 1e-9);
}

#[test]
fn a_wall_seen_from_behind_or_beside_its_solid_part_is_no_match() {
    let wall = Wall::new((2.0, -1.0), (2.0, 1.0));
    let reference = known(&[wall]);
    let config = TrackerConfig::STANDARD;
    let start = fix(Pose::identity(), [0.05, 0.05, 0.03]);
    let report = |seen: Wall| {
        let seen = seen.seen(&Pose::identity(), (0.0, 0.0), [1e-4, 1e-5]);
        Tracker::new(start, config).seen(&[seen], &reference, None)
    };
    assert_eq!(report(wall).walls.len(), 1);
    let behind = report(Wall { a: wall.b, b: wall.a });
    assert_eq!((behind.walls.len(), behind.refused), (0, 1));
    let beside = report(Wall::new((2.0, 1.2), (2.0, 3.0)));
    assert_eq!(beside.walls.len(), 0);
    // Nothing is known there: that refutes nothing.
    assert_eq!(report(Wall::new((2.0, 7.0), (2.0, 9.0))), TrackReport::default());
}

#[test]
fn of_two_walls_close_by_neither_is_believed() {
    let walls = [Wall::new((2.0, -1.0), (2.0, 1.0)), Wall::new((2.08, -1.0), (2.08, 1.0))];
    let seen =
        Wall::new((2.04, -1.0), (2.04, 1.0)).seen(&Pose::identity(), (0.0, 0.0), [1e-4, 1e-5]);
    let mut tracker =
        Tracker::new(fix(Pose::identity(), [0.1, 0.1, 0.03]), TrackerConfig::STANDARD);
    let report = tracker.seen(&[seen], &known(&walls), None);
    assert_eq!((report.walls.len(), report.refused), (0, 1));
}

#[test]
fn a_robot_that_is_carried_away_is_lost_after_five_looks() {
    let walls = room();
    let reference = known(&walls);
    let believed = Pose::new(0.0, 0.0, 0.0);
    let mut tracker = Tracker::new(fix(believed, [0.02, 0.02, 0.01]), TrackerConfig::STANDARD);
    let truth = Pose::new(0.4, -0.3, 0.0);
    for look in 1..=5 {
        let seen: Vec<_> = walls.iter().map(|w| w.seen(&truth, (0.0, 0.0), [1e-4, 1e-5])).collect();
        tracker.seen(&seen, &reference, None);
        assert_eq!(matches!(tracker.state(), Tracking::Lost(Lost::Contradicted)), look == 5);
    }
    // What fits again does not bring it back: that takes a fix.
    let seen: Vec<_> = walls.iter().map(|w| w.seen(&believed, (0.0, 0.0), [1e-4, 1e-5])).collect();
    tracker.seen(&seen, &reference, None);
    assert_eq!(tracker.state(), Tracking::Lost(Lost::Contradicted));
    assert!(!tracker.agrees(&fix(truth, [0.02, 0.02, 0.01])));
    assert!(tracker.agrees(&fix(believed, [0.02, 0.02, 0.01])));
}

#[test]
fn a_corridor_that_fits_proves_nothing_along_itself() {
    let walls = [
        Wall::new((30.0, 1.0), (0.0, 1.0)),
        Wall::new((0.0, -1.0), (30.0, -1.0)),
        Wall::new((30.0, -1.0), (30.0, 1.0)),
    ];
    let reference = known(&walls);
    let believed = Pose::new(22.0, 0.0, 0.0);
    let truth = Pose::new(24.0, 0.0, 0.0);
    let mut tracker = Tracker::new(fix(believed, [0.02, 0.02, 0.01]), TrackerConfig::STANDARD);
    for _ in 0..5 {
        // Two long walls fit; the short one ahead is two metres nearer than it should be.
        let seen: Vec<_> = walls.iter().map(|w| w.seen(&truth, (0.0, 0.0), [1e-4, 1e-5])).collect();
        tracker.seen(&seen, &reference, None);
    }
    assert_eq!(tracker.state(), Tracking::Lost(Lost::Contradicted));
}

/// A corridor whose end has a step: two walls along it, two across.
fn stepped_corridor() -> [Wall; 4] {
    [
        Wall::new((9.0, 1.0), (0.0, 1.0)),
        Wall::new((0.0, -1.0), (9.0, -1.0)),
        Wall::new((9.0, -1.0), (9.0, 0.0)),
        Wall::new((9.5, 0.0), (9.5, 1.0)),
    ]
}

/// A robot in it that knows that it is at `x`.
fn put_into_corridor(x: f64) -> Tracker {
    let start = fix(Pose::new(x, 0.0, 0.0), [0.01, 0.01, 0.005]);
    Tracker::new(start, TrackerConfig::STANDARD)
}

/// All of some walls, seen from `x` along a corridor.
fn seen_from(x: f64, walls: &[Wall]) -> Vec<ObservedSegment> {
    let truth = Pose::new(x, 0.0, 0.0);
    walls.iter().map(|w| w.seen(&truth, (0.0, 0.0), [1e-4, 1e-5])).collect()
}

#[test]
fn a_bad_slip_is_believed_if_it_explains_more_and_so_is_one_soon_after() {
    let walls = stepped_corridor();
    let reference = known(&walls);
    let mut tracker = put_into_corridor(2.0);
    let look =
        |tracker: &mut Tracker, x: f64| tracker.seen(&seen_from(x, &walls), &reference, None);
    // The wheels count half a metre and roll 30 cm.
    tracker.moved(&Pose::new(0.5, 0.0, 0.0));
    let report = look(&mut tracker, 2.3);
    assert!(report.slipped && report.walls.len() == 4, "{report:?}");
    assert!((tracked(&tracker).pose.x - 2.3).abs() < 0.01);
    // And half a metre later once more.
    tracker.moved(&Pose::new(0.5, 0.0, 0.0));
    let report = look(&mut tracker, 2.6);
    assert!(report.slipped && report.walls.len() == 4, "{report:?}");
    assert!((tracked(&tracker).pose.x - 2.6).abs() < 0.01);
}

#[test]
fn a_thing_that_was_moved_is_no_slip_while_another_stands_where_it_was() {
    let walls = stepped_corridor();
    let stands = [walls[0], walls[1], Wall::new((8.85, -1.0), (8.85, 0.0)), walls[3]];
    let reference = known(&walls);
    let mut tracker = put_into_corridor(2.0);
    for n in 1..=10 {
        tracker.moved(&Pose::new(0.3, 0.0, 0.0));
        let x = 2.0 + 0.3 * f64::from(n);
        let report = tracker.seen(&seen_from(x, &stands), &reference, None);
        assert!(!report.slipped && report.refused == 1, "{n}: {report:?}");
        let claimed = tracked(&tracker);
        let off = (claimed.pose.x - x).abs();
        assert!(off < 0.02 && off < 3.0 * claimed.covariance.sd(0), "{n}: {claimed:?}");
    }
}

#[test]
fn who_sees_nothing_that_is_known_is_lost_after_five_metres() {
    let start = fix(Pose::identity(), [0.02, 0.02, 0.01]);
    let mut tracker = Tracker::new(start, TrackerConfig::STANDARD);
    for step in 1..=51 {
        tracker.moved(&Pose::new(0.1, 0.0, 0.0));
        assert_eq!(matches!(tracker.state(), Tracking::Lost(Lost::Blind)), step == 51, "{step}");
    }
    let mut turning = Tracker::new(start, TrackerConfig::STANDARD);
    (0..250).for_each(|_| turning.moved(&Pose::new(0.0, 0.0, 0.5)));
    assert_eq!(turning.state(), Tracking::Lost(Lost::Uncertain));
}

#[test]
fn the_walls_of_a_plan_stand_as_far_off_as_their_objects_may() {
    use mapfold_map::gdb::{Kind, Model, Object, ObjectId, Solid, Structure};
    let mut model = Model::default();
    let mut object = Object::of(Kind::Wall, vec![Solid::cuboid([3.0, -2.0, 0.0], [3.2, 2.0, 2.0])]);
    object.tolerance = 0.02;
    model.objects.insert(ObjectId([1; 16]), object);
    let plan = Structure::of(&model).plan(0.3);
    let reference = ReferenceWalls::of_plan(&plan);
    assert_eq!(reference.len(), 4);
    let face = Wall::new((3.0, -2.0), (3.0, 2.0));
    let seen = face.seen(&Pose::identity(), (0.0, 0.0), [1e-6, 1e-6]);
    let mut tracker = Tracker::new(fix(Pose::identity(), [0.2, 0.2, 0.1]), TrackerConfig::STANDARD);
    for _ in 0..50 {
        assert_eq!(tracker.seen(std::slice::from_ref(&seen), &reference, None).walls.len(), 1);
    }
    // 2 cm of the object and 5 mm of the surface.
    let sd = tracked(&tracker).covariance.sd(0);
    assert!((0.0204..0.0212).contains(&sd), "{sd}");
    assert!(tracked(&tracker).covariance.sd(1) > 0.19);
}

#[test]
fn the_model_tells_what_the_map_does_not_and_nobody_has_seen_through() {
    use mapfold_map::gdb::{Kind, Model, Object, ObjectId, Solid, Structure, Surface};
    let mut model = Model::default();
    let object = Object::of(Kind::Wall, vec![Solid::cuboid([0.0, 2.0, 0.0], [10.0, 2.3, 2.0])]);
    model.objects.insert(ObjectId([1; 16]), object);
    let plan = Structure::of(&model).plan(0.3);
    let surfaces: Vec<Surface> = plan.edges().map(Surface::from).collect();
    // Robots have measured the lower face from 3 to 6 m, 4 cm off, and seen through the wall from 7 to 8 m.
    let mapped = Wall::new((6.0, 1.96), (3.0, 1.96)).mapped((0.0, 0.0), [1e-6; 2], [0.0; 2]);
    let mut walls = ReferenceWalls::of_segments([(id(1), &mapped)]);
    walls.fill_up(&surfaces, |p| (7.0..8.0).contains(&p.x) && p.y < 2.2);
    let covers = |x: f64, y: f64| {
        let at = Point::new(x, y);
        let here = walls.near(&at, &at, 0.0).into_iter().filter(|wall| {
            let along = wall.along(&at);
            wall.across(&at).abs() < 0.01
                && wall.parts.iter().any(|(from, to)| (*from..=*to).contains(&along))
        });
        here.map(|wall| matches!(wall.name, WallName::Planned(..))).collect::<Vec<_>>()
    };
    for x in [0.5, 2.8, 6.3, 6.8, 8.3, 9.5] {
        assert_eq!(covers(x, 2.0), [true], "{x}");
    }
    for x in [3.2, 5.0, 5.8, 7.2, 7.8] {
        assert!(covers(x, 2.0).is_empty(), "{x}");
    }
    assert_eq!(covers(4.0, 1.96), [false]);
    // The other face is another one, and was not seen through all the way.
    for x in [0.5, 4.0, 7.5] {
        assert_eq!(covers(x, 2.3), [true], "{x}");
    }
}

#[test]
fn a_pose_from_the_same_look_is_taken_in_without_counting_anything_twice() {
    let start = fix(Pose::new(2.0, 3.0, 0.1), [0.01, 1.0, 0.02]);
    let mut tracker = Tracker::new(start, TrackerConfig::STANDARD);
    // The same once more is no news.
    tracker.found(&start);
    let same = tracked(&tracker);
    assert!((same.pose.x - 2.0).abs() < 1e-9 && (same.covariance.sd(1) - 1.0).abs() < 1e-6);
    // What knows the other direction tells it: either counts half.
    let other = fix(Pose::new(2.5, 3.4, 0.1), [1.0, 0.01, 0.02]);
    tracker.found(&other);
    let both = tracked(&tracker);
    assert!((both.pose.x - 2.0).abs() < 0.001 && (both.pose.y - 3.4).abs() < 0.001, "{both:?}");
    for i in [0, 1] {
        assert!((both.covariance.sd(i) - 0.01 * 2_f64.sqrt()).abs() < 1e-4, "{both:?}");
    }
    assert!((both.covariance.sd(2) - 0.02).abs() < 1e-6, "{both:?}");
    // What knows less of everything changes nothing.
    tracker.found(&fix(Pose::new(9.0, 9.0, 1.0), [2.0, 2.0, 1.0]));
    let still = tracked(&tracker);
    assert!((still.pose.x - both.pose.x).abs() < 1e-9, "{still:?}");
}
