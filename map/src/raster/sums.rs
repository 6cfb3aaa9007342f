//! The sums of one slice of a tile: open while looks are still added, packed as long as none is.
//!
//! Packed, row by row from below, each cell is told by its difference to the one before: the sums of neighbours are
//! alike, and where nobody looked they are the same. A difference is a variable-length integer (seven
//! bits a byte, least first; small ones of either sign are short), a run of cells without one is a zero byte
//! and how many more there are. On recorded logs that is a fifth of the open tile, as much as a general
//! compressor gains at its fastest.

use std::sync::Arc;

use super::{TILE_CELLS, Tile};

/// The sums of one slice of a tile. Equal if the sums are, however they are held.
#[derive(Debug, Clone)]
pub enum Sums {
    /// To be added to.
    Open(Arc<Tile>),
    /// To be kept.
    Packed(Packed),
}

/// A tile in few bytes: equal bytes are equal sums.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Packed(Arc<[u8]>);

impl Sums {
    /// The sums, cell by cell.
    pub fn tile(&self) -> Arc<Tile> {
        match self {
            Self::Open(tile) => Arc::clone(tile),
            Self::Packed(packed) => Arc::new(packed.tile()),
        }
    }

    /// The sums, cell by cell, shared with nobody that did not share them before.
    pub(crate) fn into_tile(self) -> Arc<Tile> {
        match self {
            Self::Open(tile) => tile,
            Self::Packed(packed) => Arc::new(packed.tile()),
        }
    }

    /// The same in few bytes.
    #[must_use]
    pub fn packed(self) -> Self {
        match self {
            Self::Open(tile) => Self::Packed(Packed::new(&tile)),
            packed @ Self::Packed(_) => packed,
        }
    }

    /// The same, to be added to.
    pub(crate) fn open(self) -> Self {
        Self::Open(self.into_tile())
    }

    /// Bytes that the cells take in memory.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Open(tile) => size_of_val(tile.cells()),
            Self::Packed(Packed(bytes)) => bytes.len(),
        }
    }
}

impl PartialEq for Sums {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Open(a), Self::Open(b)) => Arc::ptr_eq(a, b) || a == b,
            (Self::Packed(a), Self::Packed(b)) => a == b,
            (Self::Open(tile), Self::Packed(packed)) | (Self::Packed(packed), Self::Open(tile)) => {
                packed.tile() == **tile
            }
        }
    }
}

impl Eq for Sums {}

impl Packed {
    /// Packs a tile.
    pub fn new(tile: &Tile) -> Self {
        let mut bytes = Vec::with_capacity(TILE_CELLS);
        let (mut before, mut same) = (0_i32, 0_u32);
        for cell in tile.cells() {
            let difference = cell.wrapping_sub(before);
            before = *cell;
            if difference == 0 {
                same += 1;
                continue;
            }
            end_run(&mut bytes, &mut same);
            push(
                &mut bytes,
                (difference.cast_unsigned() << 1) ^ (difference >> 31).cast_unsigned(),
            );
        }
        end_run(&mut bytes, &mut same);
        Self(bytes.into())
    }

    /// The tile.
    pub fn tile(&self) -> Tile {
        let mut cells = Box::new([0_i32; TILE_CELLS]);
        let (mut bytes, mut before, mut at) = (self.0.iter(), 0_i32, 0);
        while let Some(code) = pull(&mut bytes) {
            let (difference, length) = match code {
                0 => (0, pull(&mut bytes).unwrap_or(0) as usize + 1),
                code => ((code >> 1).cast_signed() ^ -(code & 1).cast_signed(), 1),
            };
            before = before.wrapping_add(difference);
            let end = TILE_CELLS.min(at + length);
            cells[at..end].fill(before);
            at = end;
        }
        Tile::new(cells)
    }
}

/// Writes a run of `same` cells that are as the one before, if it has any, and begins the next.
fn end_run(bytes: &mut Vec<u8>, same: &mut u32) {
    if let Some(more) = same.checked_sub(1) {
        bytes.push(0);
        push(bytes, more);
    }
    *same = 0;
}

fn push(bytes: &mut Vec<u8>, mut value: u32) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

fn pull<'a>(bytes: &mut impl Iterator<Item = &'a u8>) -> Option<u32> {
    let mut value = 0_u32;
    for place in (0..u32::BITS).step_by(7) {
        let byte = bytes.next()?;
        value |= u32::from(byte & 0x7f) << place;
        if *byte < 0x80 {
            break;
        }
    }
    Some(value)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn tile(runs: &[(usize, i32)]) -> Tile {
        let mut cells = Box::new([0; TILE_CELLS]);
        let mut at = 0;
        for (length, value) in runs {
            let end = TILE_CELLS.min(at + length);
            cells[at..end].fill(*value);
            at = end;
        }
        Tile::new(cells)
    }

    #[test]
    fn a_tile_of_one_value_is_a_few_bytes() {
        assert_eq!(Packed::new(&Tile::default()).0.len(), 3);
        assert_eq!(Packed::new(&tile(&[(TILE_CELLS, -40)])).0.len(), 4);
    }

    #[test]
    fn sums_are_equal_however_they_are_held() {
        let open = Sums::Open(Arc::new(tile(&[(100, 5), (7, -3)])));
        let packed = open.clone().packed();
        assert_eq!(open, packed);
        assert_eq!(packed.clone().open(), packed);
        assert_ne!(packed, Sums::Open(Arc::default()));
        assert_eq!(open.bytes(), 16_384);
        assert!(packed.bytes() < 16);
    }

    proptest! {
        #[test]
        fn what_is_packed_comes_back(runs in prop::collection::vec(
            (1..300_usize, prop_oneof![any::<i32>(), -200..200_i32, Just(0), Just(i32::MIN), Just(i32::MAX)]), 0..80,
        )) {
            let tile = tile(&runs);
            prop_assert_eq!(Packed::new(&tile).tile(), tile);
        }
    }
}
