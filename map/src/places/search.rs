//! All places that a look fits nearly as well as the best, by branch and bound.
//!
//! Blocks of places, heading by heading, are looked into in the order of what their best place can come to
//! at most, those with likely headings first; a block that cannot come near the best place found so far is never opened. A
//! block of one place is moved to where it fits best and weighed in full. The bound holds for what the ends of the beams come to
//! on cells of the search, which forgive what is off by less than one of them.

use std::collections::HashMap;
use std::ops::Range;

use super::field::{FAR_OFF_CELLS, LikelihoodField, STEPS};
use super::pyramid::LEVELS;
use super::weigh::{posterior, refined, weighed};
use super::{Beam, Found, Place, View};
use crate::geometry::{Level, Point, Pose, Robot, UncertainPose, difference};

/// Poses so close to one that was tried would be moved to the same place: metres, radians.
const TRIED: (f64, f64) = (0.25, 0.03);
/// Headings within this of a place that is kept belong to it, radians.
const SAME_HEADING: f64 = 0.15;
/// Headings around a known one are so far apart, radians: a beam of the search's range moves by two cells.
const HEADING_STEP: f64 = 0.0175;
/// Blocks to begin with around a known pose: 8 cells.
const NEAR_LEVEL: u8 = 3;
/// Beams between two looks at whether a block can still come to anything.
const CHUNK: usize = 16;

/// A block of places at one heading.
#[derive(Debug, Clone, Copy)]
struct Block {
    /// What its best place comes to at most, in steps.
    bound: u32,
    level: u8,
    heading: u16,
    x: i32,
    y: i32,
}

/// Blocks by their bounds, of which there are some thousands: taking the best of millions costs no more than of a few.
#[derive(Default)]
struct Blocks {
    by_bound: Vec<Vec<Block>>,
}

impl Blocks {
    fn push(&mut self, block: Block) {
        let bound = block.bound as usize;
        if bound >= self.by_bound.len() {
            self.by_bound.resize_with(bound + 1, Vec::new);
        }
        self.by_bound[bound].push(block);
    }

    /// One with the greatest bound, the last of them that came.
    fn pop(&mut self) -> Option<Block> {
        while let Some(last) = self.by_bound.last_mut() {
            if let Some(block) = last.pop() {
                return Some(block);
            }
            self.by_bound.pop();
        }
        None
    }
}

/// The levels whose blocks hold all that is off by [`FAR_OFF_CELLS`] from the places of a block: of a block of one place, of two to a side, and
/// so on. Larger ones would have to be so large that they hold a wall anyway.
const FAR_LEVELS: [usize; 4] = [2, 3, 3, 4];

/// The ends of beams at one heading.
struct Turned {
    /// Of near beams, as offsets into each level of the field.
    near: Vec<Vec<i64>>,
    /// Of far beams: the lower left of the cells where they may end, from the robot's cell on.
    far: Vec<(i32, i32)>,
}

/// Poses that were tried, by where they are.
#[derive(Default)]
struct Tried {
    by_square: HashMap<(i32, i32), Vec<Pose<Level, Robot>>>,
    count: usize,
}

impl Tried {
    fn square(p: &Point) -> (i32, i32) {
        ((p.x / TRIED.0).floor() as i32, (p.y / TRIED.0).floor() as i32)
    }

    fn add(&mut self, pose: Pose<Level, Robot>) {
        self.count += 1;
        self.by_square.entry(Self::square(&pose.position())).or_default().push(pose);
    }

    /// Those that may be as close to a place as poses are that would be moved to the same one.
    fn near(&self, p: &Point) -> impl Iterator<Item = &Pose<Level, Robot>> {
        let (x, y) = Self::square(p);
        let squares = (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| (x + dx, y + dy)));
        squares.filter_map(|square| self.by_square.get(&square)).flatten()
    }
}

/// The place close to a pose at which a look fits best.
pub fn place_near(field: &LikelihoodField, view: &View, pose: &Pose<Level, Robot>) -> Place {
    let beams = thinned(&view.beams, field.config.beams_max);
    weighed(field, &beams, &refined(field, &beams, *pose).0)
}

/// Where the robot is if it is at this place, by all that the look shows: mean and covariance over the poses that count as
/// this place.
pub fn pose_at(field: &LikelihoodField, view: &View, place: &Place) -> UncertainPose<Level, Robot> {
    let beams = thinned(&view.beams, field.config.beams_max);
    posterior(field, &beams, &place.level_from_robot.pose)
}

/// Finds where the look that `view` is can have been taken: all places, if there are not too many, that
/// fit it as well as the best to within the odds and the margin, and nearly as well as one of so many must by chance. `proposals` are poses to begin with, from landmarks that
/// were matched for instance; the answer does not depend on them, only the time that it takes.
pub fn search(field: &LikelihoodField, view: &View, proposals: &[Pose<Level, Robot>]) -> Found {
    let headings = field.search.directions.headings(&view.walls);
    let (width, height) = field.search.size;
    let window = Window {
        level: LEVELS as u8 - 1,
        x: (0, width as i32 - 1),
        y: (0, height as i32 - 1),
        floor: field.ln_places() - field.config.below_chance,
    };
    within(field, view, headings, &window, proposals)
}

/// The same around a pose that is known to within `reach` metres along each axis and `turn` radians: places that
/// fit better than one of so few must by chance. Some of them may lie a little beyond.
pub fn search_near(
    field: &LikelihoodField,
    view: &View,
    around: &Pose<Level, Robot>,
    (reach, turn): (f64, f64),
) -> Found {
    let steps = (turn / HEADING_STEP).ceil() as i32;
    let heading = |step: i32| around.heading() + f64::from(step) * HEADING_STEP;
    let cell = |at: f64, corner: f64| ((at - corner) / field.search.cell).floor() as i32;
    let side = 1 << NEAR_LEVEL;
    let (corner, (width, height)) = (field.search.corner, field.search.size);
    // From the beginning of a block on, and never off the map.
    let span = |at: f64, corner: f64, size: usize| {
        let low = cell(at - reach, corner).div_euclid(side) * side;
        (low.max(0), cell(at + reach, corner).min(size as i32 - 1))
    };
    let (apart, turned) = field.config.apart;
    let places = (2.0 * reach / apart).max(1.0).powi(2) * (2.0 * turn / turned).max(1.0);
    let window = Window {
        level: NEAR_LEVEL,
        x: span(around.x, corner.x, width),
        y: span(around.y, corner.y, height),
        floor: places.ln(),
    };
    let headings = (-steps..=steps).map(heading).collect();
    within(field, view, [headings, Vec::new()], &window, &[*around])
}

/// Where to search: blocks of a level from cell to cell.
struct Window {
    level: u8,
    x: (i32, i32),
    y: (i32, i32),
    /// Places that fit less are of no interest.
    floor: f64,
}

fn within(
    field: &LikelihoodField,
    view: &View,
    [likely, others]: [Vec<f64>; 2],
    window: &Window,
    proposals: &[Pose<Level, Robot>],
) -> Found {
    let config = &field.config;
    let beams = thinned(&view.beams, config.beams_max);
    if beams.is_empty() {
        return Found { places: Vec::new(), rest: 0.0, blocks: 0 };
    }
    let (near, far): (Vec<Beam>, Vec<Beam>) =
        beams.iter().partition(|beam| beam.to.norm() <= config.search_range);
    let parties = [0..likely.len(), likely.len()..likely.len() + others.len()];
    let headings = [likely, others].concat();
    let turned = headings.iter().map(|heading| turned(field, &near, &far, *heading)).collect();
    let mut search = Search {
        field,
        beams: &beams,
        headings,
        turned,
        floor: f64::NEG_INFINITY,
        least: 1,
        best: f64::NEG_INFINITY,
        places: Vec::new(),
        tried: Tried::default(),
        opened: 0,
    };
    search.raise(window.floor);
    for proposal in proposals {
        search.weigh(*proposal);
    }
    let rest = parties.into_iter().map(|headings| search.run(headings, window));
    // In this order: what likely headings came to spares most of the others.
    let rest = rest.fold(f64::NEG_INFINITY, f64::max);
    let blocks = search.opened;
    let mut places = search.places;
    places.retain(|place| place.fit >= search.best - config.odds - config.margin);
    places.sort_by(|a, b| b.fit.total_cmp(&a.fit));
    Found { places, rest, blocks }
}

/// Evenly taken from all.
fn thinned(beams: &[Beam], most: usize) -> Vec<Beam> {
    if beams.len() <= most {
        return beams.to_vec();
    }
    (0..most).map(|i| beams[i * beams.len() / most]).collect()
}

fn turned(field: &LikelihoodField, near: &[Beam], far: &[Beam], heading: f64) -> Turned {
    let (sin, cos) = heading.sin_cos();
    let cell = field.search.cell;
    let end = |Beam { to, .. }: &Beam| {
        let (x, y) = (cos * to.x - sin * to.y, sin * to.x + cos * to.y);
        ((x / cell).round() as i32, (y / cell).round() as i32)
    };
    let ends: Vec<(i32, i32)> = near.iter().map(end).collect();
    let of_level =
        |level| ends.iter().map(|(x, y)| field.search.fits.offset(level, *x, *y)).collect();
    let lower_left = |beam| {
        let (x, y) = end(beam);
        (x - FAR_OFF_CELLS, y - FAR_OFF_CELLS)
    };
    Turned { near: (0..LEVELS).map(of_level).collect(), far: far.iter().map(lower_left).collect() }
}

struct Search<'a> {
    field: &'a LikelihoodField,
    beams: &'a [Beam],
    headings: Vec<f64>,
    turned: Vec<Turned>,
    /// Places that fit less do not matter.
    floor: f64,
    /// What a block must come to for that, in steps.
    least: u32,
    /// How well the best place so far fits.
    best: f64,
    places: Vec<Place>,
    tried: Tried,
    /// Blocks that were looked into.
    opened: usize,
}

impl Search<'_> {
    /// Looks into blocks with some of the headings until none can hold a place that matters; answers what no other place
    /// exceeds that has one of these.
    fn run(&mut self, headings: Range<usize>, window: &Window) -> f64 {
        let config = &self.field.config;
        let mut blocks = self.coarsest(headings, window);
        while let Some(block) = blocks.pop() {
            if block.bound < self.least {
                break;
            }
            self.opened += 1;
            if self.opened > config.blocks_max
                || self.tried.count >= config.tries_max
                || self.places.len() >= config.places_max
            {
                return self.fit_of(block.bound);
            }
            if self.is_known(&block) {
                continue;
            }
            let Some(level) = block.level.checked_sub(1) else {
                self.weigh(self.pose(&block));
                continue;
            };
            let half = 1 << level;
            for (dx, dy) in [(0, 0), (half, 0), (0, half), (half, half)] {
                let (x, y) = (block.x + dx, block.y + dy);
                let bound = self.bound(level, block.heading, x, y).min(block.bound);
                if bound >= self.least {
                    blocks.push(Block { bound, level, x, y, ..block });
                }
            }
        }
        self.fit_of(self.least)
    }

    fn coarsest(&self, headings: Range<usize>, window: &Window) -> Blocks {
        let level = window.level;
        let mut blocks = Blocks::default();
        for heading in headings.start as u16..headings.end as u16 {
            for y in (window.y.0..=window.y.1).step_by(1 << level) {
                for x in (window.x.0..=window.x.1).step_by(1 << level) {
                    let bound = self.bound(level, heading, x, y);
                    if bound >= self.least {
                        blocks.push(Block { bound, level, heading, x, y });
                    }
                }
            }
        }
        blocks
    }

    /// What the best place of a block comes to at most; 0 if it is less than what matters.
    fn bound(&self, level: u8, heading: u16, x: i32, y: i32) -> u32 {
        let (level, field) = (usize::from(level), &self.field.search);
        if field.free.value(level, field.free.place(level, x, y)) == 0 {
            return 0;
        }
        let place = field.fits.place(level, x, y);
        let Turned { near, far } = &self.turned[usize::from(heading)];
        let offsets = &near[level];
        // Far ones lose nothing, to begin with.
        let (mut sum, mut left) = (far.len() as u32 * u32::from(self.field.best), offsets.len());
        for chunk in offsets.chunks(CHUNK) {
            sum += chunk.iter().map(|o| u32::from(field.fits.value(level, place + o))).sum::<u32>();
            left -= chunk.len();
            if sum + left as u32 * u32::from(self.field.best) < self.least {
                return 0;
            }
        }
        let Some(far_level) = FAR_LEVELS.get(level) else { return sum };
        for (dx, dy) in far {
            let end = field.fits.place(*far_level, x + dx, y + dy);
            let fit = field.fits.value(*far_level, end);
            sum -= u32::from(self.field.best.saturating_sub(fit));
            if sum < self.least {
                return 0;
            }
        }
        sum
    }

    /// The pose of a block of one place.
    fn pose(&self, block: &Block) -> Pose<Level, Robot> {
        let at = self.lower(block);
        Pose::new(at.x, at.y, self.headings[usize::from(block.heading)])
    }

    /// The first place of a block.
    fn lower(&self, block: &Block) -> Point {
        let field = &self.field.search;
        let half = Point::new(f64::from(block.x) + 0.5, f64::from(block.y) + 0.5);
        field.corner + half * field.cell
    }

    /// Whether all places of a block are close to one that is kept or was tried.
    fn is_known(&self, block: &Block) -> bool {
        let lower = self.lower(block);
        let heading = self.headings[usize::from(block.heading)];
        let side = f64::from((1_u32 << block.level) - 1) * self.field.search.cell;
        let is_within = |pose: &Pose<Level, Robot>, (reach, turn): (f64, f64)| {
            let off = |at: f64, lower: f64| (at - lower).abs().max((at - lower - side).abs());
            let (x, y) = (off(pose.x, lower.x), off(pose.y, lower.y));
            x < reach
                && y < reach
                && x * x + y * y < reach * reach
                && difference(pose.heading(), heading).abs() < turn
        };
        let same = (0.8 * self.field.config.apart.0, SAME_HEADING);
        self.places.iter().any(|place| is_within(&place.level_from_robot.pose, same))
            || (side < TRIED.0 && self.tried.near(&lower).any(|pose| is_within(pose, TRIED)))
    }

    /// Moves a pose to where it fits best and keeps it if it fits nearly as well as the best.
    fn weigh(&mut self, pose: Pose<Level, Robot>) {
        self.tried.add(pose);
        let config = &self.field.config;
        let (pose, ends) = refined(self.field, self.beams, pose);
        // What beams pass through can only cost.
        if self.fit_of(ends) < self.floor {
            return;
        }
        let place = weighed(self.field, self.beams, &pose);
        if place.fit < self.floor {
            return;
        }
        if place.fit > self.best {
            self.best = place.fit;
            self.raise(self.best - config.odds - config.margin);
        }
        let (apart, turned) = config.apart;
        let at = place.level_from_robot.pose;
        let is_same = |other: &&mut Place| {
            let other = &other.level_from_robot.pose;
            (other.position() - at.position()).norm() < apart
                && difference(other.heading(), at.heading()).abs() < turned
        };
        match self.places.iter_mut().find(is_same) {
            Some(known) if known.fit < place.fit => *known = place,
            Some(_) => {}
            None => self.places.push(place),
        }
    }

    /// How well a place fits at most if the ends of the beams come to `steps`.
    fn fit_of(&self, steps: u32) -> f64 {
        let most = f64::from(self.field.best) * self.beams.len() as f64;
        let cost = (most - f64::from(steps)) / STEPS;
        self.field.config.fit(self.beams.len(), cost)
    }

    /// From now on only places matter that fit as well as this.
    fn raise(&mut self, fit: f64) {
        self.floor = self.floor.max(fit);
        let config = &self.field.config;
        let count = self.beams.len() as f64;
        let cost = config.elsewhere * count - fit / config.temper;
        let most = f64::from(self.field.best) * count;
        self.least = self.least.max((most - STEPS * cost).max(0.0) as u32);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::PlacesConfig;
    use super::*;
    use crate::raster::{TILE_CELLS, TILE_SIDE, Tile, TileIndex};

    /// Cells of 5 cm, free but for walls here and there.
    fn field(walls: &[(usize, usize)]) -> LikelihoodField {
        let tiles = (0..12).flat_map(|x| (0..12).map(move |y| TileIndex { x, y }));
        let tiles = tiles.map(|index| {
            let mut cells = Box::new([-300; TILE_CELLS]);
            for (column, row) in walls {
                let tile = ((column / TILE_SIDE) as i32, (row / TILE_SIDE) as i32);
                if tile == (index.x, index.y) {
                    cells[row % TILE_SIDE * TILE_SIDE + column % TILE_SIDE] = 300;
                }
            }
            (index, Tile::new(cells))
        });
        LikelihoodField::new(tiles, [], 0.05, &PlacesConfig::STANDARD)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn no_place_of_a_block_is_better_than_its_bound(
            walls in prop::collection::vec((0..12 * TILE_SIDE, 0..12 * TILE_SIDE), 1..400),
            beams in prop::collection::vec((0.5..22.5_f64, -3.1..3.1_f64), 1..40),
            (x, y) in (0..300_i32, 0..300_i32),
            (off_x, off_y, off_turn) in (0.0..1.0_f64, 0.0..1.0_f64, -0.5..0.5_f64),
            degrees in 0..360_u32,
        ) {
            let field = field(&walls);
            let beam = |(range, bearing): (f64, f64)| Beam {
                from: Point::zeros(),
                to: Point::new(range * bearing.cos(), range * bearing.sin()),
                normal: None,
            };
            let beams: Vec<Beam> = beams.into_iter().map(beam).collect();
            let (near, far): (Vec<Beam>, Vec<Beam>) =
                beams.iter().partition(|beam| beam.to.norm() <= field.config.search_range);
            let heading = f64::from(degrees).to_radians();
            let search = Search {
                field: &field,
                beams: &beams,
                headings: vec![heading],
                turned: vec![turned(&field, &near, &far, heading)],
                floor: f64::NEG_INFINITY,
                least: 0,
                best: f64::NEG_INFINITY,
                places: Vec::new(),
                tried: Tried::default(),
                opened: 0,
            };
            for level in 0..LEVELS as u8 {
                let side = 1 << level;
                let (x, y) = (x / side * side, y / side * side);
                let within = |at: i32, off: f64| at + (off * f64::from(side)) as i32;
                let (x_in, y_in) = (within(x, off_x), within(y, off_y));
                // On cells of the search; far ends as they are with a heading that is off by up to half a degree.
                let fits = &field.search.fits;
                let place = fits.place(0, x_in, y_in);
                let of_near = search.turned[0].near[0].iter().map(|o| fits.value(0, place + o));
                let (sin, cos) = (heading + off_turn.to_radians()).sin_cos();
                let of_far = far.iter().map(|Beam { to, .. }| {
                    let end = Point::new(cos * to.x - sin * to.y, sin * to.x + cos * to.y);
                    let cell = |at: i32, end: f64| at + (end / field.search.cell).round() as i32;
                    fits.value(0, fits.place(0, cell(x_in, end.x), cell(y_in, end.y)))
                });
                let most: u32 = of_near.chain(of_far).map(u32::from).sum();
                let bound = search.bound(level, 0, x, y);
                let can_stand = field.search.free.value(0, field.search.free.place(0, x_in, y_in)) > 0;
                prop_assert!(!can_stand || bound >= most, "level {level}: {bound} for {most}");
            }
        }
    }
}
