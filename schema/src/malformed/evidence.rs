//! Faults of the evidence.

use serde_json::{Value, json};

use super::Fault;
use crate::border::Target;

pub(super) fn catalogue(base: &Value, target: &Target) -> Vec<Fault> {
    let at = Fault::at;
    let runs = |runs: Value, code, pointer, name| {
        Fault::of(vec![("/evidence/0/tiles/1/runs", Some(runs))], pointer, code, name)
    };
    let entry = base.pointer("/evidence/0").cloned().unwrap_or_default();
    let tile = |x: i64| json!({"x": x, "y": 0, "runs": [0, 1, 1]});
    let tiles = |columns: &[i64]| Value::Array(columns.iter().map(|x| tile(*x)).collect());
    let too_many: Vec<i64> = (0..=target.limits.tiles_max as i64).collect();
    let tile_m = 64.0 * target.resolution_m;
    let beyond = (target.limits.coordinate_max_m / tile_m) as i64 + 1;
    let (run_0, run_1) = ("/evidence/0/tiles/1/runs/0", "/evidence/0/tiles/1/runs/3");
    let (length_0, value_0) = ("/evidence/0/tiles/1/runs/1", "/evidence/0/tiles/1/runs/2");
    let whole = "/evidence/0/tiles/1/runs";
    let strongest = target.limits.evidence_max;
    vec![
        Fault::of(
            vec![("/evidence", Some(json!([entry, entry])))],
            "/evidence/1/sensor",
            "duplicate_sensor",
            "two entries of one class",
        ),
        Fault::of(
            vec![("/evidence/0/tiles", Some(tiles(&too_many)))],
            "/evidence",
            "too_many_tiles",
            "more tiles than one look touches",
        ),
        Fault::of(
            vec![("/evidence/0/tiles", Some(tiles(&[0, 2, 1])))],
            "/evidence/0/tiles/2",
            "tiles_not_ascending",
            "tiles in disorder",
        ),
        Fault::of(
            vec![("/evidence/0/tiles", Some(tiles(&[0, 0])))],
            "/evidence/0/tiles/1",
            "tiles_not_ascending",
            "a tile twice",
        ),
        Fault::of(
            vec![("/evidence/0/tiles", Some(tiles(&[0, beyond])))],
            "/evidence/0/tiles/1/x",
            "out_of_range",
            "a tile outside the level",
        ),
        at("/evidence/0/tiles/0/x", json!(i32::MIN), "out_of_range", "the leftmost tile there is"),
        at("/evidence/0/tiles/2/y", json!(i32::MAX), "out_of_range", "the highest tile there is"),
        runs(json!([]), "no_runs", whole, "a tile without evidence"),
        runs(json!([0, 1]), "not_triples", whole, "a run without value"),
        runs(json!([0, 1, 1, 5]), "not_triples", whole, "a start without run"),
        runs(json!([-1, 1, 1]), "run_past_end", run_0, "a run before the tile"),
        runs(json!([4096, 1, 1]), "run_past_end", run_0, "a run behind the tile"),
        runs(json!([4000, 97, 1]), "run_past_end", run_0, "a run that leaves the tile"),
        runs(json!([0, -5, 1]), "run_past_end", length_0, "a run backwards"),
        runs(json!([0, 70_000, 1]), "run_past_end", length_0, "a run of very many cells"),
        runs(json!([0, 0, 1]), "empty_run", run_0, "a run of no cells"),
        runs(json!([0, 1, 0]), "empty_run", run_0, "a run of no evidence"),
        runs(json!([0, 4, 1, 3, 1, 1]), "runs_not_ascending", run_1, "runs that overlap"),
        runs(json!([9, 1, 1, 3, 1, 1]), "runs_not_ascending", run_1, "runs in disorder"),
        runs(json!([0, 1, strongest + 1]), "evidence_too_strong", value_0, "too much evidence"),
        runs(json!([0, 1, -strongest - 1]), "evidence_too_strong", value_0, "too little evidence"),
        runs(json!([0, 1, i32::MIN]), "evidence_too_strong", value_0, "the least number there is"),
    ]
}
