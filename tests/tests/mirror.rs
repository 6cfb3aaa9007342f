//! Following patches from the beginning leads to what a full fetch answers, in JSON and in CBOR.

#![expect(clippy::expect_used, reason = "tests may stop at the first surprise")]

use std::collections::BTreeSet;
use std::path::Path;

use mapfold_schema::codec::{CBOR, JSON};
use mapfold_schema::v1::{Removed, TileAddress};
use mapfold_tests::Error;
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::fleet;
use mapfold_tests::level::{Level, Replica};
use mapfold_tests::server::Server;

/// Scans that are played: enough for walls to be founded, merged, opened and dropped.
const SCANS: usize = 600;

/// Parts in which they are played: a mirror that follows must have been at the end of each.
const PARTS: usize = 5;

/// Things a page, far fewer than there are: every mirror must go through many pages.
const PAGE: usize = 100;

/// A mirror that follows while the fleet plays, and the revisions at which it was up to date.
struct Follower {
    accept: &'static str,
    replica: Replica,
    steps: BTreeSet<i64>,
}

impl Follower {
    fn new(accept: &'static str) -> Self {
        Self { accept, replica: Replica::default(), steps: BTreeSet::new() }
    }

    async fn follow(&mut self, level: &Level, until: i64) {
        while self.replica.revision < until {
            // The level is made by the first robot: until then there is nothing to follow.
            if self.replica.follow(level, PAGE, self.accept).await.is_ok() {
                self.steps.insert(self.replica.revision);
            }
            tokio::time::sleep(std::time::Duration::from_millis(10)).await;
        }
    }
}

async fn mirrors_equal_full_fetches(database: Database) -> Result<(), Error> {
    let server = Server::start(database).await?;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz"))?;
    let level = Level::new(server.api()?, "mit", "floor");

    // Two mirrors follow while the fleet plays, each in its own words.
    let (mut json, mut cbor) = (Follower::new(JSON), Follower::new(CBOR));
    let ends = (1..=PARTS).map(|part| part * SCANS / PARTS);
    let mut begin = 0;
    for end in ends.clone() {
        let folder = folder.path().join(end.to_string());
        std::fs::create_dir(&folder).expect("a folder for a part");
        let part = folder.join("part.log.gz");
        log.write_part(begin, end, &part)?;
        let robots = fleet::cut(&Log::read(&part)?, &folder)?;
        let (played, (), ()) = tokio::join!(
            fleet::play(&server, "mit", "floor", &robots, &folder),
            json.follow(&level, end as i64),
            cbor.follow(&level, end as i64)
        );
        played?;
        begin = end;
    }
    for follower in [&json, &cbor] {
        let missed: Vec<usize> =
            ends.clone().filter(|end| !follower.steps.contains(&(*end as i64))).collect();
        assert!(missed.is_empty(), "{} was never at {missed:?}", follower.accept);
    }
    let (json, cbor) = (json.replica, cbor.replica);

    let description = level.folded().await?;
    assert_eq!(description.revision, SCANS as i64);
    assert!(json == cbor, "the mirrors differ");
    let mut late = Replica::default();
    let pages = late.follow(&level, PAGE, CBOR).await?;
    assert!(pages > 3, "only {pages} pages");
    assert!(late == cbor, "a mirror that begins at the end differs from one that followed");

    for accept in [JSON, CBOR] {
        let whole = level.vector(0, accept).await?;
        assert_eq!(whole.revision, cbor.revision);
        assert!(whole.segments.len() > 20, "only {} segments", whole.segments.len());
        let segments = whole.segments.into_iter().map(|s| (s.id.clone(), s)).collect();
        assert!(cbor.segments == segments, "segments differ in {accept}");
        let clusters = whole.clusters.into_iter().map(|c| (c.id.clone(), c)).collect();
        assert!(cbor.clusters == clusters, "clusters differ in {accept}");
        assert!(!whole.chains.is_empty(), "no walls meet");
        let chains = whole.chains.into_iter().map(|c| (c.id.clone(), c)).collect();
        assert!(cbor.chains == chains, "chains differ in {accept}");
        let raster = level.raster(0, accept).await?;
        let addresses: BTreeSet<TileAddress> = raster.tiles.iter().copied().collect();
        assert!(addresses.iter().eq(cbor.tiles.keys()), "tiles differ in {accept}");
    }
    for (at, tile) in &cbor.tiles {
        let mut sums = vec![0; 64 * 64];
        for run in tile.runs.chunks_exact(3) {
            sums[run[0] as usize..][..run[1] as usize].fill(run[2]);
        }
        assert!(level.tile(at).await? == sums, "{at:?} differs");
    }

    // Who is up to date gets nothing.
    for accept in [JSON, CBOR] {
        let patch = level.patch(description.revision, PAGE, accept).await?;
        assert_eq!((patch.since, patch.revision), (description.revision, description.revision));
        assert!(!patch.more && patch.segments.is_empty() && patch.clusters.is_empty());
        assert!(patch.chains.is_empty());
        assert!(patch.tiles.is_empty() && patch.removed == Removed::default());
        let vector = level.vector(description.revision, accept).await?;
        assert!(vector.segments.is_empty() && vector.clusters.is_empty());
        assert!(vector.chains.is_empty());
        assert!(level.raster(description.revision, accept).await?.tiles.is_empty());
    }
    Ok(())
}

#[tokio::test]
async fn a_mirror_that_follows_patches_equals_a_full_fetch_on_sqlite() -> Result<(), Error> {
    mirrors_equal_full_fetches(Database::Sqlite).await
}

#[tokio::test]
async fn a_mirror_that_follows_patches_equals_a_full_fetch_on_postgres() -> Result<(), Error> {
    mirrors_equal_full_fetches(Database::new_postgres().await?).await
}
