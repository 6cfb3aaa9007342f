//! Evidence against truth and against exact models: the set-up of `mapfold-evaluate raster` with fewer
//! rooms.

use mapfold_client::evidence::{Canvas, ScannerEvidenceConfig, beam_evidence, scanner_evidence};
use mapfold_map::geometry::{Covariance, Pose, UncertainPose};
use mapfold_tests::Error;
use mapfold_tests::extraction::{FANS, Set};
use mapfold_tests::plane::Point;
use mapfold_tests::raster::exact::{BeamModel, enter, posterior};
use mapfold_tests::raster::recorded::{Rounds, log};
use mapfold_tests::raster::{Grid, tables};

const RESOLUTION_M: f64 = 0.05;

/// Cells at the border of what a scan frees differ by all of "free": one way they are freed if the
/// outline holds their centre, the other if a beam touches them.
#[test]
fn scans_filled_row_by_row_say_what_their_beams_say_one_by_one() {
    let config = ScannerEvidenceConfig::STANDARD;
    for fan in FANS {
        let set = Set::plain(fan, 0.01, 20);
        let mut canvas = Canvas::default();
        let (mut seen, mut alike, mut close) = (0.0, 0.0, 0.0);
        // Free and occupied, filled and ray by ray.
        let mut sums = [[0.0; 2]; 2];
        for (scan, (plan, sweep)) in set.scans().iter().zip(&set.sweeps) {
            let level_from_robot = UncertainPose {
                pose: Pose::new(sweep.at.x, sweep.at.y, sweep.heading),
                covariance: Covariance::from_variances([1e-4, 1e-4, 1e-6]),
            };
            let patch = scanner_evidence(
                scan,
                |_| true,
                &set.profile,
                &level_from_robot,
                RESOLUTION_M,
                &config,
                &mut canvas,
            );
            let mut filled = Grid::about(&set.plans[*plan].pieces, RESOLUTION_M);
            let mut rays = filled.clone();
            filled.add(&patch, 1.0);
            let model = BeamModel {
                free_nat: config.free_nat,
                occupied_nat: config.occupied_nat,
                // Range, pose, cell.
                sd_m: (1e-4 + 1e-4 + RESOLUTION_M * RESOLUTION_M / 12.0_f64).sqrt(),
            };
            let beams = (0..fan.beams).map(|b| (sweep.heading + fan.bearing(b), sweep.ranges[b]));
            let eye = Point::new(sweep.at.x, sweep.at.y);
            enter(&mut rays, eye, beams.filter(|(_, z)| z.is_finite()), &model);
            // What no ray crosses is left out: there is nothing to compare with.
            for (filled, ray) in filled.nats.iter().zip(&rays.nats).filter(|(_, ray)| **ray != 0.0)
            {
                seen += 1.0;
                alike += f64::from(u8::from((filled - ray).abs() <= 0.2));
                close += f64::from(u8::from((filled - ray).abs() <= 0.45));
                let kind = usize::from(*ray > 0.0);
                sums[kind][0] += if *ray > 0.0 { filled.max(0.0) } else { filled.min(0.0) };
                sums[kind][1] += ray;
            }
        }
        assert!(alike / seen > 0.85, "{}: {} alike", fan.beams, alike / seen);
        assert!(close / seen > 0.97, "{}: {} close", fan.beams, close / seen);
        for [filled, rays] in sums {
            let ratio = filled / rays;
            assert!((0.88..1.02).contains(&ratio), "{}: {ratio} of the evidence", fan.beams);
        }
    }
}

/// The exact posterior is of a certain reading, ours of a look that shares its pose error with others:
/// less by a factor, but of the same shape.
#[test]
fn a_beam_has_the_shape_and_the_sign_of_the_exact_posterior() {
    let config = ScannerEvidenceConfig::STANDARD;
    let z = 2.025;
    for sd in [0.02, 0.03, 0.06] {
        for prior in [0.2, 0.5] {
            let exact = posterior(z, sd, 80, RESOLUTION_M, prior);
            let ours: Vec<f64> = (0..80)
                .map(|k| {
                    let d = (f64::from(k) + 0.5) * RESOLUTION_M;
                    let (free, occupied) = beam_evidence(d, z, sd, RESOLUTION_M, &config);
                    free + occupied
                })
                .collect();
            for (k, (exact, ours)) in exact.iter().zip(&ours).enumerate() {
                let off = (k as f64 + 0.5) * RESOLUTION_M - z;
                let context =
                    format!("sd {sd}, prior {prior}, {off} m from the hit: {exact} {ours}");
                if off < -3.0 * sd {
                    assert!(*exact < -0.4 && *ours <= config.free_nat, "{context}");
                } else if off > 3.0 * sd + RESOLUTION_M {
                    assert!(exact.abs() < 0.05 && ours.abs() < 1e-12, "{context}");
                }
            }
            let peak = |of: &[f64]| {
                (0..of.len()).max_by(|a, b| of[*a].total_cmp(&of[*b])).expect("cells") as i32
            };
            // The first of several equally likely cells is the likelier hit, the more so the likelier
            // any cell is: that is as far as the two may be apart.
            assert!((peak(&exact) - peak(&ours)).abs() <= 2, "sd {sd}, prior {prior}");
            assert!(exact[peak(&ours) as usize] > 0.0 || sd > 0.05, "sd {sd}, prior {prior}");
        }
    }
}

/// Fewer rooms than the evaluation has, the same bounds.
#[test]
fn grids_of_sonar_and_of_scanners_tell_what_is_there() {
    let (_, faults) = tables::sonar_rows(3);
    assert_eq!(faults, [""; 0]);
    let (_, faults) = tables::scanner_rows(4);
    assert_eq!(faults, [""; 0]);
}

#[test]
fn every_rule_earns_its_place_in_a_scene_made_for_it() {
    let (rows, faults) = tables::rule_rows(3);
    assert_eq!(faults, [""; 0]);
    assert!(rows.iter().step_by(2).all(|row| row[2] != "0"), "a rule that never applied: {rows:?}");
}

#[test]
fn layers_together_tell_more_than_each_alone() {
    let (_, faults) = tables::layer_rows(1);
    assert_eq!(faults, [""; 0]);
}

#[test]
fn the_real_corridor_is_told_better_than_by_the_plain_cone() -> Result<(), Error> {
    let rounds = Rounds::read(&log("corridor-ring8.log.gz"))?;
    let (rows, verdicts) = rounds.rows();
    let bits: Vec<f64> = rows.iter().map(|row| row[2].parse().expect("a number")).collect();
    assert!(bits[2] < bits[1] && bits[2] < bits[0], "{rows:?}");
    assert!(verdicts.contains("silent") && verdicts.contains("no support"), "{verdicts}");
    assert!(rounds.picture().len() > 10_000);
    Ok(())
}
