//! Floors that change: how soon the map believes that a shelf has moved, and whether it keeps what
//! has not.
//!
//! A shelf stands in a hall for some days, and is moved overnight. Robots drive round it all the
//! time. The same looks are folded twice: with evidence that yields from day to day, and as one sum.

use std::path::Path;

use mapfold_map::geometry;
use mapfold_map::level::{Contribution, Level, LevelConfig};
use mapfold_map::raster::{Cell, SensorClass, SliceConfig, TileKey};

use crate::plane::{Piece, Point};
use crate::simulation::{Noise, World};
use crate::surveying::{Looker, RESOLUTION_M, START_S};
use crate::{Error, report};

/// Size of the hall, metres.
const HALL_M: (f64, f64) = (12.0, 8.0);
/// Half the size of the shelf, metres.
const SHELF_M: (f64, f64) = (1.0, 0.3);
/// The middle of the shelf before and after, metres.
const PLACES: [(f64, f64); 2] = [(3.5, 4.0), (8.5, 4.0)];
const DAY_S: f64 = 86_400.0;
/// The share of a shelf's outline that must read as it is.
const MOST: f64 = 0.9;
/// A slice that holds all days.
const NEVER_S: u32 = u32::MAX;

/// How the map followed a shelf that was moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Following {
    /// Looks until nine tenths of its old outline read free; `None` if not within a day.
    pub gone_after: Option<u32>,
    /// Looks until nine tenths of its new outline read occupied.
    pub there_after: Option<u32>,
    /// Metres of published walls on its old outline after a day.
    pub walls_left_m: f64,
    /// Share of the hall's walls that read occupied: the least after any look of that day.
    pub hall_kept: f64,
}

/// Lets the shelf stand for `days` days of so many looks each, moves it, and watches for a day.
///
/// # Errors
/// Settings that the surveyor refuses: none of these.
pub fn follow(days: u32, looks_a_day: u32, slice_s: u32, seed: u64) -> Result<Following, Error> {
    let mut noise = Noise::of_seed(seed);
    let mut robot = Looker::new("ada", 7)?;
    let standard = LevelConfig::standard(RESOLUTION_M);
    let slices = SliceConfig { length_s: slice_s, ..standard.slices };
    let mut level = Level::new(LevelConfig { slices, ..standard });
    let [before, after] = PLACES.map(|place| hall(&shelf(place)));
    let mut index = 0;
    let mut look = |world: &World, day: u32, of_day: u32| -> Option<Contribution> {
        let time_s = START_S + DAY_S * f64::from(day) + 30.0 * f64::from(of_day);
        index += 1;
        let place = stand(&mut noise);
        robot.look(world, place, (index, time_s), &mut noise)
    };
    for day in 0..days {
        for of_day in 0..looks_a_day {
            level.fold(&look(&before, day, of_day));
        }
    }
    let [old, new] = PLACES.map(|place| outline(&shelf(place)));
    let walls = outline(&hall(&[]).walls);
    let mut following =
        Following { gone_after: None, there_after: None, walls_left_m: 0.0, hall_kept: 1.0 };
    for of_day in 0..looks_a_day {
        level.fold(&look(&after, days, of_day));
        let looks = Some(of_day + 1);
        if occupied(&level, &old) <= 1.0 - MOST {
            following.gone_after = following.gone_after.or(looks);
        }
        if occupied(&level, &new) >= MOST {
            following.there_after = following.there_after.or(looks);
        }
        following.hall_kept = following.hall_kept.min(occupied(&level, &walls));
    }
    following.walls_left_m = walls_on(&level, &shelf(PLACES[0]));
    Ok(following)
}

/// Somewhere in the aisle round the shelves, with any heading.
fn stand(noise: &mut Noise) -> (Point, f64) {
    let (width, height) = HALL_M;
    // Along the walls, a metre and a half off, anywhere.
    let (inner_x, inner_y) = (width - 3.0, height - 3.0);
    let along = noise.share() * 2.0 * (inner_x + inner_y);
    let (x, y) = if along < inner_x {
        (along, 0.0)
    } else if along < inner_x + inner_y {
        (inner_x, along - inner_x)
    } else if along < 2.0 * inner_x + inner_y {
        (along - inner_x - inner_y, inner_y)
    } else {
        (0.0, along - 2.0 * inner_x - inner_y)
    };
    let at = Point::new(1.5 + x, 1.5 + y);
    (at, (noise.share() - 0.5) * std::f64::consts::TAU)
}

fn rectangle((left, low): (f64, f64), (right, high): (f64, f64)) -> Vec<Piece> {
    let corners = [(left, low), (right, low), (right, high), (left, high), (left, low)];
    let corners = corners.map(|(x, y)| Point::new(x, y));
    corners.windows(2).map(|ends| Piece { a: ends[0], b: ends[1] }).collect()
}

fn shelf((x, y): (f64, f64)) -> Vec<Piece> {
    rectangle((x - SHELF_M.0, y - SHELF_M.1), (x + SHELF_M.0, y + SHELF_M.1))
}

fn hall(shelf: &[Piece]) -> World {
    let mut walls = rectangle((0.0, 0.0), HALL_M);
    walls.extend_from_slice(shelf);
    World { name: "hall", walls, way: Vec::new() }
}

/// Places along pieces, two a cell.
fn outline(pieces: &[Piece]) -> Vec<Point> {
    let places = |piece: &Piece| {
        let Piece { a, b } = *piece;
        let count = (a.distance(b) / (0.5 * RESOLUTION_M)).round() as u32;
        (0..count).map(move |i| {
            let share = (f64::from(i) + 0.5) / f64::from(count);
            Point::new(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y))
        })
    };
    pieces.iter().flat_map(places).collect()
}

/// Share of the places that read occupied within a cell.
fn occupied(level: &Level, places: &[Point]) -> f64 {
    let reads_occupied = |place: &&Point| {
        let p = geometry::Point::new(place.x, place.y);
        let middle = Cell::holding(&p, RESOLUTION_M);
        (-1..=1).any(|row| {
            (-1..=1).any(|column| {
                let cell = Cell { column: middle.column + column, row: middle.row + row };
                let (tile, offset) = cell.tile();
                let key = TileKey { class: SensorClass::Scanner, tile };
                level.map().tiles.get(&key).is_some_and(|tile| tile.cells()[offset] > 0)
            })
        })
    };
    places.iter().filter(reads_occupied).count() as f64 / places.len() as f64
}

/// Metres of published walls within a hand of an outline.
fn walls_on(level: &Level, pieces: &[Piece]) -> f64 {
    let near = |p: &geometry::Point| {
        let p = Point::new(p.x, p.y);
        pieces.iter().any(|piece| piece.distance(p) < 0.1)
    };
    let mut left_m = 0.0;
    for segment in level.map().segments.values() {
        for part in &segment.solid {
            let (from, to) = (part.span.from_m(), part.span.to_m());
            let steps = ((to - from) / 0.05).ceil().max(1.0);
            let step = (to - from) / steps;
            let middles = (0..steps as u32).map(|i| from + step * (f64::from(i) + 0.5));
            left_m += middles.filter(|t| near(&segment.line.at(*t))).count() as f64 * step;
        }
    }
    left_m
}

/// Days that the shelf stands before it is moved.
const DAYS: [u32; 3] = [1, 7, 30];
const LOOKS_A_DAY: u32 = 60;
const RUNS: u64 = 5;

/// Measures how the map follows, and rewrites the table `change` of a page.
///
/// # Errors
/// The page cannot be read or written.
pub fn table(page: &Path) -> Result<Vec<String>, Error> {
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    for days in DAYS {
        for (name, slice_s) in
            [("a day a slice", SliceConfig::STANDARD.length_s), ("one sum", NEVER_S)]
        {
            let runs: Vec<Following> = (0..RUNS)
                .map(|seed| follow(days, LOOKS_A_DAY, slice_s, seed))
                .collect::<Result<_, _>>()?;
            let after = |looks: fn(&Following) -> Option<u32>| {
                let mut all: Vec<u32> = runs.iter().map(|r| looks(r).unwrap_or(u32::MAX)).collect();
                all.sort_unstable();
                let told = |looks: u32| match looks {
                    u32::MAX => format!("> {LOOKS_A_DAY}"),
                    looks => looks.to_string(),
                };
                format!("{} ({})", told(all[all.len() / 2]), told(all[all.len() - 1]))
            };
            let left: f64 = runs.iter().map(|r| r.walls_left_m).sum::<f64>() / RUNS as f64;
            let kept = runs.iter().map(|r| r.hall_kept).fold(1.0, f64::min);
            if name == "a day a slice"
                && (runs.iter().any(|r| r.gone_after.is_none()) || kept < 0.97)
            {
                faults.push(format!(
                    "after {days} days the map does not follow, or forgets: {runs:?}"
                ));
            }
            rows.push(vec![
                days.to_string(),
                name.to_owned(),
                after(|r| r.gone_after),
                after(|r| r.there_after),
                format!("{left:.2}"),
                format!("{:.1} %", 100.0 * kept),
            ]);
            report::say(&rows[rows.len() - 1].join(" | "));
        }
    }
    let header =
        ["days", "evidence", "gone after looks", "there after looks", "walls left m", "hall kept"];
    report::rewrite(page, "change", &report::table(&header, &rows))?;
    Ok(faults)
}
