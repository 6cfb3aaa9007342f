//! Where one look's evidence comes together before it becomes a patch.

use std::collections::BTreeMap;

use mapfold_map::raster::{
    Cell, EvidencePatch, LogOdds, SensorClass, TILE_CELLS, TileIndex, TilePatch,
};

/// Most evidence for "free" that one look may give a cell, nat: all its beams share one pose error.
const FREE_MOST_NAT: f32 = -2.0;
/// Most evidence for "occupied" that one look may give a cell, nat.
const OCCUPIED_MOST_NAT: f32 = 3.0;

type Values = Box<[f32; TILE_CELLS]>;

/// Evidence in nats, tile by tile. Reused from look to look, it allocates nothing once warm.
#[derive(Debug, Default)]
pub struct Canvas {
    tiles: BTreeMap<TileIndex, Values>,
    spare: Vec<Values>,
    /// The tile that was last painted on, out of `tiles`: neighbours are painted one after another.
    current: Option<(TileIndex, Values)>,
}

impl Canvas {
    fn cell(&mut self, cell: Cell) -> &mut f32 {
        let (index, offset) = cell.tile();
        let values = match self.current.take() {
            Some((at, values)) if at == index => values,
            other => {
                if let Some((at, values)) = other {
                    self.tiles.insert(at, values);
                }
                self.tiles.remove(&index).unwrap_or_else(|| {
                    self.spare.pop().unwrap_or_else(|| Box::new([0.0; TILE_CELLS]))
                })
            }
        };
        let (_, values) = self.current.insert((index, values));
        &mut values[offset]
    }

    /// A cell that was seen free: it counts once a look, however many beams cross it, and not at
    /// all where a beam of the look ended (a hit wins).
    pub(super) fn free_once(&mut self, cell: Cell, nat: f32) {
        let value = self.cell(cell);
        if *value <= 0.0 {
            *value = value.min(nat);
        }
    }

    /// A cell in which a beam ended: beams add up, and outdo "free".
    pub(super) fn hit(&mut self, cell: Cell, nat: f32) {
        let value = self.cell(cell);
        *value = value.max(0.0) + nat;
    }

    /// Evidence of either sign that simply adds up.
    pub(super) fn add(&mut self, cell: Cell, nat: f32) {
        *self.cell(cell) += nat;
    }

    /// Takes the evidence out as a patch, capped and rounded to `step` (a multiple of the log-odds
    /// step), and leaves the canvas clean.
    pub(super) fn take(&mut self, class: SensorClass, step: LogOdds) -> EvidencePatch {
        if let Some((at, values)) = self.current.take() {
            self.tiles.insert(at, values);
        }
        let mut patch = EvidencePatch { class, tiles: BTreeMap::new() };
        let mut rounded = [0_i16; TILE_CELLS];
        let step_nat = step.nat() as f32;
        for (index, mut values) in std::mem::take(&mut self.tiles) {
            for (steps, value) in rounded.iter_mut().zip(values.iter_mut()) {
                let capped = value.clamp(FREE_MOST_NAT, OCCUPIED_MOST_NAT);
                *steps = ((capped / step_nat).round() as i16) * step.0 as i16;
                *value = 0.0;
            }
            let cells = TilePatch::from_cells(&rounded);
            if !cells.runs().is_empty() {
                patch.tiles.insert(index, cells);
            }
            self.spare.push(values);
        }
        patch
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn painted(canvas: &mut Canvas) -> Vec<(u16, i16)> {
        let patch = canvas.take(SensorClass::Scanner, LogOdds(1));
        let runs = patch.tiles.values().flat_map(|tile| tile.runs().to_vec());
        runs.map(|run| (run.start, run.value)).collect()
    }

    #[test]
    fn a_hit_outdoes_free_in_whatever_order_they_come() {
        let cell = Cell { column: 3, row: 0 };
        let mut canvas = Canvas::default();
        canvas.free_once(cell, -0.4);
        canvas.free_once(cell, -0.4);
        assert_eq!(painted(&mut canvas), [(3, -40)]);
        canvas.free_once(cell, -0.4);
        canvas.hit(cell, 0.5);
        canvas.hit(cell, 0.25);
        canvas.free_once(cell, -0.4);
        assert_eq!(painted(&mut canvas), [(3, 75)]);
        assert!(painted(&mut canvas).is_empty());
    }

    #[test]
    fn one_look_cannot_say_more_than_its_cap() {
        let mut canvas = Canvas::default();
        for _ in 0..100 {
            canvas.hit(Cell { column: 1, row: 0 }, 0.85);
            canvas.add(Cell { column: 9, row: 0 }, -0.4);
        }
        assert_eq!(painted(&mut canvas), [(1, 300), (9, -200)]);
    }
}
