//! What confirmed walls say of the raster is what the published segments say, whatever came before.

use std::collections::BTreeMap;

use mapfold_map::raster::{Tile, TileIndex};
use mapfold_map::vector::{ConfirmedConfig, confirmed};
use mapfold_server::level::Snapshot;
use mapfold_server::store::acts::Targets;

use crate::engines::Database;
use crate::levels_in_memory::{open, reached, still, submit_all};
use crate::reverts::{act, of_robot};
use crate::synthetic::{RESOLUTION_M, furnish, looks};

on_each_engine!(walls_say_what_the_segments_say_after_looks_reverts_and_restarts,);

/// Tiles that are as they should be; how many.
fn checked(snapshot: &Snapshot) -> usize {
    let mut expected: BTreeMap<TileIndex, Tile> = BTreeMap::new();
    for (_, segment) in snapshot.segments() {
        for (at, patch) in confirmed(segment, RESOLUTION_M, &ConfirmedConfig::STANDARD) {
            expected.entry(at).or_default().add(&patch);
        }
    }
    let first = TileIndex { x: i32::MIN, y: i32::MIN };
    let last = TileIndex { x: i32::MAX, y: i32::MAX };
    let found: BTreeMap<TileIndex, Tile> =
        snapshot.walls_between(first, last).map(|(at, tile)| (*at, Tile::clone(tile))).collect();
    assert!(found == expected, "{} tiles, not {}", found.len(), expected.len());
    found.len()
}

async fn walls_say_what_the_segments_say_after_looks_reverts_and_restarts(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (levels, level) = open(&store, still()).await;
    let all = looks(71, 120);
    let full = submit_all(&level, &all).await;
    assert!(checked(&full) > 10);
    // Whoever has seen an earlier revision learns of each tile that has changed since.
    let halfway = full.raster_since(60, None).unwrap();
    assert!(!halfway.walls.is_empty());
    assert_eq!(full.raster_since(full.folded_revision(), None).unwrap().walls, []);

    let targets: Targets = of_robot("bert");
    let reverted = level.revert(&act(1, &targets), &targets).await.unwrap();
    let without = reached(&level, reverted.revision).await;
    checked(&without);
    let before_restart = without.raster_since(full.folded_revision(), None).unwrap();
    let changed = before_restart.walls.len() + before_restart.removed_walls.len();
    assert!(changed > 0, "a third of the looks moves walls");
    drop(level);
    levels.shutdown().await;

    let (levels, level) = open(&store, still()).await;
    let back = reached(&level, reverted.revision).await;
    assert_eq!(checked(&back), checked(&without));
    let after_restart = back.raster_since(full.folded_revision(), None).unwrap();
    for place in before_restart.walls.iter().chain(&before_restart.removed_walls) {
        let known = after_restart.walls.iter().chain(&after_restart.removed_walls);
        assert!(known.into_iter().any(|other| other == place), "{place:?} is not told");
    }
    drop(level);
    levels.shutdown().await;
}
