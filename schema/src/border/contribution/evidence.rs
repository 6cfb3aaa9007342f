//! The evidence of a contribution.

use std::collections::{BTreeMap, BTreeSet};

use mapfold_map::raster::{
    EvidencePatch, EvidenceRun, RunError, SensorClass, TILE_SIDE, TileIndex, TilePatch,
};

use crate::border::Target;
use crate::border::features::TILE_INDEX_MAX;
use crate::border::violations::{Place, Violations};
use crate::v1;

pub(super) fn check(
    evidence: &[v1::EvidencePatch],
    target: &Target,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Vec<EvidencePatch>> {
    let tiles: usize = evidence.iter().map(|patch| patch.tiles.len()).sum();
    let tiles_max = target.limits.tiles_max;
    if tiles > tiles_max {
        wrong.add(
            place,
            "too_many_tiles",
            format_args!("{tiles} tiles: one look touches at most {tiles_max}"),
        );
        return None;
    }
    let mut seen: BTreeSet<SensorClass> = BTreeSet::new();
    let mut checked = Vec::with_capacity(evidence.len().min(SensorClass::ALL.len()));
    for (i, patch) in evidence.iter().enumerate() {
        let place = place.index(i);
        let class = patch.sensor.into();
        if !seen.insert(class) {
            wrong.add(
                &place.field("sensor"),
                "duplicate_sensor",
                "each class of sensor has at most one entry",
            );
        }
        if wrong.is_full() {
            break;
        }
        let tiles = check_tiles(&patch.tiles, target, &place.field("tiles"), wrong);
        checked.push(EvidencePatch { class, tiles });
    }
    Some(checked)
}

fn check_tiles(
    tiles: &[v1::TilePatch],
    target: &Target,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> BTreeMap<TileIndex, TilePatch> {
    let mut before = None;
    let mut checked = Vec::with_capacity(tiles.len());
    for (i, tile) in tiles.iter().enumerate() {
        if wrong.is_full() {
            break;
        }
        let place = place.index(i);
        let index = TileIndex { x: tile.x, y: tile.y };
        if before.is_some_and(|before| before >= index) {
            wrong.add(&place, "tiles_not_ascending", "tiles ascend by (x, y), each is there once");
        }
        before = Some(index);
        for (at, name) in [(tile.x, "x"), (tile.y, "y")] {
            check_index(at, target, &place.field(name), wrong);
        }
        if let Some(patch) = check_runs(&tile.runs, target, &place.field("runs"), wrong) {
            checked.push((index, patch));
        }
    }
    checked.into_iter().collect()
}

/// Whether a tile at this index, with its far edge, lies within the level.
fn check_index(index: i32, target: &Target, place: &Place<'_>, wrong: &mut Violations) {
    let far = if index < 0 { f64::from(index) } else { f64::from(index) + 1.0 };
    let edge_m = far * TILE_SIDE as f64 * target.resolution_m;
    let max_m = target.limits.coordinate_max_m;
    // The second holds whatever the limits say.
    let within = edge_m.abs() <= max_m && index.unsigned_abs() <= TILE_INDEX_MAX;
    if !within {
        wrong.add(
            place,
            "out_of_range",
            format_args!(
                "a tile that reaches to {edge_m} m: {max_m} m from the level's origin is the most"
            ),
        );
    }
}

fn check_runs(
    runs: &[i32],
    target: &Target,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<TilePatch> {
    let (triples, rest) = runs.as_chunks::<3>();
    if triples.is_empty() && rest.is_empty() {
        wrong.add(place, "no_runs", "a tile without evidence does not belong here");
        return None;
    }
    if !rest.is_empty() {
        wrong.add(place, "not_triples", "runs are start, length, value, start, length, value, ...");
        return None;
    }
    let mut checked = Vec::with_capacity(triples.len());
    for (i, triple) in triples.iter().enumerate() {
        checked.push(check_run(3 * i, *triple, target, place, wrong)?);
    }
    TilePatch::new(checked)
        .map_err(|error| {
            let (index, code) = match error {
                RunError::Empty { index } => (index, "empty_run"),
                RunError::PastEnd { index, .. } => (index, "run_past_end"),
                RunError::OutOfOrder { index } => (index, "runs_not_ascending"),
            };
            wrong.add(&place.index(3 * index), code, error);
        })
        .ok()
}

/// One run's numbers; how runs follow each other is [`TilePatch::new`]'s to say.
fn check_run(
    at: usize,
    [start, length, value]: [i32; 3],
    target: &Target,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<EvidenceRun> {
    let Ok(start) = u16::try_from(start) else {
        wrong.add(&place.index(at), "run_past_end", "a run starts at one of the cells 0 to 4095");
        return None;
    };
    let Ok(length) = u16::try_from(length) else {
        wrong.add(&place.index(at + 1), "run_past_end", "a run has 1 to 4096 cells");
        return None;
    };
    let value_max = target.limits.evidence_max.min(i32::from(i16::MAX));
    match i16::try_from(value) {
        Ok(value) if i32::from(value).abs() <= value_max => {
            Some(EvidenceRun { start, length, value })
        }
        _ => {
            wrong.add(
                &place.index(at + 2),
                "evidence_too_strong",
                format_args!(
                    "one look gives a cell at most {value_max} steps of 0.01 nat, not {value}"
                ),
            );
            None
        }
    }
}
