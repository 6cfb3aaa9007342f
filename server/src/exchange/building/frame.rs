//! From units of a drawing to metres of a level.

use std::collections::BTreeMap;

use mapfold_map::geometry::Point;

use super::BuildingError;
use super::document::{Document, Level};

/// Shared fiducials that lie nearer to each other than this tell no direction, units of the drawing.
const SPREAD_MIN: f64 = 1e-6;

/// `level_from_drawing`: a turn, a scale and a shift, after y was turned to point up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    is_image: bool,
    /// Scale times cosine and sine of the turn.
    turn: Point,
    shift: Point,
}

impl Frame {
    /// The frame of a level: aligned to the reference level by fiducials of the same names if there are two, else
    /// scaled by its own measurements.
    pub(super) fn of(building: &Document, level: &Level) -> Result<Self, BuildingError> {
        let is_image = building.is_image;
        let own = Self::scaled(is_image, scale(building, level));
        let reference = building.levels.iter().find(|other| other.name == building.reference);
        let aligned =
            reference.filter(|reference| reference.name != level.name).and_then(|reference| {
                let scaled = Self::scaled(is_image, Some(scale(building, reference)?))?;
                scaled.aligned(level, reference)
            });
        let no_scale = || BuildingError::NoScale { level: level.name.clone() };
        aligned.or(own).ok_or_else(no_scale)
    }

    fn scaled(is_image: bool, scale: Option<f64>) -> Option<Self> {
        Some(Self { is_image, turn: Point::new(scale?, 0.0), shift: Point::zeros() })
    }

    /// Of `level`, by the fiducials that it shares with `reference`, whose frame this is: least squares over turn,
    /// scale and shift (Umeyama 1991, in the plane a quotient of complex numbers).
    fn aligned(&self, level: &Level, reference: &Level) -> Option<Self> {
        let known: BTreeMap<&str, [f64; 2]> =
            reference.fiducials.iter().map(|(name, at)| (name.as_str(), *at)).collect();
        let pairs: Vec<[Point; 2]> = level
            .fiducials
            .iter()
            .filter_map(|(name, at)| {
                let there = known.get(name.as_str())?;
                Some([upright(self.is_image, *at), self.point(*there)])
            })
            .collect();
        let count = pairs.len() as f64;
        let mean = |side: usize| pairs.iter().map(|pair| pair[side]).sum::<Point>() / count;
        let (from, to) = (mean(0), mean(1));
        let (mut product, mut spread) = (Point::zeros(), 0.0);
        for [p, q] in &pairs {
            let (p, q) = (p - from, q - to);
            product += Point::new(p.dot(&q), p.perp(&q));
            spread += p.norm_squared();
        }
        if pairs.len() < 2 || spread < SPREAD_MIN {
            return None;
        }
        let turn = product / spread;
        Some(Self { is_image: self.is_image, turn, shift: to - turned(turn, from) })
    }

    /// A place of the drawing in the level, metres.
    pub(super) fn point(&self, at: [f64; 2]) -> Point {
        turned(self.turn, upright(self.is_image, at)) + self.shift
    }

    /// Metres of one unit of the drawing.
    pub(super) fn scale_m(&self) -> f64 {
        self.turn.norm()
    }

    /// By how much the drawing is turned, counter-clockwise.
    pub(super) fn yaw(&self) -> f64 {
        self.turn.y.atan2(self.turn.x)
    }
}

fn upright(is_image: bool, [x, y]: [f64; 2]) -> Point {
    Point::new(x, if is_image { -y } else { y })
}

fn turned(turn: Point, p: Point) -> Point {
    Point::new(turn.x * p.x - turn.y * p.y, turn.y * p.x + turn.x * p.y)
}

/// Metres of one unit: the mean over the measurements, as the traffic editor takes it. Drawings in metres need none.
fn scale(building: &Document, level: &Level) -> Option<f64> {
    if !building.is_image {
        return Some(1.0);
    }
    let metres_of_one = level.measurements.iter().filter_map(|([from, to], metres)| {
        let [p, q] = [from, to].map(|end| Point::from(level.vertices[*end]));
        let units = (q - p).norm();
        (units > 0.0).then_some(metres / units)
    });
    let all: Vec<f64> = metres_of_one.collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    mean.is_finite().then_some(mean)
}
