//! Finding places on plans of real buildings that nobody has driven: robots look about in the building as it stands,
//! with things in it that no plan shows.

use std::path::Path;

use mapfold_client::localization::{Fix, KnownLevel, LocalizerConfig, Seeker, SeekerConfig, view};
use mapfold_client::perception::Perception;
use mapfold_client::replay::known_level;
use mapfold_client::sensor::{Scan, ScanGeometry, ScannerProfile, preset};
use mapfold_map::geometry::{Level as LevelFrame, Pose, Robot};
use mapfold_map::places::{PlacesConfig, View};

use super::answers::{Answers, RIGHT, in_view};
use super::is_at;
use crate::buildings::BUILDINGS;
use crate::database::Database;
use crate::level::Level;
use crate::plane::{Piece, Point};
use crate::planned::Planned;
use crate::server::Server;
use crate::simulation::{Noise, Scanner, World};
use crate::{Error, report};

/// Places from which robots look, in each building.
const PLACES: u64 = 60;
/// Corners of the building stand off by this, metres (standard deviation).
const OFF_M: f64 = 0.015;
/// Ranges err by this, metres (standard deviation).
const RANGE_SD_M: f64 = 0.05;
/// Farthest that the scanner sees, metres.
const CAP_M: f64 = 20.0;
/// This share of the beams ends on things that no plan shows.
const CLUTTER: f64 = 0.2;
/// Those that are not told their place drive on so far at most, metres, and look after every so many.
const WAY_M: f64 = 12.0;
const STEP_M: f64 = 1.5;
/// Odometry errs by this share of the way, and by this angle after a metre, radians.
const ODOMETRY: (f64, f64) = (0.02, 0.02);

/// What was asked, and how many answers were wrong.
pub(super) struct Asked {
    pub(super) asked: u32,
    pub(super) wrong: u32,
}

/// What drives came to that were not told their place by the first look.
#[derive(Default)]
struct Driven {
    all: u32,
    right: u32,
    wrong: u32,
}

/// Rewrites the table `on-plans` of a page.
pub(super) async fn table(page: &Path, data: &Path, now: &dyn Fn() -> f64) -> Result<Asked, Error> {
    let server = Server::start(Database::Sqlite).await?;
    let (mut rows, mut total) = (Vec::new(), Asked { asked: 0, wrong: 0 });
    for (number, building) in (0_u64..).zip(&BUILDINGS) {
        let Some(file) = building.read(data)? else { continue };
        let level = Level::create(server.api()?, &format!("b{number}"), "l").await?;
        let mut noise = Noise::of_seed(100 + number);
        let file = (building.query, building.media_type, file);
        let planned =
            Planned::build(level, file, server.admin_token(), (OFF_M, &mut noise)).await?;
        let Some(robot) = Looker::new(&planned)? else {
            report::say(&format!("{}: no rooms", building.name));
            continue;
        };
        let (single, driven) = robot.look_about(&planned, &mut noise, now);
        if single.asked == 0 {
            report::say(&format!("{}: nowhere to stand", building.name));
            continue;
        }
        total.asked += single.asked + driven.all;
        total.wrong += single.wrong + driven.wrong;
        let walls = planned.world.walls.len().to_string();
        let after = [driven.all, driven.right, driven.wrong].map(|n| n.to_string());
        rows.push([vec![building.name.to_owned(), walls], single.row(), after.to_vec()].concat());
        report::say(&rows[rows.len() - 1].join(" | "));
    }
    let header = [
        &["building", "surfaces"][..],
        &Answers::HEADER,
        &["driven on", "then right", "then wrong"],
    ]
    .concat();
    report::rewrite(page, "on-plans", &report::table(&header, &rows))?;
    Ok(total)
}

/// A robot that knows the plan.
struct Looker {
    known: KnownLevel,
    scanner: Scanner,
    profile: ScannerProfile,
}

impl Looker {
    fn new(planned: &Planned) -> Result<Option<Self>, Error> {
        let Some(known) = known_level(&planned.mirror, &LocalizerConfig::STANDARD) else {
            return Ok(None);
        };
        let base = preset("sick-lms").and_then(|sensors| sensors.scanner);
        let base = base.ok_or_else(|| Error::Client("there is no sick-lms".to_owned()))?;
        let profile = ScannerProfile { range_sd_m: RANGE_SD_M, range_max_m: CAP_M, ..base };
        let scanner = Scanner { cap_m: CAP_M, range_sd_m: RANGE_SD_M, ..Scanner::default() };
        Ok(Some(Self { known, scanner, profile }))
    }

    fn scan(&self, world: &World, pose: (Point, f64), noise: &mut Noise) -> Scan {
        Scan {
            geometry: ScanGeometry {
                first_bearing: -std::f64::consts::FRAC_PI_2,
                increment: 1f64.to_radians(),
            },
            ranges: self.scanner.scan(world, pose, noise),
            range_max: CAP_M,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        }
    }

    fn view(&self, scan: &Scan) -> View {
        view(&Perception::for_scanner(&self.profile).of(scan), &PlacesConfig::STANDARD)
    }

    fn look_about(
        &self,
        planned: &Planned,
        noise: &mut Noise,
        now: &dyn Fn() -> f64,
    ) -> (Answers, Driven) {
        let (mut single, mut driven) = (Answers::default(), Driven::default());
        for _ in 0..PLACES {
            let Some(from) = planned.place(noise) else { break };
            let near = planned.near(from, WAY_M + CAP_M);
            let way = near.way(from, WAY_M, noise);
            // Where a robot cannot even turn about it does not stand.
            let [first, second, ..] = way[..] else { continue };
            let heading = (second.y - first.y).atan2(second.x - first.x);
            let things = clutter(&near, &way, (first, heading), noise);
            let cluttered = World { walls: [&near.walls[..], &things].concat(), ..near };
            let scan = self.scan(&cluttered, (first, heading), noise);
            let truth = Pose::new(first.x, first.y, heading);
            let landmarks =
                self.known.table.as_ref().map_or(0, |table| in_view(&scan, &truth, table));
            let view = self.view(&scan);
            let fix = single.ask(&self.known.field, &view, &truth, landmarks, now);
            if !matches!(fix, Fix::Unique(_)) {
                driven.all += 1;
                match self.drive(&cluttered, &way, noise) {
                    Some(true) => driven.right += 1,
                    Some(false) => driven.wrong += 1,
                    None => {}
                }
            }
        }
        (single, driven)
    }

    /// Drives on until a place is told; whether it is the right one.
    fn drive(&self, world: &World, way: &[Point], noise: &mut Noise) -> Option<bool> {
        let mut seeker = Seeker::new(SeekerConfig::STANDARD, PlacesConfig::STANDARD);
        let mut last: Option<Pose<LevelFrame, Robot>> = None;
        for leg in way.windows(2) {
            let heading = (leg[1].y - leg[0].y).atan2(leg[1].x - leg[0].x);
            for step in 0..(leg[0].distance(leg[1]) / STEP_M).ceil() as u32 {
                let at = leg[0].towards(heading, f64::from(step) * STEP_M);
                let truth = Pose::new(at.x, at.y, heading);
                if let Some(last) = last {
                    let moved: Pose<Robot, Robot> = last.inverse().compose(&truth);
                    let length = moved.position().norm();
                    let scale = 1.0 + noise.normal(ODOMETRY.0);
                    let turn = noise.normal(ODOMETRY.1 * length.sqrt());
                    let counted =
                        Pose::new(scale * moved.x, scale * moved.y, moved.heading() + turn);
                    seeker.moved(&counted);
                }
                last = Some(truth);
                if !seeker.is_due() {
                    continue;
                }
                let view = self.view(&self.scan(world, (at, heading), noise));
                if let Fix::Unique(found) = seeker.seen(&self.known.field, &view, &[]) {
                    let found = found.level_from_robot.pose;
                    return Some(is_at(&found, &truth, RIGHT));
                }
            }
        }
        None
    }
}

/// Round things about a place, off the way, until they take a share of what is seen from there.
fn clutter(
    world: &World,
    way: &[Point],
    (at, heading): (Point, f64),
    noise: &mut Noise,
) -> Vec<Piece> {
    let legs: Vec<Piece> = way.windows(2).map(|leg| Piece { a: leg[0], b: leg[1] }).collect();
    let angles: Vec<f64> =
        (-90..=90).map(|degrees| heading + f64::from(degrees).to_radians()).collect();
    let range = |world: &World, angle| world.cast(at, angle, CAP_M).map_or(CAP_M, |hit| hit.0);
    let walls: Vec<f64> = angles.iter().map(|angle| range(world, *angle)).collect();
    let mut things = World { walls: Vec::new(), ..world.clone() };
    for _ in 0..400 {
        let hidden =
            angles.iter().zip(&walls).filter(|(angle, wall)| range(&things, **angle) < **wall);
        if hidden.count() as f64 >= CLUTTER * angles.len() as f64 {
            break;
        }
        let angle = heading + (noise.share() - 0.5) * std::f64::consts::PI;
        let (middle, radius) =
            (at.towards(angle, 0.8 + 4.2 * noise.share()), 0.1 + 0.2 * noise.share());
        if legs.iter().all(|leg| leg.distance(middle) > radius + 0.3) {
            let corner =
                |i: u32| middle.towards(f64::from(i % 12) / 12.0 * std::f64::consts::TAU, radius);
            things.walls.extend((0..12).map(|i| Piece { a: corner(i), b: corner(i + 1) }));
        }
    }
    things.walls
}
