//! Ready profiles of common sensors, by name.
//!
//! The figures of `sick-lms`, `sick-pls` and `hokuyo-urg` are not the data sheets', which know
//! neither a moving robot nor a wall that is not quite flat, but those under which long walls of
//! real logs scatter as claimed: over eleven logs the median reduced chi-square lies between 0.3 and
//! 0.9, so that claimed deviations are 1.05 to 1.8 times the real ones, careful and never bold
//! (`tests/calibration.rs` repeats it on the committed log).
//!
//! The figures of the others were not measured here. Those of `sick-lms1xx` and `rplidar` come from
//! their makers' pages: the statistical error stands as it is, the systematic error, which makers
//! give as a bound, at half of it (two deviations to the bound). Those of `sick-tim` and
//! `hokuyo-utm` are the commonly quoted ones, not checked against a data sheet. Who knows better
//! writes a file, or measures a target (`mapfold-robot calibrate`).

use super::profile::{MountedAt, ScannerProfile, Sensors, SonarProfile};

/// The names that [`preset`] knows.
pub const PRESETS: [&str; 9] = [
    "sick-lms",
    "sick-pls",
    "sick-lms1xx",
    "sick-tim",
    "hokuyo-urg",
    "hokuyo-utm",
    "rplidar",
    "ir-led",
    "sonar-ring",
];

/// The figures of a scanner: ranges from, to; deviation at zero distance and its growth; degrees of
/// a bearing; systematic deviation.
struct Figures {
    model: &'static str,
    ranges: (f64, f64),
    sd: (f64, f64),
    bearing_deg: f64,
    systematic: f64,
}

/// A ready profile by name.
pub fn preset(name: &str) -> Option<Sensors> {
    if name == "sonar-ring" {
        return Some(Sensors { scanner: None, sonar: Some(ring()) });
    }
    let figures = match name {
        // SICK LMS 200/291: data sheet 5 mm statistical, 15 mm systematic up to 8 m; 80 m.
        "sick-lms" => Figures {
            model: "SICK LMS 200",
            ranges: (0.05, 80.0),
            sd: (0.01, 0.0005),
            bearing_deg: 0.1,
            systematic: 0.01,
        },
        // SICK PLS: ranges in steps of 2.5 to 5 cm, 50 m.
        "sick-pls" => Figures {
            model: "SICK PLS 101",
            ranges: (0.05, 50.0),
            sd: (0.025, 0.002),
            bearing_deg: 0.1,
            systematic: 0.015,
        },
        // SICK LMS 100/111: typically 12 mm statistical, 30 mm systematic; 0.5 to 20 m.
        "sick-lms1xx" => Figures {
            model: "SICK LMS 111",
            ranges: (0.5, 20.0),
            sd: (0.012, 0.0005),
            bearing_deg: 0.1,
            systematic: 0.015,
        },
        // SICK TiM 5xx: 20 mm statistical, 60 mm systematic; 0.05 to 25 m (TiM571; others less).
        "sick-tim" => Figures {
            model: "SICK TiM 571",
            ranges: (0.05, 25.0),
            sd: (0.02, 0.0005),
            bearing_deg: 0.1,
            systematic: 0.03,
        },
        // Hokuyo URG-04LX: data sheet 1 cm below 1 m, 1 % above; 5.6 m.
        "hokuyo-urg" => Figures {
            model: "Hokuyo URG-04LX",
            ranges: (0.06, 5.6),
            sd: (0.008, 0.002),
            bearing_deg: 0.1,
            systematic: 0.01,
        },
        // Hokuyo UTM-30LX: below 10 m repeatable to 10 mm and accurate to 30 mm, up to 30 m to 30
        // and 50 mm.
        "hokuyo-utm" => Figures {
            model: "Hokuyo UTM-30LX",
            ranges: (0.1, 30.0),
            sd: (0.01, 0.001),
            bearing_deg: 0.1,
            systematic: 0.015,
        },
        // Slamtec RPLIDAR A1 and A2: triangulation, whose noise grows with the square of the
        // distance; "< 0.5 mm below 1.5 m, < 1 % of the distance" is a resolution, no accuracy. 1 %
        // of the distance is claimed as noise; the systematic part is a guess. White things are
        // seen up to 12 m, dark ones to half of that.
        "rplidar" => Figures {
            model: "Slamtec RPLIDAR A1/A2",
            ranges: (0.15, 12.0),
            sd: (0.005, 0.01),
            bearing_deg: 0.5,
            systematic: 0.02,
        },
        // A head that measures the phase of an infrared LED, like that of Skrzypczynski's scanner
        // (1999), before any correction: the deviation of its systematic errors is what such a head
        // is simulated with (`tests/src/simulation/ir_head.rs`), for the paper prints none. A table
        // belongs to one head, so there is none here: `mapfold-robot calibrate` makes it, and brings
        // the systematic part to a centimetre.
        "ir-led" => Figures {
            model: "scanner with an infrared LED",
            ranges: (0.2, 4.1),
            sd: (0.012, 0.007),
            bearing_deg: 0.2,
            systematic: 0.04,
        },
        _ => return None,
    };
    Some(Sensors { scanner: Some(figures.profile()), sonar: None })
}

impl Figures {
    fn profile(self) -> ScannerProfile {
        ScannerProfile {
            model: self.model.to_owned(),
            range_min_m: self.ranges.0,
            range_max_m: self.ranges.1,
            range_sd_m: self.sd.0,
            range_sd_per_m: self.sd.1,
            bearing_sd_rad: self.bearing_deg.to_radians(),
            systematic_sd_m: self.systematic,
            mount: MountedAt::default(),
            correction: None,
        }
    }
}

/// Eight Polaroid-like sonars over the front half circle, their cones just overlapping.
fn ring() -> SonarProfile {
    SonarProfile {
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
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_passes_its_own_checks_and_survives_toml_and_json() {
        for name in PRESETS {
            let sensors = preset(name).unwrap();
            let text = toml::to_string(&sensors).unwrap();
            assert_eq!(Sensors::parse(&text).unwrap(), sensors, "{name}");
            let text = serde_json::to_string(&sensors).unwrap();
            assert_eq!(Sensors::parse(&text).unwrap(), sensors, "{name}");
        }
        assert_eq!(preset("no-such-sensor"), None);
    }
}
