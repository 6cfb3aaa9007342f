//! Finding lines beside the bare loop, on the same simulated scans, in the same run: what covariances,
//! merging, ends, facing, what was seen through, clusters, and a correction of ranges cost.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use mapfold_client::perception::Extractor;
use mapfold_client::sensor::ScannerProfile;
use mapfold_schema::v1::RangeCorrection;
use mapfold_tests::extraction::{FANS, Set};

/// Scans that take turns.
const SCANS: usize = 200;
const RANGE_SD_M: f64 = 0.01;

fn extraction(c: &mut Criterion) {
    let mut group = c.benchmark_group("lines");
    for fan in FANS {
        let set = Set::plain(fan, RANGE_SD_M, SCANS);
        let scans = set.scans();
        let bare = set.bare_loop();
        let mut lines = Vec::new();
        let mut next = (0..SCANS).cycle();
        group.bench_function(BenchmarkId::new("bare loop", fan.beams), |b| {
            b.iter(|| {
                let scan = &scans[next.next().unwrap_or(0)];
                bare.lines(&fan, black_box(&scan.ranges), &mut lines);
                black_box(lines.len())
            });
        });
        let corrected = with_table(&set.profile);
        for (name, profile) in [("Mapfold", &set.profile), ("Mapfold with a table", &corrected)] {
            let mut extractor = Extractor::for_scanner(profile);
            group.bench_function(BenchmarkId::new(name, fan.beams), |b| {
                b.iter(|| {
                    let scan = &scans[next.next().unwrap_or(0)];
                    black_box(extractor.extract(black_box(scan)).segments.len())
                });
            });
        }
    }
    group.finish();
}

/// A table that takes nothing away and costs as much as any: every 10 cm and 10 degrees.
fn with_table(profile: &ScannerProfile) -> ScannerProfile {
    let distances_m: Vec<f64> = (0..400).map(|i| 0.1 * f64::from(i)).collect();
    let correction = RangeCorrection {
        incidences_rad: (0..9).map(|i| f64::from(10 * i).to_radians()).collect(),
        bias_m: vec![vec![0.0; distances_m.len()]; 9],
        sd_m: vec![vec![RANGE_SD_M; distances_m.len()]; 9],
        distances_m,
        incidence_max_rad: 85f64.to_radians(),
    };
    ScannerProfile { correction: Some(correction), ..profile.clone() }
}

criterion_group!(benches, extraction);
criterion_main!(benches);
