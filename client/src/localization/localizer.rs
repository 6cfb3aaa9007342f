//! The whole of localization: seek until the place is certain, track until it is not, and seek again.

use mapfold_map::gdb::Surface;
use mapfold_map::geometry::{Level, Pose, Robot, UncertainPose};
use mapfold_map::landmarks::{Landmark, LandmarkTable, LearnedConfig, landmarks_of_map};
use mapfold_map::level::LevelMap;
use mapfold_map::places::{LikelihoodField, PlacesConfig, View, place_near, pose_at, search_near};
use mapfold_map::vector::ObservedSegment;

use super::drift::{Drift, DriftConfig};
use super::filter::apart_sq;
use super::seeker::{Candidate, Fix, Seeker, SeekerConfig, fix_of};
use crate::sensor::{Ring, SonarProfile};

use super::{Lost, ReferenceWalls, TrackReport, Tracker, TrackerConfig, Tracking};

/// What a robot knows of its level.
#[derive(Debug, Clone)]
pub struct KnownLevel {
    /// Its raster, for finding the place.
    pub field: LikelihoodField,
    /// Its walls, for keeping it.
    pub walls: ReferenceWalls,
    /// Its landmarks, if there is a table: those that its walls make, or the server's, with those of the model.
    pub table: Option<LandmarkTable>,
}

impl KnownLevel {
    /// What a map tells, `resolution` metres a cell; `None` if it has no raster, neither from robots nor as a prior.
    pub fn of_map(map: &LevelMap, resolution: f64, config: &LocalizerConfig) -> Option<Self> {
        Self::of_map_and_model(map, &[], [], resolution, config)
    }

    /// What a map tells and, where it does not, the surfaces of the a-priori model; `landmarks` are those of both, as the
    /// server's table has them. Without any, those that the map's walls make.
    pub fn of_map_and_model(
        map: &LevelMap,
        surfaces: &[Surface],
        landmarks: impl IntoIterator<Item = Landmark>,
        resolution: f64,
        config: &LocalizerConfig,
    ) -> Option<Self> {
        if map.tiles.is_empty() && map.prior.is_empty() {
            return None;
        }
        let sides = surfaces.iter().flat_map(Surface::sides);
        let field = LikelihoodField::of_map_and_walls(map, sides, resolution, &config.places);
        let mut walls = ReferenceWalls::of_map(map);
        walls.fill_up(surfaces, |p| field.is_free(p));
        let told: Vec<Landmark> = landmarks.into_iter().collect();
        let table = if told.is_empty() { learned_table(map) } else { LandmarkTable::new(told) };
        Some(Self { field, walls, table: Some(table) })
    }
}

/// What is wrong with a level without raster, in words.
pub const NOTHING_KNOWN: &str =
    "has no raster yet: nobody has contributed to it, and no plan is published as its prior";

/// The landmarks that a map's own walls make.
fn learned_table(map: &LevelMap) -> LandmarkTable {
    let segments = map.segments.iter().map(|(id, segment)| (id, &**segment));
    let learned = landmarks_of_map(segments, &LearnedConfig::STANDARD);
    LandmarkTable::new(learned.values().map(|learned| learned.landmark).collect())
}

/// How a tracked robot is held against the raster, and what is done where it does not fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckConfig {
    /// Least share of a look's beams that end on what is known to be occupied, for the raster to bear the pose out.
    pub hits_min: f64,
    /// Below this the raster contradicts the pose: nat a beam, where 0 is what a place that is not on the map comes to.
    pub gain_min: f64,
    /// Looks in a row that it may contradict.
    pub contradictions: u32,
    /// A place is looked for so far around the pose, besides its deviations: metres, radians.
    pub reach: (f64, f64),
    /// And within so many of its deviations.
    pub reach_sds: f64,
    /// How far a pose may be off what fits best, as a squared Mahalanobis distance (99.9 %).
    pub off_sq: f64,
    /// How a share of what wheels get wrong is learned.
    pub drift: DriftConfig,
}

impl CheckConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        hits_min: 0.55,
        gain_min: -0.2,
        contradictions: 3,
        reach: (0.4, 0.25),
        reach_sds: 3.0,
        off_sq: 16.266,
        drift: DriftConfig::STANDARD,
    };
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
    /// How it is checked.
    pub check: CheckConfig,
}

impl LocalizerConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        places: PlacesConfig::STANDARD,
        seeker: SeekerConfig::STANDARD,
        tracker: TrackerConfig::STANDARD,
        check: CheckConfig::STANDARD,
    };
}

/// Where a robot is after a look.
#[derive(Debug, Clone, PartialEq)]
pub enum Localized {
    /// Where it should be by the way since its fix, and what the look was matched with.
    Tracked(UncertainPose<Level, Robot>, TrackReport),
    /// Where it should be, but the raster there does not show what it sees.
    Doubted(UncertainPose<Level, Robot>),
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
    drift: Drift,
    /// Why it was lost last.
    lost: Option<Lost>,
}

#[derive(Debug, Clone)]
enum State {
    Seeking(Box<Seeker>),
    Tracking(Box<Kept>),
}

/// A place that is kept.
#[derive(Debug, Clone)]
struct Kept {
    tracker: Tracker,
    /// Where the raster bore it out last, unless the wheels were not counted since.
    borne_out: Option<Pose<Level, Robot>>,
    /// Looks in a row that contradict it.
    contradictions: u32,
}

impl Kept {
    fn from(fix: UncertainPose<Level, Robot>, config: &LocalizerConfig) -> Self {
        let tracker = Tracker::new(fix, config.tracker);
        Self { tracker, borne_out: None, contradictions: 0 }
    }
}

impl Localizer {
    /// A robot that knows nothing of its place.
    pub fn new(config: LocalizerConfig) -> Self {
        let drift = Drift::new(config.check.drift);
        Self { state: Self::seeking(&config), config, drift, lost: None }
    }

    /// A robot that was told its place.
    pub fn at(fix: UncertainPose<Level, Robot>, config: LocalizerConfig) -> Self {
        Self { state: State::Tracking(Box::new(Kept::from(fix, &config))), ..Self::new(config) }
    }

    /// Where the robot is, if that is known.
    pub fn pose(&self) -> Option<UncertainPose<Level, Robot>> {
        match &self.state {
            State::Tracking(kept) => Some(*kept.tracker.pose()),
            State::Seeking(_) => None,
        }
    }

    fn seeking(config: &LocalizerConfig) -> State {
        State::Seeking(Box::new(Seeker::new(config.seeker, config.places)))
    }

    /// The wheels have counted a step: the robot's pose now in its own frame before.
    pub fn moved(&mut self, step: &Pose<Robot, Robot>) {
        let step = self.drift.corrected(step);
        match &mut self.state {
            State::Seeking(seeker) => seeker.moved(&step),
            State::Tracking(kept) => kept.tracker.moved(&step),
        }
    }

    /// The robot has looked.
    pub fn seen(
        &mut self,
        view: &View,
        segments: &[ObservedSegment],
        known: &KnownLevel,
    ) -> Localized {
        if let State::Tracking(kept) = &mut self.state {
            match kept.seen(view, segments, known, &self.config, &mut self.drift) {
                Ok(localized) => return localized,
                Err(why) => self.lose(why),
            }
        }
        let State::Seeking(seeker) = &mut self.state else { return Localized::NotDue };
        if !seeker.is_due() {
            return Localized::NotDue;
        }
        let fix = seeker.seen(&known.field, view, &[]);
        let Fix::Unique(found) = fix else { return Localized::Sought(fix) };
        let mut kept = Kept::from(fix_of(&found.level_from_robot), &self.config);
        self.drift.forget_way();
        // The same look again, now against lines: it places the robot better than cells can.
        kept.tracker.seen(segments, &known.walls, known.table.as_ref());
        let found = Candidate { level_from_robot: *kept.tracker.pose(), ..found };
        if matches!(kept.tracker.state(), Tracking::Tracked(_)) {
            kept.borne_out = Some(found.level_from_robot.pose);
            self.state = State::Tracking(Box::new(kept));
        }
        Localized::Sought(Fix::Unique(found))
    }

    /// The robot has listened. That keeps a place that is known, and says when it no longer is, but finds none.
    pub fn heard(&mut self, ring: &Ring, profile: &SonarProfile, known: &KnownLevel) -> Localized {
        let State::Tracking(kept) = &mut self.state else { return Localized::NotDue };
        let report = kept.tracker.heard(ring, profile, &known.walls, known.table.as_ref());
        match kept.tracker.state() {
            Tracking::Tracked(pose) => Localized::Tracked(pose, report),
            Tracking::Lost(why) => {
                self.lose(why);
                Localized::NotDue
            }
        }
    }

    fn lose(&mut self, why: Lost) {
        self.lost = Some(why);
        self.state = Self::seeking(&self.config);
    }

    /// Why it was lost last, if it ever was since it first knew its place.
    pub fn last_lost(&self) -> Option<Lost> {
        self.lost
    }
}

/// What the raster says of a pose.
enum Judged {
    /// It shows what is seen from there.
    BorneOut,
    /// It tells too little of what is seen from there.
    Untold,
    /// It shows something else.
    Contradicted,
}

impl Kept {
    /// The robot has looked; or why it is lost.
    fn seen(
        &mut self,
        view: &View,
        segments: &[ObservedSegment],
        known: &KnownLevel,
        config: &LocalizerConfig,
        drift: &mut Drift,
    ) -> Result<Localized, Lost> {
        let predicted = *self.tracker.pose();
        let mut report = self.tracker.seen(segments, &known.walls, known.table.as_ref());
        // What walls do not tell, and wheels err in, the raster may: where there is just one place around, it is that.
        if let Some(place) = found_near(&known.field, view, &predicted, &config.check) {
            let is_lost = matches!(self.tracker.state(), Tracking::Lost(_));
            if is_lost || !self.tracker.agrees(&place) {
                self.tracker = Tracker::new(place, config.tracker);
                report = self.tracker.seen(segments, &known.walls, known.table.as_ref());
                if !self.tracker.agrees(&place) {
                    self.tracker = Tracker::new(place, config.tracker);
                    report = TrackReport::default();
                }
            }
            self.tracker.found(&place);
        }
        let judged = judge(&known.field, view, self.tracker.pose(), &config.check);
        let pose = match self.tracker.state() {
            Tracking::Tracked(pose) => pose,
            Tracking::Lost(why) => return Err(why),
        };
        match judged {
            Judged::BorneOut => {
                self.contradictions = 0;
                match self.borne_out.replace(pose.pose) {
                    Some(before) => {
                        let moved = before.inverse().compose(&pose.pose);
                        drift.learn(&moved, &config.tracker.odometry);
                    }
                    None => drift.forget_way(),
                }
            }
            Judged::Untold => self.contradictions = 0,
            Judged::Contradicted => {
                self.contradictions += 1;
                if self.contradictions >= config.check.contradictions {
                    return Err(Lost::Contradicted);
                }
                return Ok(Localized::Doubted(pose));
            }
        }
        Ok(Localized::Tracked(pose, report))
    }
}

fn judge(
    field: &LikelihoodField,
    view: &View,
    pose: &UncertainPose<Level, Robot>,
    config: &CheckConfig,
) -> Judged {
    let place = place_near(field, view, &pose.pose);
    let is_there = apart_sq(pose, &pose_at(field, view, &place)) <= config.off_sq;
    if is_there && place.hits >= config.hits_min {
        Judged::BorneOut
    } else if place.gain() < config.gain_min || (!is_there && place.hits >= config.hits_min) {
        Judged::Contradicted
    } else {
        Judged::Untold
    }
}

/// The one place around a pose that a look fits, if there is just one.
fn found_near(
    field: &LikelihoodField,
    view: &View,
    around: &UncertainPose<Level, Robot>,
    config: &CheckConfig,
) -> Option<UncertainPose<Level, Robot>> {
    let sd = |i| config.reach_sds * around.covariance.sd(i);
    let reach = (config.reach.0 + sd(0).max(sd(1)), config.reach.1 + sd(2));
    let found = search_near(field, view, &around.pose, reach);
    let best = found.places.first().filter(|best| best.hits >= config.hits_min)?;
    let others = found.places[1..].iter().map(|place| place.fit).chain([found.rest]);
    let others: f64 = others.map(|fit| (fit - best.fit).exp()).sum();
    (others.ln() < -field.odds()).then(|| fix_of(&pose_at(field, view, best)))
}
