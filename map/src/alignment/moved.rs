//! A look in a robot's own frame, as it would have been in the level's.

use std::collections::{BTreeMap, BTreeSet};

use crate::geometry::{Level, Odom, Point, Pose, UncertainPose};
use crate::level::{Contribution, Provenance};
use crate::raster::{Cell, EvidencePatch, TILE_CELLS, TILE_SIDE, TileIndex, TilePatch};

type Cells = BTreeMap<TileIndex, Box<[i16; TILE_CELLS]>>;

/// Moves a contribution whose pose and evidence are in a robot's own frame onto the level, a grid of `resolution`
/// metres a cell. Its pose becomes as uncertain as the alignment in addition, and is from then on of
/// the shared map, as the alignment is. Each cell takes the evidence of the cell that its centre comes from: none is made
/// up, and where cells turn against each other one may be told twice or not at all. The same arguments give the same bits.
#[must_use]
pub fn moved(
    contribution: &Contribution,
    level_from_odom: &UncertainPose<Level, Odom>,
    resolution: f64,
) -> Contribution {
    // A contribution names its frame `Level`, whichever it was made in.
    let own = &contribution.level_from_robot;
    let odom_from_robot = UncertainPose {
        pose: Pose::new(own.pose.x, own.pose.y, own.pose.heading()),
        covariance: own.covariance,
    };
    let evidence = contribution.evidence.iter();
    Contribution {
        level_from_robot: level_from_odom.compose(&odom_from_robot),
        provenance: Provenance::SharedMap,
        evidence: evidence.map(|patch| turned(patch, &level_from_odom.pose, resolution)).collect(),
        ..contribution.clone()
    }
}

fn turned(
    patch: &EvidencePatch,
    level_from_odom: &Pose<Level, Odom>,
    resolution: f64,
) -> EvidencePatch {
    let mut cells = Cells::new();
    let mut reached = BTreeSet::new();
    for (tile, runs) in &patch.tiles {
        let of_tile = cells.entry(*tile).or_insert_with(|| Box::new([0; TILE_CELLS]));
        for run in runs.runs() {
            of_tile[run.range()].fill(run.value);
        }
        reached.extend(reaches(*tile, level_from_odom, resolution));
    }
    let odom_from_level = level_from_odom.inverse();
    let mut tiles = BTreeMap::new();
    for tile in reached {
        let mut turned = Box::new([0; TILE_CELLS]);
        let mut near: Option<(TileIndex, Option<&[i16; TILE_CELLS]>)> = None;
        for (offset, value) in turned.iter_mut().enumerate() {
            let centre = odom_from_level.act(&tile.cell(offset).centre(resolution));
            let (from, at) = Cell::holding(&centre, resolution).tile();
            let of_tile = match near {
                Some((known, of_tile)) if known == from => of_tile,
                _ => cells.get(&from).map(AsRef::as_ref),
            };
            near = Some((from, of_tile));
            *value = of_tile.map_or(0, |cells| cells[at]);
        }
        let patch = TilePatch::from_cells(&turned);
        if !patch.runs().is_empty() {
            tiles.insert(tile, patch);
        }
    }
    EvidencePatch { class: patch.class, tiles }
}

/// Tiles of the level in which a tile of the robot's grid can lie.
fn reaches(
    tile: TileIndex,
    level_from_odom: &Pose<Level, Odom>,
    resolution: f64,
) -> impl Iterator<Item = TileIndex> + use<> {
    let side = TILE_SIDE as f64 * resolution;
    let corner = |dx: f64, dy: f64| {
        let p = Point::new((f64::from(tile.x) + dx) * side, (f64::from(tile.y) + dy) * side);
        level_from_odom.act(&p)
    };
    let corners = [corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0)];
    let span = |of: fn(&Point) -> f64| {
        let low = corners.iter().map(of).fold(f64::INFINITY, f64::min);
        let high = corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        (low / side).floor() as i32..=(high / side).floor() as i32
    };
    let (columns, rows) = (span(|p| p.x), span(|p| p.y));
    rows.flat_map(move |y| columns.clone().map(move |x| TileIndex { x, y }))
}
