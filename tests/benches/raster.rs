//! Entering scans into cells of 5 cm beside the bare ray loop, and adding tiles beside the machine's
//! plain addition: on the same data, in the same run.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use mapfold_client::evidence::{Canvas, ScannerEvidenceConfig, scanner_evidence};
use mapfold_map::geometry::{Covariance, Pose, UncertainPose};
use mapfold_map::raster::{TILE_CELLS, Tile, TilePatch};
use mapfold_tests::extraction::{FANS, Set};
use mapfold_tests::raster::BareGrid;
use mapfold_tests::simulation::REACH_M;

/// Scans that take turns.
const SCANS: usize = 200;
const RANGE_SD_M: f64 = 0.01;
const RESOLUTION_M: f64 = 0.05;
/// How well the scanner knows where it is: 3 cm and 0.3 degrees.
const POSE_VARIANCES: [f64; 3] = [9e-4, 9e-4, 2.7e-5];

fn insertion(c: &mut Criterion) {
    let mut group = c.benchmark_group("insertion");
    for fan in FANS {
        let set = Set::plain(fan, RANGE_SD_M, SCANS);
        let scans = set.scans();
        let directions: Vec<[f64; 2]> = (0..fan.beams)
            .map(|beam| {
                let (sin, cos) = fan.bearing(beam).sin_cos();
                [cos, sin]
            })
            .collect();
        let mut next = (0..SCANS).cycle();
        let mut grid = BareGrid::new(REACH_M, RESOLUTION_M);
        group.bench_function(BenchmarkId::new("bare rays", fan.beams), |b| {
            b.iter(|| {
                grid.enter(&directions, black_box(&scans[next.next().unwrap_or(0)].ranges));
            });
        });
        black_box(grid.touched());
        let mut canvas = Canvas::default();
        let level_from_robot = UncertainPose {
            pose: Pose::new(12.3, 4.5, 0.0),
            covariance: Covariance::from_variances(POSE_VARIANCES),
        };
        group.bench_function(BenchmarkId::new("Mapfold", fan.beams), |b| {
            b.iter(|| {
                scanner_evidence(
                    black_box(&scans[next.next().unwrap_or(0)]),
                    |_| true,
                    &set.profile,
                    &level_from_robot,
                    RESOLUTION_M,
                    &ScannerEvidenceConfig::STANDARD,
                    &mut canvas,
                )
            });
        });
    }
    group.finish();
}

fn merging(c: &mut Criterion) {
    let mut group = c.benchmark_group("tiles");
    group.throughput(Throughput::Elements(TILE_CELLS as u64));
    let ones = vec![1_i32; TILE_CELLS];
    let mut sums = vec![0_i32; TILE_CELLS];
    group.bench_function("plain addition", |b| {
        b.iter(|| {
            for (sum, more) in sums.iter_mut().zip(black_box(&ones)) {
                *sum = sum.wrapping_add(*more);
            }
            black_box(&mut sums);
        });
    });
    group.bench_function("saturating addition", |b| {
        b.iter(|| {
            for (sum, more) in sums.iter_mut().zip(black_box(&ones)) {
                *sum = sum.saturating_add(*more);
            }
            black_box(&mut sums);
        });
    });
    let mut cells = Box::new([0; TILE_CELLS]);
    cells.copy_from_slice(&ones);
    let (mut tile, other) = (Tile::default(), Tile::new(cells));
    group.bench_function("a tile", |b| {
        b.iter(|| black_box(&mut tile).add_tile(black_box(&other)));
    });
    // A patch whose cells are all free but for a wall.
    let mut cells = Box::new([-40_i16; TILE_CELLS]);
    for (at, cell) in cells.iter_mut().enumerate().filter(|(at, _)| at % 64 == 50) {
        *cell = 100 + (at % 7) as i16;
    }
    let patch = TilePatch::from_cells(&cells);
    group.bench_function("a patch", |b| {
        b.iter(|| black_box(&mut tile).add(black_box(&patch)));
    });
    group.finish();
}

criterion_group!(benches, insertion, merging);
criterion_main!(benches);
