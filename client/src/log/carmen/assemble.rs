//! From messages to readings with poses.

use mapfold_map::geometry::{Level, Odom, Pose, Robot, Sensor};

use super::line::{Message, Triple};
use super::stream::Messages;
use super::{FAULTS_KEPT, ReadError};
use crate::log::{Log, Observation, Reading, ScannerMake, Summary};
use crate::sensor::{Ring, Scan, ScanGeometry, Sonar};

/// `robot_front_laser_max` of a log that does not say, metres (MRPT's default).
const FRONT_LASER_MAX: f64 = 81.0;
/// Scanners of CARMEN's time that see no farther than this are SICK's PLS, metres.
const PLS_RANGE_MAX: f64 = 55.0;

/// The pose that a line tells.
fn pose<A: Copy, B: Copy>([x, y, heading]: Triple) -> Pose<A, B> {
    Pose::new(x, y, heading)
}

/// What the lines so far have told.
struct State {
    readings: Vec<Reading>,
    summary: Summary,
    scanner: Option<ScannerMake>,
    /// Degrees.
    front_resolution: Option<f64>,
    front_max: f64,
    odom: Option<Pose<Odom, Robot>>,
    fix: Option<Fix>,
}

/// Where the last scan was taken.
#[derive(Clone, Copy)]
struct Fix {
    level_from_robot: Pose<Level, Robot>,
    odom_from_robot: Option<Pose<Odom, Robot>>,
}

/// Reads all messages.
pub(super) fn assemble(mut messages: Messages) -> Result<Log, ReadError> {
    let mut state = State {
        readings: Vec::new(),
        summary: Summary::default(),
        scanner: None,
        front_resolution: None,
        front_max: FRONT_LASER_MAX,
        odom: None,
        fix: None,
    };
    for message in &mut messages {
        match message {
            Ok(message) => state.take(message),
            Err(error) => {
                state.summary.malformed += 1;
                if state.summary.faults.len() < FAULTS_KEPT {
                    state.summary.faults.push(error);
                }
            }
        }
    }
    state.summary.lines = messages.lines();
    let (cut_short, digest) = messages.finish();
    let State { mut readings, mut summary, scanner, .. } = state;
    if readings.is_empty() {
        return Err(match cut_short {
            Some(error) => error.into(),
            None => ReadError::NoReadings {
                lines: summary.lines,
                malformed: summary.malformed,
                first: summary.faults.into_iter().next(),
            },
        });
    }
    // What came before the break is as good as ever.
    summary.cut_short = cut_short.map(|error| error.to_string());
    if summary.scans == 0 {
        for reading in &mut readings {
            reading.level_from_robot =
                reading.odom_from_robot.map(|p| Pose::new(p.x, p.y, p.heading()));
        }
    }
    Ok(Log { readings, digest, scanner, summary })
}

impl State {
    fn take(&mut self, message: Message) {
        match message {
            Message::Ignored(name) => *self.summary.ignored.entry(name).or_default() += 1,
            Message::Param { name, value } => self.parameter(name, value),
            Message::Odom { robot, .. } => {
                self.summary.odometry += 1;
                self.odom = Some(pose(robot));
            }
            Message::FrontLaser { ranges, robot, odom, time_s } => {
                let geometry = front_geometry(ranges.len(), self.front_resolution);
                let range_max = self.front_max;
                self.scanner.get_or_insert(make_by_range(range_max));
                let robot_from_sensor = Pose::identity();
                let scan =
                    Scan { geometry, ranges, range_max, robot_from_sensor, repeats: Vec::new() };
                self.scan(scan, pose(robot), Some(pose(odom)), time_s);
            }
            Message::RobotLaser {
                make,
                first_bearing,
                increment,
                range_max,
                ranges,
                sensor,
                robot,
                time_s,
            } => {
                self.scanner.get_or_insert(match make {
                    1 => ScannerMake::SickPls,
                    2 => ScannerMake::HokuyoUrg,
                    _ => make_by_range(range_max),
                });
                let level_from_robot: Pose<Level, Robot> = pose(robot);
                let level_from_sensor: Pose<Level, Sensor> = pose(sensor);
                let scan = Scan {
                    geometry: ScanGeometry { first_bearing, increment },
                    ranges,
                    range_max,
                    robot_from_sensor: level_from_robot.inverse().compose(&level_from_sensor),
                    repeats: Vec::new(),
                };
                self.scan(scan, level_from_robot, self.odom, time_s);
            }
            Message::Sonar { cone, ranges, mounts, time_s } => {
                self.summary.rings += 1;
                let sonars = ranges
                    .into_iter()
                    .zip(mounts)
                    .map(|(range, mount)| Sonar {
                        robot_from_sensor: pose(mount),
                        range: (range.is_finite() && range > 0.0).then_some(range),
                        is_steady: true,
                    })
                    .collect();
                self.push(Reading {
                    index: 0,
                    time_s,
                    level_from_robot: self.carried_on(),
                    odom_from_robot: self.odom,
                    observation: Observation::Ring(Ring { cone, sonars }),
                });
            }
        }
    }

    fn parameter(&mut self, name: String, value: String) {
        let number = value.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0);
        match (name.as_str(), number) {
            ("laser_front_laser_resolution", Some(degrees)) => {
                self.front_resolution = Some(degrees);
            }
            ("robot_front_laser_max", Some(max)) => self.front_max = max,
            _ => {}
        }
        self.summary.parameters.insert(name, value);
    }

    fn scan(
        &mut self,
        scan: Scan,
        level_from_robot: Pose<Level, Robot>,
        odom: Option<Pose<Odom, Robot>>,
        time_s: f64,
    ) {
        self.summary.scans += 1;
        self.fix = Some(Fix { level_from_robot, odom_from_robot: odom });
        self.push(Reading {
            index: 0,
            time_s,
            level_from_robot: Some(level_from_robot),
            odom_from_robot: odom,
            observation: Observation::Scan(scan),
        });
    }

    /// The last scan's pose, moved as the wheels have moved since.
    fn carried_on(&self) -> Option<Pose<Level, Robot>> {
        let fix = self.fix?;
        Some(match (fix.odom_from_robot, self.odom) {
            (Some(then), Some(now)) => {
                fix.level_from_robot.compose(&then.inverse().compose::<Robot>(&now))
            }
            _ => fix.level_from_robot,
        })
    }

    fn push(&mut self, reading: Reading) {
        let index = self.readings.len() as u32;
        self.readings.push(Reading { index, ..reading });
    }
}

fn make_by_range(range_max: f64) -> ScannerMake {
    if range_max <= PLS_RANGE_MAX { ScannerMake::SickPls } else { ScannerMake::SickLms }
}

/// The angles of a `FLASER` line.
fn front_geometry(count: usize, resolution_deg: Option<f64>) -> ScanGeometry {
    let degrees = resolution_deg.unwrap_or(match count {
        180 | 181 => 1.0,
        _ => 0.5,
    });
    let spans = |beams: usize| (degrees * beams as f64 - 180.0).abs() < 0.5 * degrees;
    let first = if spans(count) || spans(count.saturating_sub(1)) {
        -90.0
    } else {
        -0.5 * degrees * count.saturating_sub(1) as f64
    };
    ScanGeometry { first_bearing: first.to_radians(), increment: degrees.to_radians() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::carmen::read_from;
    use std::io::{Cursor, Write as _};

    fn log_of(text: &str) -> Log {
        read_from(Cursor::new(text.to_owned().into_bytes())).unwrap()
    }

    #[test]
    fn front_laser_angles_follow_the_count_unless_a_parameter_overrules() {
        let degrees = |count, resolution| {
            let g: ScanGeometry = front_geometry(count, resolution);
            (
                (g.first_bearing.to_degrees() * 1e6).round() / 1e6,
                (g.increment.to_degrees() * 1e6).round() / 1e6,
            )
        };
        assert_eq!(degrees(180, None), (-90.0, 1.0));
        assert_eq!(degrees(181, None), (-90.0, 1.0));
        assert_eq!(degrees(360, None), (-90.0, 0.5));
        assert_eq!(degrees(361, None), (-90.0, 0.5));
        assert_eq!(degrees(181, Some(0.5)), (-45.0, 0.5));
        assert_eq!(degrees(401, Some(0.25)), (-50.0, 0.25));
    }

    #[test]
    fn a_bad_line_is_counted_and_the_rest_is_read() {
        let log = log_of(
            "PARAM robot_front_laser_max 50\nFLASER 2 1 2 0 0 0 1 1 0 5 h 5\nFLASER 9 1\n\
             RLASER 0\nFLASER 2 1 2 3 4 0.5 1 1 0 6 h 6\n",
        );
        assert_eq!((log.readings.len(), log.summary.malformed), (2, 1));
        assert_eq!(log.summary.faults[0].line, 3);
        assert_eq!(log.summary.ignored.get("RLASER"), Some(&1));
        assert_eq!((log.readings[1].index, log.readings[1].time_s), (1, 6.0));
        assert_eq!(log.scanner, Some(ScannerMake::SickPls));
    }

    #[test]
    fn nothing_but_bad_lines_is_an_error_that_says_why() {
        let error = read_from(Cursor::new(b"FLASER 9 1\nODOM 0\n".to_vec())).unwrap_err();
        assert_eq!(
            error.to_string(),
            "no scan and no sonar reading in 2 lines (2 malformed, first: line 1: the line ends \
             before range)"
        );
    }

    #[test]
    fn sonar_without_scans_stands_where_the_odometry_says() {
        let log = log_of("ODOM 1 2 0.5 0 0 0 1\nSONAR 0.4 2 1.5 0 0 0 0.1 0 0 -0.1 1 h 1\n");
        let reading = &log.readings[0];
        assert_eq!(reading.level_from_robot, Some(Pose::new(1.0, 2.0, 0.5)));
        let Observation::Ring(ring) = &reading.observation else { panic!("not a ring") };
        assert_eq!((ring.sonars[0].range, ring.sonars[1].range), (Some(1.5), None));
    }

    #[test]
    fn sonar_after_a_scan_is_carried_on_by_the_wheels() {
        let log = log_of(
            "FLASER 1 2.0 10 20 1.5707963267948966 0 0 0 1 h 1\nODOM 1 0 0 0 0 0 2\n\
             SONAR 0.4 1 1 0 0 0 2 h 2\n",
        );
        let p = log.readings[1].level_from_robot.unwrap();
        assert!((p.x - 10.0).abs() < 1e-12 && (p.y - 21.0).abs() < 1e-12, "{p:?}");
    }

    #[test]
    fn gzip_and_text_are_the_same_log() {
        let text = "FLASER 2 1 2 0 0 0 1 1 0 5 h 5\n";
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gzip.write_all(text.as_bytes()).unwrap();
        let packed = gzip.finish().unwrap();
        assert_eq!(read_from(Cursor::new(packed.clone())).unwrap(), log_of(text));
        // A file cut off in the middle of its compression still gives what came before.
        let long = text.repeat(10_000);
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::none());
        gzip.write_all(long.as_bytes()).unwrap();
        let mut cut = gzip.finish().unwrap();
        cut.truncate(cut.len() / 2);
        let log = read_from(Cursor::new(cut)).unwrap();
        assert!((3_000..7_000).contains(&log.readings.len()), "{}", log.readings.len());
        assert_eq!(log.summary.malformed, 0);
        let reason = log.summary.cut_short.unwrap();
        assert!(reason.starts_with("cannot read on after line "), "{reason}");
    }
}
