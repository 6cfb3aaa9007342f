//! `mapfold-robot calibrate`.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use mapfold_client::sensor::Sensors;
use mapfold_client::sensor::calibration::{
    Calibration, CalibrationConfig, Errors, Quality, TargetReadings, calibrate,
};

use super::{say, sensors};

#[derive(Debug, Args)]
pub(super) struct Calibrate {
    /// The readings: text with commas, headed `distance_m,incidence_deg,reading_m[,surface]`, a
    /// reading on each line. Distances from the scanner's centre along the beam (best every 0.1 m),
    /// incidence between beam and target's normal (best every 10 degrees up to 70, and one at 65),
    /// 30 readings or more at each, of a bright and of a dark surface. A reading of 0 is one that
    /// did not come back.
    readings: PathBuf,
    /// The profile to write: TOML, or JSON if its name ends so.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// The profile to begin with: a preset or a file. Its bearings, limits and place on the robot
    /// stay; what is measured is replaced.
    #[arg(long, value_name = "FILE", value_parser = sensors, default_value = "ir-led")]
    sensor: Sensors,
    /// Make and model, for people; that of the profile if absent.
    #[arg(long, value_name = "TEXT")]
    model: Option<String>,
}

impl Calibrate {
    pub(super) fn run(self) -> Result<ExitCode, Box<dyn std::error::Error>> {
        let name = self.readings.display();
        let text = std::fs::read_to_string(&self.readings)
            .map_err(|error| format!("cannot read {name}: {error}"))?;
        let readings = TargetReadings::parse(&text).map_err(|error| format!("{name}, {error}"))?;
        let base =
            self.sensor.scanner.as_ref().ok_or("the profile to begin with names no scanner")?;
        let Calibration { mut profile, quality } =
            calibrate(&readings, base, &CalibrationConfig::STANDARD)
                .map_err(|error| format!("{name}: {error}"))?;
        if let Some(model) = self.model {
            profile.model = model;
        }
        say(&in_words(&quality, profile.systematic_sd_m));
        let sensors = Sensors { scanner: Some(profile), ..self.sensor };
        let json = self.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        let text = if json {
            serde_json::to_string_pretty(&sensors)? + "\n"
        } else {
            toml::to_string(&sensors)?
        };
        std::fs::write(&self.out, text)
            .map_err(|error| format!("cannot write {}: {error}", self.out.display()))?;
        Ok(ExitCode::SUCCESS)
    }
}

fn in_words(quality: &Quality, systematic: f64) -> String {
    let mm = |metres: f64| format!("{:.1} mm", 1e3 * metres);
    let errors = |e: &Errors| {
        format!("rms {}, p99 {}, mean {}, max {}", mm(e.rms), mm(e.p99), mm(e.bias), mm(e.max))
    };
    let Quality {
        readings, lost, measured, nodes, raw, corrected, worst, systematic: parts, ..
    } = quality;
    let mut text = format!(
        "readings: {readings} at {measured} of {nodes} nodes; {lost} did not come back\n\
         as they came:  {}\n\
         corrected:     {}\n\
         worst node:    {:.2} m, {:.0} degrees: mean {}, rms {}\n\
         systematic:    {} (means {}, between distances {}, between incidences {}, surfaces {})",
        errors(raw),
        errors(corrected),
        worst.distance,
        worst.incidence.to_degrees(),
        mm(worst.bias),
        mm(worst.rms),
        mm(systematic),
        mm(parts.means),
        mm(parts.distances),
        mm(parts.incidences),
        mm(parts.surfaces),
    );
    for warning in &quality.warnings {
        // Writing to a String cannot fail.
        let _ = write!(text, "\nwarning: {warning}");
    }
    text
}
