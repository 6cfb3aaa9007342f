//! Where on a level a whole look fits: with nothing known, and with certainty that no other place does.
//!
//! Landmarks propose, the whole look disposes. A likelihood field ([`LikelihoodField`]) says of every cell of
//! the raster how well the end of a beam fits there: on a wall, in the unknown, in what is known to be
//! free. A place weighs what its beams' ends come to, and what they would have passed through. [`search()`]
//! finds every place whose weight comes near the best one's, by branch and bound over headings that
//! bring walls onto walls: what it does not name has been shown to weigh less. So whoever finds one place
//! alone may believe it, and whoever finds several knows between which to tell.
//!
//! Correlative matching by branch and bound is Olson's (2009) and Hess's (2016); weighing what is found
//! against "nowhere on this map", and answering with all that cannot be told apart, is ours.

mod field;
mod headings;
mod pyramid;
mod search;
mod sides;
mod weigh;

use crate::geometry::{Level, Point, Robot, UncertainPose};

pub use field::LikelihoodField;
pub(crate) use field::{Known, STEPS, walls_of};
pub use search::{place_near, pose_at, search, search_near};

/// A beam of a look that hit something, in the robot frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// Where its sensor was.
    pub from: Point,
    /// What it hit.
    pub to: Point,
    /// The unit normal of the wall that it hit, if it hit a wall.
    pub normal: Option<Point>,
}

/// What a robot sees, in its own frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct View {
    /// Beams, thinned so that neighbours end some way apart.
    pub beams: Vec<Beam>,
    /// Walls, each from end to end with free space on the left.
    pub walls: Vec<(Point, Point)>,
}

impl View {
    /// Takes a beam if it ends far enough from the last one that was taken.
    pub fn add(&mut self, beam: Beam, config: &PlacesConfig) {
        let is_apart = |last: &Beam| (beam.to - last.to).norm() >= config.spacing;
        if (beam.to - beam.from).norm() <= config.range_max
            && self.beams.last().is_none_or(is_apart)
        {
            self.beams.push(beam);
        }
    }
}

/// How well places fit, and when no other one does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacesConfig {
    /// Edge of the cells of the search, metres.
    pub cell: f64,
    /// From this evidence on a cell is occupied, nat: two to one.
    pub occupied: f64,
    /// Down to this evidence a cell is not yet free, nat.
    pub free: f64,
    /// Down to this a cell that the prior says is free, and no robot contradicts, is presumed to be, nat.
    pub presumed: f64,
    /// Of what the prior says is solid, so much can be seen from outside, metres.
    pub skin: f64,
    /// What a beam that ends in the unknown costs, nat.
    pub unknown_cost: f64,
    /// What one that ends in free space costs, nat.
    pub free_cost: f64,
    /// What one that ends in what is presumed to be free costs: furniture is in no plan, nat.
    pub presumed_cost: f64,
    /// What one costs that passes through a wall, besides, nat: glass, and walls grazed, are rarer than places that only
    /// resemble the right one.
    pub through_cost: f64,
    /// The same of one that ends in the unknown behind it: what was never seen from here is behind a wall for good, nat.
    pub through_unknown_cost: f64,
    /// What one costs that ends on a wall of which only the other side is known, besides: thin walls have been seen from one
    /// side, nat.
    pub behind_cost: f64,
    /// What one costs that ends on a wall which stands across the one that was hit, besides, nat.
    pub across_cost: f64,
    /// Deviation of beams' ends from the cells of the walls that they hit, metres.
    pub spread: f64,
    /// What counts of a beam, as its neighbours err with it.
    pub temper: f64,
    /// What a beam costs on average at a place that is not on the map, nat.
    pub elsewhere: f64,
    /// Ends of beams are so far apart at least, metres.
    pub spacing: f64,
    /// Longer beams are left out, metres.
    pub range_max: f64,
    /// With longer beams only small blocks of the search are bounded, as a heading's error shows most there, metres.
    pub search_range: f64,
    /// Most beams that are weighed.
    pub beams_max: usize,
    /// Logarithm of how much likelier a place must be than all others together, and than none.
    pub odds: f64,
    /// Places that are less likely than the best by this and the odds are not told, nat.
    pub margin: f64,
    /// Places closer than this are one: metres, radians.
    pub apart: (f64, f64),
    /// In a search of the whole map places are told down to this below what one of so many must fit by chance, so that it is
    /// known by how much the best is ahead, nat.
    pub below_chance: f64,
    /// Most places that are told.
    pub places_max: usize,
    /// Most blocks of places that are looked into.
    pub blocks_max: usize,
    /// Most places that are weighed.
    pub tries_max: usize,
}

impl PlacesConfig {
    /// The defaults: a thousand to one.
    pub const STANDARD: Self = Self {
        cell: 0.1,
        occupied: 0.62,
        free: -1.0,
        presumed: -0.4,
        skin: 0.05,
        unknown_cost: 1.0,
        free_cost: 2.2,
        presumed_cost: 1.5,
        through_cost: 1.0,
        through_unknown_cost: 3.5,
        behind_cost: 0.5,
        across_cost: 1.5,
        spread: 0.08,
        temper: 0.5,
        elsewhere: 0.9,
        spacing: 0.15,
        range_max: 30.0,
        search_range: 12.0,
        beams_max: 160,
        odds: 6.9,
        margin: 3.0,
        apart: (0.5, 0.3),
        below_chance: 4.0,
        places_max: 64,
        blocks_max: 2_000_000,
        tries_max: 20_000,
    };
    /// How well so many beams fit that cost so much in all, nat: above 0 if better than at a place that is not on the map.
    fn fit(&self, beams: usize, cost: f64) -> f64 {
        self.temper * (self.elsewhere * beams as f64 - cost)
    }
}

/// A place that a look fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// The robot's pose there. Along what the look does not tell, its deviation is half the distance at which
    /// places count as two.
    pub level_from_robot: UncertainPose<Level, Robot>,
    /// Logarithm of how much likelier the look is from here than from a place that is not on the map.
    pub fit: f64,
    /// Share of the beams that end on what is known to be occupied.
    pub hits: f64,
    /// Share of the beams that pass through what is known to be occupied.
    pub throughs: f64,
    /// Beams that were weighed.
    pub beams: usize,
}

impl Place {
    /// How much better a beam fits here than at a place that is not on the map, on average, nat.
    pub fn gain(&self) -> f64 {
        self.fit / self.beams.max(1) as f64
    }
}

/// What a search came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// Places, best first.
    pub places: Vec<Place>,
    /// No other place fits better than this: less than the best by the odds and the margin, unless there were
    /// too many to look at.
    pub rest: f64,
    /// Blocks of places that were looked into.
    pub blocks: usize,
}
