//! A plant on its first day: a published plan, and no robot's word. Who comes finds itself on it.

use std::path::Path;

use mapfold_schema::v1::ContributionState;
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::planned::Planned;
use mapfold_tests::robot::{Robot, Target};
use mapfold_tests::server::Server;
use mapfold_tests::simulation::{Noise, Recording, Scanner, World, record};
use mapfold_tests::{Error, programs};
use serde_json::Value;

#[tokio::test]
async fn a_robot_finds_itself_on_a_plan_that_nobody_has_driven_and_adds_to_it() -> Result<(), Error>
{
    let server = Server::start(Database::Sqlite).await?;
    let folder = server.folder().to_owned();
    let level = Level::create(server.api()?, "works", "office").await?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/office.building.yaml");
    let file = std::fs::read(&path).map_err(|e| Error::file(&path, e))?;
    let mut noise = Noise::of_seed(11);
    let office = ("", "application/yaml", file);
    let planned = Planned::build(level, office, server.admin_token(), (0.015, &mut noise)).await?;
    let from = planned.place(&mut noise).unwrap();
    let way = planned.world.way(from, 40.0, &mut noise);
    let world = World { way, ..planned.world.clone() };
    let log = folder.join("anna.log");
    record(&world, 0.5, &Recording::Scanner(Scanner::default()), 3, &log)?;
    let truth = Log::read(&log)?;
    assert!(truth.scans.len() > 50, "{} scans", truth.scans.len());

    let target = Target {
        url: server.url(),
        token: server.admin_token().to_owned(),
        site: "works".to_owned(),
        level: "office".to_owned(),
    };
    let mirror = folder.join("mirror");
    let output = tokio::process::Command::new(programs::path("mapfold-robot")?)
        .arg("locate")
        .arg(&log)
        .args(["--track", "--server", &target.url, "--token", &target.token])
        .args(["--site", &target.site, "--level", &target.level, "--mirror"])
        .arg(&mirror)
        .output()
        .await
        .map_err(|e| Error::file(&log, e))?;
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut off = Vec::new();
    for line in told.lines() {
        let fix: Value = serde_json::from_str(line).unwrap();
        if fix["kind"] != "tracked" && fix["kind"] != "unique" {
            continue;
        }
        let number = |of: &Value| of.as_f64().unwrap();
        let time = number(&fix["time"]);
        let scan = truth.scans.iter().find(|scan| (scan.time - time).abs() < 1e-6).unwrap();
        let at = (number(&fix["x"]) - scan.origin.x, number(&fix["y"]) - scan.origin.y);
        off.push(at.0.hypot(at.1));
    }
    off.sort_by(f64::total_cmp);
    // It knows its place on most of the way, and is never told a wrong one.
    assert!(10 * off.len() > 7 * truth.scans.len(), "{} of {}", off.len(), truth.scans.len());
    assert!(off[off.len() / 2] < 0.06, "{} m off in the middle", off[off.len() / 2]);
    assert!(off[off.len() - 1] < 0.3, "{} m off at worst", off[off.len() - 1]);

    // What it sees from there goes into the map, and says what of the plan the poses were matched with.
    let mirror = mirror.display().to_string();
    let options = ["--poses", "localize", "--mirror", &mirror].map(str::to_owned).to_vec();
    let anna = Robot { name: "anna".to_owned(), log, options };
    anna.start(&target, &folder)?.finish().await?;
    planned.level.folded().await?;
    let entries = planned.level.log().await?;
    let folded = entries.iter().filter(|entry| entry.state == ContributionState::Folded).count();
    assert!(2 * folded > truth.scans.len(), "{folded} of {}", truth.scans.len());
    let record = planned.level.contribution(entries[entries.len() / 2].id).await?;
    let basis = record.contribution.pose.basis.unwrap();
    assert!(basis.revision > 0, "{basis:?}");
    Ok(())
}
