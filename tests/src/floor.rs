//! A merged map as plain shapes: straight pieces, hulls, occupied cells, and fast answers to
//! "what is near this point" and "what does this beam cross". Built from the wire types alone.

use std::collections::BTreeMap;

use mapfold_schema::v1::{Cluster, Segment, TileEvidence};

use crate::plane::{Piece, Point, distance_to_hull};

/// Cells along the side of a tile, by the contract of the wire.
const TILE_CELLS: i32 = 64;

/// Edge of a bin of the index, metres.
const BIN_M: f64 = 1.0;

/// A merged map.
#[derive(Debug)]
pub struct Floor {
    pieces: Vec<Piece>,
    hulls: Vec<Vec<Point>>,
    /// Sums of evidence over all sensors, tile by tile, row by row from below.
    tiles: BTreeMap<(i32, i32), Vec<i32>>,
    resolution_m: f64,
    piece_bins: Bins,
    hull_bins: Bins,
}

impl Floor {
    /// The map of these segments, clusters and tiles. Shapes within `reach_m` of a point are found
    /// by [`Floor::is_near`] with up to that distance.
    pub fn new(
        segments: &[Segment],
        clusters: &[Cluster],
        tiles: &[TileEvidence],
        resolution_m: f64,
        reach_m: f64,
    ) -> Self {
        let point = |at: &[f64; 2]| Point::new(at[0], at[1]);
        let mut floor = Self {
            pieces: segments.iter().flat_map(pieces_of).collect(),
            hulls: clusters.iter().map(|c| c.hull_m.iter().map(point).collect()).collect(),
            tiles: BTreeMap::new(),
            resolution_m,
            piece_bins: Bins::default(),
            hull_bins: Bins::default(),
        };
        for (index, piece) in floor.pieces.iter().enumerate() {
            floor
                .piece_bins
                .add(index, &[piece.a, piece.b], reach_m, |p, r| piece.distance(p) <= r);
        }
        for (index, hull) in floor.hulls.iter().enumerate() {
            floor.hull_bins.add(index, hull, reach_m, |p, r| distance_to_hull(hull, p) <= r);
        }
        for tile in tiles {
            let side = TILE_CELLS as usize;
            let sums = floor.tiles.entry((tile.x, tile.y)).or_insert_with(|| vec![0; side * side]);
            for run in tile.runs.chunks_exact(3) {
                for sum in sums.iter_mut().skip(run[0] as usize).take(run[1] as usize) {
                    *sum += run[2];
                }
            }
        }
        floor
    }

    /// Edge of a cell, metres.
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// The solid pieces of all segments.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Whether a piece, a hull or an occupied cell lies within `distance_m` of a point.
    pub fn is_near(&self, point: Point, distance_m: f64) -> bool {
        self.piece_bins.at(point).any(|index| self.pieces[index].distance(point) <= distance_m)
            || self
                .hull_bins
                .at(point)
                .any(|index| distance_to_hull(&self.hulls[index], point) <= distance_m)
            || self.is_occupied_near(point, distance_m)
    }

    /// Whether a cell that is more likely occupied than free lies within `distance_m` of a point,
    /// measured to the cell's square.
    fn is_occupied_near(&self, point: Point, distance_m: f64) -> bool {
        let cell = |metres: f64| (metres / self.resolution_m).floor() as i32;
        let (left, right) = (cell(point.x - distance_m), cell(point.x + distance_m));
        let (low, high) = (cell(point.y - distance_m), cell(point.y + distance_m));
        (low..=high).any(|row| {
            (left..=right).any(|column| {
                let outside = |at: f64, index: i32| {
                    let edge = f64::from(index) * self.resolution_m;
                    (edge - at).max(at - edge - self.resolution_m).max(0.0)
                };
                outside(point.x, column).hypot(outside(point.y, row)) <= distance_m
                    && self.evidence(column, row) > 0
            })
        })
    }

    /// The summed evidence of a cell, 0.01 nat; more than 0 means a probability above one half.
    pub fn evidence(&self, column: i32, row: i32) -> i32 {
        let tile = (column.div_euclid(TILE_CELLS), row.div_euclid(TILE_CELLS));
        let offset = row.rem_euclid(TILE_CELLS) * TILE_CELLS + column.rem_euclid(TILE_CELLS);
        self.tiles.get(&tile).map_or(0, |sums| sums[offset as usize])
    }

    /// How far a beam goes on, along itself, behind the first of the pieces that it crosses; 0 if
    /// it crosses none.
    pub fn behind_m(&self, beam: &Piece) -> f64 {
        let length = beam.length();
        let mut behind_m: f64 = 0.0;
        // Half a bin a step, and every bin reaches half a bin farther than its square: no piece
        // that the beam crosses is missed.
        let steps = (length / (0.5 * BIN_M)).ceil().max(1.0) as usize;
        for step in 0..=steps {
            let share = step as f64 / steps as f64;
            let at = Point::new(
                beam.a.x + share * (beam.b.x - beam.a.x),
                beam.a.y + share * (beam.b.y - beam.a.y),
            );
            for index in self.piece_bins.at(at) {
                if let Some(share) = beam.crossing(&self.pieces[index]) {
                    behind_m = behind_m.max((1.0 - share) * length);
                }
            }
        }
        behind_m
    }
}

/// The solid parts of a segment as pieces: `from_m` and `to_m` run from the foot point of the
/// origin a quarter turn left of the normal.
fn pieces_of(segment: &Segment) -> impl Iterator<Item = Piece> {
    let foot = Point::new(0.0, 0.0).towards(segment.alpha_rad, segment.rho_m);
    let along = segment.alpha_rad + std::f64::consts::FRAC_PI_2;
    segment.solid.iter().map(move |solid| Piece {
        a: foot.towards(along, solid.from_m),
        b: foot.towards(along, solid.to_m),
    })
}

/// Which shapes may matter in which square of the plane.
#[derive(Debug, Default)]
struct Bins {
    bins: BTreeMap<(i32, i32), Vec<usize>>,
}

impl Bins {
    /// Enters a shape into every bin within `reach_m` of it, and at least half a bin.
    fn add(
        &mut self,
        index: usize,
        corners: &[Point],
        reach_m: f64,
        is_within: impl Fn(Point, f64) -> bool,
    ) {
        let reach = reach_m.max(0.5 * BIN_M);
        let bounds = |of: fn(&Point) -> f64| {
            let low = corners.iter().map(of).fold(f64::INFINITY, f64::min);
            let high = corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            (((low - reach) / BIN_M).floor() as i32, ((high + reach) / BIN_M).floor() as i32)
        };
        let ((left, right), (low, high)) = (bounds(|p| p.x), bounds(|p| p.y));
        let half_diagonal = BIN_M * std::f64::consts::FRAC_1_SQRT_2;
        for column in left..=right {
            for row in low..=high {
                let centre = |at: i32| (f64::from(at) + 0.5) * BIN_M;
                if is_within(Point::new(centre(column), centre(row)), reach + half_diagonal) {
                    self.bins.entry((column, row)).or_default().push(index);
                }
            }
        }
    }

    fn at(&self, point: Point) -> impl Iterator<Item = usize> {
        let bin = ((point.x / BIN_M).floor() as i32, (point.y / BIN_M).floor() as i32);
        self.bins.get(&bin).into_iter().flatten().copied()
    }
}

#[cfg(test)]
mod tests {
    use mapfold_schema::v1::{EndKind, Facing, SensorClass, SolidInterval};

    use super::*;

    /// A wall from (0, 2) to (`length`, 2), seen from below.
    fn wall(length: f64) -> Segment {
        Segment {
            id: String::new(),
            rho_m: 2.0,
            alpha_rad: std::f64::consts::FRAC_PI_2,
            covariance: [[1e-4, 0.0], [0.0, 1e-4]],
            covariance_independent: [[1e-4, 0.0], [0.0, 1e-4]],
            covariance_dependent: [[0.0, 0.0], [0.0, 0.0]],
            facing: Facing::Origin,
            // A quarter turn left of "up" is "left": the wall lies on the negative side.
            solid: vec![SolidInterval {
                from_m: -length,
                to_m: 0.0,
                ends: [EndKind::Jump; 2],
                existence_nat: 2.89,
            }],
            quality: 1,
            robots: Vec::new(),
            first_seen: String::new(),
            last_seen: String::new(),
        }
    }

    #[test]
    fn a_segment_lies_where_its_line_and_its_solid_part_say() {
        let floor = Floor::new(&[wall(3.0)], &[], &[], 0.05, 0.1);
        let piece = floor.pieces()[0];
        assert!(piece.a.distance(Point::new(3.0, 2.0)) < 1e-12);
        assert!(piece.b.distance(Point::new(0.0, 2.0)) < 1e-12);
        assert!(floor.is_near(Point::new(1.0, 2.09), 0.1));
        assert!(!floor.is_near(Point::new(1.0, 2.11), 0.1));
        assert!(!floor.is_near(Point::new(3.2, 2.0), 0.1));
    }

    #[test]
    fn an_occupied_cell_is_near_by_its_square_and_a_free_one_never() {
        let tile = |value| TileEvidence {
            sensor: SensorClass::Sonar,
            x: -1,
            y: 0,
            // The last cell of the lowest row: from (-0.05, 0) to (0, 0.05).
            runs: vec![63, 1, value],
        };
        let occupied = Floor::new(&[], &[], &[tile(80), tile(-79)], 0.05, 0.1);
        assert!(occupied.is_near(Point::new(0.09, 0.02), 0.1));
        assert!(!occupied.is_near(Point::new(0.11, 0.02), 0.1));
        assert!(!occupied.is_near(Point::new(0.09, 0.14), 0.1));
        let free = Floor::new(&[], &[], &[tile(80), tile(-80)], 0.05, 0.1);
        assert!(!free.is_near(Point::new(-0.02, 0.02), 0.1));
    }

    #[test]
    fn a_beam_runs_through_a_wall_only_if_it_goes_on_behind_it() {
        let floor = Floor::new(&[wall(30.0)], &[], &[], 0.05, 0.1);
        let beam = |top: f64| Piece { a: Point::new(29.0, -20.0), b: Point::new(29.0, top) };
        assert!((floor.behind_m(&beam(2.3)) - 0.3).abs() < 1e-9);
        assert!(floor.behind_m(&beam(1.9)) <= 0.0);
        let past = Piece { a: Point::new(31.0, 0.0), b: Point::new(31.0, 9.0) };
        assert!(floor.behind_m(&past) <= 0.0);
        let grazing = Piece { a: Point::new(26.0, 1.9), b: Point::new(29.0, 2.09) };
        assert!(floor.behind_m(&grazing) > 1.0);
    }
}
