//! Profiles: what a sensor can do and how its readings err, as data: read from TOML or JSON, told
//! to the server and read back from it.
//!
//! Every threshold of perception and evidence is derived from these few figures, so that a new
//! sensor needs a profile and no tuning.

use mapfold_map::geometry::{Pose, Robot, Sensor};
use mapfold_schema::border::{Violation, check_correction};
use mapfold_schema::v1;
use serde::{Deserialize, Serialize};

use super::Scan;

/// Where a sensor sits on the robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct MountedAt {
    /// Metres ahead of the robot's centre.
    pub x_m: f64,
    /// Metres to the left of it.
    pub y_m: f64,
    /// Direction of the sensor's own x, counter-clockwise from straight ahead.
    pub heading_rad: f64,
}

impl MountedAt {
    /// As a pose.
    pub fn robot_from_sensor(&self) -> Pose<Robot, Sensor> {
        Pose::new(self.x_m, self.y_m, self.heading_rad)
    }

    /// The scan as taken from here, if the log did not tell where its sensor sits and this does.
    pub fn placed(&self, scan: &Scan) -> Option<Scan> {
        let told = &scan.robot_from_sensor;
        let untold = told.x == 0.0 && told.y == 0.0 && told.heading() == 0.0;
        (untold && *self != Self::default())
            .then(|| Scan { robot_from_sensor: self.robot_from_sensor(), ..scan.clone() })
    }

    fn to_wire(self) -> v1::SensorMount {
        let Self { x_m, y_m, heading_rad } = self;
        v1::SensorMount { x_m, y_m, heading_rad }
    }

    fn from_wire(mount: &v1::SensorMount) -> Self {
        let v1::SensorMount { x_m, y_m, heading_rad } = *mount;
        Self { x_m, y_m, heading_rad }
    }
}

/// A scanner: narrow beams, one range each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScannerProfile {
    /// Make and model, for people.
    #[serde(default)]
    pub model: String,
    /// Nearer readings are dirt on the window or an error code.
    pub range_min_m: f64,
    /// Readings from here on are no return; a log that says less is believed.
    pub range_max_m: f64,
    /// Standard deviation of a range at zero distance, one beam from the next.
    pub range_sd_m: f64,
    /// Growth of that standard deviation with distance.
    #[serde(default)]
    pub range_sd_per_m: f64,
    /// Standard deviation of a bearing.
    pub bearing_sd_rad: f64,
    /// Error that all beams on one surface share, so that more beams do not average it out.
    pub systematic_sd_m: f64,
    /// Where it sits, for logs that do not tell.
    #[serde(default)]
    pub mount: MountedAt,
    /// How the ranges of this very scanner are corrected; as they come if absent. The deviations
    /// above are then those of corrected ranges, and this has them node by node.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<v1::RangeCorrection>,
}

impl ScannerProfile {
    /// Standard deviation of a range of `range` metres.
    pub fn range_sd(&self, range: f64) -> f64 {
        self.range_sd_m.hypot(self.range_sd_per_m * range)
    }

    /// The profile as the robot declares it to the server.
    pub fn to_wire(&self) -> v1::SensorProfile {
        v1::SensorProfile {
            kind: v1::SensorKind::Scanner,
            model: self.model.clone(),
            range_min_m: Some(self.range_min_m),
            range_max_m: self.range_max_m,
            range_sd_m: self.range_sd_m,
            range_sd_per_m: Some(self.range_sd_per_m),
            beam_rad: self.bearing_sd_rad,
            systematic_sd_m: Some(self.systematic_sd_m),
            mount: Some(self.mount.to_wire()),
            transducers: Vec::new(),
            correction: self.correction.clone(),
            emulated: false,
        }
    }
}

/// A ring of ultrasonic range finders: wide cones, the nearest echo each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SonarProfile {
    /// Make and model, for people.
    #[serde(default)]
    pub model: String,
    /// Nearer readings are the transducer's own ringing.
    pub range_min_m: f64,
    /// Readings from here on are no echo.
    pub range_max_m: f64,
    /// Standard deviation of a range at zero distance.
    pub range_sd_m: f64,
    /// Growth of that standard deviation with distance.
    #[serde(default)]
    pub range_sd_per_m: f64,
    /// Full width of the cone.
    pub cone_rad: f64,
    /// Where the transducers sit, for logs without sonar whose sonar is emulated.
    #[serde(default)]
    pub transducers: Vec<MountedAt>,
}

impl SonarProfile {
    /// Standard deviation of a range of `range` metres.
    pub fn range_sd(&self, range: f64) -> f64 {
        self.range_sd_m.hypot(self.range_sd_per_m * range)
    }

    /// The profile as the robot declares it to the server.
    pub fn to_wire(&self, emulated: bool) -> v1::SensorProfile {
        v1::SensorProfile {
            kind: v1::SensorKind::Sonar,
            model: self.model.clone(),
            range_min_m: Some(self.range_min_m),
            range_max_m: self.range_max_m,
            range_sd_m: self.range_sd_m,
            range_sd_per_m: Some(self.range_sd_per_m),
            beam_rad: self.cone_rad,
            systematic_sd_m: None,
            mount: None,
            transducers: self.transducers.iter().copied().map(MountedAt::to_wire).collect(),
            correction: None,
            emulated,
        }
    }
}

/// All sensors of one robot: at most one scanner and one ring.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct Sensors {
    /// Its scanner.
    #[serde(default)]
    pub scanner: Option<ScannerProfile>,
    /// Its ring of sonars.
    #[serde(default)]
    pub sonar: Option<SonarProfile>,
}

/// A profile that cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProfileError {
    /// Not TOML or JSON of the expected shape.
    #[error("the sensor file does not fit: {0}")]
    Shape(String),
    /// A figure that no sensor can have.
    #[error("{sensor}.{field} is {value}: {rule}")]
    Figure {
        /// `scanner` or `sonar`.
        sensor: &'static str,
        /// The field.
        field: &'static str,
        /// What it says.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
    /// A correction table that cannot be one.
    #[error("scanner.correction{}: {}", .0.pointer, .0.detail)]
    Correction(Violation),
    /// Neither a scanner nor a sonar.
    #[error("the sensor file names neither a [scanner] nor a [sonar]")]
    Empty,
    /// What a server keeps of a sensor may be less than what a robot needs to know of its own.
    #[error("what the server keeps of the {sensor} lacks {field}")]
    Incomplete {
        /// `scanner` or `sonar`.
        sensor: &'static str,
        /// What is missing.
        field: &'static str,
    },
}

impl Sensors {
    /// Reads and checks a sensor file, JSON if it begins with a brace, else TOML.
    ///
    /// # Errors
    /// What does not fit, or the first figure that no sensor can have.
    pub fn parse(text: &str) -> Result<Self, ProfileError> {
        let shape = |error: &dyn std::fmt::Display| ProfileError::Shape(error.to_string());
        let sensors: Self = if text.trim_start().starts_with('{') {
            serde_json::from_str(text).map_err(|e| shape(&e))?
        } else {
            toml::from_str(text).map_err(|e| shape(&e))?
        };
        sensors.check()?;
        Ok(sensors)
    }

    /// The sensors that a server keeps of a robot, emulated ones aside; of several of one kind the
    /// first.
    ///
    /// # Errors
    /// A sensor that was declared by the least that can be said of it, or figures that no sensor
    /// can have.
    pub fn from_wire(declared: &[v1::SensorProfile]) -> Result<Self, ProfileError> {
        let of = |kind| declared.iter().find(|s| s.kind == kind && !s.emulated);
        let scanner = of(v1::SensorKind::Scanner).map(scanner_from_wire).transpose()?;
        let sonar = of(v1::SensorKind::Sonar).map(sonar_from_wire).transpose()?;
        let sensors = Self { scanner, sonar };
        sensors.check()?;
        Ok(sensors)
    }

    fn check(&self) -> Result<(), ProfileError> {
        if self.scanner.is_none() && self.sonar.is_none() {
            return Err(ProfileError::Empty);
        }
        if let Some(s) = &self.scanner {
            let check = Figures("scanner");
            check.range(s.range_min_m, s.range_max_m)?;
            check.positive("range_sd_m", s.range_sd_m)?;
            check.not_negative("range_sd_per_m", s.range_sd_per_m)?;
            check.positive("bearing_sd_rad", s.bearing_sd_rad)?;
            check.not_negative("systematic_sd_m", s.systematic_sd_m)?;
            check.mount(&s.mount)?;
            let wrong = s.correction.as_ref().map(check_correction).unwrap_or_default();
            if let Some(first) = wrong.into_iter().next() {
                return Err(ProfileError::Correction(first));
            }
        }
        if let Some(s) = &self.sonar {
            let check = Figures("sonar");
            check.range(s.range_min_m, s.range_max_m)?;
            check.positive("range_sd_m", s.range_sd_m)?;
            check.not_negative("range_sd_per_m", s.range_sd_per_m)?;
            check.positive("cone_rad", s.cone_rad)?;
            if s.cone_rad > std::f64::consts::FRAC_PI_2 {
                return Err(check.fault("cone_rad", s.cone_rad, "a cone is at most pi/2 wide"));
            }
            s.transducers.iter().try_for_each(|m| check.mount(m))?;
        }
        Ok(())
    }
}

fn scanner_from_wire(s: &v1::SensorProfile) -> Result<ScannerProfile, ProfileError> {
    let need = |field, value: Option<f64>| {
        value.ok_or(ProfileError::Incomplete { sensor: "scanner", field })
    };
    Ok(ScannerProfile {
        model: s.model.clone(),
        range_min_m: need("range_min_m", s.range_min_m)?,
        range_max_m: s.range_max_m,
        range_sd_m: s.range_sd_m,
        range_sd_per_m: s.range_sd_per_m.unwrap_or(0.0),
        bearing_sd_rad: s.beam_rad,
        systematic_sd_m: need("systematic_sd_m", s.systematic_sd_m)?,
        mount: s.mount.as_ref().map(MountedAt::from_wire).unwrap_or_default(),
        correction: s.correction.clone(),
    })
}

fn sonar_from_wire(s: &v1::SensorProfile) -> Result<SonarProfile, ProfileError> {
    let missing = ProfileError::Incomplete { sensor: "sonar", field: "range_min_m" };
    Ok(SonarProfile {
        model: s.model.clone(),
        range_min_m: s.range_min_m.ok_or(missing)?,
        range_max_m: s.range_max_m,
        range_sd_m: s.range_sd_m,
        range_sd_per_m: s.range_sd_per_m.unwrap_or(0.0),
        cone_rad: s.beam_rad,
        transducers: s.transducers.iter().map(MountedAt::from_wire).collect(),
    })
}

/// The checks of one sensor's figures.
struct Figures(&'static str);

impl Figures {
    fn fault(&self, field: &'static str, value: f64, rule: &'static str) -> ProfileError {
        ProfileError::Figure { sensor: self.0, field, value, rule }
    }

    fn positive(&self, field: &'static str, value: f64) -> Result<(), ProfileError> {
        if value.is_finite() && value > 0.0 {
            Ok(())
        } else {
            Err(self.fault(field, value, "it must be more than 0"))
        }
    }

    fn not_negative(&self, field: &'static str, value: f64) -> Result<(), ProfileError> {
        if value.is_finite() && value >= 0.0 {
            Ok(())
        } else {
            Err(self.fault(field, value, "it must not be negative"))
        }
    }

    fn range(&self, min: f64, max: f64) -> Result<(), ProfileError> {
        self.not_negative("range_min_m", min)?;
        if max.is_finite() && max > min && max <= 1000.0 {
            Ok(())
        } else {
            Err(self.fault("range_max_m", max, "it must lie between range_min_m and 1000"))
        }
    }

    fn mount(&self, mount: &MountedAt) -> Result<(), ProfileError> {
        for (field, value) in
            [("x_m", mount.x_m), ("y_m", mount.y_m), ("heading_rad", mount.heading_rad)]
        {
            if !value.is_finite() || value.abs() > 100.0 {
                return Err(self.fault(field, value, "a sensor sits within 100 m of its robot"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::preset;

    #[test]
    fn figures_that_no_sensor_can_have_are_named() {
        let text = "[scanner]\nrange_min_m = 0.1\nrange_max_m = 30.0\nrange_sd_m = 0.0\n\
                    bearing_sd_rad = 0.001\nsystematic_sd_m = 0.01\n";
        assert_eq!(
            Sensors::parse(text),
            Err(ProfileError::Figure {
                sensor: "scanner",
                field: "range_sd_m",
                value: 0.0,
                rule: "it must be more than 0"
            })
        );
        assert_eq!(Sensors::parse(""), Err(ProfileError::Empty));
        assert!(matches!(Sensors::parse("[scanner]\nrange = 3.0"), Err(ProfileError::Shape(_))));
    }

    #[test]
    fn what_a_server_keeps_is_the_whole_profile() {
        let mut scanner = preset("ir-led").and_then(|s| s.scanner).unwrap();
        scanner.mount = MountedAt { x_m: 0.2, y_m: -0.1, heading_rad: 0.05 };
        scanner.correction = Some(v1::RangeCorrection {
            distances_m: vec![0.3, 4.0],
            incidences_rad: vec![0.0, 1.2],
            bias_m: vec![vec![0.01, -0.02]; 2],
            sd_m: vec![vec![0.01, 0.02]; 2],
            incidence_max_rad: 1.1,
        });
        let sonar = preset("sonar-ring").and_then(|s| s.sonar);
        let sensors = Sensors { scanner: Some(scanner.clone()), sonar: sonar.clone() };
        let wire = [scanner.to_wire(), sonar.unwrap().to_wire(false)];
        assert_eq!(Sensors::from_wire(&wire), Ok(sensors.clone()));
        assert_eq!(Sensors::parse(&toml::to_string(&sensors).unwrap()), Ok(sensors));
        let bare = v1::SensorProfile::new(v1::SensorKind::Scanner, 4.0, 0.01, 0.01);
        assert_eq!(
            Sensors::from_wire(&[bare]),
            Err(ProfileError::Incomplete { sensor: "scanner", field: "range_min_m" })
        );
        scanner.correction.as_mut().unwrap().sd_m[1][0] = -1.0;
        let error = Sensors::from_wire(&[scanner.to_wire()]).unwrap_err().to_string();
        assert!(error.starts_with("scanner.correction/sd_m/1/0: "), "{error}");
    }
}
