//! The page's card of own frames in headless Chromium against a real server: robots map a simulated hall, another one comes
//! with a map in a frame of its own; an operator accepts the place that is proposed, and takes it back.

use mapfold_client::log::carmen;
use mapfold_client::replay::SensorChoice;
use mapfold_client::robot::{Surveyor, SurveyorConfig};
use mapfold_map::geometry::{Level as LevelFrame, Pose};
use mapfold_schema::border::wire_contribution;
use mapfold_schema::route;
use mapfold_schema::v1::{Alignments, Contribution, Provenance};
use mapfold_tests::Error;
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::fleet;
use mapfold_tests::level::Level;
use mapfold_tests::page;
use mapfold_tests::server::Server;
use mapfold_tests::simulation::{Recording, Scanner, hall, record};
use uuid::Uuid;

const RESOLUTION_M: f64 = 0.05;
/// Looks of the lost robot: one fewer than after which a frame that is certain is aligned by rule.
const LOOKS: usize = 15;
/// The robot's frame.
const OWN: Uuid = Uuid::from_u128(0x5000_0000_0000_4000_8000_0000_0000_0001);

/// Looks all over the hall, in a frame of the robot's own.
fn lost_looks(
    log: &std::path::Path,
    own_from_level: &Pose<LevelFrame, LevelFrame>,
) -> Result<Vec<Contribution>, Error> {
    let fault = |fault: String| Error::Log { path: log.to_owned(), line: 0, fault };
    let log = carmen::read(log).map_err(|e| fault(e.to_string()))?;
    let sensors = SensorChoice::default().choose(&log).map_err(|e| fault(e.to_string()))?;
    let config = SurveyorConfig::of_log("lost", sensors, &log, RESOLUTION_M);
    let mut surveyor = Surveyor::new(config, 0).map_err(|e| fault(e.to_string()))?;
    let mut looks = Vec::new();
    for reading in log.readings.iter().step_by((log.readings.len() / LOOKS).max(1)).take(LOOKS) {
        let mut reading = reading.clone();
        reading.level_from_robot =
            reading.level_from_robot.map(|pose| own_from_level.compose(&pose));
        let Ok(look) = surveyor.survey(&reading) else { continue };
        let mut wire = wire_contribution(&look.contribution, OWN, false, None);
        wire.pose.provenance = Provenance::OwnMap;
        looks.push(wire);
    }
    Ok(looks)
}

#[tokio::test]
async fn the_page_gives_a_robots_own_map_its_place_and_takes_it_off_again() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let folder = server.folder();
    let [seen, lost] = ["seen.log", "lost.log"].map(|name| folder.join(name));
    record(&hall(), 0.5, &Recording::Scanner(Scanner::default()), 20, &seen)?;
    record(&hall(), 0.7, &Recording::Scanner(Scanner::default()), 21, &lost)?;
    let robots = fleet::cut(&Log::read(&seen)?, folder)?;
    fleet::play(&server, "plant", "hall", &robots, folder).await?;
    let level = Level::new(server.api()?, "plant", "hall");
    let before = level.folded().await?;
    let token = level.enrol("lost").await?;
    let own_from_level = Pose::new(31.0, -12.0, 2.2);
    let looks = lost_looks(&lost, &own_from_level)?;
    let count = looks.len();
    let sender = level.api.with_token(&token);
    sender.post_json(&level.path(route::CONTRIBUTIONS), &looks).await?.expect(201)?;
    level.folded().await?;
    let scopes = ["--scope", "map:read"];
    let reader =
        server.command(&[&["token", "create", "--site", "plant"], &scopes[..]].concat()).await?;

    let settings = [("READER", reader.trim())];
    let told = page::play(&server, "alignments.mjs", ["plant", "hall"], &settings).await?;
    let said = &told.text;
    assert_eq!(told.event("reader")["answers"], 0, "{said}");
    assert!(told.words("told", "now").contains("1 frame waits"), "{said}");
    assert!(told.words("told", "frame").contains(&format!("{count} contributions")), "{said}");
    assert!(told.words("accepted", "done").contains("lies at"), "{said}");
    assert!(told.words("withdrawn", "log").contains("withdrawn"), "{said}");

    let after: Alignments = level.api.fetch(&level.path(route::ALIGNMENTS)).await?;
    assert_eq!(after.unaligned.len(), 1, "held again: {said}");
    let [alignment] = &after.alignments[..] else { panic!("one is in the log: {said}") };
    let accepted = &alignment.pose;
    let truth: Pose<LevelFrame, LevelFrame> = own_from_level.inverse();
    let off = (accepted.x_m - truth.x).hypot(accepted.y_m - truth.y);
    assert!(off < 0.2, "{accepted:?} is {off} m off {truth:?}: {said}");
    let now = level.folded().await?;
    assert_eq!(now.counts.in_force, before.counts.in_force, "as before: {said}");
    Ok(())
}
