//! From evidence to colours: one byte a cell, and the same tile ever coarser.

use mapfold_map::raster::{LogOdds, SensorClass, TILE_CELLS, TILE_SIDE, Tile};

use super::{LayerId, PICTURE_SIDE};

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

/// The step of each value of evidence, so that no cell needs an exponential.
#[derive(Debug)]
pub struct Shading {
    steps: Vec<u8>,
}

/// Values beyond this many log-odds steps read like this many.
const READ_LIMIT: i32 = (LogOdds::READ_LIMIT_NAT * LogOdds::STEPS_PER_NAT) as i32;

impl Default for Shading {
    fn default() -> Self {
        let steps = (-READ_LIMIT..=READ_LIMIT)
            .map(|v| (LogOdds(v).probability() * f64::from(STEPS - 1)).round() as u8)
            .collect();
        Self { steps }
    }
}

impl Shading {
    fn step(&self, value: i64) -> u8 {
        let clamped = value.clamp(i64::from(-READ_LIMIT), i64::from(READ_LIMIT));
        self.steps[(clamped + i64::from(READ_LIMIT)) as usize]
    }

    /// The shades of the layers of one place.
    pub fn shade(&self, layers: &[(LayerId, &Tile)]) -> Shades {
        let mut levels = vec![UNKNOWN; LEVELS_LENGTH];
        for (cell, shade) in levels[..TILE_CELLS].iter_mut().enumerate() {
            let (mut sum, mut known, mut scanned) = (0, false, false);
            for (class, tile) in layers {
                let value = tile.cells()[cell];
                sum += i64::from(value);
                known |= value != 0;
                scanned |= value != 0 && *class == LayerId::Sensor(SensorClass::Scanner);
            }
            if known {
                *shade = 1 + self.step(sum) + if scanned { 0 } else { STEPS };
            }
        }
        let mut finer_start = 0;
        let mut side = TILE_SIDE / 2;
        while side >= 1 {
            let coarser_start = finer_start + 4 * side * side;
            let (finer, coarser) = levels.split_at_mut(coarser_start);
            halve(&finer[finer_start..], &mut coarser[..side * side], side);
            finer_start = coarser_start;
            side /= 2;
        }
        Shades { levels: levels.into_boxed_slice() }
    }
}

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

/// Four pixels become one. An obstacle wins, the surest first, so that a wall one cell thick
/// stays a line at any zoom; else what is surest free; else nothing is known.
fn halve(finer: &[u8], coarser: &mut [u8], side: usize) {
    for (at, pixel) in coarser.iter_mut().enumerate() {
        let corner = 2 * (at / side) * (2 * side) + 2 * (at % side);
        let four = [corner, corner + 1, corner + 2 * side, corner + 2 * side + 1];
        *pixel = four.map(|i| finer[i]).into_iter().fold(UNKNOWN, stronger);
    }
}

fn stronger(a: u8, b: u8) -> u8 {
    if a == UNKNOWN || b == UNKNOWN {
        return a.max(b);
    }
    let step = |shade: u8| (shade - 1) % STEPS;
    let obstacle = step(a).max(step(b)) >= OCCUPIED_FROM;
    // Equal steps: the scanner's, which has the lower number.
    match (step(a).cmp(&step(b)), obstacle) {
        (std::cmp::Ordering::Equal, _) => a.min(b),
        (std::cmp::Ordering::Greater, true) | (std::cmp::Ordering::Less, false) => a,
        (std::cmp::Ordering::Less, true) | (std::cmp::Ordering::Greater, false) => b,
    }
}

/// The colours of all shades: red, green, blue; number 0 is transparent.
fn palette() -> Vec<u8> {
    let mut palette = vec![0, 0, 0];
    for [free, occupied] in [SCANNER_RAMP, SONAR_RAMP] {
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
