//! Robot logs: what a robot recorded, reading by reading, in one shape whatever the file was.
//!
//! Knows nothing of perception or maps. [`carmen`] reads CARMEN text, plain or gzip.

pub mod carmen;

use std::collections::BTreeMap;

use mapfold_map::geometry::{Level, Odom, Pose, Robot};

use crate::sensor::{Ring, Scan};

/// Malformed lines that people are told of one by one.
const FAULTS_TOLD: usize = 5;

/// What a reading holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Observation {
    /// A scanner's sweep.
    Scan(Scan),
    /// What the sonars heard.
    Ring(Ring),
}

/// What one sensor gave at one instant, and where the log says the robot then was.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Its place among the readings of the log, from 0.
    pub index: u32,
    /// Seconds by the log's clock; not always ascending, and in some logs without meaning.
    pub time_s: f64,
    /// The log's own (corrected) pose.
    pub level_from_robot: Option<Pose<Level, Robot>>,
    /// What the wheels counted.
    pub odom_from_robot: Option<Pose<Odom, Robot>>,
    /// What was sensed.
    pub observation: Observation,
}

/// The make of a log's scanner, as far as the log tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScannerMake {
    /// SICK LMS: 80 m, centimetres.
    SickLms,
    /// SICK PLS: 50 m, steps of 2.5 to 5 cm.
    SickPls,
    /// Hokuyo URG: a few metres.
    HokuyoUrg,
}

/// What reading a log came upon.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Summary {
    /// Lines of the file.
    pub lines: u64,
    /// Scans that became readings.
    pub scans: u64,
    /// Sonar lines that became readings.
    pub rings: u64,
    /// Odometry lines.
    pub odometry: u64,
    /// Parameters, by name.
    pub parameters: BTreeMap<String, String>,
    /// Known messages that mean nothing to a map, counted by name.
    pub ignored: BTreeMap<String, u64>,
    /// Lines that could not be read.
    pub malformed: u64,
    /// The first of them.
    pub faults: Vec<carmen::LineError>,
    /// What cut the file short, if anything; what came before it was read as ever.
    pub cut_short: Option<String>,
}

impl Summary {
    /// What is wrong with the file, for people, a line each; nothing for a sound one.
    pub fn damage(&self) -> Vec<String> {
        let mut told = Vec::new();
        if self.malformed > 0 {
            let (malformed, lines) = (self.malformed, self.lines);
            told.push(format!(
                "{malformed} of {lines} lines of the log are malformed and are passed over"
            ));
            told.extend(self.faults.iter().take(FAULTS_TOLD).map(|fault| format!("  {fault}")));
            let rest = malformed.saturating_sub(self.faults.len().min(FAULTS_TOLD) as u64);
            if rest > 0 {
                told.push(format!("  and {rest} more"));
            }
        }
        if let Some(reason) = &self.cut_short {
            told.push(format!("the log is cut short: {reason}"));
        }
        told
    }
}

/// A whole log.
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    /// Its readings in the order of the file.
    pub readings: Vec<Reading>,
    /// SHA-256 of its text, the same whether the file was compressed or not.
    pub digest: [u8; 32],
    /// The make of its scanner, if it has one.
    pub scanner: Option<ScannerMake>,
    /// What reading it came upon.
    pub summary: Summary,
}

impl Log {
    /// Time of the first reading, seconds by the log's clock; 0 for a log without readings.
    pub fn start_s(&self) -> f64 {
        self.readings.first().map_or(0.0, |r| r.time_s)
    }
}
