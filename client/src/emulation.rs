//! A ring of sonars emulated from a scanner's readings, for demonstrations: no public log has
//! laser, sonar and odometry together.
//!
//! Each sonar hears the nearest surface in its cone that throws the pulse back: one that stands
//! nearly square to it, or (now and then) an edge. Smooth walls seen aslant stay silent, as they
//! do for real sonars. What comes of this is labelled `emulated` wherever it goes.

use mapfold_map::geometry::{Point, Pose, Robot, Sensor, difference};

use crate::sensor::{MountedAt, Ring, Scan, Sonar, SonarProfile};

/// How surfaces answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmulationConfig {
    /// Walls turned further than this from the pulse throw it aside, radians.
    pub critical: f64,
    /// Share of edges (jumps in depth) that answer.
    pub edges_heard: f64,
    /// Neighbouring returns further apart than this have an edge between them, metres.
    pub edge_jump: f64,
    /// Share of echoes that get lost for no reason that a scanner sees.
    pub lost: f64,
}

impl EmulationConfig {
    /// The defaults. The critical angle is that of the literature (12 to 20 degrees); edges and
    /// losses are set so that in the corridors of the log `killian` a third of the readings are
    /// silent, as on the real ring of the log `corridor-ring8` (33 % below 5 m).
    pub const STANDARD: Self = Self { critical: 0.26, edges_heard: 0.4, edge_jump: 0.3, lost: 0.1 };
}

/// A source of chance that is part of the result: the same seed gives the same readings in every
/// build (the `SplitMix64` generator of Steele, Lea and Flood 2014).
#[derive(Debug, Clone)]
pub struct Chance(u64);

impl Chance {
    /// The sequence of `seed`.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Normal with mean 0 and standard deviation `sd` (Box and Muller).
    pub fn normal(&mut self, sd: f64) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        sd * radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// What a surface does to a pulse.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Surface {
    Edge,
    /// Angle between the sight line and the surface's normal, radians.
    Wall(f64),
}

/// A return of the scanner, in the robot frame.
struct Return {
    point: Point,
    surface: Surface,
}

/// What a ring of sonars like `profile`'s would have heard where `scan` was taken.
///
/// Sonars whose cone does not lie wholly in the scanner's view are left out.
pub fn emulate(
    scan: &Scan,
    profile: &SonarProfile,
    config: &EmulationConfig,
    chance: &mut Chance,
) -> Ring {
    let returns = returns_of(scan, config);
    let sonars = profile
        .transducers
        .iter()
        .map(MountedAt::robot_from_sensor)
        .filter(|robot_from_sonar| in_view(scan, robot_from_sonar, profile.cone_rad))
        .map(|robot_from_sonar| Sonar {
            robot_from_sensor: robot_from_sonar,
            range: nearest_echo(&returns, &robot_from_sonar, profile, config, chance),
            is_steady: true,
        })
        .collect();
    Ring { cone: profile.cone_rad, sonars }
}

/// The scanner's returns with what their neighbours tell of the surface.
fn returns_of(scan: &Scan, config: &EmulationConfig) -> Vec<Return> {
    let point = |beam: usize| {
        let range = *scan.ranges.get(beam)?;
        let hit = range.is_finite() && range > 0.0 && range < scan.range_max;
        hit.then(|| scan.robot_from_sensor.act(&(scan.direction(beam) * range)))
    };
    let eye = scan.robot_from_sensor.position();
    (0..scan.ranges.len())
        .filter_map(|beam| {
            let here = point(beam)?;
            let before = beam.checked_sub(1).and_then(point);
            let after = point(beam + 1);
            let depth = |p: Point| ((p - eye).norm() - (here - eye).norm()).abs();
            let surface = match (before, after) {
                (Some(a), Some(b))
                    if depth(a) < config.edge_jump && depth(b) < config.edge_jump =>
                {
                    let along = (b - a).normalize();
                    let sight = (here - eye).normalize();
                    Surface::Wall(sight.perp(&along).abs().clamp(0.0, 1.0).acos())
                }
                _ => Surface::Edge,
            };
            Some(Return { point: here, surface })
        })
        .collect()
}

/// Whether the scanner looks wherever the sonar listens.
fn in_view(scan: &Scan, robot_from_sonar: &Pose<Robot, Sensor>, cone: f64) -> bool {
    if scan.is_full_circle() || scan.ranges.is_empty() {
        return !scan.ranges.is_empty();
    }
    let half_view = 0.5 * scan.geometry.increment * (scan.ranges.len() - 1) as f64;
    let middle = scan.robot_from_sensor.heading() + scan.geometry.first_bearing + half_view;
    let off = difference(robot_from_sonar.heading(), middle).abs();
    // Half a beam of tolerance: a cone may end where the view does.
    off + 0.5 * cone <= half_view + 0.5 * scan.geometry.increment
}

fn nearest_echo(
    returns: &[Return],
    robot_from_sonar: &Pose<Robot, Sensor>,
    profile: &SonarProfile,
    config: &EmulationConfig,
    chance: &mut Chance,
) -> Option<f64> {
    let sonar_from_robot = robot_from_sonar.inverse();
    let mut nearest: Option<f64> = None;
    let edge_heard = chance.uniform() < config.edges_heard;
    for Return { point, surface } in returns {
        let seen = sonar_from_robot.act(point);
        let range = seen.norm();
        let inside = seen.y.atan2(seen.x).abs() <= 0.5 * profile.cone_rad;
        let answers = match surface {
            Surface::Edge => edge_heard,
            Surface::Wall(incidence) => *incidence <= config.critical,
        };
        if inside && answers && nearest.is_none_or(|n| range < n) {
            nearest = Some(range);
        }
    }
    let lost = chance.uniform() < config.lost;
    let noise = chance.normal(1.0);
    let range = nearest.filter(|_| !lost)?;
    let heard = range + noise * profile.range_sd(range);
    (profile.range_min_m..profile.range_max_m).contains(&heard).then_some(heard)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{ScanGeometry, preset};

    /// A scanner with 181 beams to the front in a corridor along x, walls 1 m to either side,
    /// closed `ahead` metres in front.
    fn corridor(ahead: f64) -> Scan {
        let geometry =
            ScanGeometry { first_bearing: (-90f64).to_radians(), increment: 1f64.to_radians() };
        let ranges = (0..181)
            .map(|beam| {
                let bearing = geometry.bearing(beam);
                (1.0 / bearing.sin().abs()).min(ahead / bearing.cos().max(1e-9))
            })
            .collect();
        Scan {
            geometry,
            ranges,
            range_max: 50.0,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        }
    }

    fn heard(scan: &Scan, seed: u64) -> Vec<(f64, Option<f64>)> {
        let profile = preset("sonar-ring").and_then(|s| s.sonar).unwrap();
        let ring = emulate(scan, &profile, &EmulationConfig::STANDARD, &mut Chance::new(seed));
        ring.sonars.iter().map(|s| (s.robot_from_sensor.heading(), s.range)).collect()
    }

    #[test]
    fn walls_square_to_the_pulse_answer_and_walls_aslant_do_not() {
        let ring = heard(&corridor(3.0), 1);
        let towards = |degrees: f64| {
            let nearest = ring.iter().min_by(|a, b| {
                let off = |h: f64| (h - degrees.to_radians()).abs();
                off(a.0).total_cmp(&off(b.0))
            });
            nearest.and_then(|(_, range)| *range)
        };
        assert!((towards(11.25).unwrap() - 3.0).abs() < 0.3);
        // At 33.75 degrees the cone sees the side wall 45 to 68 degrees aslant, and little else.
        assert_eq!(towards(33.75), None);
    }

    #[test]
    fn the_same_seed_hears_the_same() {
        assert_eq!(heard(&corridor(3.0), 5), heard(&corridor(3.0), 5));
        assert_ne!(heard(&corridor(3.0), 5), heard(&corridor(3.0), 6));
    }

    #[test]
    fn cones_outside_of_the_view_are_left_out() {
        // 78.75 + 12.5 degrees is more than the 90 that the scanner sees to either side.
        assert_eq!(heard(&corridor(3.0), 1).len(), 6);
    }

    #[test]
    fn nothing_within_range_is_silence() {
        let mut scan = corridor(3.0);
        scan.ranges.fill(50.0);
        assert!(heard(&scan, 1).iter().all(|(_, range)| range.is_none()));
    }
}
