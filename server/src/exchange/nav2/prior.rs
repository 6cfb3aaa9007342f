//! A map of another program as evidence on the grid of a level.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use mapfold_map::raster::{LogOdds, TILE_CELLS, TILE_SIDE, Tile, TileIndex};

use super::cells::Cells;
use super::description::Description;
use super::refusal::{ImportError, Warning};

/// What an occupied cell of the prior says at full trust, nat.
pub const OCCUPIED_NAT: f64 = 4.0;
/// What a free cell of the prior says at full trust, nat.
pub const FREE_NAT: f64 = -0.5;
/// Pixels may be this many times finer or coarser than the level's cells.
const RATIO_MAX: f64 = 32.0;
/// Most cells of the level under an image, known or not.
const CELLS_MAX: f64 = (1_u64 << 26) as f64;
/// Farthest from the level's origin that a prior reaches, metres.
const REACH_M: f64 = 100_000.0;
/// By how much of a cell an image may lie beside the grid and still count as lying on it.
const ON_GRID: f64 = 1e-6;

/// How much a prior is trusted, from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trust(f64);

impl Trust {
    /// What a prior gets if nobody says: sensors overturn a wrong wall within some looks.
    pub const STANDARD: Self = Self(0.5);

    /// From 0 (say nothing) to 1; `None` for anything else.
    pub fn new(trust: f64) -> Option<Self> {
        (0.0..=1.0).contains(&trust).then_some(Self(trust))
    }

    /// The number.
    pub fn get(self) -> f64 {
        self.0
    }
}

/// Evidence on the grid of a level. A tile without any is not in it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Prior {
    /// The tiles.
    pub tiles: BTreeMap<TileIndex, Tile>,
}

impl Prior {
    /// Puts cells on a grid of `resolution_m`.
    ///
    /// Where pixels and cells coincide (the same resolution, no yaw, an origin on the grid) each
    /// pixel is a cell. Otherwise each cell is looked up in the image at a lattice of places no
    /// farther apart than half a pixel, so that none is missed: the surest obstacle among them
    /// wins; without one the cell gets their mean, what is unknown counting as nothing.
    ///
    /// # Errors
    /// Pixels far smaller or larger than cells; an extent that no building has.
    pub fn on_grid(
        cells: &Cells,
        description: &Description,
        resolution_m: f64,
        trust: Trust,
    ) -> Result<(Self, Vec<Warning>), ImportError> {
        let placing = Placing::new(cells, description, resolution_m)?;
        let mut warnings = Vec::new();
        if description.origin[2] != 0.0 {
            warnings.push(Warning::Turned(description.origin[2]));
        }
        if placing.samples > 1 {
            warnings.push(Warning::Resampled {
                image_m: description.resolution_m,
                level_m: resolution_m,
            });
        }
        let says = evidence_of_values(trust);
        let mut prior = Self::default();
        for x in placing.tiles_across.clone() {
            for y in placing.tiles_up.clone() {
                let tile = placing.tile(cells, TileIndex { x, y }, &says);
                if !tile.is_empty() {
                    prior.tiles.insert(TileIndex { x, y }, tile);
                }
            }
        }
        Ok((prior, warnings))
    }
}

/// What an occupancy from 0 to 100 says, in log-odds steps: its log-odds, but never more than an
/// occupied nor less than a free cell does.
fn evidence_of_values(trust: Trust) -> [i32; 101] {
    std::array::from_fn(|value| {
        let p = value as f64 / 100.0;
        let nat = (p / (1.0 - p)).ln().clamp(FREE_NAT, OCCUPIED_NAT);
        (nat * trust.0 * LogOdds::STEPS_PER_NAT).round() as i32
    })
}

/// Where an image lies on a level's grid.
struct Placing {
    /// Lower left corner of the image, in cells of the level.
    corner: [f64; 2],
    /// Sine and cosine of its turn.
    turn: (f64, f64),
    /// Cells of the level per pixel.
    ratio: f64,
    /// Places along a cell's side at which the image is looked up.
    samples: u32,
    tiles_across: RangeInclusive<i32>,
    tiles_up: RangeInclusive<i32>,
}

impl Placing {
    fn new(cells: &Cells, from: &Description, resolution_m: f64) -> Result<Self, ImportError> {
        let ratio = from.resolution_m / resolution_m;
        if !(1.0 / RATIO_MAX..=RATIO_MAX).contains(&ratio) {
            return Err(ImportError::Resolution {
                image_m: from.resolution_m,
                level_m: resolution_m,
                finest_m: resolution_m / RATIO_MAX,
                coarsest_m: resolution_m * RATIO_MAX,
            });
        }
        let [x, y, yaw] = from.origin;
        let turn = yaw.sin_cos();
        let (width, height) = (f64::from(cells.columns), f64::from(cells.rows));
        let corner = [x / resolution_m, y / resolution_m];
        let at = |across: f64, up: f64| {
            let (sin, cos) = turn;
            [
                corner[0] + ratio * (cos * across - sin * up),
                corner[1] + ratio * (sin * across + cos * up),
            ]
        };
        let corners = [at(0.0, 0.0), at(width, 0.0), at(0.0, height), at(width, height)];
        let least = |axis: usize| corners.iter().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
        let most = |axis: usize| corners.iter().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max);
        let (left, right, below, above) = (least(0), most(0), least(1), most(1));
        let far = corners.iter().flatten().any(|c| (c * resolution_m).abs() > REACH_M);
        if far || (right - left) * (above - below) > CELLS_MAX {
            return Err(ImportError::Extent {
                min_x_m: left * resolution_m,
                min_y_m: below * resolution_m,
                max_x_m: right * resolution_m,
                max_y_m: above * resolution_m,
            });
        }
        let beside = corner.map(|c| (c - c.round()).abs());
        let coincide = yaw == 0.0
            && (ratio - 1.0).abs() * width.max(height) < ON_GRID
            && beside.iter().all(|b| *b < ON_GRID);
        let samples = if coincide { 1 } else { (2.0 / ratio).ceil().max(2.0) as u32 };
        let tiles = |from: f64, to: f64| {
            let side = TILE_SIDE as f64;
            // A rim of a cell, so that rounding loses none; tiles without evidence are dropped.
            ((from - 1.0) / side).floor() as i32..=((to + 1.0) / side).floor() as i32
        };
        let (tiles_across, tiles_up) = (tiles(left, right), tiles(below, above));
        Ok(Self { corner, turn, ratio, samples, tiles_across, tiles_up })
    }

    fn tile(&self, cells: &Cells, tile: TileIndex, says: &[i32; 101]) -> Tile {
        let mut evidence = Box::new([0; TILE_CELLS]);
        let first = |index: i32| i64::from(index) * TILE_SIDE as i64;
        for (offset, cell) in evidence.iter_mut().enumerate() {
            let column = first(tile.x) + (offset % TILE_SIDE) as i64;
            let row = first(tile.y) + (offset / TILE_SIDE) as i64;
            *cell = self.cell(cells, column as f64, row as f64, says);
        }
        Tile::new(evidence)
    }

    fn cell(&self, cells: &Cells, column: f64, row: f64, says: &[i32; 101]) -> i32 {
        let (mut sum, mut surest) = (0_i64, 0);
        for up in 0..self.samples {
            for across in 0..self.samples {
                let inside = |step: u32| (f64::from(step) + 0.5) / f64::from(self.samples);
                let value = self.value_near(cells, column + inside(across), row + inside(up));
                let said = value.map_or(0, |value| says[value]);
                surest = surest.max(said);
                sum += i64::from(said);
            }
        }
        if surest > 0 {
            return surest;
        }
        let count = f64::from(self.samples * self.samples);
        (sum as f64 / count).round() as i32
    }

    /// The occupancy at a place of the level, in cells; `None` beside the image or if unknown.
    fn value_near(&self, cells: &Cells, x: f64, y: f64) -> Option<usize> {
        let (dx, dy) = (x - self.corner[0], y - self.corner[1]);
        let (sin, cos) = self.turn;
        let across = ((cos * dx + sin * dy) / self.ratio).floor();
        let up = ((cos * dy - sin * dx) / self.ratio).floor();
        let inside = across >= 0.0
            && up >= 0.0
            && across < f64::from(cells.columns)
            && up < f64::from(cells.rows);
        let index = || up as usize * cells.columns as usize + across as usize;
        if inside { usize::try_from(cells.values[index()]).ok() } else { None }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use mapfold_map::raster::Cell;

    use super::super::Mode;
    use super::*;

    fn description(resolution_m: f64, origin: [f64; 3]) -> Description {
        Description {
            image: "map.pgm".into(),
            resolution_m,
            origin,
            negate: false,
            occupied_thresh: 0.65,
            free_thresh: 0.196,
            mode: Mode::Trinary,
        }
    }

    /// `#` occupied, `.` free, ` ` unknown; as on the page, the topmost row first.
    fn drawn(picture: &[&str]) -> Cells {
        let values = picture.iter().rev().flat_map(|row| row.bytes()).map(|byte| match byte {
            b'#' => 100,
            b'.' => 0,
            _ => -1,
        });
        let columns = picture[0].len() as u32;
        Cells { columns, rows: picture.len() as u32, values: values.collect() }
    }

    fn evidence(prior: &Prior, column: i32, row: i32) -> i32 {
        let (tile, offset) = Cell { column, row }.tile();
        prior.tiles.get(&tile).map_or(0, |tile| tile.cells()[offset])
    }

    fn seen(
        prior: &Prior,
        columns: std::ops::Range<i32>,
        rows: std::ops::Range<i32>,
    ) -> Vec<String> {
        let mark = |value: i32| match value {
            1.. => '#',
            0 => ' ',
            _ => '.',
        };
        rows.rev()
            .map(|row| columns.clone().map(|c| mark(evidence(prior, c, row))).collect())
            .collect()
    }

    const L: [&str; 4] = ["#.. ", "#.. ", "#...", "####"];

    fn on(cells: &Cells, description: &Description) -> (Prior, Vec<Warning>) {
        Prior::on_grid(cells, description, 0.05, Trust::STANDARD).unwrap()
    }

    #[test]
    fn a_picture_on_the_grid_is_taken_cell_by_cell() {
        let (prior, warnings) = on(&drawn(&L), &description(0.05, [-3.25, 0.1, 0.0]));
        assert_eq!(warnings, []);
        assert_eq!(seen(&prior, -65..-61, 2..6), L);
        assert_eq!(evidence(&prior, -65, 2), 200, "+4.0 nat at a trust of a half");
        assert_eq!(evidence(&prior, -64, 3), -25, "-0.5 nat at a trust of a half");
        assert_eq!(evidence(&prior, -62, 5), 0);
        assert_eq!(prior.tiles.len(), 2, "the picture lies across the seam of two tiles");
    }

    #[test]
    fn an_obstacle_keeps_its_place_to_half_a_cell_where_pixels_lie_across_cells() {
        let (prior, warnings) = on(&drawn(&L), &description(0.05, [0.025, 0.025, 0.0]));
        assert!(matches!(warnings[..], [Warning::Resampled { .. }]));
        // Each obstacle's pixel covers a quarter of four cells: all of them are obstacles.
        assert_eq!(seen(&prior, 0..5, 0..5), ["##.. ", "##.. ", "##...", "#####", "#####"]);
    }

    #[test]
    fn yaw_turns_the_picture_about_its_lower_left_corner() {
        // A quarter turn to the left: what went right goes up, what went up goes left.
        let (prior, warnings) = on(&drawn(&L), &description(0.05, [0.0, 0.0, FRAC_PI_2]));
        assert!(warnings.contains(&Warning::Turned(FRAC_PI_2)));
        assert_eq!(seen(&prior, -4..0, 0..4), ["  .#", "...#", "...#", "####"]);
        // By 30 degrees a wall stays a wall: no way through it from cell to neighbouring cell.
        let wall = Cells { columns: 100, rows: 1, values: vec![100; 100] };
        let (prior, _) = on(&wall, &description(0.05, [1.0, 1.0, 0.5]));
        for step in 0..1000 {
            let along = f64::from(step) * 0.005;
            let (sin, cos) = 0.5_f64.sin_cos();
            let (x, y) = (1.0 + along * cos - 0.025 * sin, 1.0 + along * sin + 0.025 * cos);
            let value = evidence(&prior, (x / 0.05).floor() as i32, (y / 0.05).floor() as i32);
            assert_eq!(value, 200, "at {along} m along the wall");
        }
    }

    #[test]
    fn finer_pixels_leave_no_hole_in_a_wall_and_coarser_ones_fill_all_their_cells() {
        // A wall one pixel of 1 cm thick among free pixels.
        let mut cells = Cells { columns: 50, rows: 50, values: vec![0; 2500] };
        for row in 0..50 {
            cells.values[row * 50 + 23] = 100;
        }
        let (prior, _) = on(&cells, &description(0.01, [0.0; 3]));
        for row in 0..10 {
            assert_eq!((0..10).filter(|c| evidence(&prior, *c, row) > 0).collect::<Vec<_>>(), [4]);
            assert_eq!(evidence(&prior, 0, row), -25);
        }
        let (prior, _) = on(&drawn(&["#."]), &description(0.15, [0.0; 3]));
        assert_eq!(seen(&prior, 0..7, 0..3), ["###... "; 3]);
    }

    #[test]
    fn in_between_values_say_their_log_odds_within_the_bounds_and_trust_scales_all() {
        let says = |trust| evidence_of_values(Trust::new(trust).unwrap());
        let full = says(1.0);
        assert_eq!((full[0], full[50], full[100]), (-50, 0, 400));
        assert_eq!(full[75], (3.0_f64.ln() * 100.0).round() as i32);
        assert!(full.is_sorted());
        assert!(says(0.0).iter().all(|steps| *steps == 0));
        assert!(Trust::new(1.01).is_none() && Trust::new(f64::NAN).is_none());
        let (nothing, _) =
            Prior::on_grid(&drawn(&L), &description(0.05, [0.0; 3]), 0.05, Trust(0.0)).unwrap();
        assert_eq!(nothing, Prior::default());
    }

    #[test]
    fn what_no_building_is_is_refused_before_room_is_made_for_it() {
        let one = drawn(&["#"]);
        for resolution_m in [0.05 / 33.0, 0.05 * 33.0, f64::MIN_POSITIVE, f64::MAX] {
            let refused =
                Prior::on_grid(&one, &description(resolution_m, [0.0; 3]), 0.05, Trust(1.0));
            assert!(matches!(refused, Err(ImportError::Resolution { .. })), "{resolution_m}");
        }
        for origin in [[1e6, 0.0, 0.0], [0.0, -1e300, 0.0], [f64::MAX, f64::MAX, 1.0]] {
            let refused = Prior::on_grid(&one, &description(0.05, origin), 0.05, Trust(1.0));
            assert!(matches!(refused, Err(ImportError::Extent { .. })), "{origin:?}");
        }
        let wide = Cells { columns: 20_000, rows: 1, values: vec![-1; 20_000] };
        let askew = Prior::on_grid(&wide, &description(0.05, [0.0, 0.0, 0.7]), 0.05, Trust(1.0));
        assert!(matches!(askew, Err(ImportError::Extent { .. })));
    }
}
