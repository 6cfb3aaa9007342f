//! What single looks are answered, by robots that know nothing else.

use mapfold_client::localization::{Fix, Seeker, SeekerConfig};
use mapfold_client::sensor::Scan;
use mapfold_map::geometry::{Level, Point, Pose, Robot};
use mapfold_map::landmarks::LandmarkTable;
use mapfold_map::places::{LikelihoodField, PlacesConfig, View, place_near};

use super::is_at;
use crate::statistics::quantile;

/// Landmarks are seen within this, metres.
const SIGHT_M: f64 = 8.0;
/// A beam that ends so much before a landmark hides it, metres.
const BEFORE_M: f64 = 0.15;
/// A pose this far off the log's is a wrong one: metres, radians. Some logs' own headings err by degrees.
pub(super) const RIGHT: (f64, f64) = (0.5, 0.105);
/// A view that holds so many landmarks should tell its place.
const ENOUGH: usize = 5;

/// How many landmarks of a level a scan shows, as its pose is known: within sight, and not hidden by anything.
pub(super) fn in_view(scan: &Scan, pose: &Pose<Level, Robot>, table: &LandmarkTable) -> usize {
    let sensor_from_level = pose.compose(&scan.robot_from_sensor).inverse();
    let near = table.near(pose.position(), SIGHT_M);
    let is_seen = |at: &Point| {
        let at = sensor_from_level.act(at);
        let bearing = at.y.atan2(at.x) - scan.geometry.first_bearing;
        let beam = (bearing / scan.geometry.increment).round();
        let range = (beam >= 0.0).then(|| scan.ranges.get(beam as usize)).flatten();
        range.is_some_and(|range| *range > at.norm() - BEFORE_M)
    };
    near.filter(|(_, landmark)| is_seen(&landmark.at)).count()
}

/// A log's pose is refuted if the scan fits it less well than a place that is on no map, and the pose that was told, near by, better
/// by more than this, nat.
const REFUTED_NAT: f64 = 20.0;
/// Metres.
const NEAR_BY_M: f64 = 1.0;

/// Whether a look shows that it was not taken where its log says, but close to there.
fn is_refuted(
    field: &LikelihoodField,
    view: &View,
    truth: &Pose<Level, Robot>,
    found: &Pose<Level, Robot>,
) -> bool {
    let [told, found_fit] = [truth, found].map(|pose| place_near(field, view, pose).fit);
    (found.position() - truth.position()).norm() < NEAR_BY_M
        && told < 0.0
        && found_fit > told + REFUTED_NAT
}

/// What looks came to.
#[derive(Debug, Clone, Default)]
pub(super) struct Answers {
    pub(super) asked: u32,
    pub(super) right: u32,
    pub(super) ambiguous: u32,
    pub(super) none: u32,
    pub(super) wrong: u32,
    /// Not where the log says, which the look itself refutes.
    refuted: u32,
    /// Those that held enough landmarks, and of these the right ones.
    enough: (u32, u32),
    milliseconds: Vec<f64>,
}

impl Answers {
    pub(super) const HEADER: [&str; 10] = [
        "looks",
        "right",
        "ambiguous",
        "nothing",
        "wrong",
        "log refuted",
        "with 5 landmarks",
        "of these right %",
        "ms, median",
        "p99",
    ];

    /// Asks for the place of one look.
    pub(super) fn ask(
        &mut self,
        field: &LikelihoodField,
        view: &View,
        truth: &Pose<Level, Robot>,
        landmarks: usize,
        now: &dyn Fn() -> f64,
    ) -> Fix {
        let fix = self.fix(field, view, now);
        let is_enough = landmarks >= ENOUGH;
        self.enough.0 += u32::from(is_enough);
        match &fix {
            Fix::Unique(found) => {
                let found = found.level_from_robot.pose;
                let is_right = is_at(&found, truth, RIGHT);
                let is_refuted = !is_right && is_refuted(field, view, truth, &found);
                self.right += u32::from(is_right);
                self.refuted += u32::from(is_refuted);
                self.wrong += u32::from(!is_right && !is_refuted);
                self.enough.1 += u32::from(is_right && is_enough);
            }
            Fix::Ambiguous(_) => self.ambiguous += 1,
            Fix::NoMatch => self.none += 1,
        }
        fix
    }

    /// Asks for the place of a look that was taken somewhere else: whatever is told is wrong.
    pub(super) fn ask_stranger(
        &mut self,
        field: &LikelihoodField,
        view: &View,
        now: &dyn Fn() -> f64,
    ) {
        match self.fix(field, view, now) {
            Fix::Unique(_) => self.wrong += 1,
            Fix::Ambiguous(_) => self.ambiguous += 1,
            Fix::NoMatch => self.none += 1,
        }
    }

    fn fix(&mut self, field: &LikelihoodField, view: &View, now: &dyn Fn() -> f64) -> Fix {
        let started = now();
        let mut seeker = Seeker::new(SeekerConfig::STANDARD, PlacesConfig::STANDARD);
        let fix = seeker.seen(field, view, &[]);
        self.milliseconds.push(1e3 * (now() - started));
        self.asked += 1;
        fix
    }

    pub(super) const STRANGERS: [&str; 4] =
        ["looks from elsewhere", "told", "ambiguous", "nothing"];

    pub(super) fn strangers_row(&self) -> Vec<String> {
        [self.asked, self.wrong, self.ambiguous, self.none].map(|n| n.to_string()).to_vec()
    }

    pub(super) fn row(&self) -> Vec<String> {
        let answers = [self.right, self.ambiguous, self.none, self.wrong, self.refuted];
        let counts = [&[self.asked][..], &answers, &[self.enough.0]].concat();
        let share = if self.enough.0 == 0 {
            "-".to_owned()
        } else {
            format!("{:.1}", 100.0 * f64::from(self.enough.1) / f64::from(self.enough.0))
        };
        let times = [0.5, 0.99].map(|q| format!("{:.0}", quantile(&self.milliseconds, q)));
        counts.iter().map(ToString::to_string).chain([share]).chain(times).collect()
    }
}
