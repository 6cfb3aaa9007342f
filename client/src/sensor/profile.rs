//! Profiles: what a kind of sensor can do, read from TOML or taken from a preset.
//!
//! Every threshold of perception and evidence is derived from these few figures, so that a new
//! sensor needs a profile and no tuning.

use mapfold_map::geometry::{Pose, Robot, Sensor};
use mapfold_schema::v1;
use serde::{Deserialize, Serialize};

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
            range_max_m: self.range_max_m,
            range_sd_m: self.range_sd_m,
            beam_rad: self.bearing_sd_rad,
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
            range_max_m: self.range_max_m,
            range_sd_m: self.range_sd_m,
            beam_rad: self.cone_rad,
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
    /// Not TOML of the expected shape.
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
    /// Neither a scanner nor a sonar.
    #[error("the sensor file names neither a [scanner] nor a [sonar]")]
    Empty,
}

impl Sensors {
    /// Reads and checks a sensor file.
    ///
    /// # Errors
    /// What does not fit, or the first figure that no sensor can have.
    pub fn from_toml(text: &str) -> Result<Self, ProfileError> {
        let sensors: Self = toml::from_str(text).map_err(|e| ProfileError::Shape(e.to_string()))?;
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

/// The names that [`preset`] knows.
pub const PRESETS: [&str; 4] = ["sick-lms", "sick-pls", "hokuyo-urg", "sonar-ring"];

/// A ready profile by name.
///
/// The noise figures are not the data sheets', which know neither a moving robot nor a wall that
/// is not quite flat, but those under which long walls of real logs scatter as claimed: over
/// eleven logs the median reduced chi-square lies between 0.3 and 0.9, so that claimed deviations
/// are 1.05 to 1.8 times the real ones, careful and never bold (`tests/calibration.rs` repeats it
/// on the committed log).
pub fn preset(name: &str) -> Option<Sensors> {
    let scanner = |scanner| Sensors { scanner: Some(scanner), sonar: None };
    match name {
        // SICK LMS 200/291: data sheet 5 mm statistical, 15 mm systematic up to 8 m; 80 m.
        "sick-lms" => Some(scanner(ScannerProfile {
            model: "SICK LMS 200".to_owned(),
            range_min_m: 0.05,
            range_max_m: 80.0,
            range_sd_m: 0.01,
            range_sd_per_m: 0.0005,
            bearing_sd_rad: 0.1_f64.to_radians(),
            systematic_sd_m: 0.01,
            mount: MountedAt::default(),
        })),
        // SICK PLS: ranges in steps of 2.5 to 5 cm, 50 m.
        "sick-pls" => Some(scanner(ScannerProfile {
            model: "SICK PLS 101".to_owned(),
            range_min_m: 0.05,
            range_max_m: 50.0,
            range_sd_m: 0.025,
            range_sd_per_m: 0.002,
            bearing_sd_rad: 0.1_f64.to_radians(),
            systematic_sd_m: 0.015,
            mount: MountedAt::default(),
        })),
        // Hokuyo URG-04LX: data sheet 1 cm below 1 m, 1 % above; 5.6 m.
        "hokuyo-urg" => Some(scanner(ScannerProfile {
            model: "Hokuyo URG-04LX".to_owned(),
            range_min_m: 0.06,
            range_max_m: 5.6,
            range_sd_m: 0.008,
            range_sd_per_m: 0.002,
            bearing_sd_rad: 0.1_f64.to_radians(),
            systematic_sd_m: 0.01,
            mount: MountedAt::default(),
        })),
        // Eight Polaroid-like sonars over the front half circle, their cones just overlapping.
        "sonar-ring" => Some(Sensors {
            scanner: None,
            sonar: Some(SonarProfile {
                model: "ring of ultrasonic range finders".to_owned(),
                range_min_m: 0.15,
                range_max_m: 5.0,
                range_sd_m: 0.03,
                range_sd_per_m: 0.01,
                cone_rad: 25f64.to_radians(),
                transducers: (0..8u8)
                    .map(|i| MountedAt {
                        x_m: 0.0,
                        y_m: 0.0,
                        heading_rad: (-78.75 + 22.5 * f64::from(i)).to_radians(),
                    })
                    .collect(),
            }),
        }),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_passes_its_own_checks_and_survives_toml() {
        for name in PRESETS {
            let sensors = preset(name).unwrap();
            let text = toml::to_string(&sensors).unwrap();
            assert_eq!(Sensors::from_toml(&text).unwrap(), sensors, "{name}");
        }
        assert_eq!(preset("no-such-sensor"), None);
    }

    #[test]
    fn figures_that_no_sensor_can_have_are_named() {
        let text = "[scanner]\nrange_min_m = 0.1\nrange_max_m = 30.0\nrange_sd_m = 0.0\n\
                    bearing_sd_rad = 0.001\nsystematic_sd_m = 0.01\n";
        assert_eq!(
            Sensors::from_toml(text),
            Err(ProfileError::Figure {
                sensor: "scanner",
                field: "range_sd_m",
                value: 0.0,
                rule: "it must be more than 0"
            })
        );
        assert_eq!(Sensors::from_toml(""), Err(ProfileError::Empty));
        assert!(matches!(
            Sensors::from_toml("[scanner]\nrange = 3.0"),
            Err(ProfileError::Shape(_))
        ));
    }
}
