//! What one reading comes to: features and evidence.

use std::borrow::Cow;

use mapfold_map::level::Contribution;
use mapfold_schema::border::wire_contribution;
use mapfold_schema::v1;
use uuid::Uuid;

use super::{Basis, Scanner, Surveyor};
use crate::emulation::{self, Chance};
use crate::evidence::{KnownWalls, SonarVerdicts, scanner_evidence, sonar_evidence};
use crate::log::{Observation, Reading};
use crate::perception::{BeamState, Percept};
use crate::sensor::{Ring, Scan};

/// One contribution before it is sent.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    /// What the fold takes.
    pub contribution: Contribution,
    /// Whether its readings were derived from those of another sensor.
    pub emulated: bool,
    /// What its pose owes to the map, if the robot found itself.
    pub basis: Option<Basis>,
    /// What was thought of its sonar readings.
    pub sonar: SonarVerdicts,
}

impl Look {
    /// As it travels, for the level with this `frame`.
    pub fn to_wire(&self, frame: Uuid) -> v1::Contribution {
        let basis = self.basis.as_ref().map(Basis::to_wire);
        wire_contribution(&self.contribution, frame, self.emulated, basis)
    }
}

/// Fills in what the reading shows.
pub(super) fn fill(
    surveyor: &mut Surveyor,
    reading: &Reading,
    walls: Option<&dyn KnownWalls>,
    look: &mut Contribution,
) -> SonarVerdicts {
    match (&reading.observation, ring(surveyor, reading)) {
        (_, Some(ring)) => hear(surveyor, &ring, walls, look),
        (Observation::Scan(scan), None) => {
            see(surveyor, scan, look);
            SonarVerdicts::default()
        }
        (Observation::Ring(_), None) => SonarVerdicts::default(),
    }
}

/// What the robot's sonars heard: as the log has it, or as they would have heard what its scanner saw.
pub(super) fn ring<'a>(surveyor: &Surveyor, reading: &'a Reading) -> Option<Cow<'a, Ring>> {
    match (&reading.observation, surveyor.emulation) {
        (Observation::Ring(ring), _) => Some(Cow::Borrowed(ring)),
        (Observation::Scan(_), None) => None,
        (Observation::Scan(scan), Some(config)) => {
            let profile = surveyor.sonar.as_ref()?;
            // The id's own chance: the same reading is always heard the same.
            let id = surveyor.id(reading);
            let mut seed = [0; 8];
            seed.copy_from_slice(&id.0[8..]);
            let mut chance = Chance::new(u64::from_be_bytes(seed));
            Some(Cow::Owned(emulation::emulate(scan, profile, &config, &mut chance)))
        }
    }
}

/// Walls, clusters and evidence of a scan.
fn see(surveyor: &mut Surveyor, scan: &Scan, look: &mut Contribution) {
    let Some(scanner) = &mut surveyor.scanner else { return };
    let Scanner { profile, perception, evidence } = scanner.as_mut();
    let Percept { scan, states, features } = perception.of(scan);
    look.segments.clone_from(&features.segments);
    look.clusters.clone_from(&features.clusters);
    let usable = |beam: usize| states.get(beam).is_some_and(|state| *state == BeamState::Hit);
    let patch = scanner_evidence(
        scan,
        usable,
        profile,
        &look.level_from_robot,
        surveyor.config.resolution,
        evidence,
        &mut surveyor.canvas,
    );
    look.evidence.extend((!patch.tiles.is_empty()).then_some(patch));
}

/// Evidence of a ring.
fn hear(
    surveyor: &mut Surveyor,
    ring: &Ring,
    walls: Option<&dyn KnownWalls>,
    look: &mut Contribution,
) -> SonarVerdicts {
    let Some(profile) = &surveyor.sonar else { return SonarVerdicts::default() };
    let (patch, verdicts) = sonar_evidence(
        ring,
        profile,
        &look.level_from_robot,
        walls,
        surveyor.config.resolution,
        &surveyor.sonar_evidence,
        &mut surveyor.canvas,
    );
    look.evidence.extend((!patch.tiles.is_empty()).then_some(patch));
    verdicts
}
