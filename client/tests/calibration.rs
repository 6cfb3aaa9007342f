//! Whether the noise that a preset claims is the noise that a real log has: residuals of long
//! walls over their claimed deviations.

use std::path::PathBuf;

use mapfold_client::log::{Observation, carmen};
use mapfold_client::perception::{Config, breakpoints, plausibility, points, split};
use mapfold_client::sensor::{Scan, preset};

/// Points that make a wall long enough to judge noise by.
const LONG: usize = 15;

/// Reduced chi-square of every long line of a scan, and its points' mean range.
fn long_walls(scan: &Scan, config: &Config) -> Vec<(f64, f64)> {
    let states = plausibility::judge(scan, &config.plausibility);
    let found = points::points(scan, &states, &config.noise);
    let ring = breakpoints::Ring { closed: scan.is_full_circle(), beams: scan.ranges.len() };
    let increment = scan.geometry.increment;
    let (found, runs) = breakpoints::runs(found, ring, increment, &config.breakpoints, &config.fit);
    let (mut lines, mut loose) = (Vec::new(), Vec::new());
    for run in runs {
        split::lines(&found, run, increment, config, &mut lines, &mut loose);
    }
    lines
        .iter()
        .filter(|line| line.members.len() >= LONG)
        .map(|line| {
            let count = line.members.len() as f64;
            let range = line.members.iter().map(|&i| found[i].range).sum::<f64>() / count;
            (line.fit.chi_sq / (count - 2.0), range)
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
    let config = Config::for_scanner(&preset("sick-pls").unwrap().scanner.unwrap());
    let mut walls = Vec::new();
    for reading in carmen::read(file).unwrap().readings.iter().step_by(5) {
        let Observation::Scan(scan) = &reading.observation else { panic!("not a scan") };
        walls.extend(long_walls(scan, &config));
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
