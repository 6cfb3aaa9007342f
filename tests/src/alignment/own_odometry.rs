//! Maps that bend: a robot's own map is made of what its wheels counted, and no pose fits all of it.

use std::path::Path;

use mapfold_map::alignment::{Alignment, AlignmentConfig, Chart, align};
use mapfold_map::geometry::{Level as LevelFrame, Odom, Point, Pose, Robot, difference};

use super::chart;
use super::cuts::{Look, Recorded, blocks};
use super::outcome::told;
use crate::{Error, logs, report};

/// Logs whose odometry is clean, and two in which it is not.
const LOGS: [&str; 5] = ["freiburg-101", "aces", "fhw", "intel", "csail"];
/// Ways after which a robot's map is aligned, metres.
const WAYS_M: [f64; 3] = [20.0, 40.0, 80.0];
/// A pose is right if it puts the robot's way so close to where the best rigid fit does: metres, radians.
const RIGHT: (f64, f64) = (0.3, 0.02);

/// The rigid motion that brings a way that was counted closest to the published one, and how far off the worst place of
/// it then is: the bend, metres.
struct Fit {
    level_from_odom: Pose<LevelFrame, Odom>,
    bend: f64,
}

/// By least squares: the middles meet, and the heading is that of the sum of products of arms.
fn fit(way: &[(Point, Point)]) -> Fit {
    let count = way.len() as f64;
    let own_middle = way.iter().map(|(own, _)| own).sum::<Point>() / count;
    let middle = way.iter().map(|(_, at)| at).sum::<Point>() / count;
    let (mut cos, mut sin) = (0.0, 0.0);
    for (own, at) in way {
        let (own, at) = (own - own_middle, at - middle);
        cos += own.dot(&at);
        sin += own.perp(&at);
    }
    let heading = sin.atan2(cos);
    let turned = Pose::<LevelFrame, Odom>::new(0.0, 0.0, heading).act(&own_middle);
    let level_from_odom = Pose::new(middle.x - turned.x, middle.y - turned.y, heading);
    let off = way.iter().map(|(own, at)| (level_from_odom.act(own) - at).norm());
    Fit { level_from_odom, bend: off.fold(0.0, f64::max) }
}

/// What alignments of maps after a way of one length came to.
#[derive(Debug, Clone, Default)]
struct Tried {
    right: usize,
    /// Not right, but by no more than the bend.
    bent: usize,
    not_told: usize,
    /// Of these, those whose best candidate was right or bent.
    held_back: usize,
    wrong: usize,
    bends: Vec<f64>,
    off: Vec<f64>,
}

impl Tried {
    fn count(&mut self, alignment: &Alignment, fit: &Fit, way: &[(Point, Point)]) {
        self.bends.push(fit.bend);
        let told = alignment.aligned().is_some();
        self.not_told += usize::from(!told);
        let Some(best) = alignment.candidates.first() else { return };
        let found = best.level_from_odom.pose;
        let squares = way
            .iter()
            .map(|(own, _)| (found.act(own) - fit.level_from_odom.act(own)).norm_squared());
        let off = (squares.sum::<f64>() / way.len() as f64).sqrt();
        let turned = difference(found.heading(), fit.level_from_odom.heading()).abs();
        let is_right = off < RIGHT.0 && turned < RIGHT.1;
        let is_bent = off < RIGHT.0 + fit.bend;
        if !told {
            self.held_back += usize::from(is_right || is_bent);
            return;
        }
        self.off.push(off);
        match (is_right, is_bent) {
            (true, _) => self.right += 1,
            (false, true) => self.bent += 1,
            (false, false) => self.wrong += 1,
        }
    }

    fn row(&self, name: &str, way_m: f64) -> Vec<String> {
        let tried = self.bends.len();
        let mut row = vec![name.to_owned(), format!("{way_m:.0}")];
        let counts = [tried, self.right, self.bent, self.not_told, self.held_back, self.wrong];
        row.extend(counts.map(|count| count.to_string()));
        row.extend(told(&self.bends, 100.0, 0));
        row.extend(told(&self.off, 100.0, 0));
        row
    }

    fn add(&mut self, other: &Self) {
        self.right += other.right;
        self.bent += other.bent;
        self.not_told += other.not_told;
        self.held_back += other.held_back;
        self.wrong += other.wrong;
        self.bends.extend(&other.bends);
        self.off.extend(&other.off);
    }
}

/// Where the wheels say that a look was taken.
fn counted(look: &Look) -> Pose<LevelFrame, Robot> {
    let of_level = || {
        let p = &look.level_from_robot;
        Pose::new(p.x, p.y, p.heading())
    };
    let odom = look.odom_from_robot.unwrap_or_else(of_level);
    Pose::new(odom.x, odom.y, odom.heading())
}

/// Looks one after the other, cut where a way has been driven; what is left at the end is left out.
fn windows(recorded: &Recorded, way_m: f64) -> Vec<std::ops::Range<usize>> {
    let mut windows = Vec::new();
    let (mut start, mut way) = (0, 0.0);
    for (index, pair) in recorded.looks.windows(2).enumerate() {
        let [from, to] = pair else { continue };
        let step = to.level_from_robot.position() - from.level_from_robot.position();
        way += step.norm();
        if way >= way_m {
            windows.push(start..index + 2);
            (start, way) = (index + 2, 0.0);
        }
    }
    windows
}

fn tried(recorded: &Recorded, level: &Chart, way_m: f64) -> Result<Tried, Error> {
    let mut tried = Tried::default();
    for window in windows(recorded, way_m) {
        let looks = blocks(window, 1);
        let own = chart(&recorded.map(&looks, counted)?);
        let place = |look: &usize| {
            let look = &recorded.looks[*look];
            (counted(look).position(), look.level_from_robot.position())
        };
        let way: Vec<(Point, Point)> = looks.iter().map(place).collect();
        tried.count(&align(level, &own, &AlignmentConfig::STANDARD), &fit(&way), &way);
    }
    Ok(tried)
}

/// Rewrites the table `own-odometry` of a page and answers whether any pose was wrong by more than its map bends.
pub(super) fn table(page: &Path, data: Option<&Path>) -> Result<Vec<String>, Error> {
    let mut rows = Vec::new();
    let mut sums = vec![Tried::default(); WAYS_M.len()];
    for (name, path) in logs::named(data, &LOGS) {
        let recorded = Recorded::read(&path)?;
        let mapped = blocks(0..recorded.looks.len(), 0);
        let level = chart(&recorded.published_map(&mapped));
        for (way_m, sum) in WAYS_M.iter().zip(&mut sums) {
            let tried = tried(&recorded, &level, *way_m)?;
            sum.add(&tried);
            let row = tried.row(&name, *way_m);
            report::say(&row.join(" | "));
            rows.push(row);
        }
    }
    rows.extend(WAYS_M.iter().zip(&sums).map(|(way_m, sum)| sum.row("all", *way_m)));
    let header = [
        "log",
        "way m",
        "tried",
        "right",
        "within the bend",
        "not told",
        "of these near",
        "wrong",
        "bend cm, median",
        "greatest",
        "off cm, median",
        "greatest",
    ];
    report::rewrite(page, "own-odometry", &report::table(&header, &rows))?;
    let wrong: usize = sums.iter().map(|sum| sum.wrong).sum();
    let fault = || format!("{wrong} maps of odometry alone were aligned wrongly");
    Ok((wrong > 0).then(fault).into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_that_does_not_bend_is_fitted_exactly() {
        let truth: Pose<LevelFrame, Odom> = Pose::new(4.0, -7.0, 2.5);
        let own = [(0.0, 0.0), (5.0, 0.2), (9.0, 4.0), (3.0, 8.0)].map(|(x, y)| Point::new(x, y));
        let mut way: Vec<(Point, Point)> = own.iter().map(|p| (*p, truth.act(p))).collect();
        let exact = fit(&way);
        assert!(exact.bend < 1e-9);
        assert!((exact.level_from_odom.vector() - truth.vector()).norm() < 1e-9);
        way[3].1 += Point::new(0.4, 0.0);
        let bent = fit(&way).bend;
        assert!((0.05..0.4).contains(&bent), "{bent}");
    }
}
