//! Sensors of robots: what they are, how they err, where they sit.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a sensor is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SensorKind {
    /// A range scanner with narrow beams.
    Scanner,
    /// A ring of ultrasonic range finders.
    Sonar,
}

/// Where a sensor sits on its robot.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorMount {
    /// Metres ahead of the robot's centre.
    pub x_m: f64,
    /// Metres to the left of it.
    pub y_m: f64,
    /// Direction of the sensor's own x, counter-clockwise from straight ahead.
    pub heading_rad: f64,
}

/// How the readings of one scanner err, measured on a flat target: reading = distance + bias +
/// noise, bias and noise depending on the distance and on the incidence, which is the angle between
/// the beam and the target's normal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RangeCorrection {
    /// Distances of the target along the beam, ascending; at least two.
    pub distances_m: Vec<f64>,
    /// Incidences, ascending from 0 or more, below a right angle; at least one.
    pub incidences_rad: Vec<f64>,
    /// Mean reading less distance: a row for each incidence, in it a number for each distance.
    pub bias_m: Vec<Vec<f64>>,
    /// Standard deviation of a reading, in the same order.
    pub sd_m: Vec<Vec<f64>>,
    /// Readings of surfaces met at more than this are not used: at most the last incidence.
    pub incidence_max_rad: f64,
}

/// One sensor of a robot, as the robot declares it. What is absent is not known to the server; the
/// robot itself may know more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorProfile {
    /// What it is.
    pub kind: SensorKind,
    /// Make and model, for people.
    #[serde(default)]
    pub model: String,
    /// Nearer readings say nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range_min_m: Option<f64>,
    /// Readings at or beyond this are no echo.
    pub range_max_m: f64,
    /// Standard deviation of a range.
    pub range_sd_m: f64,
    /// Its growth with distance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range_sd_per_m: Option<f64>,
    /// Standard deviation of a bearing (scanner), or full width of the cone (sonar).
    pub beam_rad: f64,
    /// Error that all readings of one surface share, so that more readings do not average it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub systematic_sd_m: Option<f64>,
    /// Where it sits (scanner), for readings that do not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mount: Option<SensorMount>,
    /// Where each of its transducers sits (sonar).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub transducers: Vec<SensorMount>,
    /// How its ranges are corrected (scanner); not at all if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<RangeCorrection>,
    /// Whether its readings are derived from those of another sensor (demonstrations).
    #[serde(default)]
    pub emulated: bool,
}

impl SensorProfile {
    /// The least that a robot can say of a sensor.
    pub fn new(kind: SensorKind, range_max_m: f64, range_sd_m: f64, beam_rad: f64) -> Self {
        Self {
            kind,
            model: String::new(),
            range_min_m: None,
            range_max_m,
            range_sd_m,
            range_sd_per_m: None,
            beam_rad,
            systematic_sd_m: None,
            mount: None,
            transducers: Vec::new(),
            correction: None,
            emulated: false,
        }
    }
}
