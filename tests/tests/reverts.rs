//! A robot's contributions taken out of a real map: it is then, bit for bit, the map of a level
//! that never had them, for exports, mirrors and replicas, also when the server dies meanwhile.

#![expect(clippy::expect_used, reason = "tests may stop at the first surprise")]

use std::path::Path;
use std::time::Duration;

use mapfold_schema::codec::{CBOR, JSON};
use mapfold_schema::route;
use mapfold_schema::v1::{NewRevert, Revert, RevertPreview};
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::fleet;
use mapfold_tests::level::{Level, Replica};
use mapfold_tests::robot::Robot;
use mapfold_tests::server::Server;
use mapfold_tests::{Error, programs};
use tokio::time::Instant;
use uuid::Uuid;

/// Scans that are played, a third by each of three robots.
const SCANS: usize = 600;

/// The robot whose contributions are taken out.
const OUT: usize = 1;

fn part_of_killian(scans: usize, folder: &Path) -> Result<Vec<Robot>, Error> {
    let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz"))?;
    let part = folder.join("part.log.gz");
    log.write_part(500, 500 + scans, &part)?;
    fleet::cut(&Log::read(&part)?, folder)
}

fn out(id: Option<u128>) -> NewRevert {
    NewRevert {
        id: id.map(Uuid::from_u128),
        robot: Some(fleet::NAMES[OUT].to_owned()),
        reason: "its scanner had come loose".to_owned(),
        ..NewRevert::default()
    }
}

/// What a level shows of its map.
#[derive(PartialEq)]
struct Shown {
    geojson: Vec<u8>,
    nav2: Vec<u8>,
}

async fn shown(level: &Level) -> Result<Shown, Error> {
    level.folded().await?;
    Ok(Shown { geojson: level.export("geojson").await?, nav2: level.export("nav2").await? })
}

/// What a level shows that never had the contributions, and the digest of its map.
async fn never(robots: &[Robot], folder: &Path) -> Result<(Shown, String), Error> {
    let mut server = Server::start(Database::Sqlite).await?;
    let mut others = robots.to_vec();
    others.remove(OUT);
    let folder = folder.join("never");
    std::fs::create_dir_all(&folder).expect("a folder");
    fleet::play(&server, "mit", "floor", &others, &folder).await?;
    let never = shown(&Level::new(server.api()?, "mit", "floor")).await?;
    server.stop().await?;
    Ok((never, server.verify().await?))
}

/// A mirror that followed is what a full fetch answers.
async fn follow(mirror: &mut Replica, level: &Level) -> Result<(), Error> {
    mirror.follow(level, 100, CBOR).await?;
    let mut fresh = Replica::default();
    fresh.follow(level, 100, JSON).await?;
    assert!(*mirror == fresh, "a mirror at revision {} differs", mirror.revision);
    Ok(())
}

/// Brings a robot's mirror up to date with the program itself; answers it as written out.
async fn mirrored(server: &Server) -> Result<Vec<u8>, Error> {
    let folder = server.folder().join("mirror");
    let output = tokio::process::Command::new(programs::path("mapfold-robot")?)
        .args(["mirror", "--once", "--server", &server.url(), "--token", server.admin_token()])
        .args(["--site", "mit", "--level", "floor", "--out"])
        .arg(&folder)
        .output()
        .await
        .map_err(|e| Error::file(&folder, e))?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let file = folder.join("map.geojson");
    std::fs::read(&file).map_err(|e| Error::file(file, e))
}

/// Answers how long it took, in words.
async fn a_reverted_robot_was_never_there(database: Database) -> Result<String, Error> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let robots = part_of_killian(SCANS, folder.path())?;
    let (never, never_digest) = never(&robots, folder.path()).await?;

    let mut server = Server::start(database).await?;
    fleet::play(&server, "mit", "floor", &robots, folder.path()).await?;
    let level = Level::new(server.api()?, "mit", "floor");
    let full = shown(&level).await?;
    assert!(full != never, "the robot had nothing to say");
    let mut mirror = Replica::default();
    follow(&mut mirror, &level).await?;
    assert!(mirrored(&server).await? == full.geojson);

    let preview = format!("{}?preview=true", level.path(route::REVERTS));
    let told: RevertPreview =
        level.api.post_json(&preview, &out(None)).await?.expect(200)?.decode()?;
    assert_eq!(told.moved as usize, SCANS / 3);
    assert!(shown(&level).await? == full, "a preview changes nothing");

    let begin = Instant::now();
    let reverted = level.revert(&out(None)).await?;
    let answered = begin.elapsed();
    let without = level.folded().await?;
    let took = format!(
        "{}: {} of {SCANS} taken out in {answered:?}, shown after {:?}",
        server.database().engine(),
        reverted.taken_out,
        begin.elapsed()
    );
    assert_eq!(reverted.taken_out as usize, SCANS / 3);
    assert_eq!(
        (without.revision, without.counts.in_force),
        (SCANS as i64 + 1, 2 * SCANS as i64 / 3)
    );
    assert!(shown(&level).await? == never, "not the map of a level that never had them");
    let revised = level.patch(SCANS as i64, 1, CBOR).await?;
    assert!(!revised.more && revised.revision == reverted.revision, "not one revision");
    let gone = &revised.removed;
    let counts = [told.segments.removed, told.clusters.removed, told.tiles.removed];
    let removed = [gone.segments.len(), gone.clusters.len(), gone.tiles.len()];
    assert_eq!(removed, counts.map(|count| count as usize), "not what the preview told");
    follow(&mut mirror, &level).await?;
    assert!(mirrored(&server).await? == never.geojson);

    // Robots that send all of it again change nothing.
    fleet::play(&server, "mit", "floor", &robots, &folder.path().join("again")).await?;
    assert_eq!(level.describe().await?.revision, reverted.revision);
    server.stop().await?;
    assert_eq!(server.verify().await?, never_digest);

    server.start_again().await?;
    assert!(shown(&level).await? == never, "a restart shows another map");
    level.undo(reverted.id).await?;
    assert!(shown(&level).await? == full, "the map is not back");
    follow(&mut mirror, &level).await?;
    assert!(mirrored(&server).await? == full.geojson);
    server.stop().await?;
    assert_ne!(server.verify().await?, never_digest);
    Ok(took)
}

#[tokio::test]
async fn a_reverted_robot_was_never_there_on_sqlite() -> Result<(), Error> {
    println!("{}", a_reverted_robot_was_never_there(Database::Sqlite).await?);
    Ok(())
}

#[tokio::test]
async fn a_reverted_robot_was_never_there_on_postgres() -> Result<(), Error> {
    println!("{}", a_reverted_robot_was_never_there(Database::new_postgres().await?).await?);
    Ok(())
}

async fn reverts_outlive_kills(database: Database) -> Result<(), Error> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let robots = part_of_killian(300, folder.path())?;
    let (never, never_digest) = never(&robots, folder.path()).await?;
    let mut server = Server::start(database).await?;
    fleet::play(&server, "mit", "floor", &robots, folder.path()).await?;
    let level = Level::new(server.api()?, "mit", "floor");
    let full = shown(&level).await?;

    // Killed at once, and later and later: before, within and after the commit, the fold, the
    // write-behind. Whatever was answered holds; asking again tells what was not.
    let mut answered = 0;
    for turn in 0..8_u32 {
        let delay = Duration::from_millis(u64::from(3 * turn * turn));
        let asked = out(Some(1000 + u128::from(turn)));
        let sender = tokio::spawn({
            let (level, asked) = (level.clone(), asked.clone());
            async move { level.revert(&asked).await }
        });
        tokio::time::sleep(delay).await;
        server.kill().await?;
        let before: Option<Revert> = sender.await.expect("no panic").ok();
        server.start_again().await?;
        let after = level.revert(&asked).await?;
        if let Some(before) = before {
            answered += 1;
            assert_eq!(after, before, "the revert of turn {turn} is another");
        }
        assert!(shown(&level).await? == never, "turn {turn}: not the map without them");

        let undoer = tokio::spawn({
            let (level, id) = (level.clone(), after.id);
            async move { level.undo(id).await }
        });
        tokio::time::sleep(delay).await;
        server.kill().await?;
        let before: Option<Revert> = undoer.await.expect("no panic").ok();
        server.start_again().await?;
        let undone = level.undo(after.id).await?;
        if let Some(before) = before {
            assert_eq!(undone, before, "the undoing of turn {turn} is another");
        }
        assert!(shown(&level).await? == full, "turn {turn}: the map is not back");
    }
    assert!(answered > 0, "no revert was answered before its kill");
    assert_eq!(level.describe().await?.revision, 300 + 16);
    let last = level.revert(&out(None)).await?;
    assert_eq!(last.revision, 317);
    server.kill().await?;
    assert_eq!(server.verify().await?, never_digest);
    Ok(())
}

#[tokio::test]
async fn reverts_outlive_kills_on_sqlite() -> Result<(), Error> {
    reverts_outlive_kills(Database::Sqlite).await
}

#[tokio::test]
async fn reverts_outlive_kills_on_postgres() -> Result<(), Error> {
    reverts_outlive_kills(Database::new_postgres().await?).await
}

#[tokio::test]
async fn what_one_replica_reverts_the_other_shows() -> Result<(), Error> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let robots = part_of_killian(300, folder.path())?;
    let (never, never_digest) = never(&robots, folder.path()).await?;
    let database = Database::new_postgres().await?;
    let mut one = Server::start(database.clone()).await?;
    let mut two = Server::start(database).await?;
    fleet::play(&one, "mit", "floor", &robots, folder.path()).await?;
    let here = Level::new(one.api()?, "mit", "floor");
    let there = Level::new(two.api()?, "mit", "floor");
    let full = shown(&here).await?;
    let mut mirrors = [Replica::default(), Replica::default()];
    mirrors[0].follow(&here, 50, CBOR).await?;
    mirrors[1].follow(&there, 50, CBOR).await?;

    let reverted = here.revert(&out(None)).await?;
    here.folded().await?;
    // Who was told of a revision by one replica may ask the other for what comes after it.
    let read = there.vector(reverted.revision, CBOR).await?;
    assert!(read.revision >= reverted.revision && read.segments.is_empty());
    assert!(shown(&there).await? == never && shown(&here).await? == never);
    // Readers change sides, at whatever revision they are.
    mirrors.swap(0, 1);
    mirrors[0].follow(&here, 50, CBOR).await?;
    mirrors[1].follow(&there, 50, CBOR).await?;
    assert!(mirrors[0] == mirrors[1], "the replicas tell different things");
    for since in (0..=reverted.revision).step_by(50) {
        let patches =
            [here.patch(since, 20_000, CBOR).await?, there.patch(since, 20_000, CBOR).await?];
        assert!(patches[0] == patches[1], "the replicas differ since {since}");
    }

    let undone = there.undo(reverted.id).await?.undone.expect("it is undone");
    let read = here.vector(undone.revision, CBOR).await?;
    assert!(read.revision >= undone.revision);
    assert!(shown(&here).await? == full && shown(&there).await? == full);
    let again = there.revert(&out(None)).await?;
    mirrors[0].follow(&here, 50, CBOR).await?;
    assert!(mirrors[0].revision >= undone.revision && again.revision > undone.revision);
    one.stop().await?;
    two.stop().await?;
    assert_eq!(one.verify().await?, never_digest);
    Ok(())
}
