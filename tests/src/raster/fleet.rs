//! A fleet in one office: a robot with a scanner and three with nothing but sonar, each in a part of its
//! own, and the layers of their evidence read together.

use mapfold_client::evidence::{Canvas, SonarEvidenceConfig, sonar_evidence};
use mapfold_map::raster::{LogOdds, Said, together};

use super::rooms::{claimed, hear, sonar_profile};
use super::sonar::scanned;
use super::{Grid, Truth};
use crate::plane::Point;
use crate::simulation::{Noise, Odometry, SonarRing, drive, office};

/// Cells, metres.
const RESOLUTION_M: f64 = 0.1;
/// Robots stop for a look every so many metres.
const STEP_M: f64 = 0.4;
/// The parts of the way that robots drive: the scanner's first.
const PARTS: [(f64, f64); 4] = [(0.0, 0.45), (0.35, 0.6), (0.55, 0.8), (0.75, 1.0)];

/// The layers and the truth.
#[derive(Debug)]
pub struct Layers {
    /// The scanner's.
    pub scanner: Grid,
    /// The sonars'.
    pub sonar: Grid,
    /// How often the scanner looked at each cell.
    pub scanner_looks: Vec<u32>,
    /// What is there.
    pub truth: Truth,
}

/// Where sonar counts less because a scanner knows better.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Override {
    /// Nowhere.
    Never,
    /// Where the scanner has looked more often than this.
    Looks(u32),
    /// Where the scanner's evidence is this far from nothing, nats.
    Evidence(f64),
}

impl Layers {
    /// Drives the fleet; robots with sonar drive parts of their own, or all of them `everywhere`.
    pub fn of_seed(seed: u64, everywhere: bool) -> Self {
        let mut noise = Noise::of_seed(seed);
        let world = office();
        let all: Vec<(Point, f64)> = drive(&world.way, STEP_M, &Odometry::default(), &mut noise)
            .into_iter()
            .map(|stop| stop.truth)
            .collect();
        let part = |(from, to): (f64, f64)| {
            let at = |share: f64| (share * all.len() as f64) as usize;
            &all[at(from)..at(to)]
        };
        let blank = Grid::about(&world.walls, RESOLUTION_M);
        let mut scanner = blank.clone();
        let mut scanner_looks = vec![0; blank.nats.len()];
        for place in part(PARTS[0]) {
            let look = scanned(&world, &[*place], &blank, &mut noise);
            for (looks, nat) in scanner_looks.iter_mut().zip(&look.nats) {
                *looks += u32::from(*nat != 0.0);
            }
            scanner.add_grid(&look);
        }
        let ring = SonarRing::in_smooth_rooms();
        let profile = sonar_profile(&ring);
        let (mut sonar, mut canvas) = (blank.clone(), Canvas::default());
        for place in
            PARTS[1..].iter().flat_map(|own| part(if everywhere { (0.0, 1.0) } else { *own }))
        {
            let heard = hear(&ring, &world, *place, 1, &mut noise);
            let (patch, _) = sonar_evidence(
                &heard,
                &profile,
                &claimed(*place, 0.01, 0.002),
                None,
                RESOLUTION_M,
                &SonarEvidenceConfig::STANDARD,
                &mut canvas,
            );
            sonar.add(&patch, 1.0);
        }
        let truth = Truth::of(&blank, &world.walls, world.way[0]);
        Self { scanner, sonar, scanner_looks, truth }
    }

    /// Both layers as Mapfold reads them together.
    pub fn together(&self) -> Grid {
        let mut read = self.scanner.clone();
        for (scanner, sonar) in read.nats.iter_mut().zip(&self.sonar.nats) {
            let of = LogOdds::from_nat;
            let said = Said { scanner: of(*scanner), sonar: of(*sonar), ..Said::default() };
            *scanner = together(said).map_or(0.0, LogOdds::nat);
        }
        read
    }

    /// Both layers in one, sonar counting `weight` where the scanner overrides it.
    pub fn fused(&self, over: Override, weight: f64) -> Grid {
        let mut fused = self.scanner.clone();
        let cells = fused.nats.iter_mut().zip(&self.sonar.nats).zip(&self.scanner_looks);
        for ((sum, sonar), looks) in cells {
            let overridden = match over {
                Override::Never => false,
                Override::Looks(most) => *looks > most,
                Override::Evidence(least) => sum.abs() >= least,
            };
            *sum += if overridden { weight * sonar } else { *sonar };
        }
        fused
    }
}
