//! Robots with nothing but sonar help to build the map: a real ring of eight, and a ring emulated
//! from a laser log, which is labelled as such wherever it shows.

use std::path::{Path, PathBuf};

use mapfold_schema::route;
use mapfold_schema::v1::{RobotDescription, SensorClass, SensorKind};
use mapfold_tests::Error;
use mapfold_tests::carmen::{self, Log, Scan};
use mapfold_tests::database::Database;
use mapfold_tests::floor::Floor;
use mapfold_tests::level::{Level, Replica};
use mapfold_tests::robot::{Robot, Target};
use mapfold_tests::server::Server;

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

/// Plays one robot and answers the level, the robot as the server knows it, and the map.
async fn played(
    server: &Server,
    level: &str,
    robot: &Robot,
) -> Result<(Level, RobotDescription, Replica, Floor), Error> {
    let target = Target {
        url: server.url(),
        token: server.admin_token().to_owned(),
        site: "mit".to_owned(),
        level: level.to_owned(),
    };
    robot.start(&target, server.folder())?.finish().await?;
    let level = Level::new(server.api()?, "mit", level);
    let (replica, floor) = level.floor().await?;
    let known = level.api.fetch(&route::robot("mit", &robot.name)).await?;
    Ok((level, known, replica, floor))
}

/// Share of places that the map holds for free.
fn free_share(floor: &Floor, places: &[(f64, f64)]) -> f64 {
    let cell = |metres: f64| (metres / floor.resolution_m()).floor() as i32;
    let free = places.iter().filter(|(x, y)| floor.evidence(cell(*x), cell(*y)) < 0).count();
    free as f64 / places.len() as f64
}

#[tokio::test]
async fn a_real_ring_of_eight_sonars_maps_its_corridor() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let robot = Robot::new("ring", &data("corridor-ring8.log.gz"));
    let (level, known, replica, floor) = played(&server, "ring8-corridor", &robot).await?;

    assert_eq!(known.competence, [SensorKind::Sonar]);
    assert!(known.sensors.iter().all(|sensor| !sensor.emulated), "{:?}", known.sensors);
    assert!(level.log().await?.iter().all(|entry| !entry.emulated));
    assert!(replica.tiles.keys().all(|at| at.sensor == SensorClass::Sonar));
    // 25 m of corridor, seen to about 2 m on both sides, in tiles of 3.2 m.
    assert!((10..=80).contains(&replica.tiles.len()), "{} tiles", replica.tiles.len());
    let occupied = replica.tiles.values().flat_map(|tile| tile.runs.chunks_exact(3));
    let occupied: i32 = occupied.filter(|run| run[2] > 0).map(|run| run[1]).sum();
    assert!(occupied > 100, "only {occupied} occupied cells");

    // Where the robot drove is free.
    let places: Vec<(f64, f64)> = carmen::text(&robot.log)?
        .lines()
        .filter_map(|line| line.strip_prefix("ODOM "))
        .map(|line| {
            let mut numbers = line.split(' ').map_while(|word| word.parse().ok());
            (numbers.next().expect("x"), numbers.next().expect("y"))
        })
        .collect();
    assert_eq!(places.len(), 413);
    let share = free_share(&floor, &places);
    assert!(share > 0.9, "only {share:.2} of the robot's own way is free");
    Ok(())
}

#[tokio::test]
async fn a_ring_emulated_from_a_laser_is_labelled_and_frees_its_way() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let log = Log::read(&data("killian.log.gz"))?;
    let part = server.folder().join("part.log.gz");
    log.write_part(2600, 2800, &part)?;
    let robot = Robot::new("clara", &part).with(&["--competence", "sonar", "--emulate-sonar"]);
    let (level, known, replica, floor) = played(&server, "infinite-corridor", &robot).await?;

    assert_eq!(known.competence, [SensorKind::Sonar]);
    assert!(known.sensors.iter().all(|sensor| sensor.emulated), "{:?}", known.sensors);
    let entries = level.log().await?;
    assert!(!entries.is_empty() && entries.iter().all(|entry| entry.emulated));
    assert!(replica.tiles.keys().all(|at| at.sensor == SensorClass::Sonar));
    assert!(replica.segments.is_empty(), "a ring of sonars extracts no segments");

    let places: Vec<(f64, f64)> =
        log.scans[2600..2800].iter().map(|scan| (scan.origin.x, scan.origin.y)).collect();
    let share = free_share(&floor, &places);
    assert!(share > 0.9, "only {share:.2} of the robot's own way is free");
    Ok(())
}

/// A ring of two that look square to the sides and hear everything by a detour: a metre too far.
fn detours(log: &Log, part: std::ops::Range<usize>) -> String {
    let of = |scan: &Scan| {
        let (x, y, heading, time) = (scan.origin.x, scan.origin.y, scan.heading, scan.time);
        let heard = |range: Option<&f64>| range.filter(|r| **r < 3.0).map_or(0.0, |r| r + 1.0);
        let [right, left] = [scan.ranges.first(), scan.ranges.last()].map(heard);
        format!(
            "ODOM {x} {y} {heading} 0 0 0 {time} ring {time}\n\
             SONAR 0.436332 2 {right} {left} 0 0 -1.570796 0 0 1.570796 {time} ring {time}\n"
        )
    };
    log.scans[part].iter().map(of).collect()
}

#[tokio::test]
async fn a_robot_with_a_mirror_knows_echoes_from_behind_walls_for_ghosts() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let target = Target {
        url: server.url(),
        token: server.admin_token().to_owned(),
        site: "mit".to_owned(),
        level: "infinite-corridor".to_owned(),
    };
    let log = Log::read(&data("killian.log.gz"))?;
    let part = server.folder().join("part.log.gz");
    log.write_part(2600, 2700, &part)?;
    Robot::new("clara", &part).start(&target, server.folder())?.finish().await?;
    Level::new(server.api()?, &target.site, &target.level).folded().await?;

    let heard = server.folder().join("detours.log");
    std::fs::write(&heard, detours(&log, 2600..2700)).map_err(|e| Error::file(&heard, e))?;
    let told = async |name: &str, options: &[&str]| -> Result<[u64; 2], Error> {
        let report = server.folder().join(format!("{name}.json"));
        let told = ["--report", report.to_str().expect("a path of letters")];
        let robot = Robot::new(name, &heard).with(&told).with(options);
        robot.start(&target, server.folder())?.finish().await?;
        let text = std::fs::read(&report).map_err(|e| Error::file(&report, e))?;
        let report: serde_json::Value = serde_json::from_slice(&text).expect("a report");
        let count = |name: &str| report["sonar"][name].as_u64().expect("a count");
        Ok([count("readings"), count("ghost")])
    };
    let mirror = server.folder().join("mirror");
    let [readings, ghosts] =
        told("warned", &["--mirror", mirror.to_str().expect("a path of letters")]).await?;
    assert!(readings >= 100, "{readings} readings");
    assert!(2 * ghosts > readings, "only {ghosts} of {readings} are known for ghosts");
    assert_eq!(told("unwarned", &[]).await?[1], 0);
    Ok(())
}
