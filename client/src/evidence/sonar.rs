//! Evidence from a ring of sonars: free cones, and arcs on which something stands somewhere.
//!
//! What is wrong with sonars is known: walls that mirror, echoes of other sonars, detours. Named rules
//! ([`SonarRule`]) keep such readings out or weaken them, and each look says how often each did
//! ([`SonarVerdicts`]).

mod judge;
mod verdicts;

use mapfold_map::geometry::{Level, Point, Robot, UncertainPose};
use mapfold_map::raster::{Cell, EvidencePatch, LogOdds, SensorClass};

pub use judge::KnownWalls;
pub use verdicts::{SonarRule, SonarVerdicts};

use super::Canvas;
use super::canvas::GRADES;
use super::outline::corner;
use super::window::Window;
use crate::sensor::{Ring, SonarProfile};
use judge::{Echo, judge};

/// How echoes become evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SonarEvidenceConfig {
    /// Evidence for "free" on the axis of a cone, close by, nat (negative).
    pub free_nat: f64,
    /// Evidence for "occupied" that an echo spreads over its arc, nat.
    pub occupied_nat: f64,
    /// Least share of the free evidence, at the far end of the range.
    pub free_least: f64,
    /// Share of the free evidence of a sonar that heard nothing: a smooth wall may have thrown the
    /// pulse aside.
    pub silent_free: f64,
    /// A reading is believed free only up to this many times the nearest neighbour's range (plus
    /// `specular_margin`): beyond, it has probably gone round by a smooth wall.
    pub specular_ratio: f64,
    /// Metres.
    pub specular_margin: f64,
    /// Sonars are neighbours if they look apart by less than this many cones.
    pub neighbour_cones: f64,
    /// Neighbours support each other (a region of constant depth) when their ranges differ by
    /// less than this, metres, plus `support_ratio` of the range.
    pub support_gap: f64,
    /// Share of the range.
    pub support_ratio: f64,
    /// Weight of an echo that no neighbour supports.
    pub unsupported: f64,
    /// Weight of an echo that changed while the robot stood: of those that another robot's pulse cut short some
    /// are true all the same, and at a quarter those soon outdo the others.
    pub unsteady: f64,
    /// An echo from behind a known wall is a ghost if the wall is nearer by more than so many
    /// standard deviations of the range.
    pub ghost_sds: f64,
    /// Rules that are not applied.
    pub off: [Option<SonarRule>; 2],
}

impl SonarEvidenceConfig {
    /// The defaults: all rules are applied. What each gives and costs is told by `mapfold-evaluate raster`.
    pub const STANDARD: Self = Self {
        free_nat: -0.3,
        occupied_nat: 0.85,
        free_least: 0.1,
        silent_free: 0.6,
        specular_ratio: 1.5,
        specular_margin: 0.3,
        neighbour_cones: 1.5,
        support_gap: 0.05,
        support_ratio: 0.05,
        unsupported: 0.5,
        unsteady: 0.25,
        ghost_sds: 3.0,
        off: [None; 2],
    };
}

/// Sonar evidence is rounded to this: it is no more exact, and travels in longer runs.
const STEP: LogOdds = LogOdds(5);
/// Half the support of an arc, standard deviations.
const ARC_SDS: f64 = 2.0;
/// Places farther from the level's origin than this, in cells, are in no level.
const CELLS_MAX: f64 = 1e8;
/// Nodes of the table of how evidence falls off across a cone.
const NODES: usize = 64;
/// Pieces of the outline of a cone's arc.
const ARC_PIECES: usize = 6;

/// The evidence of one ring of readings, and what the rules said of them. `walls` are those that are
/// known already, if any are: they tell ghosts from echoes.
pub fn sonar_evidence(
    ring: &Ring,
    profile: &SonarProfile,
    level_from_robot: &UncertainPose<Level, Robot>,
    walls: Option<&dyn KnownWalls>,
    resolution: f64,
    config: &SonarEvidenceConfig,
    canvas: &mut Canvas,
) -> (EvidencePatch, SonarVerdicts) {
    let mut verdicts = SonarVerdicts::default();
    let cones = Cones::new(ring, profile, level_from_robot, resolution, config);
    let window = cones.window(ring, level_from_robot).and_then(|(low, high)| {
        let (low, window) = canvas.begin(low, high)?;
        Some((Point::new(f64::from(low.column), f64::from(low.row)), window))
    });
    if let Some((origin, window)) = window {
        for (index, sonar) in ring.sonars.iter().enumerate() {
            let pose = level_from_robot.pose.compose(&sonar.robot_from_sensor);
            let echo = judge(ring, index, &pose, walls, resolution, profile, config, &mut verdicts);
            if let Some(echo) = echo {
                cones.paint(&echo, &pose.position(), pose.heading(), &origin, window, canvas);
            }
        }
    }
    (canvas.take(SensorClass::Sonar, STEP, [0; GRADES]), verdicts)
}

/// What the cones of one ring have in common.
struct Cones<'a> {
    profile: &'a SonarProfile,
    config: &'a SonarEvidenceConfig,
    resolution: f64,
    cone: f64,
    /// Variance of a range that is not the sonar's own: of the robot's place and of the cell's.
    variance: f64,
    /// exp(-2 (angle / half)^2) by the square of the angle's tangent.
    across: [f64; NODES + 1],
    nodes_per_tangent_sq: f64,
}

impl<'a> Cones<'a> {
    fn new(
        ring: &Ring,
        profile: &'a SonarProfile,
        level_from_robot: &UncertainPose<Level, Robot>,
        resolution: f64,
        config: &'a SonarEvidenceConfig,
    ) -> Self {
        let half = 0.5 * ring.cone;
        let tangent_sq = half.tan().powi(2);
        let mut across = [0.0; NODES + 1];
        for (node, value) in across.iter_mut().enumerate() {
            let angle = (tangent_sq * node as f64 / NODES as f64).sqrt().atan();
            *value = (-0.5 * (angle / (0.5 * half)).powi(2)).exp();
        }
        let place = level_from_robot.covariance.matrix().fixed_view::<2, 2>(0, 0).trace();
        Self {
            profile,
            config,
            resolution,
            cone: ring.cone,
            variance: 0.5 * place + resolution * resolution / 12.0,
            across,
            nodes_per_tangent_sq: NODES as f64 / tangent_sq,
        }
    }

    fn deviation(&self, range: f64) -> f64 {
        (self.profile.range_sd(range).powi(2) + self.variance).sqrt()
    }

    /// The cells that hold all that the ring can hear of; `None` where no level is.
    fn window(
        &self,
        ring: &Ring,
        level_from_robot: &UncertainPose<Level, Robot>,
    ) -> Option<(Cell, Cell)> {
        let centre = level_from_robot.pose.position();
        let arm = |sonar: &crate::sensor::Sonar| sonar.robot_from_sensor.position().norm();
        let arm = ring.sonars.iter().map(arm).fold(0.0, f64::max);
        let farthest = self.profile.range_max_m;
        let reach = arm + farthest + ARC_SDS * self.deviation(farthest) + self.resolution;
        let known = (centre.norm() + reach) / self.resolution;
        let margin = Point::new(reach, reach);
        let holding = |p: Point| Cell::holding(&p, self.resolution);
        (known < CELLS_MAX).then(|| (holding(centre - margin), holding(centre + margin)))
    }

    /// Paints one cone; `origin` is the canvas's corner in cells.
    fn paint(
        &self,
        echo: &Echo,
        place: &Point,
        heading: f64,
        origin: &Point,
        window: Window,
        canvas: &mut Canvas,
    ) {
        let arc = echo.arc.map(|(range, weight)| {
            // The echo came from somewhere on the arc, not from everywhere on it.
            let cells = (self.cone * range / self.resolution).max(3.0);
            (range, self.deviation(range), weight * self.config.occupied_nat / (cells / 3.0).sqrt())
        });
        let clear_to =
            arc.map_or(echo.free_to, |(range, sd, _)| echo.free_to.min(range - ARC_SDS * sd));
        let reach = arc.map_or(echo.free_to, |(range, sd, _)| range + ARC_SDS * sd);
        let eye = place / self.resolution - origin - Point::new(0.5, 0.5);
        let (sin, cos) = heading.sin_cos();
        let mut outline = std::mem::take(&mut canvas.outline);
        outline.begin(window);
        // The outline's chords touch the arc from outside.
        let piece = self.cone / ARC_PIECES as f64;
        let radius = reach / self.resolution / (0.5 * piece).cos();
        let mut before = corner(&eye);
        for at in 0..=ARC_PIECES {
            let (sin, cos) = (heading - 0.5 * self.cone + piece * at as f64).sin_cos();
            let next = corner(&(eye + Point::new(cos, sin) * radius));
            outline.edge(before, next);
            before = next;
        }
        outline.edge(before, corner(&eye));
        let fading = self.profile.range_max_m.recip();
        let free = 1000.0 * self.config.free_nat * echo.free_weight;
        let mut marks = canvas.marks();
        outline.pieces(|row, from, to| {
            let y = (f64::from(row) - eye.y) * self.resolution;
            for column in from..to {
                let x = (f64::from(column) - eye.x) * self.resolution;
                let (ahead, aside) = (cos * x + sin * y, cos * y - sin * x);
                let d = (x * x + y * y).sqrt();
                let node = aside * aside / (ahead * ahead) * self.nodes_per_tangent_sq + 0.5;
                let Some(across) = self.across.get(node as usize) else { continue };
                let mut millinats = 0.0;
                if d < clear_to {
                    millinats += free * across * (1.0 - d * fading).max(self.config.free_least);
                }
                if let Some((range, sd, strength)) = arc
                    && (d - range).abs() <= ARC_SDS * sd
                {
                    let bell = (-0.5 * ((d - range) / sd).powi(2)).exp();
                    millinats += 1000.0 * strength * across * bell;
                }
                if millinats != 0.0 {
                    marks.add(column, row, millinats.round() as i32);
                }
            }
        });
        canvas.outline = outline;
    }
}

#[cfg(test)]
mod tests {
    use mapfold_map::geometry::{Covariance, Pose};
    use mapfold_map::raster::Tile;

    use super::*;
    use crate::sensor::{Sonar, preset};

    fn ring(ranges: &[Option<f64>]) -> Ring {
        let turn = 22.5_f64.to_radians();
        Ring {
            cone: 25_f64.to_radians(),
            sonars: ranges
                .iter()
                .enumerate()
                .map(|(i, range)| Sonar {
                    robot_from_sensor: Pose::new(0.0, 0.0, turn * i as f64),
                    range: *range,
                    is_steady: true,
                })
                .collect(),
        }
    }

    fn evidence(ring: &Ring) -> EvidencePatch {
        judged(ring, None).0
    }

    fn judged(ring: &Ring, walls: Option<&dyn KnownWalls>) -> (EvidencePatch, SonarVerdicts) {
        let profile = preset("sonar-ring").and_then(|s| s.sonar).unwrap();
        let pose = Pose::new(10.0, 10.0, 0.0);
        let covariance = Covariance::from_variances([1e-4, 1e-4, 1e-5]);
        sonar_evidence(
            ring,
            &profile,
            &UncertainPose { pose, covariance },
            walls,
            0.05,
            &SonarEvidenceConfig::STANDARD,
            &mut Canvas::default(),
        )
    }

    fn value(patch: &EvidencePatch, x: f64, y: f64) -> i32 {
        let (index, offset) = Cell::holding(&Point::new(10.0 + x, 10.0 + y), 0.05).tile();
        let mut tile = Tile::default();
        if let Some(cells) = patch.tiles.get(&index) {
            tile.add(cells);
        }
        tile.cells()[offset]
    }

    #[test]
    fn an_echo_frees_its_cone_marks_its_arc_and_says_nothing_behind() {
        let patch = evidence(&ring(&[Some(2.0)]));
        assert!(value(&patch, 0.5, 0.0) < 0);
        assert!(value(&patch, 2.0, 0.0) > 0);
        assert_eq!(value(&patch, 2.5, 0.0), 0);
        assert_eq!(value(&patch, 0.5, 0.5), 0, "outside of the cone");
        assert!(value(&patch, 2.0, 0.0) > value(&patch, 1.97, 0.3), "less at the edge of the cone");
    }

    #[test]
    fn the_longer_the_arc_the_less_it_says_of_each_cell() {
        let near = value(&evidence(&ring(&[Some(0.8)])), 0.8, 0.0);
        let far = value(&evidence(&ring(&[Some(4.0)])), 4.0, 0.0);
        assert!(near > far && far > 0, "{near} {far}");
    }

    #[test]
    fn neighbours_of_equal_depth_support_each_other() {
        let alone = value(&evidence(&ring(&[Some(2.0), Some(3.0)])), 2.0, 0.0);
        let supported = value(&evidence(&ring(&[Some(2.0), Some(2.05)])), 2.0, 0.0);
        assert!(supported > alone, "{supported} {alone}");
    }

    #[test]
    fn a_reading_far_beyond_its_neighbour_is_a_detour_and_marks_nothing() {
        let patch = evidence(&ring(&[Some(4.5), Some(1.0)]));
        assert!(value(&patch, 4.5, 0.0) <= 0);
        assert!(value(&patch, 1.0, 0.0) < 0);
        assert_eq!(value(&patch, 3.0, 0.0), 0, "free only up to what the neighbour allows");
    }

    #[test]
    fn silence_is_weak_evidence_for_free_space() {
        let silent = evidence(&ring(&[None]));
        let heard = evidence(&ring(&[Some(4.9)]));
        let [silent, heard] = [&silent, &heard].map(|patch| value(patch, 0.5, 0.0));
        assert!(silent < 0 && 2 * heard < 3 * silent, "{silent} {heard}");
    }

    #[test]
    fn readings_below_the_least_range_say_nothing() {
        assert!(evidence(&ring(&[Some(0.05)])).tiles.is_empty());
    }

    #[test]
    fn every_reading_is_counted_under_one_rule_at_most() {
        let ranges = [Some(0.05), None, Some(4.5), Some(1.0), Some(1.02), Some(2.0)];
        let mut ring = ring(&ranges);
        ring.sonars[5].is_steady = false;
        let (_, verdicts) = judged(&ring, None);
        let counts = SonarRule::ALL.map(|rule| (rule, verdicts.count(rule)));
        assert_eq!(
            counts,
            [
                (SonarRule::TooNear, 1),
                (SonarRule::Silent, 1),
                (SonarRule::Crosstalk, 1),
                (SonarRule::Ghost, 0),
                (SonarRule::Specular, 1),
                (SonarRule::NoSupport, 0),
            ]
        );
        assert_eq!(verdicts.readings(), 6);
    }

    #[test]
    fn what_changed_while_the_robot_stood_frees_and_marks_little() {
        let mut ring = ring(&[Some(2.0)]);
        let steady = evidence(&ring);
        ring.sonars[0].is_steady = false;
        let patch = evidence(&ring);
        assert_eq!(value(&patch, 1.0, 0.0), value(&steady, 1.0, 0.0));
        let [marked, steady] = [&patch, &steady].map(|patch| value(patch, 2.0, 0.0));
        assert!(0 < marked && 3 * marked < steady, "{marked} {steady}");
    }

    #[test]
    fn an_echo_from_behind_a_known_wall_is_a_ghost() {
        let wall = |at: f64| move |cell: Cell| (cell.centre(0.05).x - 10.0 - at).abs() < 0.026;
        let ring = ring(&[Some(3.0)]);
        let (patch, verdicts) = judged(&ring, Some(&wall(2.0)));
        assert_eq!(verdicts.count(SonarRule::Ghost), 1);
        assert!(value(&patch, 1.0, 0.0) < 0, "before the wall it is free all the same");
        assert_eq!(value(&patch, 2.5, 0.0), 0, "and behind nothing is known");
        assert_eq!(value(&patch, 3.0, 0.0), 0);
        // The wall that it was.
        let (patch, verdicts) = judged(&ring, Some(&wall(2.95)));
        assert_eq!(verdicts.count(SonarRule::Ghost), 0);
        assert!(value(&patch, 3.0, 0.0) > 0);
    }

    #[test]
    fn the_first_and_the_last_of_a_full_ring_are_neighbours() {
        let mut ranges = vec![None; 16];
        (ranges[0], ranges[15]) = (Some(2.0), Some(2.05));
        let around = evidence(&ring(&ranges));
        let alone = evidence(&ring(&ranges[..15]));
        assert!(value(&around, 2.0, 0.0) > value(&alone, 2.0, 0.0));
    }
}
