//! Occupied cells of a map as walls of the model.
//!
//! * `contours`: the borders of what is occupied, straightened and fitted below the size of a cell.
//! * Two parallel borders at the thickness of a wall are a wall, as in drawings (`paired`).
//! * What no wall explains is thick: a prism by its straightened border, or, where that would cross itself, in rectangles.

mod contours;

use std::collections::BTreeMap;

use mapfold_map::gdb::{Model, ObjectId, Severity, findings};
use mapfold_map::geometry::Point;
use mapfold_schema::border::gdb::map_object;
use mapfold_schema::v1::{
    GdbBox, GdbObject, GdbPlacement, GdbPrism, GdbPrototype, GdbSolid, ModelFormat, ObjectKind,
};
use uuid::Uuid;

use super::super::incoming::{FileFault, Found, Incoming, object};
use super::super::paired::{Wall, WallConfig, WallLine, walls};
use super::cells::load;
use super::description::Description;
use super::image::Image;
use super::package::Package;
use contours::{Mask, rings, straight};

/// Pixels of a map that is drawn as walls: their borders take more room than the pixels.
const PIXELS_MAX: usize = 36_000_000;
/// A cell from this occupancy on, in per cent, is part of a wall.
const OCCUPIED: i8 = 65;
/// Cells of the smallest thing that is taken: less is noise of a scanner.
const SPECK: usize = 3;
/// How far a border may be off its straight line, cells.
const STRAIGHT: f64 = 0.9;
/// How far beside a wall a cell is explained by it, cells.
const EXPLAINED: f64 = 1.5;
/// Rectangles of one thing.
const RECTANGLES_MAX: usize = 1000;
/// Height of the walls, metres.
const HEIGHT_M: f64 = 2.5;

/// How well the walls say what the cells say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Explained {
    /// Occupied cells.
    pub occupied: u64,
    /// Those within one and a half cells of a wall.
    pub explained: u64,
    /// Free or unknown cells whose middle a wall covers, farther than one cell from any occupied one.
    pub invented: u64,
    /// Walls of two parallel borders.
    pub straight: u64,
    /// Thick or crooked things.
    pub thick: u64,
}

impl Package {
    /// The occupied cells as walls in the frame of a level.
    ///
    /// # Errors
    /// What cannot be read, or be no map of a building.
    pub fn walls(
        &self,
        frame: Uuid,
        library: &BTreeMap<String, GdbPrototype>,
    ) -> Result<(Incoming, Explained), FileFault> {
        let mut found =
            Found::new(ModelFormat::Nav2, frame, &[&self.description[..], &self.image].concat())?;
        let unread = |error: super::ImportError| FileFault::at("the map", error.to_string());
        let (description, _) = Description::read(&self.description).map_err(unread)?;
        let image = Image::read(&self.image).map_err(unread)?;
        let cells = load(&description, &image).cells;
        if cells.values.len() > PIXELS_MAX {
            let fault = format!("{} pixels; {PIXELS_MAX} are the most", cells.values.len());
            return Err(FileFault::at("the image", fault));
        }
        found.scale_m = description.resolution_m;
        let occupied = cells.values.iter().map(|value| *value >= OCCUPIED).collect();
        let mut mask =
            Mask { columns: cells.columns as usize, rows: cells.rows as usize, occupied };
        let all = mask.count();
        let specks = mask.without_specks(SPECK);
        for _ in 0..specks {
            found.leave_out("specks", format!("they have fewer than {SPECK} cells"));
        }
        let placing = Placing::of(&description);
        let drawn = double_walls(&mask, description.resolution_m);
        let mut rest = mask.clone();
        for wall in &drawn {
            cover(wall, &mask, 0.8, |cell| rest.occupied[cell] = false);
        }
        let thick: Vec<Thick> = rest
            .components()
            .into_iter()
            .filter(|cells| cells.len() >= SPECK)
            .map(|cells| Thick::of(&cells, &mask))
            .collect();
        let explained = explained(&mask, all, &drawn, &thick);
        for (index, wall) in drawn.iter().enumerate() {
            found.put(&format!("wall {index}"), None, placing.wall(wall))?;
        }
        for (index, thick) in thick.iter().enumerate() {
            found.put(&format!("thick thing {index}"), None, placing.thick(thick))?;
        }
        let share = |part: u64| 100.0 * part as f64 / explained.occupied.max(1) as f64;
        found.warnings.push(format!(
            "{} walls and {} thick things explain {:.1} % of {} occupied cells; they cover {} free cells",
            explained.straight,
            explained.thick,
            share(explained.explained),
            explained.occupied,
            explained.invented
        ));
        Ok((found.settled(library)?, explained))
    }
}

/// Pairs of parallel borders, in cells.
fn double_walls(mask: &Mask, resolution_m: f64) -> Vec<Wall> {
    let config = WallConfig {
        thickness_min_m: 0.3,
        // A wall is at most as thick as in drawings, but may always be some cells.
        thickness_max_m: (WallConfig::STANDARD.thickness_max_m / resolution_m).max(4.0),
        parallel_sine: 0.08,
        length_min_m: 2.5,
        thin_m: 1.0,
    };
    let mut lines = Vec::new();
    for ring in rings(mask) {
        let corners = straight(&ring, STRAIGHT);
        let next = corners.iter().cycle().skip(1);
        lines.extend(corners.iter().zip(next).map(|(from, to)| WallLine {
            ends: [*from, *to],
            heights: None,
            line: 0,
        }));
    }
    let is_wall = |wall: &Wall| wall.is_double && is_of_cells(wall, mask);
    walls(&lines, &config).found.into_iter().filter(is_wall).collect()
}

/// Whether a wall stands where the cells are, and is not the gap between two of them.
fn is_of_cells(wall: &Wall, mask: &Mask) -> bool {
    let (mut occupied, mut all) = (0, 0);
    cover(wall, mask, 0.0, |cell| {
        all += 1;
        occupied += usize::from(mask.occupied[cell]);
    });
    all > 0 && occupied * 10 >= all * 7
}

/// Visits the cells whose middles lie within a wall, or `beside` cells of it.
fn cover(wall: &Wall, mask: &Mask, beside: f64, mut visit: impl FnMut(usize)) {
    let step = wall.ends[1] - wall.ends[0];
    let length = step.norm();
    let along = step / length;
    let reach = wall.thickness / 2.0 + beside;
    let normal = Point::new(-along.y, along.x) * reach;
    let (from, to) = (wall.ends[0] - along * beside, wall.ends[1] + along * beside);
    let corners = [from + normal, from - normal, to + normal, to - normal];
    let least = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::INFINITY, f64::min);
    let most = |of: fn(&Point) -> f64| corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
    let clamp = |value: f64, count: usize| (value.max(0.0) as usize).min(count);
    let columns = clamp(least(|p| p.x).floor(), mask.columns)
        ..clamp(most(|p| p.x).ceil() + 1.0, mask.columns);
    for row in
        clamp(least(|p| p.y).floor(), mask.rows)..clamp(most(|p| p.y).ceil() + 1.0, mask.rows)
    {
        for column in columns.clone() {
            let p = Point::new(column as f64 + 0.5, row as f64 + 0.5) - wall.ends[0];
            if (-beside..=length + beside).contains(&along.dot(&p)) && along.perp(&p).abs() <= reach
            {
                visit(row * mask.columns + column);
            }
        }
    }
}

/// What is too thick or too crooked for a wall, in cells.
struct Thick {
    cells: Vec<usize>,
    /// The rings of its border, or none if they cross.
    rings: Vec<Vec<Point>>,
    rectangles: Vec<[usize; 4]>,
}

impl Thick {
    fn of(cells: &[usize], mask: &Mask) -> Self {
        let (local, corner) = mask.cut_out(cells);
        let border: Vec<Vec<Point>> = rings(&local)
            .iter()
            .map(|ring| straight(ring, STRAIGHT).into_iter().map(|p| p + corner).collect())
            .collect();
        let prism = solid(&border).filter(is_sound);
        let rings = if prism.is_some() { border } else { Vec::new() };
        let rectangles = if rings.is_empty() { mask.rectangles(cells) } else { Vec::new() };
        Self { cells: cells.to_vec(), rings, rectangles }
    }
}

/// The outer ring, which runs counter-clockwise, and holes, as a prism.
fn solid(rings: &[Vec<Point>]) -> Option<GdbSolid> {
    let base_m: Vec<Vec<[f64; 2]>> =
        rings.iter().map(|ring| ring.iter().map(|p| [p.x, p.y]).collect()).collect();
    let is_ring = |ring: &Vec<[f64; 2]>| ring.len() > 2;
    (!base_m.is_empty() && base_m.iter().all(is_ring)).then_some(GdbSolid::Prism(GdbPrism {
        base_m,
        lower_m: 0.0,
        upper_m: HEIGHT_M,
    }))
}

fn is_sound(solid: &GdbSolid) -> bool {
    let mut thing = object(ObjectKind::Wall, "");
    thing.solids = Some(vec![solid.clone()]);
    let Ok(mapped) = map_object(&thing) else { return false };
    let objects = BTreeMap::from([(ObjectId([0; 16]), mapped)]);
    let model = Model { objects, ..Model::default() };
    findings(&model).iter().all(|finding| finding.kind.severity() != Severity::Error)
}

/// Counts cells that are within reach of what was drawn, and cells that were drawn without being there.
fn explained(mask: &Mask, occupied: u64, drawn: &[Wall], thick: &[Thick]) -> Explained {
    let mut near = vec![false; mask.occupied.len()];
    let mut covered = vec![false; mask.occupied.len()];
    for wall in drawn {
        cover(wall, mask, EXPLAINED, |cell| near[cell] = true);
        cover(wall, mask, 0.0, |cell| covered[cell] = true);
    }
    for cell in thick.iter().flat_map(|thick| &thick.cells) {
        near[*cell] = true;
    }
    let count =
        |wanted: &dyn Fn(usize) -> bool| (0..near.len()).filter(|k| wanted(*k)).count() as u64;
    Explained {
        occupied,
        explained: count(&|k| mask.occupied[k] && near[k]),
        invented: count(&|k| covered[k] && !mask.occupied[k] && !mask.has_neighbour(k)),
        straight: drawn.len() as u64,
        thick: thick.len() as u64,
    }
}

/// From cells to metres of the level.
struct Placing {
    resolution_m: f64,
    origin: [f64; 3],
}

impl Placing {
    fn of(description: &Description) -> Self {
        Self { resolution_m: description.resolution_m, origin: description.origin }
    }

    fn point(&self, p: &Point) -> Point {
        let [x, y, yaw] = self.origin;
        let (sine, cosine) = yaw.sin_cos();
        let p = p * self.resolution_m;
        Point::new(x + p.x * cosine - p.y * sine, y + p.x * sine + p.y * cosine)
    }

    fn wall(&self, wall: &Wall) -> GdbObject {
        let [from, to] = wall.ends.map(|end| self.point(&end));
        let (middle, step) = ((from + to) / 2.0, to - from);
        let (half, length) = (step.y.atan2(step.x) / 2.0, step.norm() / 2.0);
        let depth = wall.thickness * self.resolution_m / 2.0;
        let mut made = object(ObjectKind::Wall, "");
        made.solids = Some(vec![GdbSolid::Box(GdbBox {
            from_m: [-length, -depth, 0.0],
            to_m: [length, depth, HEIGHT_M],
        })]);
        made.placement = Some(GdbPlacement {
            position_m: [middle.x, middle.y, 0.0],
            rotation: Some([half.cos(), 0.0, 0.0, half.sin()]),
        });
        self.as_sure_as_cells(made)
    }

    fn thick(&self, thick: &Thick) -> GdbObject {
        let placed = |ring: &Vec<Point>| ring.iter().map(|p| self.point(p)).collect();
        let rectangle = |[left, low, right, high]: &[usize; 4]| {
            let corner = |x: &usize, y: &usize| self.point(&Point::new(*x as f64, *y as f64));
            vec![corner(left, low), corner(right, low), corner(right, high), corner(left, high)]
        };
        let mut made = object(ObjectKind::Wall, "");
        made.solids = Some(if thick.rings.is_empty() {
            let rectangles = thick.rectangles.iter().take(RECTANGLES_MAX);
            rectangles.filter_map(|sides| solid(&[rectangle(sides)])).collect()
        } else {
            solid(&thick.rings.iter().map(placed).collect::<Vec<_>>()).into_iter().collect()
        });
        self.as_sure_as_cells(made)
    }

    /// A border in a grid is known to about half a cell, or what drew it is not better.
    fn as_sure_as_cells(&self, mut object: GdbObject) -> GdbObject {
        object.tolerance_m = Some((self.resolution_m / 2.0).max(0.03));
        object
    }
}

#[cfg(test)]
mod tests;
