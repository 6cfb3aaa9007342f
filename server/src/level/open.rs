//! Reading a level back from the store: stored tiles and the features of its log up to the
//! revision of those tiles, then the rest of the log.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Debug;
use std::sync::Arc;

use mapfold_map::level::LevelConfig;
use mapfold_map::raster::{SliceKey, Sums, TileKey};
use mapfold_schema::border::{parse_chain_id, parse_feature_id};

use super::folding::Folding;
use super::history::{History, Least, MapHistory};
use super::prior;
use super::recall::{self, Logged};
use super::rows;
use super::walls;
use crate::store::acts::Force;
use crate::store::levels::LevelRow;
use crate::store::map_rows::{FeatureRow, MapRows, StoredMap, TileRow};
use crate::store::{Store, StoreError, tile_cells};

/// Rows of the log that are read at once without their evidence.
const FEATURES_PAGE: u32 = 1024;
/// Whole rows of the log that are read at once.
pub(super) const LOG_PAGE: u32 = 256;

/// A level as it was read back.
#[derive(Debug)]
pub(super) struct Opened {
    pub(super) row: LevelRow,
    pub(super) folding: Box<Folding>,
}

/// Reads a level; `None` if there is none.
pub(super) async fn open(
    store: &Store,
    site: &str,
    level: &str,
) -> Result<Option<Opened>, StoreError> {
    let Some(row) = store.level(site, level).await? else { return Ok(None) };
    let Some(stored) = store.stored_map(site, level).await? else { return Ok(None) };
    let stored = Arc::new(stored);
    let folding = match restore(store, &row, &stored).await? {
        Ok(folding) => catch_up(store, &row, folding).await?,
        Err(difference) => {
            tracing::error!(site, level, difference, "stored map is not its log's; folding again");
            metrics::counter!("mapfold_stored_map_faults_total").increment(1);
            let folding = Box::new(Folding::empty(&recall::config(&row)));
            let folding = catch_up(store, &row, folding).await?;
            mend(store, &row, stored, folding).await?
        }
    };
    Ok(Some(Opened { row, folding }))
}

/// Folds what the log holds after `folding`'s revision.
pub(super) async fn catch_up(
    store: &Store,
    row: &LevelRow,
    mut folding: Box<Folding>,
) -> Result<Box<Folding>, StoreError> {
    loop {
        let entries = recall::entries_after(store, row, folding.revision()).await?;
        if entries.is_empty() {
            return Ok(folding);
        }
        folding = aside(move || {
            for entry in &entries {
                folding.step(entry).map_err(|stray| {
                    spoilt("contributions", format!("revision {}", entry.revision()), stray)
                })?;
            }
            Ok(folding)
        })
        .await?;
    }
}

/// The level as of the stored map, or in words how the stored map differs from its log.
async fn restore(
    store: &Store,
    row: &LevelRow,
    stored: &Arc<StoredMap>,
) -> Result<Result<Box<Folding>, String>, StoreError> {
    let until = stored.folded_revision;
    let frames = store.frames_at(&row.site, &row.level, until).await?;
    let reading = recall::Reading::new(row, frames);
    let mut log: Vec<Logged> = Vec::new();
    let mut after = 0;
    while after < stored.folded_revision {
        let page = store
            .features_after(&row.site, &row.level, after, stored.folded_revision, FEATURES_PAGE)
            .await?;
        let Some(last) = page.last() else { break };
        after = last.revision;
        let reading = reading.clone();
        log.extend(
            aside(move || {
                page.iter()
                    .map(|row| recall::features(row, &reading))
                    .collect::<Result<Vec<_>, StoreError>>()
            })
            .await?,
        );
    }
    let acts = store.acts_between(&row.site, &row.level, 0, stored.folded_revision).await?;
    let (imports, prior) = prior::restore(store, row, stored.folded_revision).await?;
    let gdb = store.gdb_entry_count(&row.site, &row.level, stored.folded_revision).await?;
    if (log.len() + acts.len() + imports) as i64 + gdb != stored.folded_revision {
        return Err(spoilt(
            "contributions",
            format!("revisions up to {}", stored.folded_revision),
            format!(
                "there are {}, {} acts, {imports} imports and {gdb} entries about the GDB",
                log.len(),
                acts.len()
            ),
        ));
    }
    let (config, stored) = (recall::config(row), Arc::clone(stored));
    let force = Force::after(&acts);
    aside(move || {
        let restored = restored_with_history(&config, &stored, &log, &force);
        Ok(restored.map(|mut folding| {
            folding.history_mut().prior = prior;
            walls::tell(folding.history_mut(), config.resolution, stored.folded_revision);
            Box::new(folding)
        }))
    })
    .await
}

fn restored_with_history(
    config: &LevelConfig,
    stored: &StoredMap,
    log: &[Logged],
    force: &Force,
) -> Result<Folding, String> {
    let rows = &stored.rows;
    let mut sums: Vec<(SliceKey, Sums)> = Vec::new();
    for row in &rows.slices {
        if let Some(content) = &row.content {
            let tile = tile_cells::decode(content).map_err(|e| format!("{:?}: {e}", row.at))?;
            // Nearly all of them are old: packed here, never are all open at once.
            sums.push((row.at, Sums::Open(Arc::new(tile)).packed()));
        }
    }
    let mut folding = Folding::restored(config, stored.folded_revision, sums, log, force);
    let map = folding.level().map().clone();
    let mut history = MapHistory::default();
    for row in &rows.slices {
        let sums = folding.level().sums(&row.at).cloned();
        history.slices.put(row.at, row.revision, sums.map(Arc::new));
    }
    for row in &rows.tiles {
        let tile = map.tiles.get(&row.key);
        if tile.is_none() != row.is_gone {
            return Err(format!("tile {:?} is another", row.key));
        }
        history.tiles.put(row.key, row.revision, tile.cloned());
    }
    if let Some(key) = map.tiles.keys().find(|key| history.tiles.get(key).is_none()) {
        return Err(format!("tile {key:?} is missing"));
    }
    let MapHistory { segments, clusters, chains, .. } = &mut history;
    adopt(&rows.segments, &map.segments, parse_feature_id, rows::segment, segments)?;
    adopt(&rows.clusters, &map.clusters, parse_feature_id, rows::cluster, clusters)?;
    adopt(&rows.chains, &map.chains, parse_chain_id, rows::chain, chains)?;
    *folding.history_mut() = history;
    Ok(folding)
}

/// Takes the dates of stored features over, if the features are the very ones of the fold.
fn adopt<K: Least + Debug, V: PartialEq>(
    stored: &[FeatureRow],
    folded: &BTreeMap<K, Arc<V>>,
    parse: fn(&str) -> Option<K>,
    content: fn(&K, &V) -> Result<Vec<u8>, String>,
    history: &mut History<K, V>,
) -> Result<(), String> {
    for row in stored {
        let id = parse(&row.feature).ok_or_else(|| format!("{:?} is no feature", row.feature))?;
        let value = folded.get(&id);
        if value.map(|v| content(&id, v)).transpose()? != row.content {
            return Err(format!("feature {} is another", row.feature));
        }
        history.put(id, row.revision, value.cloned());
    }
    match folded.keys().find(|id| history.get(id).is_none()) {
        Some(id) => Err(format!("feature {id:?} is missing")),
        None => Ok(()),
    }
}

/// Puts a stored map right that differs from what its log folds to: what differs counts as
/// changed at the newest revision, so that readers who were told otherwise learn of it with their
/// next question, and everything is written at once.
async fn mend(
    store: &Store,
    row: &LevelRow,
    stored: Arc<StoredMap>,
    mut folding: Box<Folding>,
) -> Result<Box<Folding>, StoreError> {
    let (from, resolution) = (stored.folded_revision, recall::config(row).resolution);
    let (folding, everything) = aside(move || {
        let revision = folding.revision();
        let true_rows = rows::changed(folding.history(), -1, revision)?;
        let known = |rows: &[FeatureRow]| -> BTreeMap<String, Option<Vec<u8>>> {
            rows.iter().map(|r| (r.feature.clone(), r.content.clone())).collect()
        };
        let history = folding.history_mut();
        let MapHistory { segments, clusters, chains, tiles, .. } = history;
        let rows = &stored.rows;
        redate(&rows.segments, &known(&true_rows.segments), parse_feature_id, revision, segments);
        redate(&rows.clusters, &known(&true_rows.clusters), parse_feature_id, revision, clusters);
        redate(&rows.chains, &known(&true_rows.chains), parse_chain_id, revision, chains);
        // A tile reads as its slices tell: if any of them was another, so may the tile have been.
        let true_slices: BTreeMap<SliceKey, &Option<Vec<u8>>> =
            true_rows.slices.iter().map(|r| (r.at, &r.content)).collect();
        let true_tiles: BTreeMap<TileKey, &TileRow> =
            true_rows.tiles.iter().map(|r| (r.key, r)).collect();
        let stored_slices: BTreeMap<SliceKey, &Option<Vec<u8>>> =
            rows.slices.iter().map(|r| (r.at, &r.content)).collect();
        let known_slices = true_slices.keys().chain(stored_slices.keys());
        let spoilt_tiles: BTreeSet<TileKey> = known_slices
            .filter(|at| true_slices.get(at) != stored_slices.get(at))
            .map(|at| at.key)
            .chain(rows.tiles.iter().filter(|r| true_tiles.get(&r.key) != Some(r)).map(|r| r.key))
            .collect();
        for key in spoilt_tiles {
            redate_one(key, revision, tiles);
        }
        walls::tell(history, resolution, revision);
        let everything = rows::changed(folding.history(), -1, revision)?;
        Ok((folding, everything))
    })
    .await?;
    write_mended(store, row, from, folding.revision(), &everything).await?;
    Ok(folding)
}

async fn write_mended(
    store: &Store,
    row: &LevelRow,
    from: i64,
    to: i64,
    everything: &MapRows,
) -> Result<(), StoreError> {
    let written = store.write_map(&row.site, &row.level, from, to, everything).await?;
    tracing::info!(site = row.site, level = row.level, rows = everything.len(), ?written, "mended");
    Ok(())
}

fn redate<K: Least, V: PartialEq>(
    stored: &[FeatureRow],
    true_rows: &BTreeMap<String, Option<Vec<u8>>>,
    parse: fn(&str) -> Option<K>,
    revision: i64,
    history: &mut History<K, V>,
) {
    for row in stored {
        if true_rows.get(&row.feature) != Some(&row.content)
            && let Some(id) = parse(&row.feature)
        {
            redate_one(id, revision, history);
        }
    }
}

fn redate_one<K: Least, V: PartialEq>(key: K, revision: i64, history: &mut History<K, V>) {
    let value = history.get(&key).and_then(|(_, value)| value.cloned());
    history.put(key, revision, value);
}

/// Runs heavy work on a thread that may block. A panic in it is the store's fault or the fold's;
/// either way the level cannot be opened.
pub(super) async fn aside<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, StoreError> + Send + 'static,
) -> Result<T, StoreError> {
    match tokio::task::spawn_blocking(work).await {
        Ok(outcome) => outcome,
        Err(panic) => Err(spoilt("levels", "fold", panic)),
    }
}

fn spoilt(
    table: &'static str,
    key: impl Into<String>,
    detail: impl std::fmt::Display,
) -> StoreError {
    StoreError::Corrupt { table, key: key.into(), detail: detail.to_string() }
}
