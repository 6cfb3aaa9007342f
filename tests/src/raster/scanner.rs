//! Grids of a scanner in rooms, at cells of 5 cm, from poses that err as they claim.

use mapfold_client::evidence::{Canvas, ScannerEvidenceConfig, scanner_evidence};

use super::exact::{BeamModel, enter};
use super::rooms::{claimed, room, scanner_profile, see, stops};
use super::{Grid, Scores, Truth};
use crate::plane::Point;
use crate::simulation::{Noise, Scanner};

/// Cells, metres.
pub const RESOLUTION_M: f64 = 0.05;
const STOPS: usize = 40;
/// How far off poses are.
const POSITION_SD_M: f64 = 0.01;
const HEADING_SD_RAD: f64 = 0.003;

/// Scores of the base rate, ray by ray, and ours, in the room of a seed.
pub fn scores(seed: u64) -> [Scores; 3] {
    let mut noise = Noise::of_seed(seed);
    let world = room(&mut noise);
    let scanner = Scanner::default();
    let profile = scanner_profile(&scanner);
    let mut ours = Grid::about(&world.walls, RESOLUTION_M);
    let mut rays = ours.clone();
    let truth = Truth::of(&ours, &world.walls, world.way[0]);
    let mut canvas = Canvas::default();
    let config = ScannerEvidenceConfig::STANDARD;
    for stop in stops(&world, STOPS, &mut noise) {
        let scan = see(&scanner, &world, stop, &mut noise);
        let told = (
            Point::new(
                stop.0.x + noise.normal(POSITION_SD_M),
                stop.0.y + noise.normal(POSITION_SD_M),
            ),
            stop.1 + noise.normal(HEADING_SD_RAD),
        );
        let is_return = |beam: usize| scan.is_return(scan.ranges[beam]);
        let patch = scanner_evidence(
            &scan,
            is_return,
            &profile,
            &claimed(told, POSITION_SD_M, HEADING_SD_RAD),
            RESOLUTION_M,
            &config,
            &mut canvas,
        );
        ours.add(&patch, 1.0);
        let variance = scanner.range_sd_m.powi(2)
            + profile.systematic_sd_m.powi(2)
            + POSITION_SD_M.powi(2)
            + RESOLUTION_M.powi(2) / 12.0;
        let model = BeamModel {
            free_nat: config.free_nat,
            occupied_nat: config.occupied_nat,
            sd_m: variance.sqrt(),
        };
        let beams = (0..scan.ranges.len()).filter(|beam| is_return(*beam));
        let beams = beams.map(|beam| (told.1 + scan.geometry.bearing(beam), scan.ranges[beam]));
        enter(&mut rays, told.0, beams, &model);
    }
    [truth.base_scores(), truth.scores(&rays), truth.scores(&ours)]
}
