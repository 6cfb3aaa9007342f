//! The whole of localization: seek until the place is certain, track until it is not, and seek again.

use mapfold_map::geometry::{Level, Pose, Robot, UncertainPose};
use mapfold_map::landmarks::LandmarkTable;
use mapfold_map::level::LevelMap;
use mapfold_map::places::{LikelihoodField, PlacesConfig, View};
use mapfold_map::vector::ObservedSegment;

use super::seeker::{Candidate, Fix, Seeker, SeekerConfig, fix_of};
use super::{Lost, ReferenceWalls, TrackReport, Tracker, TrackerConfig, Tracking};

/// What a robot knows of its level.
#[derive(Debug, Clone)]
pub struct KnownLevel {
    /// Its raster, for finding the place.
    pub field: LikelihoodField,
    /// Its walls, for keeping it.
    pub walls: ReferenceWalls,
    /// Its landmarks, if there is a table.
    pub table: Option<LandmarkTable>,
}

impl KnownLevel {
    /// What a map tells, `resolution` metres a cell.
    pub fn of_map(map: &LevelMap, resolution: f64, config: &LocalizerConfig) -> Self {
        Self {
            field: LikelihoodField::of_map(map, resolution, &config.places),
            walls: ReferenceWalls::of_map(map),
            table: None,
        }
    }
}

/// How a robot finds its place and keeps it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalizerConfig {
    /// How well places fit.
    pub places: PlacesConfig,
    /// How it seeks.
    pub seeker: SeekerConfig,
    /// How it is tracked.
    pub tracker: TrackerConfig,
}

impl LocalizerConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        places: PlacesConfig::STANDARD,
        seeker: SeekerConfig::STANDARD,
        tracker: TrackerConfig::STANDARD,
    };
}

/// Where a robot is after a look.
#[derive(Debug, Clone, PartialEq)]
pub enum Localized {
    /// Where it should be by the way since its fix, and what the look was matched with.
    Tracked(UncertainPose<Level, Robot>, TrackReport),
    /// It has found its place, from which it is tracked on, or not yet.
    Sought(Fix),
    /// Not looked: too close to the last look to tell anything new.
    NotDue,
}

/// Localizes one robot.
#[derive(Debug, Clone)]
pub struct Localizer {
    config: LocalizerConfig,
    state: State,
    /// Why it was lost last.
    lost: Option<Lost>,
}

#[derive(Debug, Clone)]
enum State {
    Seeking(Box<Seeker>),
    Tracking(Box<Tracker>),
}

impl Localizer {
    /// A robot that knows nothing of its place.
    pub fn new(config: LocalizerConfig) -> Self {
        Self { state: Self::seeking(&config), config, lost: None }
    }

    fn seeking(config: &LocalizerConfig) -> State {
        State::Seeking(Box::new(Seeker::new(config.seeker, config.places)))
    }

    /// The wheels have counted a step: the robot's pose now in its own frame before.
    pub fn moved(&mut self, step: &Pose<Robot, Robot>) {
        match &mut self.state {
            State::Seeking(seeker) => seeker.moved(step),
            State::Tracking(tracker) => tracker.moved(step),
        }
    }

    /// The robot has looked.
    pub fn seen(
        &mut self,
        view: &View,
        segments: &[ObservedSegment],
        known: &KnownLevel,
    ) -> Localized {
        if let State::Tracking(tracker) = &mut self.state {
            let report = tracker.seen(segments, &known.walls, known.table.as_ref());
            match tracker.state() {
                Tracking::Tracked(pose) => return Localized::Tracked(pose, report),
                Tracking::Lost(why) => {
                    self.lost = Some(why);
                    self.state = Self::seeking(&self.config);
                }
            }
        }
        let State::Seeking(seeker) = &mut self.state else { return Localized::NotDue };
        if !seeker.is_due() {
            return Localized::NotDue;
        }
        let fix = seeker.seen(&known.field, view, &[]);
        let Fix::Unique(found) = fix else { return Localized::Sought(fix) };
        let mut tracker = Tracker::new(fix_of(&found), self.config.tracker);
        // The same look again, now against lines: it places the robot better than cells can.
        tracker.seen(segments, &known.walls, known.table.as_ref());
        let found = Candidate { level_from_robot: *tracker.pose(), ..found };
        if matches!(tracker.state(), Tracking::Tracked(_)) {
            self.state = State::Tracking(Box::new(tracker));
        }
        Localized::Sought(Fix::Unique(found))
    }

    /// Why it was lost last, if it ever was since it first knew its place.
    pub fn last_lost(&self) -> Option<Lost> {
        self.lost
    }
}
