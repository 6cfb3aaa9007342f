//! What a plan says about the cells of the level's grid, before any robot has looked.
//!
//! Conservative: every cell whose inside meets something solid is occupied.

use std::collections::BTreeMap;

use super::contours::Bordering;
use super::{MICROMETRES, Outline, Plan};
use crate::raster::{Cell, LogOdds, TILE_CELLS, TILE_SIDE, TileIndex, TilePatch};

/// What the parts of a plan are worth, and how much of it is made at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PriorConfig {
    /// Cell size of the level, metres.
    pub resolution: f64,
    /// A cell with a surface in it, for an object that is fully trusted, nats.
    pub surface: f64,
    /// A cell wholly inside of something solid, which no sensor will ever look at, nats; at most what a surface of the
    /// same object is worth.
    pub inside: f64,
    /// A free cell in a room, nats (negative).
    pub room: f64,
    /// The most cells that a prior may cover.
    pub cells_max: u64,
}

impl PriorConfig {
    /// The defaults for a level's cell size, metres.
    pub fn standard(resolution: f64) -> Self {
        Self { resolution, surface: 4.0, inside: 2.0, room: -0.5, cells_max: 100_000_000 }
    }
}

/// No grid is finer, metres; cells 10 km from the origin then still have numbers.
const RESOLUTION_MIN: f64 = 1e-3;

/// The layer below all evidence: log-odds steps per tile, tiles without any left out.
pub type Prior = BTreeMap<TileIndex, TilePatch>;

/// Why there is no prior.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PriorError {
    /// The plan covers too much ground.
    #[error(
        "the plan covers {cells} cells, and at most {cells_max} are made: cut the level into smaller ones"
    )]
    TooLarge {
        /// Cells that its outlines enclose, or more.
        cells: u64,
        /// The limit.
        cells_max: u64,
    },
    /// The cell size is no number, or less than a millimetre.
    #[error("cells of {resolution} m are no grid: choose 0.001 m or more")]
    BadResolution {
        /// The cell size, metres.
        resolution: f64,
    },
}

/// The prior of a plan: surfaces, what is inside of solids, rooms; nothing outside of the building.
///
/// Rooms are what outlines enclose if all doorways are walled up.
///
/// # Errors
/// A resolution that is no length, or a plan with more ground than `cells_max`.
pub fn prior(plan: &Plan, config: &PriorConfig) -> Result<Prior, PriorError> {
    let resolution = config.resolution;
    if !(resolution.is_finite() && resolution >= RESOLUTION_MIN) {
        return Err(PriorError::BadResolution { resolution });
    }
    let bands = bands(plan, config)?;
    let mut prior = Prior::new();
    for (y, band) in &bands {
        let mut tiles: BTreeMap<i32, Box<[i16; TILE_CELLS]>> = BTreeMap::new();
        let mut set = |cell: Cell, value: i16, stronger: bool| {
            let (tile, offset) = cell.tile();
            let cells = tiles.entry(tile.x).or_insert_with(|| Box::new([0; TILE_CELLS]));
            let held = &mut cells[offset];
            *held = if stronger { (*held).max(value) } else { value };
        };
        for row in 0..TILE_SIDE as i32 {
            fill_row(plan, config, band, y * TILE_SIDE as i32 + row, &mut set);
        }
        // Over all that is filled, row by row: what has a surface in it is no longer free.
        for edge in &band.surfaces {
            draw(edge, *y, resolution, &mut |cell| {
                set(cell, steps(config.surface * plan.owner(edge.owner).trust), true);
            });
        }
        for (x, cells) in tiles {
            let patch = TilePatch::from_cells(&cells);
            if !patch.runs().is_empty() {
                prior.insert(TileIndex { x, y: *y }, patch);
            }
        }
    }
    Ok(prior)
}

fn steps(nat: f64) -> i16 {
    LogOdds::from_nat(nat).0 as i16
}

/// What of a plan lies in one row of tiles.
#[derive(Default)]
struct Band<'a> {
    /// Edges of the outlines.
    outlines: Vec<&'a Bordering>,
    /// Edges of what encloses ground if doorways are walled up, with something solid inside.
    enclosing: Vec<&'a Bordering>,
    /// Edges of outlines and sheets, which are drawn.
    surfaces: Vec<&'a Bordering>,
}

/// The plan by rows of tiles.
fn bands<'a>(plan: &'a Plan, config: &PriorConfig) -> Result<BTreeMap<i32, Band<'a>>, PriorError> {
    let enclosing = || plan.walled_up.iter().filter(|outline| outline.area() < 0.0);
    let cell = config.resolution;
    let ground: f64 = enclosing().map(Outline::area).sum::<f64>().abs() / (cell * cell);
    let edges = || {
        let sheets = plan.sheets.iter().flat_map(|sheet| &sheet.edges);
        plan.outlines.iter().flat_map(|outline| &outline.edges).chain(sheets)
    };
    let length: f64 = edges().map(|edge| edge.from.distance(edge.to) / cell + 1.0).sum();
    // Each cell along an edge has neighbours that the edge touches, too.
    let cells = (ground + 3.0 * length).min(1e18) as u64;
    let cells_max = config.cells_max;
    if cells > cells_max {
        return Err(PriorError::TooLarge { cells, cells_max });
    }
    let tile = cell * TILE_SIDE as f64 * MICROMETRES;
    let of = |edge: &Bordering| {
        let (low, high) = (edge.from.y.min(edge.to.y), edge.from.y.max(edge.to.y));
        // A step of slack: rounding must not lose an edge on the border of two rows.
        let row = |y: i64| (y as f64 / tile).floor() as i32;
        row(low - 1)..=row(high + 1)
    };
    let mut bands: BTreeMap<i32, Band<'a>> = BTreeMap::new();
    for edge in plan.outlines.iter().flat_map(|outline| &outline.edges) {
        of(edge).for_each(|y| bands.entry(y).or_default().outlines.push(edge));
    }
    for edge in enclosing().flat_map(|outline| &outline.edges) {
        of(edge).for_each(|y| bands.entry(y).or_default().enclosing.push(edge));
    }
    for edge in edges() {
        of(edge).for_each(|y| bands.entry(y).or_default().surfaces.push(edge));
    }
    Ok(bands)
}

/// Where edges cross the middle of a row, from left to right: x in metres, trust of the owner, whether it goes up.
fn crossings(plan: &Plan, edges: &[&Bordering], y: f64) -> Vec<(f64, f64, bool)> {
    let cross = |edge: &&Bordering| {
        let (a, b) = (edge.from.metres(), edge.to.metres());
        if (a.y <= y) == (b.y <= y) {
            return None;
        }
        let x = a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y));
        Some((x, plan.owner(edge.owner).trust, b.y > a.y))
    };
    let mut crossings: Vec<_> = edges.iter().filter_map(cross).collect();
    crossings.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    crossings
}

/// Fills a row with rooms, then with the insides of solids, by where cells have their centres; cells with a surface
/// in them are drawn over afterwards.
fn fill_row(
    plan: &Plan,
    config: &PriorConfig,
    band: &Band<'_>,
    row: i32,
    set: &mut impl FnMut(Cell, i16, bool),
) {
    let y = (f64::from(row) + 0.5) * config.resolution;
    let mut fill = |from: f64, to: f64, value: i16| {
        // Centres within [from, to).
        let column = |x: f64| (x / config.resolution - 0.5).ceil() as i32;
        (column(from)..column(to)).for_each(|column| set(Cell { column, row }, value, false));
    };
    // Clockwise outlines go up on their left side.
    let mut depth = 0;
    for pair in crossings(plan, &band.enclosing, y).windows(2) {
        depth += if pair[0].2 { 1 } else { -1 };
        if depth > 0 {
            fill(pair[0].0, pair[1].0, steps(config.room));
        }
    }
    // Solid is on the right of an edge: what goes up enters it.
    for pair in crossings(plan, &band.outlines, y).windows(2) {
        if pair[0].2 {
            let trust = pair[0].1.min(pair[1].1);
            let value = config.inside.min(config.surface * trust);
            fill(pair[0].0, pair[1].0, steps(value));
        }
    }
}

/// The cells in row `y` of tiles whose insides meet a surface. It is drawn half a micrometre within the solid on its
/// right, so that a surface between two cells belongs to the one that is solid.
fn draw(edge: &Bordering, y: i32, resolution: f64, visit: &mut impl FnMut(Cell)) {
    let (a, b) = (edge.from.metres(), edge.to.metres());
    let along = (b - a).normalize();
    let inward = crate::geometry::Point::new(along.y, -along.x) * (0.5 / MICROMETRES);
    let (a, b) = (a + inward, b + inward);
    let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
    // The cells that an open stretch from one coordinate to another comes into; at least one.
    let within = |from: f64, to: f64| {
        let first = (from / resolution).floor() as i32;
        first..=((to / resolution).ceil() as i32 - 1).max(first)
    };
    let first = y * TILE_SIDE as i32;
    for row in within(low.y, high.y) {
        if row < first || row >= first + TILE_SIDE as i32 {
            continue;
        }
        let bottom = (f64::from(row) * resolution).max(low.y);
        let top = (f64::from(row + 1) * resolution).min(high.y);
        let x_at = |y: f64| {
            if high.y > low.y {
                low.x + (high.x - low.x) * ((y - low.y) / (high.y - low.y)).clamp(0.0, 1.0)
            } else {
                low.x
            }
        };
        let (mut left, mut right) = (x_at(bottom), x_at(top));
        if high.y <= low.y {
            right = high.x;
        }
        if left > right {
            (left, right) = (right, left);
        }
        within(left, right).for_each(|column| visit(Cell { column, row }));
    }
}
