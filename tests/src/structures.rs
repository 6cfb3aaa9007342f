//! Global localization on landmark tables: does a robot that sees a few landmarks, some of which are
//! none, find its place, and how long does that take?

mod download;

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use mapfold_map::geometry::{Covariance, Level, Point, Pose, Robot, difference};
use mapfold_map::landmarks::{
    Fix, Landmark, LandmarkKind, LandmarkTable, LocateConfig, Sight, locate,
};

use crate::simulation::Noise;
use crate::statistics::quantile;
use crate::{Error, report};

/// Landmarks a square metre.
const DENSITY: f64 = 0.2;
/// How far landmarks are seen, metres.
const RANGE_M: f64 = 8.0;
/// Noise of a place, metres, as in what is measured of other programs; of a direction, radians.
const SEEN_SD: (f64, f64) = (0.05, 0.05);
const KNOWN_SD_M: f64 = 0.01;
const KINDS: [LandmarkKind; 2] = [LandmarkKind::ConvexCorner, LandmarkKind::ConcaveCorner];
/// A pose this far off is wrong: metres, radians.
const RIGHT: (f64, f64) = (0.3, 2.0 * PI / 180.0);

/// Directions of a floor's landmarks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Directions {
    /// Any.
    Any,
    /// Multiples of a quarter turn.
    RightAngles,
}

/// What queries of one kind came to.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outcome {
    /// Unique and right.
    pub right: u32,
    /// Not to be told apart.
    pub ambiguous: u32,
    /// Nothing found.
    pub nothing: u32,
    /// Unique and wrong.
    pub wrong: u32,
    /// Seconds of each query.
    pub seconds: Vec<f64>,
    /// Seconds to make the table of its landmarks.
    pub build_s: f64,
    /// Pairs of the table.
    pub pairs: usize,
}

/// Asks `queries` times for a place on a floor of `count` landmarks, seeing `truly` of them and `clutter` that
/// are none, with no guess; `now` is a clock in seconds.
pub fn ask(
    count: usize,
    directions: Directions,
    (truly, clutter): (usize, usize),
    queries: u32,
    now: &dyn Fn() -> f64,
) -> Outcome {
    let mut noise = Noise::of_seed(count as u64 + truly as u64);
    let side = (count as f64 / DENSITY).sqrt();
    let landmarks = (0..count).map(|_| known(directions, side, &mut noise)).collect();
    let started = now();
    let table = LandmarkTable::new(landmarks);
    let mut outcome =
        Outcome { build_s: now() - started, pairs: table.pair_count(), ..Outcome::default() };
    // Only what is seen counts: nobody says what stands in the way.
    let sight = Sight { range: 0.0, half_field: PI };
    for _ in 0..queries {
        let (truth, mut seen) = view(table.landmarks(), side, truly, &mut noise);
        for _ in 0..clutter {
            let mut within = || (2.0 * noise.share() - 1.0) * RANGE_M;
            let at = Point::new(within(), within());
            let direction = noise.share() * 2.0 * PI;
            seen.push(landmark(kind(&mut noise), at, direction, SEEN_SD.0));
        }
        let started = now();
        let fix = locate(&table, &seen, &sight, None, None, &LocateConfig::STANDARD);
        outcome.seconds.push(now() - started);
        match fix {
            Fix::Unique(candidate) => {
                let pose = candidate.level_from_robot.pose;
                let is_right = (pose.position() - truth.position()).norm() < RIGHT.0
                    && difference(pose.heading(), truth.heading()).abs() < RIGHT.1;
                *(if is_right { &mut outcome.right } else { &mut outcome.wrong }) += 1;
            }
            Fix::Ambiguous(_) => outcome.ambiguous += 1,
            Fix::NoMatch => outcome.nothing += 1,
        }
    }
    outcome
}

fn landmark(kind: LandmarkKind, at: Point, direction: f64, sd: f64) -> Landmark {
    Landmark {
        kind,
        at,
        direction: difference(direction, 0.0),
        covariance: Covariance::from_variances([sd * sd; 2]),
        direction_sd: SEEN_SD.1,
    }
}

fn kind(noise: &mut Noise) -> LandmarkKind {
    KINDS[usize::from(noise.share() < 0.5)]
}

fn known(directions: Directions, side: f64, noise: &mut Noise) -> Landmark {
    let at = Point::new(side * noise.share(), side * noise.share());
    let direction = match directions {
        Directions::Any => 2.0 * PI * noise.share(),
        Directions::RightAngles => (4.0 * noise.share()).floor() * FRAC_PI_2,
    };
    landmark(kind(noise), at, direction, KNOWN_SD_M)
}

/// A robot somewhere, and `count` of the landmarks around it as it sees them.
fn view(
    landmarks: &[Landmark],
    side: f64,
    count: usize,
    noise: &mut Noise,
) -> (Pose<Level, Robot>, Vec<Landmark>) {
    let margin = RANGE_M.min(0.4 * side);
    loop {
        let mut inner = || margin + (side - 2.0 * margin) * noise.share();
        let (x, y) = (inner(), inner());
        let pose: Pose<Level, Robot> = Pose::new(x, y, 2.0 * PI * noise.share());
        let mut near: Vec<&Landmark> =
            landmarks.iter().filter(|l| (l.at - pose.position()).norm() < RANGE_M).collect();
        if near.len() < count {
            continue;
        }
        for i in 0..count {
            let other = i + ((near.len() - i) as f64 * noise.share()) as usize;
            let other = other.min(near.len() - 1);
            near.swap(i, other);
        }
        let inverse = pose.inverse();
        let mut see = |l: &&Landmark| {
            let off = Point::new(noise.normal(SEEN_SD.0), noise.normal(SEEN_SD.0));
            let direction = l.direction - pose.heading() + noise.normal(SEEN_SD.1);
            landmark(l.kind, inverse.act(&l.at) + off, direction, SEEN_SD.0)
        };
        return (pose, near[..count].iter().map(&mut see).collect());
    }
}

const COUNTS: [usize; 6] = [50, 200, 500, 1_000, 10_000, 100_000];
const VIEWS: [(usize, usize); 3] = [(5, 1), (8, 2), (12, 3)];
const QUERIES: u32 = 1000;

/// Measures all sizes and views, and rewrites the tables `structures` and `tables` of a page.
///
/// # Errors
/// The page cannot be read or written; the server that tells tables fails.
pub async fn table(page: &Path) -> Result<Vec<String>, Error> {
    download::table(page).await?;
    let started = tokio::time::Instant::now();
    let now = || started.elapsed().as_secs_f64();
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    for (name, directions) in [("any", Directions::Any), ("right angles", Directions::RightAngles)]
    {
        for count in COUNTS {
            for view in VIEWS {
                let outcome = ask(count, directions, view, QUERIES, &now);
                if outcome.wrong > 1 || outcome.right < QUERIES * 95 / 100 {
                    faults.push(format!("{count} landmarks, {view:?} seen: {outcome:?}"));
                }
                let us = |share: f64| format!("{:.0}", 1e6 * quantile(&outcome.seconds, share));
                let row = vec![
                    name.to_owned(),
                    count.to_string(),
                    format!("{} + {}", view.0, view.1),
                    format!("{:.1} %", 100.0 * f64::from(outcome.right) / f64::from(QUERIES)),
                    outcome.ambiguous.to_string(),
                    outcome.nothing.to_string(),
                    outcome.wrong.to_string(),
                    us(0.5),
                    us(0.99),
                    format!("{:.1}", 1e3 * outcome.build_s),
                    outcome.pairs.to_string(),
                ];
                report::say(&row.join(" | "));
                rows.push(row);
            }
        }
    }
    let header = [
        "directions",
        "landmarks",
        "seen + clutter",
        "right",
        "ambiguous",
        "nothing",
        "wrong",
        "median µs",
        "p99 µs",
        "table built ms",
        "pairs",
    ];
    report::rewrite(page, "structures", &report::table(&header, &rows))?;
    Ok(faults)
}
