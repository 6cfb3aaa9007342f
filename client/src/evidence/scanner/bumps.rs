//! The bell curves where beams ended, ready made.

use super::{BUMP_SDS, small};

/// Classes of deviations to a cell, and their number: wider bumps are rare and have the last class's
/// width at least.
const CLASSES_A_CELL: f64 = 32.0;
const CLASSES: usize = 8 * 32;

/// Density of the bell curve in its middle, by standard deviations: 1 / sqrt(2 pi).
const BELL_DENSITY: f64 = 0.398_942_280_401_432_7;

/// Points that a bump has at most.
const POINTS_MOST: usize = 2 * (BUMP_SDS as usize) * CLASSES / (CLASSES_A_CELL as usize) + 1;

/// One class of bumps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bump {
    /// How many steps of a cell it goes on to both sides of the middle.
    pub(super) side: u32,
    /// What falls to its points, a cell apart and in order, millinats.
    values: [i16; POINTS_MOST],
}

impl Bump {
    /// What falls to its points, a cell apart and in order, millinats.
    pub(super) fn values(&self) -> &[i16] {
        self.values.get(..2 * self.side as usize + 1).unwrap_or(&self.values)
    }
}

/// The evidence of bumps for cells at so many steps from their middle, by classes of deviations.
#[derive(Debug, Default)]
pub(in crate::evidence) struct Bumps {
    occupied_nat: f64,
    classes: Vec<Bump>,
}

impl Bumps {
    pub(super) fn make(&mut self, occupied_nat: f64) {
        if self.occupied_nat.total_cmp(&occupied_nat).is_eq() && !self.classes.is_empty() {
            return;
        }
        self.occupied_nat = occupied_nat;
        self.classes.resize(CLASSES, Bump { side: 0, values: [0; POINTS_MOST] });
        for (class, bump) in self.classes.iter_mut().enumerate() {
            let sd = (class.max(1) as f64) / CLASSES_A_CELL;
            bump.side = (BUMP_SDS * sd) as u32;
            let most = 1000.0 * occupied_nat * (BELL_DENSITY / sd).min(1.0);
            for (step, value) in bump.values.iter_mut().enumerate() {
                let off = (step as f64 - f64::from(bump.side)) / sd;
                *value = (most * (-0.5 * off * off).exp()).round() as i16;
            }
        }
    }

    /// All classes.
    pub(super) fn classes(&self) -> &[Bump] {
        &self.classes
    }

    /// The class of a deviation.
    #[inline]
    pub(super) fn class(sd: f32) -> usize {
        small((sd * CLASSES_A_CELL as f32).min((CLASSES - 1) as f32)) as usize
    }
}
