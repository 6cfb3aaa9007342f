//! Poses that a robot finds itself on the map that it has.

use mapfold_map::geometry::{Level, Odom, Point, Pose, Robot, UncertainPose};
use mapfold_map::level::FeatureId;
use mapfold_schema::border::alignment::wire_pose;
use mapfold_schema::border::feature_id;
use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;

use super::Passed;
use crate::localization::{
    Fix, KnownLevel, Localized, Localizer, LocalizerConfig, TrackReport, WallName, view,
};
use crate::perception::Percept;
use crate::sensor::{Ring, SonarProfile};

/// What a pose owes to the map.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    /// How often the robot had found its place from nothing by then.
    pub finds: u32,
    /// Metres driven since it last did.
    pub way: f64,
    /// Revision of the map that it went by.
    pub revision: i64,
    /// The map's walls that the look was matched with.
    pub walls: Vec<FeatureId>,
    /// The map's landmarks that it was matched with.
    pub landmarks: Vec<Point>,
}

impl Basis {
    pub(super) fn to_wire(&self) -> v1::FixBasis {
        v1::FixBasis {
            revision: self.revision,
            way_m: self.way,
            segments: self.walls.iter().map(feature_id).collect(),
            landmarks_m: self.landmarks.iter().map(|p| [p.x, p.y]).collect(),
        }
    }
}

/// Most places that are reported of a robot that does not know its own.
const REPORTED_MAX: usize = 16;

/// Localizes the robot from reading to reading.
#[derive(Debug)]
pub struct Whereabouts {
    known: KnownLevel,
    config: LocalizerConfig,
    localizer: Localizer,
    odom_from_robot: Option<Pose<Odom, Robot>>,
    basis: Basis,
    last: Option<Localized>,
}

impl Whereabouts {
    /// A robot that knows this much of its level, as it was at a revision, and nothing of its place.
    pub fn new(known: KnownLevel, revision: i64, config: LocalizerConfig) -> Self {
        let basis =
            Basis { finds: 0, way: 0.0, revision, walls: Vec::new(), landmarks: Vec::new() };
        let localizer = Localizer::new(config);
        Self { known, config, localizer, odom_from_robot: None, basis, last: None }
    }

    /// What the last pose owes to the map.
    pub fn basis(&self) -> &Basis {
        &self.basis
    }

    /// What the last look came to.
    pub fn last(&self) -> Option<&Localized> {
        self.last.as_ref()
    }

    /// What it knows of its place on a level, to be reported; nothing before the first look.
    pub fn report(&self, level: &str, time_s: f64) -> Option<v1::RobotFix> {
        let (kind, places) = match self.last.as_ref()? {
            Localized::NotDue => return None,
            Localized::Tracked(pose, _) => (v1::FixKind::Tracked, vec![wire_pose(pose)]),
            Localized::Doubted(pose) => (v1::FixKind::Ambiguous, vec![wire_pose(pose)]),
            Localized::Sought(Fix::Unique(found)) => {
                (v1::FixKind::Unique, vec![wire_pose(&found.level_from_robot)])
            }
            Localized::Sought(Fix::Ambiguous(candidates)) => {
                let likeliest = candidates.iter().take(REPORTED_MAX);
                (
                    v1::FixKind::Ambiguous,
                    likeliest.map(|c| wire_pose(&c.level_from_robot)).collect(),
                )
            }
            Localized::Sought(Fix::NoMatch) => (v1::FixKind::NoMatch, Vec::new()),
        };
        let v1::FixBasis { segments, landmarks_m, .. } = self.basis.to_wire();
        let observed_at = to_rfc3339((time_s * 1e6).round() as i64);
        Some(v1::RobotFix {
            level: level.to_owned(),
            observed_at,
            kind,
            places,
            segments,
            landmarks_m,
        })
    }

    /// The wheels have counted on.
    pub(super) fn moved_to(&mut self, odom_from_robot: Pose<Odom, Robot>) {
        if let Some(last) = self.odom_from_robot.replace(odom_from_robot) {
            let step: Pose<Robot, Robot> = last.inverse().compose(&odom_from_robot);
            self.basis.way += step.position().norm();
            self.localizer.moved(&step);
        }
    }

    /// The robot was told its place, which it does not know otherwise.
    pub(super) fn told(&mut self, level_from_robot: UncertainPose<Level, Robot>) {
        self.localizer = Localizer::at(level_from_robot, self.config);
        self.found();
    }

    /// Whether it has ever known its place.
    pub(super) fn has_begun(&self) -> bool {
        self.basis.finds > 0
    }

    /// Where it is after a look.
    pub(super) fn seen(
        &mut self,
        percept: &Percept<'_>,
    ) -> Result<UncertainPose<Level, Robot>, Passed> {
        let view = view(percept, &self.config.places);
        let localized = self.localizer.seen(&view, &percept.features.segments, &self.known);
        self.came_to(localized)
    }

    /// Where it is after it has listened.
    pub(super) fn heard(
        &mut self,
        ring: &Ring,
        profile: &SonarProfile,
    ) -> Result<UncertainPose<Level, Robot>, Passed> {
        let localized = self.localizer.heard(ring, profile, &self.known);
        self.came_to(localized)
    }

    /// Where it is by the wheels since the last look.
    pub(super) fn carried(&self) -> Result<UncertainPose<Level, Robot>, Passed> {
        self.localizer.pose().ok_or(Passed::Unplaced)
    }

    fn came_to(&mut self, localized: Localized) -> Result<UncertainPose<Level, Robot>, Passed> {
        self.basis.walls.clear();
        self.basis.landmarks.clear();
        let pose = match &localized {
            Localized::Tracked(pose, report) => {
                self.owe(report);
                Ok(*pose)
            }
            Localized::Sought(Fix::Unique(found)) => {
                let pose = found.level_from_robot;
                self.found();
                Ok(pose)
            }
            Localized::Doubted(_) => Err(Passed::Doubted),
            Localized::Sought(_) | Localized::NotDue => Err(Passed::Unplaced),
        };
        self.last = Some(localized);
        pose
    }

    fn found(&mut self) {
        self.basis.finds += 1;
        self.basis.way = 0.0;
    }

    fn owe(&mut self, report: &TrackReport) {
        let mapped = |(_, name): &(usize, WallName)| match name {
            WallName::Mapped(id) => Some(*id),
            WallName::Planned(..) => None,
        };
        self.basis.walls.extend(report.walls.iter().filter_map(mapped));
        self.basis.walls.sort_unstable();
        self.basis.walls.dedup();
        let table = self.known.table.as_ref().map_or(&[][..], |table| table.landmarks());
        let known = |number: &u32| table.get(*number as usize).map(|landmark| landmark.at);
        self.basis.landmarks.extend(report.landmarks.iter().filter_map(|(_, n)| known(n)));
    }
}
