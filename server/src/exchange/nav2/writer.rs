//! A level's raster, ready to be written as a description and an image.

use std::io::{self, Write};

use mapfold_map::raster::{LogOdds, TILE_SIDE, TileIndex, together};
use mapfold_schema::v1::Bounds;

use super::cells::UNKNOWN as UNKNOWN_VALUE;
use super::description::Description;
use super::image::ImageFormat;
use super::{Mode, pgm, png_image};
use crate::exchange::layers::{Layer, Raster, layered_at};

/// Most pixels of an image: 1.6 km by 1.6 km at 10 cm, and what readers still load.
pub const PIXELS_MAX: u64 = 16_384 * 16_384;

const SIDE: i64 = TILE_SIDE as i64;
/// Of trinary images. The grey 205 of an unknown cell reads as occupancy 0.19608, which must stay
/// unknown: hence 0.196 (Nav2's own saver writes the same).
const OCCUPIED_THRESH: f64 = 0.65;
const FREE_THRESH: f64 = 0.196;
const FREE: u8 = 254;
const OCCUPIED: u8 = 0;
const UNKNOWN: u8 = 205;
/// Of raw images: nothing is known.
const RAW_UNKNOWN: u8 = 255;

/// Why a map has no image.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Nav2Error {
    /// There is no evidence at all.
    #[error("the level holds no evidence in this layer yet, so there is nothing to draw")]
    Empty,
    /// There is no evidence in the rectangle.
    #[error("there is no evidence in the rectangle that `bbox` asks for")]
    EmptyBox,
    /// The tiles lie too far apart for one image, or the rectangle is too large.
    #[error(
        "an image of {columns} by {rows} pixels is larger than the {PIXELS_MAX} that readers load: ask \
         for a part with `bbox`, min_x,min_y,max_x,max_y in metres; all of it lies within \
         {min_x_m},{min_y_m},{max_x_m},{max_y_m}",
        min_x_m = bounds.min_x_m, min_y_m = bounds.min_y_m,
        max_x_m = bounds.max_x_m, max_y_m = bounds.max_y_m
    )]
    TooLarge {
        /// Pixels across.
        columns: u64,
        /// Pixels down.
        rows: u64,
        /// What the evidence covers, or the rectangle that was asked for.
        bounds: Bounds,
    },
    /// A PGM cannot be transparent.
    #[error("mode scale marks unknown cells by transparency, which PGM lacks: ask for a PNG")]
    NoTransparency,
}

/// What of a map is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Content {
    /// Which evidence.
    pub layer: Layer,
    /// All cells that touch this rectangle; all tiles that hold evidence if absent.
    pub bbox: Option<Bounds>,
}

impl Default for Content {
    /// Everything.
    fn default() -> Self {
        Self { layer: Layer::All, bbox: None }
    }
}

/// How a map is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Style {
    mode: Mode,
    format: ImageFormat,
}

impl Default for Style {
    /// A trinary PGM.
    fn default() -> Self {
        Self { mode: Mode::Trinary, format: ImageFormat::Pgm }
    }
}

impl Style {
    /// In `mode` as `format`; if that is not said, as PNG where there must be transparency and as
    /// PGM elsewhere.
    ///
    /// # Errors
    /// A PGM that would have to be transparent.
    pub fn new(mode: Mode, format: Option<ImageFormat>) -> Result<Self, Nav2Error> {
        match (mode, format) {
            (Mode::Scale, Some(ImageFormat::Pgm)) => Err(Nav2Error::NoTransparency),
            (Mode::Scale, None) => Ok(Self { mode, format: ImageFormat::Png }),
            (_, format) => Ok(Self { mode, format: format.unwrap_or(ImageFormat::Pgm) }),
        }
    }

    /// How the image is written.
    pub fn format(self) -> ImageFormat {
        self.format
    }
}

/// A map's raster, ready to be written.
pub struct Nav2Map<'a> {
    raster: &'a dyn Raster,
    resolution_m: f64,
    layer: Layer,
    style: Style,
    window: Window,
}

/// The cells of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Window {
    left: i64,
    bottom: i64,
    columns: usize,
    rows: usize,
}

impl<'a> Nav2Map<'a> {
    /// What `content` names of a raster with cells of `resolution_m` metres.
    ///
    /// # Errors
    /// No evidence there, or an extent that is too large for one image.
    pub fn new(
        raster: &'a dyn Raster,
        resolution_m: f64,
        content: Content,
        style: Style,
    ) -> Result<Self, Nav2Error> {
        let Content { layer, bbox } = content;
        let window = match bbox {
            None => Window::of_tiles(raster, layer, resolution_m)?,
            Some(bbox) => Window::of_box(raster, layer, resolution_m, bbox)?,
        };
        Ok(Self { raster, resolution_m, layer, style, window })
    }

    /// How the image is written.
    pub fn format(&self) -> ImageFormat {
        self.style.format
    }

    /// The description that readers load first, of the image that lies beside it as `image`.
    pub fn description(&self, image: &str) -> Description {
        let (occupied_thresh, free_thresh) = match self.style.mode {
            // All greys lie between, so that each is read back as it was.
            Mode::Scale => (1.0, 0.0),
            Mode::Trinary | Mode::Raw => (OCCUPIED_THRESH, FREE_THRESH),
        };
        let origin = |cells: i64| cells as f64 * self.resolution_m;
        Description {
            image: image.to_owned(),
            resolution_m: self.resolution_m,
            origin: [origin(self.window.left), origin(self.window.bottom), 0.0],
            negate: false,
            occupied_thresh,
            free_thresh,
            mode: self.style.mode,
        }
    }

    /// Writes the image, the topmost row of cells first.
    ///
    /// # Errors
    /// What `to` cannot take.
    pub fn write_image(&self, to: &mut impl Write) -> io::Result<()> {
        let Window { columns, rows, .. } = self.window;
        match self.style.format {
            ImageFormat::Pgm => {
                pgm::write_head(to, columns, rows)?;
                self.write_rows(to)
            }
            ImageFormat::Png => {
                let alpha = self.style.mode == Mode::Scale;
                let mut writer = png_image::writer(to, columns, rows, alpha).map_err(io_error)?;
                let mut pixels = writer.stream_writer().map_err(io_error)?;
                self.write_rows(&mut pixels)?;
                pixels.finish().map_err(io_error)
            }
        }
    }

    fn write_rows(&self, to: &mut impl Write) -> io::Result<()> {
        let Window { bottom, columns, rows, .. } = self.window;
        let greys = Greys::new(self.style.mode);
        let mut band = vec![None; columns * TILE_SIDE];
        let mut line = Vec::with_capacity(columns * 2);
        let above = bottom + rows as i64;
        for tile_row in (bottom.div_euclid(SIDE)..=(above - 1).div_euclid(SIDE)).rev() {
            self.read_tile_row(tile_row, &mut band);
            let lowest = tile_row * SIDE;
            for row in (lowest.max(bottom)..(lowest + SIDE).min(above)).rev() {
                let start = (row - lowest) as usize * columns;
                line.clear();
                for read in &band[start..start + columns] {
                    greys.write(*read, &mut line);
                }
                to.write_all(&line)?;
            }
        }
        Ok(())
    }

    /// Reads the layers of one row of tiles together, row by row of cells from below.
    fn read_tile_row(&self, tile_row: i64, band: &mut [Option<LogOdds>]) {
        band.fill(None);
        let Window { left, columns, .. } = self.window;
        let right = left + columns as i64;
        for tile_column in left.div_euclid(SIDE)..=(right - 1).div_euclid(SIDE) {
            let Some(tile) = tile_at(tile_column, tile_row) else { continue };
            let first = tile_column * SIDE;
            let (from, to) = (left.max(first), right.min(first + SIDE));
            let layers = layered_at(self.raster, tile, self.layer.parts());
            if layers.is_empty() {
                continue;
            }
            for row in 0..TILE_SIDE {
                let start = row * columns + (from - left) as usize;
                let cells = row * TILE_SIDE + (from - first) as usize;
                let cells = cells..cells + (to - from) as usize;
                for (read, said) in band[start..].iter_mut().zip(layers.said(cells)) {
                    *read = together(said);
                }
            }
        }
    }
}

fn tile_at(column: i64, row: i64) -> Option<TileIndex> {
    Some(TileIndex { x: i32::try_from(column).ok()?, y: i32::try_from(row).ok()? })
}

fn io_error(error: png::EncodingError) -> io::Error {
    match error {
        png::EncodingError::IoError(error) => error,
        other => io::Error::other(other),
    }
}

impl Window {
    /// All tiles that hold evidence.
    fn of_tiles(raster: &dyn Raster, layer: Layer, resolution_m: f64) -> Result<Self, Nav2Error> {
        let tiles = layer.parts().flat_map(|part| raster.tiles_of(part)).map(|(tile, _)| tile);
        let reach = tiles.fold(None, |reach: Option<[i32; 4]>, TileIndex { x, y }| {
            let [left, bottom, right, top] = reach.unwrap_or([x, y, x, y]);
            Some([left.min(x), bottom.min(y), right.max(x), top.max(y)])
        });
        let Some([left, bottom, right, top]) = reach.map(|r| r.map(i64::from)) else {
            return Err(Nav2Error::Empty);
        };
        Self::of_cells(
            [left * SIDE, bottom * SIDE, (right + 1) * SIDE, (top + 1) * SIDE],
            resolution_m,
        )
    }

    /// All cells that touch a rectangle.
    fn of_box(
        raster: &dyn Raster,
        layer: Layer,
        resolution_m: f64,
        bbox: Bounds,
    ) -> Result<Self, Nav2Error> {
        let from = |min_m: f64| (min_m / resolution_m).floor() as i64;
        let to = |min_m: f64, max_m: f64| {
            ((max_m / resolution_m).ceil() as i64).max(from(min_m).saturating_add(1))
        };
        let window = Self::of_cells(
            [
                from(bbox.min_x_m),
                from(bbox.min_y_m),
                to(bbox.min_x_m, bbox.max_x_m),
                to(bbox.min_y_m, bbox.max_y_m),
            ],
            resolution_m,
        )?;
        // No wider than an image may be, so this is no long way.
        let (left, right) = (window.left, window.left.saturating_add(window.columns as i64 - 1));
        let (bottom, top) = (window.bottom, window.bottom.saturating_add(window.rows as i64 - 1));
        let known = (left.div_euclid(SIDE)..=right.div_euclid(SIDE)).any(|column| {
            let first = tile_at(column, bottom.div_euclid(SIDE));
            let last = tile_at(column, top.div_euclid(SIDE));
            first.zip(last).is_some_and(|(first, last)| {
                layer.parts().any(|part| raster.between(part, first, last).next().is_some())
            })
        });
        if known { Ok(window) } else { Err(Nav2Error::EmptyBox) }
    }

    fn of_cells(
        [left, bottom, right, top]: [i64; 4],
        resolution_m: f64,
    ) -> Result<Self, Nav2Error> {
        let (columns, rows) = (right.abs_diff(left), top.abs_diff(bottom));
        if columns.saturating_mul(rows) > PIXELS_MAX {
            let metres = |cells: i64| cells as f64 * resolution_m;
            let bounds = Bounds {
                min_x_m: metres(left),
                min_y_m: metres(bottom),
                max_x_m: metres(right),
                max_y_m: metres(top),
            };
            return Err(Nav2Error::TooLarge { columns, rows, bounds });
        }
        Ok(Self { left, bottom, columns: columns as usize, rows: rows as usize })
    }
}

/// The greys of evidence: by log-odds step, so that no cell needs an exponential.
struct Greys {
    mode: Mode,
    occupied_from: i32,
    free_to: i32,
    /// Occupancy in per cent of each step within what is read.
    values: Vec<u8>,
}

/// Values beyond this many log-odds steps read like this many.
const READ_LIMIT: i32 = (LogOdds::READ_LIMIT_NAT * LogOdds::STEPS_PER_NAT) as i32;

impl Greys {
    fn new(mode: Mode) -> Self {
        let steps = |p: f64| (p / (1.0 - p)).ln() * LogOdds::STEPS_PER_NAT;
        // As sure as reading gets is 100 or 0: readers take nothing less for an obstacle.
        let p = |step| LogOdds(step).probability();
        let (least, most) = (p(-READ_LIMIT), p(READ_LIMIT));
        let value = |step| ((p(step) - least) / (most - least) * 100.0).round() as u8;
        Self {
            mode,
            occupied_from: steps(OCCUPIED_THRESH).ceil() as i32,
            free_to: steps(FREE_THRESH).floor() as i32,
            values: (-READ_LIMIT..=READ_LIMIT).map(value).collect(),
        }
    }

    fn trinary(&self, read: Option<LogOdds>) -> u8 {
        match read {
            Some(LogOdds(step)) if step >= self.occupied_from => OCCUPIED,
            Some(LogOdds(step)) if step <= self.free_to => FREE,
            _ => UNKNOWN,
        }
    }

    /// Occupancy in per cent, or -1.
    fn value(&self, read: Option<LogOdds>) -> i8 {
        let Some(LogOdds(step)) = read else { return UNKNOWN_VALUE };
        self.values[(step.clamp(-READ_LIMIT, READ_LIMIT) + READ_LIMIT) as usize] as i8
    }

    fn write(&self, read: Option<LogOdds>, line: &mut Vec<u8>) {
        match (self.mode, self.value(read)) {
            (Mode::Trinary, _) => line.push(self.trinary(read)),
            (Mode::Raw, value) => line.push(u8::try_from(value).unwrap_or(RAW_UNKNOWN)),
            (Mode::Scale, UNKNOWN_VALUE) => line.extend([UNKNOWN, 0]),
            (Mode::Scale, value) => {
                let bright = f64::from(100 - value) / 100.0;
                line.extend([(bright * 255.0).round() as u8, u8::MAX]);
            }
        }
    }
}

#[cfg(test)]
mod tests;
