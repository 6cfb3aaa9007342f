//! `kill -9` of the server while robots send: nothing that was acknowledged is lost or doubled, and
//! the map becomes that of an undisturbed run, bit for bit.

#![expect(clippy::expect_used, reason = "tests may stop at the first surprise")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::Duration;

use mapfold_schema::codec::{self, CBOR};
use mapfold_schema::route;
use mapfold_schema::v1::{Contribution, Receipt};
use mapfold_tests::Error;
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::robot::{Robot, Target};
use mapfold_tests::server::Server;
use uuid::Uuid;

/// Scans that are played.
const SCANS: usize = 400;

/// How often the server is killed in one run.
const KILLS: usize = 3;

fn part_of_killian(folder: &Path) -> Result<PathBuf, Error> {
    let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz"))?;
    let path = folder.join("part.log.gz");
    log.write_part(1000, 1000 + SCANS, &path)?;
    Ok(path)
}

fn target(server: &Server) -> Target {
    Target {
        url: server.url(),
        token: server.admin_token().to_owned(),
        site: "mit".to_owned(),
        level: "floor".to_owned(),
    }
}

/// What two runs of the same log must have in common.
#[derive(PartialEq)]
struct Ending {
    ids: BTreeSet<Uuid>,
    geojson: Vec<u8>,
    nav2: Vec<u8>,
    map_digest: String,
}

/// What is there in the end, with every contribution once.
async fn ending(mut server: Server) -> Result<Ending, Error> {
    let level = Level::new(server.api()?, "mit", "floor");
    level.folded().await?;
    let log = level.log().await?;
    let ids: BTreeSet<Uuid> = log.iter().map(|entry| entry.id).collect();
    assert_eq!((log.len(), ids.len()), (SCANS, SCANS), "a contribution is lost or doubled");
    let revisions: BTreeSet<i64> = log.iter().map(|entry| entry.revision).collect();
    assert!(revisions.into_iter().eq(1..=SCANS as i64), "revisions have gaps");
    let (geojson, nav2) = (level.export("geojson").await?, level.export("nav2").await?);
    server.stop().await?;
    Ok(Ending { ids, geojson, nav2, map_digest: server.verify().await? })
}

/// Plays the log without disturbance; also answers the contributions, in the order of the log.
async fn undisturbed(log: &Path, folder: &Path) -> Result<(Ending, Vec<Contribution>), Error> {
    let server = Server::start(Database::Sqlite).await?;
    Robot::new("anna", log).start(&target(&server), &folder.join("undisturbed"))?.finish().await?;
    let level = Level::new(server.api()?, "mit", "floor");
    let mut contributions = Vec::new();
    for entry in level.log().await?.iter().rev() {
        contributions.push(level.contribution(entry.id).await?.contribution);
    }
    Ok((ending(server).await?, contributions))
}

async fn a_robot_goes_on(database: Database) -> Result<(), Error> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = part_of_killian(folder.path())?;
    let (expected, _) = undisturbed(&log, folder.path()).await?;

    let mut server = Server::start(database).await?;
    let mut replay =
        Robot::new("anna", &log).start(&target(&server), &folder.path().join("disturbed"))?;
    let level = Level::new(server.api()?, "mit", "floor");
    for kill in 1..=KILLS {
        let enough = (kill * SCANS / (KILLS + 1)) as i64;
        while level.describe().await.map_or(0, |level| level.revision) < enough {
            assert!(replay.is_under_way(), "the robot ended before the server was killed");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        server.kill().await?;
        tokio::time::sleep(Duration::from_millis(300)).await;
        assert!(replay.is_under_way(), "the robot gave up, or was done before kill {kill}");
        server.start_again().await?;
    }
    replay.finish().await?;
    let ending = ending(server).await?;
    assert!(ending.ids == expected.ids, "not the same contributions");
    assert!(ending == expected, "the maps differ");
    Ok(())
}

#[tokio::test]
async fn a_robot_goes_on_by_itself_after_the_server_was_killed_on_sqlite() -> Result<(), Error> {
    a_robot_goes_on(Database::Sqlite).await
}

#[tokio::test]
async fn a_robot_goes_on_by_itself_after_the_server_was_killed_on_postgres() -> Result<(), Error> {
    a_robot_goes_on(Database::new_postgres().await?).await
}

/// Sends contributions one by one until the server is gone; answers the receipts.
async fn send(level: &Level, contributions: &[Contribution]) -> BTreeMap<Uuid, Receipt> {
    let mut receipts = BTreeMap::new();
    for contribution in contributions {
        let body = codec::to_cbor(contribution).expect("a contribution can be encoded");
        let answer = level.api.post(&level.path(route::CONTRIBUTIONS), CBOR, body).await;
        let Ok(receipt) = answer.and_then(|answer| answer.expect(201)?.decode::<Receipt>()) else {
            break;
        };
        receipts.insert(contribution.id, receipt);
    }
    receipts
}

async fn receipts_outlive_a_kill(database: Database) -> Result<(), Error> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = part_of_killian(folder.path())?;
    let (expected, mut contributions) = undisturbed(&log, folder.path()).await?;

    let mut server = Server::start(database).await?;
    let level = Level::create(server.api()?, "mit", "floor").await?;
    level.enrol("anna").await?;
    let frame = level.describe().await?.frame;
    for contribution in &mut contributions {
        contribution.frame = frame;
    }

    // Four senders at a time, each with a quarter, and a kill while they are busy.
    let quarters: Vec<Vec<Contribution>> =
        contributions.chunks(SCANS.div_ceil(4)).map(<[_]>::to_vec).collect();
    let senders: Vec<_> = quarters
        .into_iter()
        .map(|quarter| {
            let level = level.clone();
            tokio::spawn(async move { send(&level, &quarter).await })
        })
        .collect();
    while level.describe().await?.revision < SCANS as i64 / 3 {
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    server.kill().await?;
    let mut receipts = BTreeMap::new();
    for sender in senders {
        receipts.extend(sender.await.expect("a sender does not panic"));
    }
    assert!((SCANS / 4..SCANS).contains(&receipts.len()), "{} receipts", receipts.len());

    server.start_again().await?;
    let entries = level.log().await?;
    for receipt in receipts.values() {
        let found: Vec<_> = entries.iter().filter(|entry| entry.id == receipt.id).collect();
        assert_eq!(found.len(), 1, "{} is there {} times", receipt.id, found.len());
        assert_eq!(found[0].revision, receipt.revision, "{}", receipt.id);
    }
    // All are sent again, last ones first: what was acknowledged gets the receipt it had.
    contributions.reverse();
    let again = send(&level, &contributions).await;
    assert_eq!(again.len(), SCANS);
    for (id, receipt) in &receipts {
        assert_eq!(again.get(id), Some(receipt));
    }
    assert!(ending(server).await? == expected, "the maps differ");
    Ok(())
}

#[tokio::test]
async fn receipts_outlive_a_killed_server_on_sqlite() -> Result<(), Error> {
    receipts_outlive_a_kill(Database::Sqlite).await
}

#[tokio::test]
async fn receipts_outlive_a_killed_server_on_postgres() -> Result<(), Error> {
    receipts_outlive_a_kill(Database::new_postgres().await?).await
}
