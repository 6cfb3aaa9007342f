//! Grids of sonar in rooms of smooth walls: beside the base rate, beside the plain cone, and without each
//! of the rules in turn.

use mapfold_client::evidence::{
    Canvas, KnownWalls, ScannerEvidenceConfig, SonarEvidenceConfig, SonarRule, SonarVerdicts,
    scanner_evidence, sonar_evidence,
};
use mapfold_client::sensor::Ring;
use mapfold_map::raster::Cell;

use super::rooms::{claimed, hear, scanner_profile, see, sonar_profile, stops};
use super::{Grid, Scores, Truth, cone};
use crate::plane::Point;
use crate::simulation::{Noise, Scanner, SonarRing, World};

/// Cells of these grids, metres, as in the published comparison.
pub const RESOLUTION_M: f64 = 0.1;
/// Stops in a room.
const STOPS: usize = 72;
/// Stops of the robot with a scanner, where one has been there before.
const SCANNER_STOPS: usize = 12;
/// Log-odds of 0.9: from there on a cell is a known wall.
const WALL_NAT: f64 = 2.2;

/// What is simulated: a kind of world, a ring, rounds at each stop, and whether a robot with a scanner has
/// mapped the place before.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Its name.
    pub name: &'static str,
    /// Makes a world.
    pub world: fn(&mut Noise) -> World,
    /// The ring.
    pub ring: SonarRing,
    /// Rounds at each stop.
    pub rounds: usize,
    /// Whether walls are known.
    pub mapped: bool,
}

/// One world and all that was heard in it.
#[derive(Debug)]
pub struct Heard {
    ring: SonarRing,
    looks: Vec<((Point, f64), Ring)>,
    walls: Option<Grid>,
    blank: Grid,
    /// What is there.
    pub truth: Truth,
}

impl Scene {
    /// Drives through the world of a seed.
    pub fn play(&self, seed: u64) -> Heard {
        let mut noise = Noise::of_seed(seed);
        let world = (self.world)(&mut noise);
        let blank = Grid::about(&world.walls, RESOLUTION_M);
        let looks = stops(&world, STOPS, &mut noise)
            .into_iter()
            .map(|stop| (stop, hear(&self.ring, &world, stop, self.rounds, &mut noise)))
            .collect();
        let walls = self.mapped.then(|| {
            let places = stops(&world, SCANNER_STOPS, &mut noise);
            scanned(&world, &places, &blank, &mut noise)
        });
        let truth = Truth::of(&blank, &world.walls, world.way[0]);
        Heard { ring: self.ring.clone(), looks, walls, blank, truth }
    }
}

/// What a robot with a scanner makes of a world from these places.
pub fn scanned(world: &World, places: &[(Point, f64)], blank: &Grid, noise: &mut Noise) -> Grid {
    let scanner = Scanner::default();
    let profile = scanner_profile(&scanner);
    let (mut grid, mut canvas) = (blank.clone(), Canvas::default());
    for place in places {
        let scan = see(&scanner, world, *place, noise);
        let patch = scanner_evidence(
            &scan,
            |beam| scan.ranges.get(beam).is_some_and(|range| scan.is_return(*range)),
            &profile,
            &claimed(*place, 0.01, 0.002),
            blank.resolution_m,
            &ScannerEvidenceConfig::STANDARD,
            &mut canvas,
        );
        grid.add(&patch, 1.0);
    }
    grid
}

struct Walls<'a>(&'a Grid);

impl KnownWalls for Walls<'_> {
    fn is_wall(&self, cell: Cell) -> bool {
        self.0.index(cell.column, cell.row).is_some_and(|index| self.0.nats[index] > WALL_NAT)
    }
}

impl Heard {
    /// Our grid, and what the rules said.
    pub fn ours(&self, config: &SonarEvidenceConfig) -> (Grid, SonarVerdicts) {
        let (mut grid, mut canvas) = (self.blank.clone(), Canvas::default());
        let profile = sonar_profile(&self.ring);
        let mut verdicts = SonarVerdicts::default();
        let walls = self.walls.as_ref().map(Walls);
        for (stop, ring) in &self.looks {
            let (patch, told) = sonar_evidence(
                ring,
                &profile,
                &claimed(*stop, 0.01, 0.002),
                walls.as_ref().map(|walls| walls as &dyn KnownWalls),
                RESOLUTION_M,
                config,
                &mut canvas,
            );
            grid.add(&patch, 1.0);
            verdicts.add(&told);
        }
        (grid, verdicts)
    }

    /// The plain cone's grid.
    pub fn plain(&self) -> Grid {
        let mut grid = self.blank.clone();
        for (stop, ring) in &self.looks {
            cone::enter(&mut grid, ring, *stop, self.ring.range_max_m);
        }
        grid
    }
}

/// The scenes: rooms as published, and one made for each rule.
pub fn scenes() -> Vec<(Scene, Option<SonarRule>)> {
    let ring = SonarRing::in_smooth_rooms;
    let rooms = Scene {
        name: "smooth rooms",
        world: super::rooms::room,
        ring: ring(),
        rounds: 1,
        mapped: false,
    };
    let of = |name, rule, ring, rounds, mapped| {
        (Scene { name, ring, rounds, mapped, ..rooms.clone() }, Some(rule))
    };
    let detours = SonarRing { detour_share: 0.9, mirror_rad: 0.2, ..ring() };
    let mirrors = SonarRing { detour_share: 1.0, mirror_rad: 0.12, corners_share: 0.3, ..ring() };
    let busy = SonarRing { crosstalk_share: 0.15, ..ring() };
    let silent = SonarRing { detour_share: 0.0, mirror_rad: 0.2, corners_share: 0.2, ..ring() };
    let stray = SonarRing { crosstalk_share: 0.1, ..ring() };
    vec![
        (rooms.clone(), None),
        of("three robots at once, two rounds a stop", SonarRule::Crosstalk, busy, 2, false),
        of("walls that throw pulses aside unheard", SonarRule::Silent, silent, 1, false),
        of("detours in a place mapped by a scanner", SonarRule::Ghost, detours.clone(), 1, true),
        of("mirrors: echoes within 7 degrees only", SonarRule::Specular, mirrors, 1, false),
        of("stray echoes", SonarRule::NoSupport, stray, 1, false),
    ]
}

/// Mean scores over seeds of the base rate, the plain cone and ours.
pub fn beside(scene: &Scene, seeds: u64) -> [Scores; 3] {
    let mut all: [Vec<Scores>; 3] = Default::default();
    for seed in 0..seeds {
        let heard = scene.play(seed);
        all[0].push(heard.truth.base_scores());
        all[1].push(heard.truth.scores(&heard.plain()));
        all[2].push(heard.truth.scores(&heard.ours(&SonarEvidenceConfig::STANDARD).0));
    }
    all.map(|scores| Scores::mean(&scores))
}

/// Mean scores over seeds with all rules and without one, and how often it applied.
pub fn ablated(scene: &Scene, rule: SonarRule, seeds: u64) -> ([Scores; 2], u64) {
    let mut all: [Vec<Scores>; 2] = Default::default();
    let mut applied = 0;
    for seed in 0..seeds {
        let heard = scene.play(seed);
        let standard = SonarEvidenceConfig::STANDARD;
        let [off, _] = standard.off.map(|off| off.filter(|off| *off != rule));
        let with = SonarEvidenceConfig { off: [off, None], ..standard };
        let without = SonarEvidenceConfig { off: [off, Some(rule)], ..standard };
        let (with, verdicts) = heard.ours(&with);
        all[0].push(heard.truth.scores(&with));
        all[1].push(heard.truth.scores(&heard.ours(&without).0));
        applied += verdicts.count(rule);
    }
    (all.map(|scores| Scores::mean(&scores)), applied)
}
