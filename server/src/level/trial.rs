//! What an act would change in a level's map, told without changing it.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_map::level::{Batch, Changes};
use mapfold_schema::border::{chain_id, feature_id};
use mapfold_schema::v1::{Bounds, ChangeCounts, ChangeKind, ChangedFeature, FeatureKind};
use tokio::sync::oneshot;

use super::folding::Folding;
use super::history::{History, Least};
use super::snapshot::{chain_bounds, hull_bounds, segment_bounds, tile_bounds, union};
use crate::store::acts::ActKind;

/// Features that a preview names.
const FEATURES_MAX: usize = 200;

/// An act to be tried out.
#[derive(Debug)]
pub(super) struct Trial {
    pub(super) kind: ActKind,
    pub(super) moved: Batch,
    /// `None` if it cannot be done, because another act came before it.
    pub(super) answer: oneshot::Sender<Option<Outcome>>,
}

/// What it would change.
#[derive(Debug, Default)]
pub(super) struct Outcome {
    /// The revision of the map for which this holds.
    pub(super) revision: i64,
    pub(super) segments: ChangeCounts,
    pub(super) clusters: ChangeCounts,
    pub(super) chains: ChangeCounts,
    pub(super) tiles: ChangeCounts,
    pub(super) bounds: Option<Bounds>,
    pub(super) features: Vec<ChangedFeature>,
    pub(super) more_features: bool,
}

impl Outcome {
    /// What `changes` have made of the map whose history `folding` still has.
    pub(super) fn of(folding: &Folding, changes: &Changes) -> Self {
        let (history, map) = (folding.history(), folding.level().map());
        let mut outcome = Self { revision: folding.revision(), ..Self::default() };
        let mut features = Vec::new();
        let mut bounds = None;
        outcome.segments = compare(
            &changes.segments,
            &history.segments,
            &map.segments,
            |_, segment| segment_bounds(segment),
            &mut bounds,
            |id, change| features.push((FeatureKind::Segment, feature_id(id), change)),
        );
        outcome.clusters = compare(
            &changes.clusters,
            &history.clusters,
            &map.clusters,
            |_, cluster| hull_bounds(&cluster.hull),
            &mut bounds,
            |id, change| features.push((FeatureKind::Cluster, feature_id(id), change)),
        );
        outcome.chains = compare(
            &changes.chains,
            &history.chains,
            &map.chains,
            |_, chain| chain_bounds(chain),
            &mut bounds,
            |id, change| features.push((FeatureKind::Chain, chain_id(id), change)),
        );
        let resolution_m = folding.level().config().resolution;
        outcome.tiles = compare(
            &changes.tiles,
            &history.tiles,
            &map.tiles,
            |key, _| Some(tile_bounds(key.tile, resolution_m)),
            &mut bounds,
            |_, _| {},
        );
        outcome.bounds = bounds;
        outcome.more_features = features.len() > FEATURES_MAX;
        features.truncate(FEATURES_MAX);
        outcome.features = features
            .into_iter()
            .map(|(kind, id, change)| ChangedFeature { id, kind, change })
            .collect();
        outcome
    }
}

/// Counts what differs between the history's things and the map's, and tells each of them.
fn compare<'a, K: Least + 'a, V: PartialEq>(
    changed: impl IntoIterator<Item = &'a K>,
    history: &History<K, V>,
    map: &BTreeMap<K, Arc<V>>,
    covers: impl Fn(&K, &V) -> Option<Bounds>,
    bounds: &mut Option<Bounds>,
    mut tell: impl FnMut(&K, ChangeKind),
) -> ChangeCounts {
    let mut counts = ChangeCounts::default();
    for key in changed {
        let before = history.get(key).and_then(|(_, value)| value);
        let after = map.get(key);
        let (count, kind) = match (before, after) {
            (None, Some(_)) => (&mut counts.new, ChangeKind::New),
            (Some(_), None) => (&mut counts.removed, ChangeKind::Removed),
            (Some(old), Some(new)) if old != new => (&mut counts.changed, ChangeKind::Changed),
            _ => continue,
        };
        *count += 1;
        tell(key, kind);
        for covered in [before, after].into_iter().flatten().filter_map(|v| covers(key, v)) {
            *bounds = Some(bounds.map_or(covered, |all| union(all, covered)));
        }
    }
    counts
}
