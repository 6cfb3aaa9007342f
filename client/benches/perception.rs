//! What a robot spends on one look: extraction and evidence, on scans of a made-up corridor with
//! doors, a pillar and noise, with as many beams as scanners of the logs and of today have.
#![expect(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use mapfold_client::evidence::{Canvas, ScannerEvidenceConfig, scanner_evidence};
use mapfold_client::perception::correction::CorrectionConfig;
use mapfold_client::perception::plausibility::{PlausibilityConfig, judge};
use mapfold_client::perception::{Config, Corrector, extract};
use mapfold_client::sensor::{Scan, ScannerProfile, preset};
use mapfold_map::geometry::{Covariance, Pose, UncertainPose};
use mapfold_schema::v1::RangeCorrection;

#[path = "../tests/worlds/room.rs"]
mod room;
use room::{Chance, Room};

fn corridor() -> Room {
    let mut room = Room::polygon(&[(-4.0, -1.2), (30.0, -1.2), (30.0, 4.0), (-4.0, 4.0)]);
    for door in 0..8 {
        let x = -4.0 + 4.2 * f64::from(door);
        room.walls.push([(x, 1.3), (x + 3.2, 1.3)]);
        room.walls.push([(x + 3.2, 1.3), (x + 3.2, 4.0)]);
    }
    room.pillars = vec![(3.0, -0.8, 0.15), (7.0, 0.9, 0.1)];
    room
}

fn scans(beams: usize, increment_deg: f64) -> Vec<Scan> {
    let mut chance = Chance(1);
    (0..16)
        .map(|i| {
            let place = (f64::from(i), 0.2, 0.3 * f64::from(i % 5) - 0.6);
            let shape = (beams, increment_deg.to_radians());
            corridor().scan(place, shape, (0.01, 0.001), &mut chance)
        })
        .collect()
}

fn profile() -> ScannerProfile {
    preset("sick-lms").unwrap().scanner.unwrap()
}

fn perception(c: &mut Criterion) {
    let config = Config::for_scanner(&profile());
    let mut group = c.benchmark_group("extract");
    for (beams, increment) in [(180, 1.0), (361, 0.5), (1081, 0.25)] {
        let scans = scans(beams, increment);
        let mut i = 0;
        group.bench_function(BenchmarkId::from_parameter(beams), |b| {
            b.iter(|| {
                i = (i + 1) % scans.len();
                extract(black_box(&scans[i]), &config)
            });
        });
    }
    group.finish();
}

/// A table that covers the corridor, every 10 cm and 10 degrees.
fn corrected_profile() -> ScannerProfile {
    let distances: Vec<f64> = (1..400).map(|i| 0.1 * f64::from(i)).collect();
    let bias = distances.iter().map(|d| 0.03 * (3.0 * d).sin()).collect();
    let correction = RangeCorrection {
        incidences_rad: (0..8).map(|i| f64::from(10 * i).to_radians()).collect(),
        bias_m: vec![bias; 8],
        sd_m: vec![vec![0.01; distances.len()]; 8],
        distances_m: distances,
        incidence_max_rad: 65f64.to_radians(),
    };
    ScannerProfile { correction: Some(correction), ..profile() }
}

fn correction(c: &mut Criterion) {
    let profile = corrected_profile();
    let plausibility = PlausibilityConfig::for_scanner(&profile);
    let mut corrector = Corrector::for_scanner(&profile, CorrectionConfig::STANDARD).unwrap();
    let mut group = c.benchmark_group("correct");
    for (beams, increment) in [(180, 1.0), (361, 0.5), (1081, 0.25)] {
        let scans = scans(beams, increment);
        let judged: Vec<_> = scans.iter().map(|scan| judge(scan, &plausibility)).collect();
        let mut corrected = corrector.correct(&scans[0], &judged[0]);
        let mut i = 0;
        group.bench_function(BenchmarkId::from_parameter(beams), |b| {
            b.iter(|| {
                i = (i + 1) % scans.len();
                corrector.correct_into(black_box(&scans[i]), &judged[i], &mut corrected);
            });
        });
    }
    group.finish();
}

fn evidence(c: &mut Criterion) {
    let profile = profile();
    let pose = UncertainPose {
        pose: Pose::new(12.3, 4.5, 0.7),
        covariance: Covariance::from_variances([9e-4, 9e-4, 2.7e-5]),
    };
    let mut canvas = Canvas::default();
    let mut group = c.benchmark_group("evidence");
    for (beams, increment) in [(180, 1.0), (1081, 0.25)] {
        let scans = scans(beams, increment);
        let mut i = 0;
        group.bench_function(BenchmarkId::from_parameter(beams), |b| {
            b.iter(|| {
                i = (i + 1) % scans.len();
                scanner_evidence(
                    black_box(&scans[i]),
                    |_| true,
                    &profile,
                    &pose,
                    0.05,
                    &ScannerEvidenceConfig::STANDARD,
                    &mut canvas,
                )
            });
        });
    }
    group.finish();
}

criterion_group!(benches, perception, correction, evidence);
criterion_main!(benches);
