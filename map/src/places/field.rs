//! The likelihood field: how well a beam that ends in a cell fits the map.

use super::PlacesConfig;
use super::headings::Directions;
use super::pyramid::Pyramid;
use super::sides::{Compared, NEAR_M, Sides};
use crate::geometry::Point;
use crate::level::LevelMap;
use crate::raster::{
    Layered, LogOdds, Said, SensorClass, TILE_CELLS, TILE_SIDE, Tile, TileIndex, TileKey, together,
};
use crate::vector::Facing;

/// Steps of a nat in which fits are counted.
pub(crate) const STEPS: f64 = 20.0;
/// By so many cells of the search the end of a far beam may be off at the nearest of the headings that are searched: half a
/// degree at 22 m; what is farther than that is forgiven with the cells around each end.
pub(super) const FAR_OFF_CELLS: i32 = 2;
/// Most cells of the search: beyond, they are made larger.
const CELLS_MAX: usize = 32_000_000;

/// What is known of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Known {
    Nothing,
    /// Free as far as the prior tells, which knows of no furniture: a robot may stand there, but what ends there need not be
    /// a mistake.
    Presumed,
    Free,
    Occupied,
    /// Solid as far as the prior tells, and deep inside: no beam ends there, and no robot stands there.
    Built,
    /// Nothing, where only the prior knows anything at all. If that has hardly any rooms, as the walls of drawings often
    /// do not close, a robot may stand there.
    Unvisited,
}

/// A level's raster as a search reads it.
#[derive(Debug, Clone, PartialEq)]
pub struct LikelihoodField {
    pub(super) config: PlacesConfig,
    /// Edge of the map's cells, metres.
    resolution: f64,
    /// Tiles from the lower left one on: which of those kept each is, from 1; 0 for none.
    low: TileIndex,
    columns: usize,
    slots: Vec<u32>,
    /// Fits of the cells of the tiles that are kept, in steps above the worst.
    fits: Vec<u8>,
    known: Vec<Known>,
    /// The sides of walls near the cells.
    sides: Vec<Sides>,
    /// The best fit.
    pub(crate) best: u8,
    pub(super) search: SearchField,
}

/// The field at the cells of the search, which forgives what is off by less than one of them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SearchField {
    /// Edge of a cell, metres.
    pub(super) cell: f64,
    /// Lower left corner of cell (0, 0), metres.
    pub(super) corner: Point,
    /// Columns and rows.
    pub(super) size: (usize, usize),
    /// Bounds of fits.
    pub(super) fits: Pyramid,
    /// Whether a robot can stand anywhere in a block.
    pub(super) free: Pyramid,
    /// Cells where a robot can stand.
    pub(super) free_count: usize,
    pub(super) directions: Directions,
}

impl LikelihoodField {
    /// Of a map: what its layers come to together, and its walls. `resolution` is the edge of its cells.
    pub fn of_map(map: &LevelMap, resolution: f64, config: &PlacesConfig) -> Self {
        Self::of_map_and_walls(map, [], resolution, config)
    }

    /// Of a map and of walls that are known besides, each with free space on the left: those of the model, say, whose
    /// raster is the map's prior.
    pub fn of_map_and_walls(
        map: &LevelMap,
        walls: impl IntoIterator<Item = (Point, Point)>,
        resolution: f64,
        config: &PlacesConfig,
    ) -> Self {
        let mut places: Vec<TileIndex> = map.tiles.keys().map(|key| key.tile).collect();
        places.extend(map.prior.keys());
        places.sort_unstable();
        places.dedup();
        let layer = |class, tile| map.tiles.get(&TileKey { class, tile }).map(AsRef::as_ref);
        let layered = |tile: TileIndex| Layered {
            prior: map.prior.get(&tile).map(AsRef::as_ref),
            scanner: layer(SensorClass::Scanner, tile),
            sonar: layer(SensorClass::Sonar, tile),
            walls: None,
        };
        let known = |tile| {
            let layers = layered(tile);
            let is_visited = layers.scanner.or(layers.sonar).is_some();
            let known = layers.said(0..TILE_CELLS).map(|said| match of_said(said, config) {
                Known::Nothing if !is_visited => Known::Unvisited,
                known => known,
            });
            (tile, known.collect())
        };
        let tiles = places.into_iter().map(known);
        let of_prior = || map.prior.values().flat_map(|tile| tile.cells());
        let rooms = of_prior().filter(|value| **value < 0).count();
        let has_rooms =
            map.prior.is_empty() || rooms > 2 * of_prior().filter(|value| **value > 0).count();
        let walls = walls_of(map).chain(walls);
        Self::of_known(&tiles.collect::<Vec<_>>(), has_rooms, walls, resolution, config)
    }

    /// Of tiles with what is known of their cells, and of walls with free space on the left.
    pub fn new(
        tiles: impl IntoIterator<Item = (TileIndex, Tile)>,
        walls: impl IntoIterator<Item = (Point, Point)>,
        resolution: f64,
        config: &PlacesConfig,
    ) -> Self {
        let known = |tile: &Tile| {
            tile.cells().iter().map(|cell| of_evidence(LogOdds(*cell), config)).collect()
        };
        let tiles = tiles.into_iter().map(|(index, tile)| (index, known(&tile)));
        Self::of_known(&tiles.collect::<Vec<_>>(), true, walls, resolution, config)
    }

    /// Of tiles of cells. If what is free in them does not make rooms, a robot may also stand where nobody has been.
    fn of_known(
        tiles: &[(TileIndex, Vec<Known>)],
        has_rooms: bool,
        walls: impl IntoIterator<Item = (Point, Point)>,
        resolution: f64,
        config: &PlacesConfig,
    ) -> Self {
        let walls: Vec<_> = walls.into_iter().collect();
        let directions = Directions::new(walls.iter().copied());
        let span = |of: fn(&TileIndex) -> i32| {
            let low = tiles.iter().map(|t| of(&t.0)).min().unwrap_or(0);
            let high = tiles.iter().map(|t| of(&t.0)).max().unwrap_or(-1);
            (low, (i64::from(high) - i64::from(low) + 1) as usize)
        };
        let ((x, columns), (y, rows)) = (span(|t| t.x), span(|t| t.y));
        let low = TileIndex { x, y };
        let mut slots = vec![0; columns * rows];
        let mut known = Vec::with_capacity(tiles.len() * TILE_CELLS);
        for (number, (index, tile)) in (1..).zip(tiles) {
            slots[(index.y - y) as usize * columns + (index.x - x) as usize] = number;
            known.extend_from_slice(tile);
        }
        let best = (STEPS * config.free_cost.max(config.unknown_cost)).round() as u8;
        let mut field = Self {
            config: *config,
            resolution,
            low,
            columns,
            slots,
            fits: Vec::new(),
            sides: vec![Sides::default(); known.len()],
            known,
            best,
            search: SearchField {
                cell: config.cell,
                corner: Point::zeros(),
                size: (0, 0),
                fits: Pyramid::default(),
                free: Pyramid::default(),
                free_count: 0,
                directions,
            },
        };
        field.bury();
        field.fits = field.known.iter().map(|known| fit(*known, best, config)).collect();
        field.soften();
        for wall in &walls {
            field.face(wall);
        }
        field.search_field((columns, rows), has_rooms);
        field
    }

    /// What the prior says is solid is occupied where a beam can reach it, and nothing farther inside.
    fn bury(&mut self) {
        let reach = (self.config.skin / self.resolution).round() as i64;
        let is_solid = |x, y| {
            let known = self.index(x, y).map(|at| self.known[at]);
            matches!(known, Some(Known::Built | Known::Occupied))
        };
        let mut found = Vec::new();
        for (at, x, y) in self.places(Known::Built) {
            let mut around =
                (-reach..=reach).flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)));
            let is_deep = around.all(|(dx, dy)| is_solid(x + dx, y + dy));
            found.extend((!is_deep).then_some(at));
        }
        for at in found {
            self.known[at] = Known::Occupied;
        }
    }

    /// Where what is known of a cell is just that: where it is kept, its column and its row from the lower left tile.
    fn places(&self, known: Known) -> impl Iterator<Item = (usize, i64, i64)> + use<'_> {
        let side = TILE_SIDE as i64;
        let kept = self.slots.iter().enumerate();
        let kept = kept.filter_map(|(tile, slot)| Some((tile, slot.checked_sub(1)? as usize)));
        kept.flat_map(move |(tile, slot)| {
            let corner = ((tile % self.columns) as i64 * side, (tile / self.columns) as i64 * side);
            let cells = slot * TILE_CELLS..(slot + 1) * TILE_CELLS;
            cells.filter(move |at| self.known[*at] == known).map(move |at| {
                let offset = (at % TILE_CELLS) as i64;
                (at, corner.0 + offset % side, corner.1 + offset / side)
            })
        })
    }

    /// Cells near occupied ones fit by their distance.
    fn soften(&mut self) {
        let reach = (2.5 * self.config.spread / self.resolution).ceil() as i64;
        let kernel: Vec<(i64, i64, u8)> = (-reach..=reach)
            .flat_map(|dy| (-reach..=reach).map(move |dx| (dx, dy)))
            .map(|(dx, dy)| {
                let off = ((dx * dx + dy * dy) as f64).sqrt() * self.resolution;
                let cost = STEPS * 0.5 * (off / self.config.spread).powi(2);
                (dx, dy, (f64::from(self.best) - cost).max(0.0).round() as u8)
            })
            .collect();
        let occupied: Vec<_> = self.places(Known::Occupied).collect();
        for (_, x, y) in occupied {
            for (dx, dy, fit) in &kernel {
                if let Some(at) = self.index(x + dx, y + dy) {
                    self.fits[at] = self.fits[at].max(*fit);
                }
            }
        }
    }

    /// Cells near a wall know which side of it is the free one.
    fn face(&mut self, (from, to): &(Point, Point)) {
        let length = (to - from).norm();
        if length <= 0.0 {
            return;
        }
        let along = (to - from) / length;
        let left = Point::new(-along.y, along.x);
        let side = Sides::facing(&left);
        // No cell is stepped over.
        let stride = 0.7 * self.resolution;
        let steps = |way: f64| (way / stride).ceil() as u32;
        for forth in 0..=steps(length + 2.0 * NEAR_M) {
            let forth = f64::from(forth) * stride - NEAR_M;
            for aside in 0..=steps(2.0 * NEAR_M) {
                let aside = f64::from(aside) * stride - NEAR_M;
                if let Some(at) = self.index_of(&(from + along * forth + left * aside)) {
                    self.sides[at] = self.sides[at].with(side);
                }
            }
        }
    }

    /// How the side of a wall that was hit at a place, and faces along a vector, compares with the walls that are known there.
    pub(super) fn compared(&self, p: &Point, facing: &Point) -> Compared {
        self.index_of(p).map_or(Compared::Agrees, |at| self.sides[at].compared(facing))
    }

    /// Where a cell, counted from the lower left tile, is kept.
    fn index(&self, x: i64, y: i64) -> Option<usize> {
        let side = TILE_SIDE as i64;
        if x < 0 || y < 0 || x >= self.columns as i64 * side {
            return None;
        }
        let tile = (y / side) as usize * self.columns + (x / side) as usize;
        let slot = self.slots.get(tile)?.checked_sub(1)?;
        Some(slot as usize * TILE_CELLS + (y % side * side + x % side) as usize)
    }

    /// All cells that are kept, by their centres, with what is known of them.
    pub(crate) fn cells(&self) -> impl Iterator<Item = (Point, Known)> + use<'_> {
        let kept = self.slots.iter().enumerate();
        let kept = kept.filter_map(|(tile, slot)| Some((tile, slot.checked_sub(1)?)));
        kept.flat_map(move |(tile, slot)| {
            let index = TileIndex {
                x: self.low.x + (tile % self.columns) as i32,
                y: self.low.y + (tile / self.columns) as i32,
            };
            let known = &self.known[slot as usize * TILE_CELLS..][..TILE_CELLS];
            let centre = move |offset| index.cell(offset).centre(self.resolution);
            known.iter().enumerate().map(move |(offset, known)| (centre(offset), *known))
        })
    }

    fn index_of(&self, p: &Point) -> Option<usize> {
        let side = TILE_SIDE as i64;
        let x = floor(p.x / self.resolution).saturating_sub(i64::from(self.low.x) * side);
        let y = floor(p.y / self.resolution).saturating_sub(i64::from(self.low.y) * side);
        self.index(x, y)
    }

    /// How well a beam that ends there fits, in steps above the worst.
    pub(crate) fn fit(&self, p: &Point) -> u8 {
        let unknown = || fit(Known::Nothing, self.best, &self.config);
        self.index_of(p).map_or_else(unknown, |at| self.fits[at])
    }

    /// Whether robots found that a place is free.
    pub fn is_free(&self, p: &Point) -> bool {
        self.known(p) == Known::Free
    }

    /// What is known of a place.
    pub(crate) fn known(&self, p: &Point) -> Known {
        self.index_of(p).map_or(Known::Nothing, |at| self.known[at])
    }

    fn search_field(&mut self, (columns, rows): (usize, usize), has_rooms: bool) {
        let (wide, high) = (columns * TILE_SIDE, rows * TILE_SIDE);
        let mut factor = ((self.config.cell / self.resolution).round() as usize).max(1);
        while (wide / factor) * (high / factor) > CELLS_MAX {
            factor *= 2;
        }
        let (width, height) = (wide.div_ceil(factor), high.div_ceil(factor));
        let mut counts = vec![(0_u32, 0_u32, 0_u32, 0_u32); width * height];
        for (tile, slot) in self.slots.iter().enumerate() {
            let (x, y) = (tile % columns * TILE_SIDE, tile / columns * TILE_SIDE);
            let cells = slot.checked_sub(1).map(|slot| &self.known[slot as usize * TILE_CELLS..]);
            for offset in 0..TILE_CELLS {
                // Where there is no tile nobody has been.
                let known = cells.map_or(Known::Unvisited, |cells| cells[offset]);
                let (x, y) = (x + offset % TILE_SIDE, y + offset / TILE_SIDE);
                let count = &mut counts[y / factor * width + x / factor];
                count.0 += u32::from(known == Known::Occupied);
                count.1 += u32::from(known == Known::Free);
                count.2 += u32::from(known == Known::Presumed);
                count.3 += u32::from(known == Known::Unvisited);
            }
        }
        let most = |of: u32| 2 * of as usize >= factor * factor;
        let of_cell = |(occupied, free, presumed, unvisited): &(u32, u32, u32, u32)| match occupied
        {
            1.. => Known::Occupied,
            0 if most(*free) => Known::Free,
            0 if most(free + presumed) => Known::Presumed,
            0 if most(free + presumed + unvisited) => Known::Unvisited,
            0 => Known::Nothing,
        };
        let known: Vec<Known> = counts.iter().map(of_cell).collect();
        let mut fits: Vec<u8> =
            known.iter().map(|known| fit(*known, self.best, &self.config)).collect();
        for (at, _) in known.iter().enumerate().filter(|(_, k)| **k == Known::Occupied) {
            let (x, y) = (at % width, at / width);
            for y in y.saturating_sub(1)..(y + 2).min(height) {
                fits[y * width + x.saturating_sub(1)..y * width + (x + 2).min(width)]
                    .fill(self.best);
            }
        }
        let is_floor = |known: &Known| match known {
            Known::Free | Known::Presumed => true,
            Known::Unvisited => !has_rooms,
            _ => false,
        };
        let free: Vec<u8> = known.iter().map(|known| u8::from(is_floor(known))).collect();
        let search = &mut self.search;
        search.cell = self.resolution * factor as f64;
        search.size = (width, height);
        let corner = |tile: i32| f64::from(tile) * TILE_SIDE as f64 * self.resolution;
        search.corner = Point::new(corner(self.low.x), corner(self.low.y));
        let reach =
            (self.config.range_max / search.cell).ceil() as usize + FAR_OFF_CELLS as usize + 1;
        let outside = fit(Known::Nothing, self.best, &self.config);
        search.free_count = free.iter().map(|free| usize::from(*free)).sum();
        search.fits = Pyramid::new(&fits, search.size, outside, reach);
        search.free = Pyramid::new(&free, search.size, 0, 0);
    }

    /// Logarithm of how much likelier a place must be than all others together.
    pub fn odds(&self) -> f64 {
        self.config.odds
    }

    /// Logarithm of the number of places that can be told apart.
    pub fn ln_places(&self) -> f64 {
        let (apart, turned) = self.config.apart;
        let area = self.search.free_count as f64 * self.search.cell * self.search.cell;
        (area / (apart * apart) * std::f64::consts::TAU / turned).max(1.0).ln()
    }
}

/// The greatest whole number not above. `f64::floor` is a call where the processors built for need not round.
fn floor(value: f64) -> i64 {
    let whole = value as i64;
    whole.saturating_sub(i64::from(value < whole as f64))
}

/// The walls of a map, part by part, each from end to end with free space on the left.
pub(crate) fn walls_of(map: &LevelMap) -> impl Iterator<Item = (Point, Point)> + use<'_> {
    map.segments.values().flat_map(|segment| {
        segment.solid.iter().map(|part| {
            let ends = (segment.line.at(part.span.from_m()), segment.line.at(part.span.to_m()));
            match segment.facing {
                Facing::Origin => ends,
                Facing::Away => (ends.1, ends.0),
            }
        })
    })
}

fn of_evidence(evidence: LogOdds, config: &PlacesConfig) -> Known {
    let nat = evidence.nat();
    if nat >= config.occupied {
        Known::Occupied
    } else if nat <= config.free {
        Known::Free
    } else {
        Known::Nothing
    }
}

/// What the layers say of a cell. What the prior alone says is free is presumed to be; no robot has been there.
fn of_said(said: Said, config: &PlacesConfig) -> Known {
    let evidence = together(said).unwrap_or_default();
    let is_untouched = said.scanner.0 == 0 && said.sonar.0 == 0;
    match of_evidence(evidence, config) {
        Known::Occupied if is_untouched => Known::Built,
        Known::Nothing if evidence.nat() <= config.presumed && said.prior.0 < 0 => Known::Presumed,
        known => known,
    }
}

fn fit(known: Known, best: u8, config: &PlacesConfig) -> u8 {
    let cost = match known {
        Known::Occupied => 0.0,
        Known::Nothing | Known::Unvisited | Known::Built => config.unknown_cost,
        Known::Presumed => config.presumed_cost,
        Known::Free => config.free_cost,
    };
    (f64::from(best) - STEPS * cost).max(0.0).round() as u8
}
