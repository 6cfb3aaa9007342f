//! Writes a drive down as a CARMEN log.

use std::fmt::Write as _;
use std::path::Path;

use super::{Noise, Odometry, Scanner, SonarRing, World, drive};
use crate::Error;

/// What the robot carries.
#[derive(Debug, Clone)]
pub enum Recording {
    /// A scanner: `FLASER` lines with the corrected pose and the odometry's.
    Scanner(Scanner),
    /// A ring of sonars: `ODOM` lines with the corrected pose, and `SONAR` lines.
    Sonar(SonarRing),
}

/// Drives a robot through a world once and writes its log, plain text.
///
/// # Errors
/// A file that cannot be written.
pub fn record(
    world: &World,
    step_m: f64,
    recording: &Recording,
    seed: u64,
    path: &Path,
) -> Result<(), Error> {
    let mut noise = Noise::of_seed(seed);
    let stops = drive(&world.way, step_m, &Odometry::default(), &mut noise);
    let mut text = format!("# simulated: {}, seed {seed}\n", world.name);
    if let Recording::Scanner(scanner) = recording {
        push(&mut text, format_args!("PARAM robot_front_laser_max {:.2}\n", scanner.cap_m));
    }
    for stop in stops {
        let ((at, heading), (said, said_heading), time) =
            (stop.corrected, stop.odometry, stop.time);
        match recording {
            Recording::Scanner(scanner) => {
                let ranges = scanner.scan(world, stop.truth, &mut noise);
                push(&mut text, format_args!("FLASER {}", ranges.len()));
                for range in ranges {
                    push(&mut text, format_args!(" {range:.3}"));
                }
                push(
                    &mut text,
                    format_args!(
                        " {:.6} {:.6} {heading:.6} {:.6} {:.6} {said_heading:.6} {time:.3} simulated {time:.3}\n",
                        at.x, at.y, said.x, said.y
                    ),
                );
            }
            Recording::Sonar(ring) => {
                let ranges = ring.ping(world, stop.truth, &mut noise);
                push(
                    &mut text,
                    format_args!(
                        "ODOM {:.6} {:.6} {heading:.6} 0 0 0 {time:.3} simulated {time:.3}\nSONAR {:.6} {}",
                        at.x,
                        at.y,
                        ring.cone_rad,
                        ranges.len()
                    ),
                );
                for range in ranges {
                    push(&mut text, format_args!(" {range:.3}"));
                }
                for bearing in &ring.bearings_rad {
                    push(&mut text, format_args!(" 0 0 {bearing:.6}"));
                }
                push(&mut text, format_args!(" {time:.3} simulated {time:.3}\n"));
            }
        }
    }
    std::fs::write(path, text).map_err(|e| Error::file(path, e))
}

fn push(text: &mut String, words: std::fmt::Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = text.write_fmt(words);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::carmen::Log;
    use crate::simulation::{hall, office};

    /// Metres that a corrected return may lie beside its wall: five standard deviations of range,
    /// position, and heading at 30 m.
    const ASTRAY_M: f64 = 0.4;

    #[test]
    fn a_recorded_world_reads_back_with_every_return_at_a_wall() {
        let folder = tempfile::tempdir().unwrap();
        for world in [office(), hall()] {
            let path = folder.path().join(world.name);
            let recording = Recording::Scanner(Scanner::default());
            record(&world, 1.0, &recording, 42, &path).unwrap();
            let log = Log::read(&path).unwrap();
            assert!(log.scans.len() > 50, "{}: {} scans", world.name, log.scans.len());
            let mut returns = 0;
            for end in log.scans.iter().flat_map(|scan| scan.end_points(log.cap)) {
                let off = world.walls.iter().map(|wall| wall.distance(end)).fold(9.0, f64::min);
                assert!(off < ASTRAY_M, "{}: {end:?} is {off} m from any wall", world.name);
                returns += 1;
            }
            assert!(returns > 100 * log.scans.len());
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_log() {
        let folder = tempfile::tempdir().unwrap();
        let of = |seed: u64, name: &str| {
            let path = folder.path().join(name);
            record(&office(), 2.0, &Recording::Sonar(SonarRing::default()), seed, &path).unwrap();
            std::fs::read_to_string(path).unwrap()
        };
        assert_eq!(of(1, "a"), of(1, "b"));
        assert_ne!(of(1, "a"), of(2, "c"));
        assert!(of(1, "a").lines().filter(|line| line.starts_with("SONAR")).count() > 40);
    }
}
