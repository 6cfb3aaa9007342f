//! Whether the noise that a preset claims is the noise that a real log has: residuals of long
//! walls over their claimed deviations.
#![expect(clippy::unwrap_used, reason = "tests stop at the first surprise")]

use std::path::PathBuf;

use mapfold_client::log::{Observation, carmen};
use mapfold_client::perception::fit::fit_line;
use mapfold_client::perception::points::ScanPoint;
use mapfold_client::perception::{BeamUse, Extractor};
use mapfold_client::sensor::{Scan, preset};

/// Points that make a wall long enough to judge noise by.
const LONG: usize = 15;

/// Reduced chi-square of every long wall of a scan, and its points' mean range.
fn long_walls(scan: &Scan, extractor: &mut Extractor) -> Vec<(f64, f64)> {
    let features = extractor.extract(scan).clone();
    let config = extractor.config();
    let point = |beam| ScanPoint::new(beam, scan.ranges[beam], scan.direction(beam), &config.noise);
    (0..features.segments.len() as u32)
        .map(|wall| {
            let own = features.beams.iter().enumerate();
            let own = own.filter(|(_, used)| **used == BeamUse::Segment(wall));
            own.map(|(beam, _)| point(beam)).collect::<Vec<_>>()
        })
        .filter(|points| points.len() >= LONG)
        .map(|points| {
            let count = points.len() as f64;
            let range = points.iter().map(|p| p.range).sum::<f64>() / count;
            let fit = fit_line(points.iter(), &config.fit).unwrap();
            (fit.chi_sq / (count - 2.0), range)
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn long_walls_of_the_killian_log_scatter_as_the_sick_pls_preset_claims() {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data/killian.log.gz");
    let profile = preset("sick-pls").unwrap().scanner.unwrap();
    let mut extractor = Extractor::for_scanner(&profile);
    let mut walls = Vec::new();
    for reading in carmen::read(file).unwrap().readings.iter().step_by(5) {
        let Observation::Scan(scan) = &reading.observation else { panic!("not a scan") };
        walls.extend(long_walls(scan, &mut extractor));
    }
    assert!(walls.len() > 1500, "{} long walls", walls.len());
    // 1 is exact; a claim may be up to 1.6 times too careful (0.4), and hardly too bold.
    let of = |near: bool| {
        median(walls.iter().filter(|(_, r)| (*r < 2.0) == near).map(|(c, _)| *c).collect())
    };
    for near in [true, false] {
        assert!((0.5..1.1).contains(&of(near)), "near {near}: {}", of(near));
    }
}
