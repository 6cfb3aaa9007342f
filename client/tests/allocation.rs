//! Extraction allocates nothing once it has seen scans of a kind: an allocator that counts, in a
//! program of its own, for it counts whatever runs.
#![expect(clippy::unwrap_used, reason = "tests stop at the first surprise")]

#[path = "worlds/room.rs"]
mod room;

use std::alloc::System;
use std::path::PathBuf;

use mapfold_client::evidence::{Canvas, ScannerEvidenceConfig, scanner_evidence};
use mapfold_client::log::{Observation, carmen};
use mapfold_client::perception::Extractor;
use mapfold_client::sensor::{Scan, ScannerProfile, preset};
use mapfold_map::geometry::{Covariance, Pose, UncertainPose};
use mapfold_schema::v1::RangeCorrection;
use room::{Chance, Room};
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

/// Rooms with doors, a corner that juts out, pillars and legs.
fn simulated() -> Vec<Scan> {
    let mut room = Room::polygon(&[(-6.0, -1.2), (9.0, -1.2), (9.0, 4.0), (-6.0, 4.0)]);
    for door in 0..4 {
        let x = -6.0 + 3.7 * f64::from(door);
        room.walls.push([(x, 1.3), (x + 2.8, 1.3)]);
        room.walls.push([(x + 2.8, 1.3), (x + 2.8, 4.0)]);
    }
    room.pillars = vec![
        (3.0, -0.8, 0.15),
        (5.0, 0.9, 0.1),
        (-2.0, 0.7, 0.05),
        (-1.7, 0.8, 0.05),
        (0.5, 3.0, 0.2),
    ];
    let mut chance = Chance(4);
    let mut scans = Vec::new();
    for i in 0..60 {
        let place = (-5.0 + 0.2 * f64::from(i), 0.1, 0.7 * f64::from(i));
        for (beams, increment) in [(361, 0.5_f64), (1081, 0.25), (720, 0.5)] {
            scans.push(room.scan(
                place,
                (beams, increment.to_radians()),
                (0.01, 0.001),
                &mut chance,
            ));
        }
    }
    scans
}

fn corrected(profile: &ScannerProfile) -> ScannerProfile {
    let distances: Vec<f64> = (1..200).map(|i| 0.1 * f64::from(i)).collect();
    let correction = RangeCorrection {
        incidences_rad: (0..8).map(|i| f64::from(10 * i).to_radians()).collect(),
        bias_m: vec![distances.iter().map(|d| 0.02 * (3.0 * d).sin()).collect(); 8],
        sd_m: vec![vec![0.01; distances.len()]; 8],
        distances_m: distances,
        incidence_max_rad: 65f64.to_radians(),
    };
    ScannerProfile { correction: Some(correction), ..profile.clone() }
}

/// The scans of a real log.
fn recorded() -> Vec<Scan> {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data/killian.log.gz");
    let readings = carmen::read(file).unwrap().readings.into_iter();
    let scans = readings.filter_map(|reading| match reading.observation {
        Observation::Scan(scan) => Some(scan),
        Observation::Ring(_) => None,
    });
    scans.collect()
}

/// Looks through all scans: allocations meanwhile, and how many segments, clusters and stretches
/// seen through were found.
fn pass(extractor: &mut Extractor, scans: &[Scan]) -> (usize, [usize; 3]) {
    let mut found = [0; 3];
    let region = Region::new(ALLOCATOR);
    for scan in scans {
        let features = extractor.extract(scan);
        found[0] += features.segments.len();
        found[1] += features.clusters.len();
        found[2] += features.segments.iter().map(|s| s.seen_through.len()).sum::<usize>();
    }
    let stats = region.change();
    (stats.allocations + stats.reallocations, found)
}

/// Evidence of all scans: allocations meanwhile, and tiles in the patches.
fn evidence(canvas: &mut Canvas, profile: &ScannerProfile, scans: &[Scan]) -> (usize, usize) {
    let level_from_robot =
        UncertainPose { pose: Pose::new(3.3, -1.7, 0.3), covariance: Covariance::zero() };
    let config = ScannerEvidenceConfig::STANDARD;
    let mut tiles = 0;
    let region = Region::new(ALLOCATOR);
    for scan in scans {
        let is_return = |beam: usize| scan.is_return(scan.ranges[beam]);
        let patch =
            scanner_evidence(scan, is_return, profile, &level_from_robot, 0.05, &config, canvas);
        tiles += patch.tiles.len();
    }
    let stats = region.change();
    (stats.allocations + stats.reallocations, tiles)
}

/// One test, for whatever runs beside it would be counted too.
#[test]
fn after_the_first_pass_over_scans_nothing_is_allocated() {
    let (simulated, recorded) = (simulated(), recorded());
    for (kind, model, scans) in
        [("simulated", "sick-lms", &simulated), ("recorded", "sick-pls", &recorded)]
    {
        let profile = preset(model).and_then(|s| s.scanner).unwrap();
        for (name, profile) in
            [("as they come", profile.clone()), ("corrected", corrected(&profile))]
        {
            let mut extractor = Extractor::for_scanner(&profile);
            let (first, found) = pass(&mut extractor, scans);
            assert!(first > 0, "a counter that does not count");
            assert!(found.iter().all(|kind| *kind > 100), "{kind}, {name}: {found:?}");
            for number in 2..5 {
                assert_eq!(
                    pass(&mut extractor, scans),
                    (0, found),
                    "{kind}, {name}: pass {number}"
                );
            }
            // Of scans that it has not seen, once it has seen others of the kind.
            let mut extractor = Extractor::for_scanner(&profile);
            let (known, new): (Vec<_>, Vec<_>) =
                scans.iter().cloned().enumerate().partition(|(i, _)| i % 4 != 0);
            let of = |scans: Vec<(usize, Scan)>| -> Vec<Scan> {
                scans.into_iter().map(|(_, scan)| scan).collect()
            };
            pass(&mut extractor, &of(known));
            let new = of(new);
            let (allocations, _) = pass(&mut extractor, &new);
            assert!(
                100 * allocations <= new.len(),
                "{kind}, {name}: {allocations} in {}",
                new.len()
            );
        }
    }
    // What evidence allocates is the patch that it gives away: its runs tile by tile, and the map of tiles.
    for scans in [&simulated, &recorded] {
        let profile = preset("sick-lms").and_then(|s| s.scanner).unwrap();
        let mut canvas = Canvas::default();
        evidence(&mut canvas, &profile, scans);
        let (allocations, tiles) = evidence(&mut canvas, &profile, scans);
        assert!(tiles > 10 * scans.len() / 4, "{tiles} tiles");
        assert!(allocations <= 2 * tiles + 8 * scans.len(), "{allocations} for {tiles} tiles");
        assert_eq!(evidence(&mut canvas, &profile, scans), (allocations, tiles));
    }
}
