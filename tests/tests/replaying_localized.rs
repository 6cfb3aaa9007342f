//! `mapfold-robot replay --poses localize`: a robot finds itself on the map that another one made, and adds to it.

use std::path::Path;

use mapfold_schema::route;
use mapfold_schema::v1::{FixKind, RobotDescription};
use mapfold_tests::Error;
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::robot::{Robot, Target};
use mapfold_tests::server::Server;
use mapfold_tests::simulation::{Recording, Scanner, office, record};

fn robot(name: &str, log: &Path, poses: &str) -> Robot {
    let options = ["--poses", poses].map(str::to_owned).to_vec();
    Robot { name: name.to_owned(), log: log.to_owned(), options }
}

#[tokio::test]
async fn a_robot_finds_itself_on_the_map_of_another_and_adds_to_it() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let folder = server.folder().to_owned();
    let target = Target {
        url: server.url(),
        token: server.admin_token().to_owned(),
        site: "works".to_owned(),
        level: "office".to_owned(),
    };
    // Drives of their own, with noise of their own; odometry drifts.
    let [first, second] = [("anna", 5), ("bruno", 6)].map(|(name, seed)| {
        let path = folder.join(format!("{name}.log"));
        record(&office(), 0.5, &Recording::Scanner(Scanner::default()), seed, &path).unwrap();
        path
    });
    let mirror = folder.join("mirror").display().to_string();
    let bruno = robot("bruno", &second, "localize").with(&["--mirror", &mirror]);

    // On a level that nobody has seen yet nobody can find himself.
    let refused = bruno.start(&target, &folder)?.finish().await.unwrap_err().to_string();
    assert!(
        refused.contains("has no raster yet") && refused.contains("another robot first"),
        "{refused}"
    );

    robot("anna", &first, "log").start(&target, &folder)?.finish().await?;
    let level = Level::new(server.api()?, "works", "office");
    let known = level.folded().await?.revision;
    bruno.start(&target, &folder)?.finish().await?;
    level.folded().await?;

    // Nearly all of its way it knows where it is, and is right.
    let log = Log::read(&second)?;
    let entries = level.log().await?;
    let own: Vec<_> = entries.iter().filter(|entry| entry.robot == "bruno").collect();
    assert!(10 * own.len() > 8 * log.scans.len(), "{} of {}", own.len(), log.scans.len());
    let mut off: Vec<f64> = Vec::new();
    for scan in &log.scans {
        let us = (scan.time * 1e6).round() as i64;
        let at = mapfold_schema::instant::to_rfc3339(us);
        let Some(entry) = own.iter().find(|entry| entry.observed_at == at) else { continue };
        off.push((entry.pose[0] - scan.origin.x).hypot(entry.pose[1] - scan.origin.y));
    }
    off.sort_by(f64::total_cmp);
    let worst = off.last().copied().unwrap_or(f64::INFINITY);
    assert!(off.len() == own.len() && worst < 0.3, "{worst} m off at worst");
    assert!(off[off.len() / 2] < 0.08, "{} m off in the middle", off[off.len() / 2]);

    // What the poses owe to the map is told with them.
    let record = level.contribution(own[0].id).await?;
    let basis = record.contribution.pose.basis.unwrap();
    assert_eq!(basis.revision, known);
    assert!(!basis.segments.is_empty() && basis.way_m > 0.0, "{basis:?}");

    // People see where it is, and by what it knows.
    let path = route::robot("works", "bruno");
    let told: RobotDescription = server.api()?.fetch(&path).await?;
    let fix = told.fix.unwrap();
    assert_eq!((fix.kind, fix.level.as_str(), fix.places.len()), (FixKind::Tracked, "office", 1));
    assert!(!fix.segments.is_empty() && told.revision == Some(known), "{fix:?}");
    Ok(())
}
