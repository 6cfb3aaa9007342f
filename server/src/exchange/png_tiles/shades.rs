//! From evidence to colours: one byte a cell, and the same tile ever coarser.
//!
//! The shades of each kind of evidence grow darker with the probability of an obstacle, in any
//! colour vision; obstacles of different kinds can be told apart in any.

use mapfold_map::raster::{LogOdds, Said, SensorClass, TILE_CELLS, TILE_SIDE, Tile, together};

use super::{LayerId, PICTURE_SIDE};
use crate::exchange::layers::layered;

/// Steps from certainly free to certainly occupied.
const STEPS: u8 = 16;
/// The first step that counts as an obstacle: probability 0.65 and more.
const OCCUPIED_FROM: u8 = 10;
/// Never seen: transparent.
const UNKNOWN: u8 = 0;
/// Colours (red, green, blue) of free and of occupied space, for what scanners speak of ...
const SCANNER_RAMP: [[u8; 3]; 2] = [[0xf3, 0xf6, 0xfa], [0x10, 0x1c, 0x33]];
/// ... and for what only sonar speaks of (the dark end is Okabe and Ito's vermilion, darkened).
const SONAR_RAMP: [[u8; 3]; 2] = [[0xfd, 0xf2, 0xe2], [0xa8, 0x4a, 0x00]];
/// ... and for what only the prior speaks of: no hue, since no robot saw it.
const PRIOR_RAMP: [[u8; 3]; 2] = [[0xf0, 0xf0, 0xf0], [0x80, 0x80, 0x80]];
/// All of them; where several speak, the first one's hue is taken.
const RAMPS: [[[u8; 3]; 2]; 3] = [SCANNER_RAMP, SONAR_RAMP, PRIOR_RAMP];
/// Shades there are: none, and the steps of each ramp.
const SHADES: usize = 1 + RAMPS.len() * STEPS as usize;

/// The place of a layer's ramp among all.
fn ramp(layer: LayerId) -> u8 {
    match layer {
        // What scanners saw often enough is what confirms a wall.
        LayerId::Sensor(SensorClass::Scanner) | LayerId::Walls => 0,
        LayerId::Sensor(SensorClass::Sonar) => 1,
        LayerId::Prior => 2,
    }
}

/// The ramp of a cell of which several layers may speak: that of the first.
fn first_to_speak(said: Said) -> u8 {
    let layer = match said {
        Said { walls, .. } if walls.0 != 0 => LayerId::Walls,
        Said { scanner: LogOdds(0), sonar: LogOdds(0), .. } => LayerId::Prior,
        Said { scanner: LogOdds(0), .. } => LayerId::Sensor(SensorClass::Sonar),
        Said { .. } => LayerId::Sensor(SensorClass::Scanner),
    };
    ramp(layer)
}

/// The step of each value of evidence, so that no cell needs an exponential.
#[derive(Debug)]
pub struct Shading {
    steps: Vec<u8>,
    /// Of two shades, the one that stays when they become one pixel.
    stronger: Box<[[u8; SHADES]; SHADES]>,
}

/// Values beyond this many log-odds steps read like this many.
const READ_LIMIT: i32 = (LogOdds::READ_LIMIT_NAT * LogOdds::STEPS_PER_NAT) as i32;

impl Default for Shading {
    fn default() -> Self {
        let steps = (-READ_LIMIT..=READ_LIMIT)
            .map(|v| (LogOdds(v).probability() * f64::from(STEPS - 1)).round() as u8)
            .collect();
        let mut table = Box::new([[UNKNOWN; SHADES]; SHADES]);
        for (a, row) in table.iter_mut().enumerate() {
            for (b, cell) in row.iter_mut().enumerate() {
                *cell = stronger(a as u8, b as u8);
            }
        }
        Self { steps, stronger: table }
    }
}

impl Shading {
    fn step(&self, value: i32) -> u8 {
        self.steps[(value.clamp(-READ_LIMIT, READ_LIMIT) + READ_LIMIT) as usize]
    }

    /// The shades of the layers of one place.
    pub fn shade(&self, layers: &[(LayerId, &Tile)]) -> Shades {
        let mut levels = vec![UNKNOWN; LEVELS_LENGTH];
        self.shade_cells(layers, &mut levels[..TILE_CELLS]);
        let mut finer_start = 0;
        let mut side = TILE_SIDE / 2;
        while side >= 1 {
            let coarser_start = finer_start + 4 * side * side;
            let (finer, coarser) = levels.split_at_mut(coarser_start);
            self.halve(&finer[finer_start..], &mut coarser[..side * side], side);
            finer_start = coarser_start;
            side /= 2;
        }
        Shades { levels: levels.into_boxed_slice() }
    }

    /// The shades of one place at [`COARSE_SIDE`] pixels along its side, the same as
    /// [`Shades::at_side`] has them, for pictures that need no others.
    pub(super) fn shade_coarsely(
        &self,
        layers: &[(LayerId, &Tile)],
    ) -> [u8; COARSE_SIDE * COARSE_SIDE] {
        let mut coarse = [UNKNOWN; COARSE_SIDE * COARSE_SIDE];
        if let [(layer, tile)] = layers {
            let blocks = tile.cells().chunks_exact(TILE_SIDE * BLOCK);
            for (rows, shades) in blocks.zip(coarse.chunks_exact_mut(COARSE_SIDE)) {
                self.shade_blocks(ramp(*layer), rows, shades);
            }
            return coarse;
        }
        let mut cells = vec![UNKNOWN; TILE_CELLS];
        let mut half = [UNKNOWN; TILE_CELLS / 4];
        self.shade_cells(layers, &mut cells);
        self.halve(&cells, &mut half, TILE_SIDE / 2);
        self.halve(&half, &mut coarse, COARSE_SIDE);
        coarse
    }

    /// A row of blocks. The surest obstacle of a block has its largest value, and the surest free
    /// cell its least: both are found without looking any value up, which takes a fourth of the time.
    fn shade_blocks(&self, ramp: u8, rows: &[i32], shades: &mut [u8]) {
        let (mut most, mut least) = ([i32::MIN; TILE_SIDE], [i32::MAX; TILE_SIDE]);
        for row in rows.chunks_exact(TILE_SIDE) {
            for ((most, least), value) in most.iter_mut().zip(&mut least).zip(row) {
                let is_known = *value != 0;
                *most = (*most).max(if is_known { *value } else { i32::MIN });
                *least = (*least).min(if is_known { *value } else { i32::MAX });
            }
        }
        let blocks = most.chunks_exact(BLOCK).zip(least.chunks_exact(BLOCK));
        for (shade, (most, least)) in shades.iter_mut().zip(blocks) {
            let most = most.iter().fold(i32::MIN, |a, b| a.max(*b));
            let least = least.iter().fold(i32::MAX, |a, b| a.min(*b));
            if least == i32::MAX && most == i32::MIN {
                continue;
            }
            let surest = self.step(most);
            let step = if surest >= OCCUPIED_FROM { surest } else { self.step(least) };
            *shade = 1 + ramp * STEPS + step;
        }
    }

    fn shade_cells(&self, layers: &[(LayerId, &Tile)], shades: &mut [u8]) {
        if let [(layer, tile)] = layers {
            // By far the most: no sums, and nothing to choose between.
            let first = 1 + ramp(*layer) * STEPS;
            for (shade, value) in shades.iter_mut().zip(tile.cells()) {
                let step = first + self.step(*value);
                *shade = if *value == 0 { UNKNOWN } else { step };
            }
            return;
        }
        let layers = layered(layers.iter().copied());
        for (shade, said) in shades.iter_mut().zip(layers.said(0..TILE_CELLS)) {
            if let Some(LogOdds(read)) = together(said) {
                *shade = 1 + first_to_speak(said) * STEPS + self.step(read);
            }
        }
    }

    /// Four pixels become one, of a square that has `side` pixels along its side then. An obstacle
    /// wins, the surest first, so that a wall one cell thick stays a line at any zoom; else what is
    /// surest free; else nothing is known.
    pub(super) fn halve(&self, finer: &[u8], coarser: &mut [u8], side: usize) {
        let pairs = finer.chunks_exact(4 * side).zip(coarser.chunks_exact_mut(side));
        for (rows, to) in pairs {
            let (one, other) = rows.split_at(2 * side);
            let four = one.chunks_exact(2).zip(other.chunks_exact(2));
            for (pixel, (a, b)) in to.iter_mut().zip(four) {
                *pixel = self.stronger(self.stronger(a[0], a[1]), self.stronger(b[0], b[1]));
            }
        }
    }

    fn stronger(&self, a: u8, b: u8) -> u8 {
        if a == b { a } else { self.stronger[usize::from(a)][usize::from(b)] }
    }
}

/// Pixels along a tile's side at the zoom level that coarser pictures are made of.
pub(super) const COARSE_SIDE: usize = TILE_SIDE / BLOCK;
/// Cells along the side of what becomes one such pixel.
const BLOCK: usize = 4;

/// Bytes of a tile at all its sizes: 64 x 64 + 32 x 32 + ... + 1.
const LEVELS_LENGTH: usize = (4 * TILE_CELLS - 1) / 3;

/// One tile's colours at 64, 32, ... 1 pixels along its side, row by row from below.
#[derive(Debug)]
pub struct Shades {
    levels: Box<[u8]>,
}

impl Shades {
    /// The tile at `side` pixels along its side, a power of two up to 64.
    pub(super) fn at_side(&self, side: usize) -> &[u8] {
        let start = (4 * TILE_CELLS - 4 * side * side) / 3;
        &self.levels[start..start + side * side]
    }
}

/// Of two shades, the one that stays when they become one pixel.
fn stronger(a: u8, b: u8) -> u8 {
    if a == UNKNOWN || b == UNKNOWN {
        return a.max(b);
    }
    let step = |shade: u8| (shade - 1) % STEPS;
    let obstacle = step(a).max(step(b)) >= OCCUPIED_FROM;
    // Equal steps: the one of the first ramp, which has the lower number.
    match (step(a).cmp(&step(b)), obstacle) {
        (std::cmp::Ordering::Equal, _) => a.min(b),
        (std::cmp::Ordering::Greater, true) | (std::cmp::Ordering::Less, false) => a,
        (std::cmp::Ordering::Less, true) | (std::cmp::Ordering::Greater, false) => b,
    }
}

/// The colours of all shades: red, green, blue; number 0 is transparent.
fn palette() -> Vec<u8> {
    let mut palette = vec![0, 0, 0];
    for [free, occupied] in RAMPS {
        for step in 0..STEPS {
            for (from, to) in free.into_iter().zip(occupied) {
                let (from, to, step) = (i32::from(from), i32::from(to), i32::from(step));
                palette.push((from + (to - from) * step / i32::from(STEPS - 1)) as u8);
            }
        }
    }
    palette
}

/// Writes a picture as a PNG with a palette.
pub(super) fn encode(pixels: &[u8]) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, PICTURE_SIDE as u32, PICTURE_SIDE as u32);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_palette(palette());
    encoder.set_trns(vec![0_u8]);
    encoder.set_compression(png::Compression::Balanced);
    encoder.set_filter(png::Filter::NoFilter);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod colours;
