//! What a robot spends on one look: extraction and evidence, on scans of a made-up corridor with
//! doors, a pillar and noise, with as many beams as scanners of the logs and of today have.
#![expect(clippy::unwrap_used, reason = "a benchmark stops at the first surprise")]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use mapfold_client::evidence::{Canvas, ScannerEvidenceConfig, scanner_evidence};
use mapfold_client::perception::{Config, extract};
use mapfold_client::sensor::{Scan, ScannerProfile, preset};
use mapfold_map::geometry::{Covariance, Pose, UncertainPose};

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
        let usable = vec![true; beams];
        let mut i = 0;
        group.bench_function(BenchmarkId::from_parameter(beams), |b| {
            b.iter(|| {
                i = (i + 1) % scans.len();
                scanner_evidence(
                    black_box(&scans[i]),
                    &usable,
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

criterion_group!(benches, perception, evidence);
criterion_main!(benches);
