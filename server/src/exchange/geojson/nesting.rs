//! Which outline of what is solid is round which room, so that the rooms become its holes.

use std::collections::BTreeMap;

use mapfold_map::geometry::Point;

use super::super::dxf::area;
use super::super::incoming::FileFault;

/// Bands that edges are sorted into by their height in the plan.
const BANDS_MAX: f64 = 4096.0;
/// Edges, once for each band that they touch, and edges that are looked at for all rooms together.
const WORK_MAX: usize = 40_000_000;

/// Of each room the outline that it lies in: the smallest of those round it that is larger than the room.
///
/// # Errors
/// There are too many of both.
pub(super) fn around(
    rooms: &[Vec<Point>],
    outlines: &[Vec<Point>],
) -> Result<Vec<Option<usize>>, FileFault> {
    let crowded = || {
        FileFault::at(
            "/features",
            "there are too many rooms and outlines to tell which holds which",
        )
    };
    let corners = || outlines.iter().flatten();
    let low = corners().map(|p| p.y).fold(f64::INFINITY, f64::min);
    let high = corners().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return Ok(vec![None; rooms.len()]);
    }
    let count = (high - low).ceil().clamp(1.0, BANDS_MAX);
    let step = ((high - low) / count).max(1e-6);
    let band = |y: f64| ((y - low) / step).clamp(0.0, count - 1.0) as usize;
    let mut bands: Vec<Vec<(usize, Point, Point)>> = vec![Vec::new(); count as usize];
    let mut work = 0;
    for (index, outline) in outlines.iter().enumerate() {
        for (from, to) in outline.iter().zip(outline.iter().cycle().skip(1)) {
            let (first, last) = (band(from.y.min(to.y)), band(from.y.max(to.y)));
            work += last - first + 1;
            if work > WORK_MAX {
                return Err(crowded());
            }
            bands[first..=last].iter_mut().for_each(|edges| edges.push((index, *from, *to)));
        }
    }
    let areas: Vec<f64> = outlines.iter().map(|outline| area(outline).abs()).collect();
    let mut found = Vec::with_capacity(rooms.len());
    for room in rooms {
        let Some(at) = inner(room) else {
            found.push(None);
            continue;
        };
        let edges = &bands[band(at.y)];
        work += edges.len();
        if work > WORK_MAX {
            return Err(crowded());
        }
        // Edges to the right of it: an odd number of an outline that it lies in.
        let mut crossed: BTreeMap<usize, bool> = BTreeMap::new();
        for (index, from, to) in edges {
            let passes = (from.y > at.y) != (to.y > at.y);
            if passes && from.x + (at.y - from.y) / (to.y - from.y) * (to.x - from.x) > at.x {
                let odd = crossed.entry(*index).or_default();
                *odd = !*odd;
            }
        }
        let size = area(room).abs();
        let inside = crossed.into_iter().filter(|(index, odd)| *odd && areas[*index] > size);
        let smallest = inside.min_by(|a, b| areas[a.0].total_cmp(&areas[b.0]));
        found.push(smallest.map(|(index, _)| index));
    }
    Ok(found)
}

/// A place of a room that is on no outline of what is round it: the middle of its longest wall, for rooms and outlines share
/// corners at most.
fn inner(room: &[Point]) -> Option<Point> {
    let walls = room.iter().zip(room.iter().cycle().skip(1));
    let longest = walls.max_by(|a, b| (a.1 - a.0).norm().total_cmp(&(b.1 - b.0).norm()));
    longest.map(|(from, to)| (from + to) * 0.5)
}
