//! What alignments came to.

use mapfold_map::alignment::Alignment;
use mapfold_map::geometry::{Level as LevelFrame, Odom, Point, Pose, difference};

use crate::statistics::quantile;

/// An alignment farther off than this in the middle of what both have seen is wrong: metres, radians.
pub(super) type Tolerance = (f64, f64);

/// What alignments of one kind came to.
#[derive(Debug, Clone, Default)]
pub(super) struct Tried {
    pub(super) all: u32,
    pub(super) right: u32,
    pub(super) wrong: u32,
    /// Not told, though the best candidate was right.
    held_back: u32,
    /// Of what stands, and of all that was seen.
    overlaps: Vec<(f64, f64)>,
    /// Metres and degrees, of those that are right.
    off: Vec<(f64, f64)>,
    /// Normalised squares of these errors.
    nees: Vec<f64>,
    seconds: Vec<f64>,
}

/// The columns of [`Tried::row`], but for the first two.
pub(super) const COLUMNS: [&str; 14] = [
    "of walls",
    "of area",
    "tried",
    "right",
    "not told",
    "of these right",
    "wrong",
    "off cm, median",
    "greatest",
    "off °, median",
    "greatest",
    "NEES",
    "s, median",
    "greatest",
];

/// How far a pose is off in the middle of what both maps have seen.
fn off(
    found: &Pose<LevelFrame, Odom>,
    truth: &Pose<LevelFrame, Odom>,
    middle: &Point,
) -> (f64, f64) {
    let there = truth.inverse().act(middle);
    let turned = difference(found.heading(), truth.heading()).abs();
    ((found.act(&there) - middle).norm(), turned)
}

/// The middle of some values, and the greatest.
pub(super) fn told(values: &[f64], scale: f64, digits: usize) -> [String; 2] {
    [0.5, 1.0].map(|q| match values {
        [] => "-".to_owned(),
        _ => format!("{:.digits$}", scale * quantile(values, q)),
    })
}

impl Tried {
    /// Counts an alignment of two maps that saw these shares in common, which took some seconds.
    pub(super) fn count(
        &mut self,
        alignment: &Alignment,
        truth: &Pose<LevelFrame, Odom>,
        right: Tolerance,
        overlap: (f64, f64),
        seconds: f64,
    ) {
        self.all += 1;
        self.overlaps.push(overlap);
        self.seconds.push(seconds);
        let Some(best) = alignment.candidates.first() else { return };
        let found = best.level_from_odom.pose;
        let (metres, radians) = off(&found, truth, &best.middle);
        let is_right = metres < right.0 && radians < right.1;
        match (alignment.aligned().is_some(), is_right) {
            (true, true) => {
                self.right += 1;
                self.off.push((metres, radians.to_degrees()));
                let mut error = found.vector() - truth.vector();
                error.z = difference(found.heading(), truth.heading());
                let covariance = best.level_from_odom.covariance.matrix();
                if let Some(root) = covariance.cholesky() {
                    self.nees.push(error.dot(&root.solve(&error)) / 3.0);
                }
            }
            (true, false) => self.wrong += 1,
            (false, true) => self.held_back += 1,
            (false, false) => {}
        }
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.all += other.all;
        self.right += other.right;
        self.wrong += other.wrong;
        self.held_back += other.held_back;
        self.overlaps.extend(&other.overlaps);
        self.off.extend(&other.off);
        self.nees.extend(&other.nees);
        self.seconds.extend(&other.seconds);
    }

    /// The row of a table, as [`COLUMNS`] has it.
    pub(super) fn row(&self, name: &str, cuts: &str) -> Vec<String> {
        let count = self.overlaps.len() as f64;
        let share = |of: fn(&(f64, f64)) -> f64| {
            format!("{:.0} %", 100.0 * self.overlaps.iter().map(of).sum::<f64>() / count)
        };
        let mut row = vec![name.to_owned(), cuts.to_owned(), share(|o| o.0), share(|o| o.1)];
        let not_told = self.all - self.right - self.wrong;
        row.extend(
            [self.all, self.right, not_told, self.held_back, self.wrong].map(|n| n.to_string()),
        );
        let (metres, degrees): (Vec<f64>, Vec<f64>) = self.off.iter().copied().unzip();
        row.extend(told(&metres, 100.0, 1));
        row.extend(told(&degrees, 1.0, 2));
        let nees = self.nees.iter().sum::<f64>() / self.nees.len() as f64;
        row.push(if self.nees.is_empty() { "-".to_owned() } else { format!("{nees:.2}") });
        row.extend(told(&self.seconds, 1.0, 1));
        row
    }
}
