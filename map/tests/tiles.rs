//! Evidence: it adds up in any order, and what was added can be taken out again exactly.

use mapfold_map::geometry::Point;
use mapfold_map::raster::{
    Cell, EvidenceRun, LogOdds, RunError, TILE_CELLS, TILE_SIDE, Tile, TileIndex, TilePatch,
};
use proptest::collection::vec;
use proptest::prelude::*;

/// Cells as one look fills them: in runs, with single cells in between.
fn cells() -> impl Strategy<Value = Box<[i16; TILE_CELLS]>> {
    // Of few values, so that equal ones often come close to each other.
    let value = prop_oneof![any::<i16>(), -1..2_i16];
    vec((0..TILE_CELLS, 1..200_usize, value), 0..20).prop_map(|runs| {
        let mut cells = Box::new([0; TILE_CELLS]);
        for (start, length, value) in runs {
            cells[start..(start + length).min(TILE_CELLS)].fill(value);
        }
        cells
    })
}

fn patches() -> impl Strategy<Value = Vec<TilePatch>> {
    vec(cells().prop_map(|cells| TilePatch::from_cells(&cells)), 1..6)
}

fn tile() -> impl Strategy<Value = Tile> {
    let ends = prop::sample::select(vec![0, 1, -1, i32::MAX, i32::MIN, i32::MAX - 400]);
    vec((0..TILE_CELLS, prop_oneof![any::<i32>(), ends]), 0..100).prop_map(|values| {
        let mut cells = Box::new([0; TILE_CELLS]);
        for (at, value) in values {
            cells[at] = value;
        }
        Tile::new(cells)
    })
}

proptest! {
    #[test]
    fn what_was_added_is_taken_out_exactly(tile in tile(), patches in patches()) {
        let mut changed = tile.clone();
        for patch in &patches {
            changed.add(patch);
        }
        for patch in &patches {
            changed.subtract(patch);
        }
        prop_assert_eq!(changed, tile);
    }

    #[test]
    fn evidence_adds_up_in_any_order(
        tile in tile(),
        patches in patches(),
        order in any::<prop::sample::Index>(),
    ) {
        let mut forwards = tile.clone();
        for patch in &patches {
            forwards.add(patch);
        }
        // Backwards from some place on, one of them out and in again on the way.
        let mut otherwise = tile;
        let first = order.index(patches.len());
        for patch in patches[first..].iter().rev().chain(&patches[..first]) {
            otherwise.add(patch);
            otherwise.subtract(&patches[0]);
            otherwise.add(&patches[0]);
        }
        prop_assert_eq!(otherwise, forwards);
    }

    #[test]
    fn a_patch_from_cells_adds_those_cells(cells in cells()) {
        let patch = TilePatch::from_cells(&cells);
        let mut tile = Tile::default();
        tile.add(&patch);
        prop_assert!(tile.cells().iter().zip(cells.iter()).all(|(t, c)| *t == i32::from(*c)));
        prop_assert_eq!(tile.is_empty(), cells.iter().all(|c| *c == 0));
    }

    #[test]
    fn runs_from_cells_are_valid_and_as_long_as_can_be(cells in cells()) {
        let patch = TilePatch::from_cells(&cells);
        prop_assert_eq!(TilePatch::new(patch.runs().to_vec()), Ok(patch.clone()));
        for pair in patch.runs().windows(2) {
            let touching = pair[0].range().end == pair[1].range().start;
            prop_assert!(!touching || pair[0].value != pair[1].value);
        }
    }

    #[test]
    fn any_runs_are_answered_and_what_is_accepted_fits_the_tile(
        runs in vec((0..5000_u16, 0..5000_u16, -1..2_i16), 0..5)
    ) {
        let runs: Vec<EvidenceRun> = runs
            .into_iter()
            .map(|(start, length, value)| EvidenceRun { start, length, value })
            .collect();
        let accepted = TilePatch::new(runs.clone());
        let mut free_from = 0;
        let fits = runs.iter().all(|run| {
            let fits = run.range().start >= free_from
                && run.range().end <= TILE_CELLS
                && run.length > 0
                && run.value != 0;
            free_from = run.range().end;
            fits
        });
        prop_assert_eq!(accepted.is_ok(), fits);
        if let Ok(patch) = accepted {
            Tile::default().add(&patch);
        }
    }

    #[test]
    fn a_cell_knows_its_tile_and_the_tile_its_cell(
        column in -100_000_000..100_000_000_i32,
        row in -100_000_000..100_000_000_i32,
    ) {
        let cell = Cell { column, row };
        let (tile, offset) = cell.tile();
        prop_assert!(offset < TILE_CELLS);
        prop_assert_eq!(tile.cell(offset), cell);
    }

    #[test]
    fn a_point_lies_in_the_cell_that_holds_it(
        x in -1e5..1e5_f64,
        y in -1e5..1e5_f64,
        resolution in 0.01..1.0_f64,
    ) {
        let p = Point::new(x, y);
        let cell = Cell::holding(&p, resolution);
        let off = p - cell.centre(resolution);
        // Half a cell, and rounding at 100 km.
        prop_assert!(off.amax() <= 0.5 * resolution + 1e-9);
        prop_assert_eq!(Cell::holding(&cell.centre(resolution), resolution), cell);
    }

    #[test]
    fn more_evidence_is_more_probable(a in any::<i32>(), b in any::<i32>()) {
        let [a, b] = [a.min(b), a.max(b)].map(|steps| LogOdds(steps).probability());
        prop_assert!(a <= b && a >= 0.006 && b <= 0.994);
    }

    #[test]
    fn log_odds_survive_as_nats(steps in any::<i32>()) {
        prop_assert_eq!(LogOdds::from_nat(LogOdds(steps).nat()), LogOdds(steps));
    }
}

#[test]
fn tiles_count_from_the_origin_row_by_row_from_below() {
    let side = TILE_SIDE as i32;
    assert_eq!(Cell { column: 0, row: 0 }.tile(), (TileIndex { x: 0, y: 0 }, 0));
    assert_eq!(Cell { column: 1, row: 2 }.tile(), (TileIndex { x: 0, y: 0 }, 2 * TILE_SIDE + 1));
    assert_eq!(
        Cell { column: -1, row: -1 }.tile(),
        (TileIndex { x: -1, y: -1 }, TILE_CELLS - 1),
        "the cell left of and below the origin is the last of its tile"
    );
    assert_eq!(Cell { column: side, row: -side }.tile(), (TileIndex { x: 1, y: -1 }, 0));
}

#[test]
fn no_evidence_is_even_odds() {
    assert!((LogOdds::default().probability() - 0.5).abs() < 1e-15);
    assert!((LogOdds::from_nat(0.85).probability() - 0.7006).abs() < 1e-4);
}

#[test]
fn runs_that_make_no_patch_are_named() {
    let run = |start, length, value| EvidenceRun { start, length, value };
    let refused = |runs: &[EvidenceRun]| TilePatch::new(runs.to_vec()).err();
    assert_eq!(refused(&[]), None);
    assert_eq!(refused(&[run(0, 4096, 1)]), None);
    assert_eq!(refused(&[run(0, 2, 1), run(2, 0, 1)]), Some(RunError::Empty { index: 1 }));
    assert_eq!(refused(&[run(0, 2, 0)]), Some(RunError::Empty { index: 0 }));
    assert_eq!(refused(&[run(4000, 97, 1)]), Some(RunError::PastEnd { index: 0, end: 4097 }));
    assert_eq!(refused(&[run(0, 3, 1), run(2, 1, 1)]), Some(RunError::OutOfOrder { index: 1 }));
    assert_eq!(refused(&[run(9, 1, 1), run(3, 1, 1)]), Some(RunError::OutOfOrder { index: 1 }));
}
