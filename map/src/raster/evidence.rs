//! Patches of evidence: what one look adds to the cells that it saw.

use std::collections::BTreeMap;
use std::ops::Range;

use super::{SensorClass, TILE_CELLS, TileIndex};

/// Equal evidence for neighbouring cells of a tile, in the tile's cell order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EvidenceRun {
    /// Offset of the first cell.
    pub start: u16,
    /// Number of cells, at least 1.
    pub length: u16,
    /// Log-odds steps to add to each; not 0.
    pub value: i16,
}

impl EvidenceRun {
    /// The cells' offsets.
    pub fn range(&self) -> Range<usize> {
        usize::from(self.start)..usize::from(self.start) + usize::from(self.length)
    }
}

/// Why runs do not make a patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum RunError {
    /// A run of no cells, or of no evidence.
    #[error("run {index} is empty: its length and its value must not be 0")]
    Empty {
        /// Which run.
        index: usize,
    },
    /// A run leaves the tile.
    #[error("run {index} ends at cell {end} of a tile of {TILE_CELLS}")]
    PastEnd {
        /// Which run.
        index: usize,
        /// One past the last cell of the run.
        end: usize,
    },
    /// A run starts before its predecessor has ended.
    #[error("run {index} starts before its predecessor ends: runs ascend and do not overlap")]
    OutOfOrder {
        /// Which run.
        index: usize,
    },
}

/// What one look adds to one tile: ascending runs that do not overlap.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TilePatch {
    runs: Vec<EvidenceRun>,
}

impl TilePatch {
    /// Checks runs from outside.
    ///
    /// # Errors
    /// The first run that is empty, out of order or leaves the tile.
    pub fn new(runs: Vec<EvidenceRun>) -> Result<Self, RunError> {
        // Without a branch for each run: hardly ever is anything wrong.
        let (mut free_from, mut is_sound) = (0, true);
        for run in &runs {
            let start = u32::from(run.start);
            is_sound &= run.length != 0;
            is_sound &= run.value != 0;
            is_sound &= start >= free_from;
            free_from = start + u32::from(run.length);
        }
        if !is_sound || free_from as usize > TILE_CELLS {
            Self::check(&runs)?;
        }
        Ok(Self { runs })
    }

    /// The patch of runs that are known to ascend, not to overlap and not to be empty.
    pub(super) fn of_sound(runs: Vec<EvidenceRun>) -> Self {
        Self { runs }
    }

    /// The first run that is not as it must be.
    #[cold]
    fn check(runs: &[EvidenceRun]) -> Result<(), RunError> {
        let mut free_from = 0;
        for (index, run) in runs.iter().enumerate() {
            if run.length == 0 || run.value == 0 {
                return Err(RunError::Empty { index });
            }
            let Range { start, end } = run.range();
            if end > TILE_CELLS {
                return Err(RunError::PastEnd { index, end });
            }
            if start < free_from {
                return Err(RunError::OutOfOrder { index });
            }
            free_from = end;
        }
        Ok(())
    }

    /// The patch that adds `cells[i]` to cell `i`.
    pub fn from_cells(cells: &[i16; TILE_CELLS]) -> Self {
        let mut runs: Vec<EvidenceRun> = Vec::new();
        for (offset, value) in cells.iter().enumerate().filter(|(_, v)| **v != 0) {
            match runs.last_mut() {
                Some(run) if run.value == *value && run.range().end == offset => run.length += 1,
                _ => runs.push(EvidenceRun { start: offset as u16, length: 1, value: *value }),
            }
        }
        Self { runs }
    }

    /// The runs, ascending.
    pub fn runs(&self) -> &[EvidenceRun] {
        &self.runs
    }
}

/// What one look adds to the grid, for one class of sensor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EvidencePatch {
    /// The layer.
    pub class: SensorClass,
    /// The touched tiles.
    pub tiles: BTreeMap<TileIndex, TilePatch>,
}
