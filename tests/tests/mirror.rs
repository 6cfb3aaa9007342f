//! Following patches from the beginning leads to what a full fetch answers, in JSON and in CBOR.

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

/// Things a page, far fewer than there are: every mirror must go through many pages.
const PAGE: usize = 100;

#[tokio::test]
async fn a_mirror_that_follows_patches_equals_a_full_fetch() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz"))?;
    let part = folder.path().join("part.log.gz");
    log.write_part(0, SCANS, &part)?;
    let robots = fleet::cut(&Log::read(&part)?, folder.path())?;
    let level = Level::new(server.api()?, "mit", "floor");

    // Two mirrors follow while the fleet plays, each in its own words.
    let following = |accept: &'static str| {
        let level = level.clone();
        async move {
            let mut replica = Replica::default();
            let mut steps = BTreeSet::new();
            while replica.revision < SCANS as i64 {
                // The level is made by the first robot: until then there is nothing to follow.
                if replica.follow(&level, PAGE, accept).await.is_ok() {
                    steps.insert(replica.revision);
                }
                tokio::time::sleep(std::time::Duration::from_millis(10)).await;
            }
            (replica, steps.len())
        }
    };
    let (played, (json, json_steps), (cbor, cbor_steps)) = tokio::join!(
        fleet::play(&server, "mit", "floor", &robots, folder.path()),
        following(JSON),
        following(CBOR)
    );
    played?;
    assert!(json_steps + cbor_steps > 3, "the mirrors saw {json_steps}, {cbor_steps} revisions");

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
