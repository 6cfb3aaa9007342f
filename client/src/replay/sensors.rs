//! Which sensors a robot has: as told, or as its log tells.

use crate::log::{Log, ScannerMake};
use crate::sensor::{Sensors, SonarProfile, preset};

/// The kinds of sensor to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Competence {
    /// Scans only.
    Scanner,
    /// Sonar only.
    Sonar,
    /// Both.
    Both,
}

/// What is asked for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SensorChoice {
    /// The robot's sensors; presets that fit the log if absent.
    pub profile: Option<Sensors>,
    /// The kinds to use; those that the log holds if absent.
    pub competence: Option<Competence>,
    /// Whether to make sonar readings out of scans.
    pub emulate_sonar: bool,
}

/// Sensors that do not go together with the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SensorsError {
    /// No scans, but a scanner is asked for.
    #[error("the log holds no scans")]
    NoScans,
    /// No sonar, but it is asked for.
    #[error("the log holds no sonar readings; --emulate-sonar makes some out of its scans")]
    NoSonar,
    /// The file given names no such sensor.
    #[error("the sensor profile given names no {0}")]
    NotInProfile(&'static str),
    /// A robot whose sonar is emulated has no scanner of its own.
    #[error("emulated sonar goes with --competence sonar only: the scans are what it is made of")]
    EmulatedAndScanner,
}

impl SensorChoice {
    /// The sensors to use on this log.
    ///
    /// # Errors
    /// Why they do not go together.
    pub fn choose(&self, log: &Log) -> Result<Sensors, SensorsError> {
        let (scans, rings) = (log.summary.scans > 0, log.summary.rings > 0);
        if self.emulate_sonar {
            if !matches!(self.competence, None | Some(Competence::Sonar)) {
                return Err(SensorsError::EmulatedAndScanner);
            }
            if !scans {
                return Err(SensorsError::NoScans);
            }
            let own = self.profile.as_ref().and_then(|p| p.sonar.clone());
            let sonar = own.filter(|s| !s.transducers.is_empty()).or_else(ring_preset);
            return Ok(Sensors { scanner: None, sonar });
        }
        let competence = self.competence.unwrap_or(match (scans, rings) {
            (true, false) => Competence::Scanner,
            (false, _) => Competence::Sonar,
            (true, true) => Competence::Both,
        });
        let wants = |kind| competence == Competence::Both || competence == kind;
        let (see, hear) = (wants(Competence::Scanner), wants(Competence::Sonar));
        if see && !scans {
            return Err(SensorsError::NoScans);
        }
        if hear && !rings {
            return Err(SensorsError::NoSonar);
        }
        let profile = match &self.profile {
            Some(given) => given.clone(),
            None => Sensors {
                scanner: log.scanner.and_then(|make| preset(preset_of(make))?.scanner),
                sonar: ring_preset(),
            },
        };
        // What the profile lacks is only missed if it was asked for in so many words.
        let asked = |kind| self.competence.is_some_and(|c| c == Competence::Both || c == kind);
        if asked(Competence::Scanner) && profile.scanner.is_none() {
            return Err(SensorsError::NotInProfile("scanner"));
        }
        if asked(Competence::Sonar) && profile.sonar.is_none() {
            return Err(SensorsError::NotInProfile("sonar"));
        }
        Ok(Sensors {
            scanner: profile.scanner.filter(|_| see),
            sonar: profile.sonar.filter(|_| hear),
        })
    }
}

fn ring_preset() -> Option<SonarProfile> {
    preset("sonar-ring")?.sonar
}

fn preset_of(make: ScannerMake) -> &'static str {
    match make {
        ScannerMake::SickLms => "sick-lms",
        ScannerMake::SickPls => "sick-pls",
        ScannerMake::HokuyoUrg => "hokuyo-urg",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::carmen::read_from;
    use std::io::Cursor;

    const SCAN: &str = "FLASER 1 2.0 0 0 0 0 0 0 1 h 1\n";
    const RING: &str = "ODOM 0 0 0 0 0 0 1\nSONAR 0.4 1 1.5 0 0 0 1 h 1\n";

    fn chosen(text: &str, choice: &SensorChoice) -> Result<(bool, bool), SensorsError> {
        let log = read_from(Cursor::new(text.to_owned().into_bytes())).unwrap();
        choice.choose(&log).map(|s| (s.scanner.is_some(), s.sonar.is_some()))
    }

    #[test]
    fn without_a_word_the_log_decides() {
        let choice = SensorChoice::default();
        assert_eq!(chosen(SCAN, &choice), Ok((true, false)));
        assert_eq!(chosen(RING, &choice), Ok((false, true)));
        assert_eq!(chosen(&format!("{SCAN}{RING}"), &choice), Ok((true, true)));
    }

    #[test]
    fn what_the_log_does_not_hold_cannot_be_used() {
        let only = |competence| SensorChoice { competence: Some(competence), ..Default::default() };
        assert_eq!(chosen(SCAN, &only(Competence::Sonar)), Err(SensorsError::NoSonar));
        assert_eq!(chosen(RING, &only(Competence::Both)), Err(SensorsError::NoScans));
        assert_eq!(chosen(&format!("{SCAN}{RING}"), &only(Competence::Sonar)), Ok((false, true)));
        let profile = preset("sick-lms");
        let choice = SensorChoice { profile, ..only(Competence::Sonar) };
        assert_eq!(chosen(RING, &choice), Err(SensorsError::NotInProfile("sonar")));
    }

    #[test]
    fn emulated_sonar_is_the_only_sensor() {
        let emulated = SensorChoice { emulate_sonar: true, ..Default::default() };
        assert_eq!(chosen(SCAN, &emulated), Ok((false, true)));
        assert_eq!(chosen(RING, &emulated), Err(SensorsError::NoScans));
        let both = SensorChoice { competence: Some(Competence::Both), ..emulated };
        assert_eq!(chosen(SCAN, &both), Err(SensorsError::EmulatedAndScanner));
    }
}
