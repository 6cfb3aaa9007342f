//! One line of a CARMEN log.

use std::str::SplitAsciiWhitespace;

/// Most beams or sonars that a line may claim.
const READINGS_MAX: usize = 100_000;
/// Positions farther out than this are a broken line, metres.
const COORDINATE_MAX: f64 = 1e6;
/// Instants from here on (year 2200) are a broken line, seconds; the server says so too.
const TIME_MAX: f64 = 7_258_118_399.0;

/// Messages that are known and mean nothing to a map.
const IGNORED: [&str; 24] = [
    "RLASER",
    "LASER3",
    "LASER4",
    "LASER5",
    "RAWLASER1",
    "RAWLASER2",
    "RAWLASER3",
    "RAWLASER4",
    "RAWLASER5",
    "ROBOTLASER2",
    "ROBOTLASER3",
    "ROBOTLASER4",
    "ROBOTLASER5",
    "TRUEPOS",
    "GLOBALPOS",
    "SYNC",
    "COMMENT",
    "BUMPER",
    "IMU",
    "VECTORMOVE",
    "ROBOTVELOCITY",
    "FOLLOWTRAJECTORY",
    "NMEAGGA",
    "NMEARMC",
];

/// (x, y, heading) as a line tells it.
pub(super) type Triple = [f64; 3];

/// What a line says.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// `PARAM name value`.
    Param {
        /// Its name.
        name: String,
        /// Its value.
        value: String,
    },
    /// `ODOM`: (x, y, heading) of the wheels.
    Odom {
        /// (x, y, heading).
        robot: [f64; 3],
        /// Seconds.
        time_s: f64,
    },
    /// `FLASER`: a scan without angles.
    FrontLaser {
        /// Metres, beam by beam.
        ranges: Vec<f64>,
        /// Corrected pose.
        robot: [f64; 3],
        /// Pose by odometry.
        odom: [f64; 3],
        /// Seconds.
        time_s: f64,
    },
    /// `ROBOTLASER1`: a scan that describes itself.
    RobotLaser {
        /// 0 SICK LMS, 1 SICK PLS, 2 Hokuyo URG, 3 simulated.
        make: u32,
        /// Bearing of the first beam, radians.
        first_bearing: f64,
        /// Radians from beam to beam.
        increment: f64,
        /// Metres.
        range_max: f64,
        /// Metres, beam by beam.
        ranges: Vec<f64>,
        /// Pose of the scanner.
        sensor: [f64; 3],
        /// Pose of the robot.
        robot: [f64; 3],
        /// Seconds.
        time_s: f64,
    },
    /// `SONAR`: what a ring heard.
    Sonar {
        /// Full width of the cones, radians.
        cone: f64,
        /// Metres, sonar by sonar.
        ranges: Vec<f64>,
        /// Where each sits on the robot.
        mounts: Vec<[f64; 3]>,
        /// Seconds.
        time_s: f64,
    },
    /// A message that means nothing to a map.
    Ignored(String),
}

/// Why a line cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LineFault {
    /// The line ends too early.
    #[error("the line ends before {0}")]
    Missing(&'static str),
    /// A field is no number.
    #[error("{field} is {text:?}, not a number")]
    NotANumber {
        /// The field.
        field: &'static str,
        /// What stands there.
        text: String,
    },
    /// A field is a number that it cannot be.
    #[error("{field} is {value}, which it cannot be")]
    OutOfRange {
        /// The field.
        field: &'static str,
        /// What stands there.
        value: f64,
    },
    /// The message is none that CARMEN writes.
    #[error("{0:?} is no message of a CARMEN log")]
    UnknownMessage(String),
    /// Bytes that are no text.
    #[error("the line is no text")]
    NotText,
    /// Longer than any line of a log.
    #[error("the line is longer than a megabyte")]
    TooLong,
}

/// A line that cannot be read, and which.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("line {line}: {fault}")]
pub struct LineError {
    /// Its number, from 1.
    pub line: u64,
    /// What is wrong with it.
    pub fault: LineFault,
}

/// Reads a line; `None` for comments and empty ones.
pub(super) fn parse(line: &str) -> Result<Option<Message>, LineFault> {
    let mut fields = Fields(line.split_ascii_whitespace());
    let Some(name) = fields.0.next() else { return Ok(None) };
    if name.starts_with('#') {
        return Ok(None);
    }
    match name {
        "PARAM" => fields.param(),
        "ODOM" => fields.odom(),
        "FLASER" => fields.front_laser(),
        "ROBOTLASER1" => fields.robot_laser(),
        "SONAR" => fields.sonar(),
        known if IGNORED.contains(&known) => Ok(Message::Ignored(known.to_owned())),
        unknown => Err(LineFault::UnknownMessage(unknown.chars().take(32).collect())),
    }
    .map(Some)
}

struct Fields<'a>(SplitAsciiWhitespace<'a>);

impl Fields<'_> {
    /// Any number, also NaN and infinities.
    fn number(&mut self, field: &'static str) -> Result<f64, LineFault> {
        let text = self.0.next().ok_or(LineFault::Missing(field))?;
        text.parse().map_err(|_not_a_number: std::num::ParseFloatError| LineFault::NotANumber {
            field,
            text: text.chars().take(32).collect(),
        })
    }

    fn within(&mut self, field: &'static str, min: f64, max: f64) -> Result<f64, LineFault> {
        let value = self.number(field)?;
        // Written so that NaN fails.
        if value >= min && value <= max {
            Ok(value)
        } else {
            Err(LineFault::OutOfRange { field, value })
        }
    }

    fn count(&mut self, field: &'static str) -> Result<usize, LineFault> {
        let value = self.within(field, 0.0, READINGS_MAX as f64)?;
        if value.fract() == 0.0 {
            Ok(value as usize)
        } else {
            Err(LineFault::OutOfRange { field, value })
        }
    }

    fn triple(&mut self, field: &'static str) -> Result<Triple, LineFault> {
        Ok([
            self.within(field, -COORDINATE_MAX, COORDINATE_MAX)?,
            self.within(field, -COORDINATE_MAX, COORDINATE_MAX)?,
            self.within(field, -COORDINATE_MAX, COORDINATE_MAX)?,
        ])
    }

    /// `count` ranges; what is not finite is kept: it is a beam without return.
    fn ranges(&mut self, count: usize) -> Result<Vec<f64>, LineFault> {
        (0..count).map(|_| self.number("range")).collect()
    }

    fn skip(&mut self, count: usize, field: &'static str) -> Result<(), LineFault> {
        (0..count).try_for_each(|_| self.number(field).map(drop))
    }

    /// The first of `ipc_timestamp ipc_hostname logger_timestamp`.
    fn time(&mut self) -> Result<f64, LineFault> {
        self.within("time", 0.0, TIME_MAX)
    }

    fn param(&mut self) -> Result<Message, LineFault> {
        let name = self.0.next().ok_or(LineFault::Missing("name"))?.to_owned();
        let value = self.0.next().ok_or(LineFault::Missing("value"))?.to_owned();
        Ok(Message::Param { name, value })
    }

    fn odom(&mut self) -> Result<Message, LineFault> {
        let robot = self.triple("pose")?;
        self.skip(3, "velocity")?;
        Ok(Message::Odom { robot, time_s: self.time()? })
    }

    fn front_laser(&mut self) -> Result<Message, LineFault> {
        let count = self.count("number of beams")?;
        let ranges = self.ranges(count)?;
        let robot = self.triple("pose")?;
        let odom = self.triple("odometry pose")?;
        Ok(Message::FrontLaser { ranges, robot, odom, time_s: self.time()? })
    }

    fn robot_laser(&mut self) -> Result<Message, LineFault> {
        let make = self.within("laser type", 0.0, f64::from(u32::MAX))? as u32;
        let first_bearing = self.within("start angle", -10.0, 10.0)?;
        self.number("field of view")?;
        let increment = self.within("angular resolution", 1e-6, 1.0)?;
        let range_max = self.within("maximum range", 1e-3, 1e4)?;
        self.skip(2, "accuracy and remission mode")?;
        let count = self.count("number of beams")?;
        let ranges = self.ranges(count)?;
        let remissions = self.count("number of remissions")?;
        self.skip(remissions, "remission")?;
        let sensor = self.triple("laser pose")?;
        let robot = self.triple("robot pose")?;
        self.skip(5, "velocities and safety distances")?;
        let time_s = self.time()?;
        Ok(Message::RobotLaser {
            make,
            first_bearing,
            increment,
            range_max,
            ranges,
            sensor,
            robot,
            time_s,
        })
    }

    fn sonar(&mut self) -> Result<Message, LineFault> {
        let cone = self.within("cone", 1e-3, std::f64::consts::FRAC_PI_2)?;
        let count = self.count("number of sonars")?;
        let ranges = self.ranges(count)?;
        let mounts = (0..count).map(|_| self.triple("sonar pose")).collect::<Result<_, _>>()?;
        Ok(Message::Sonar { cone, ranges, mounts, time_s: self.time()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_self_describing_scan_keeps_its_angles_and_both_poses() {
        let line = "ROBOTLASER1 2 -1.5 3.0 0.5 5.6 0.03 0 3 1.0 nan 5.7 1 200 \
                    1.0 2.0 0.5 0.9 2.0 0.5 0 0 0 0 0 12.25 host 12.5";
        let Some(Message::RobotLaser {
            make, first_bearing, ranges, sensor, robot, time_s, ..
        }) = parse(line).unwrap()
        else {
            panic!("not a scan")
        };
        assert_eq!((make, first_bearing, time_s), (2, -1.5, 12.25));
        assert_eq!((ranges[0], ranges[2], ranges.len()), (1.0, 5.7, 3));
        assert!(ranges[1].is_nan());
        assert_eq!((sensor, robot), ([1.0, 2.0, 0.5], [0.9, 2.0, 0.5]));
    }

    #[test]
    fn faults_are_named() {
        let table = [
            ("FLASER 3 1.0 2.0", LineFault::Missing("range")),
            ("FLASER", LineFault::Missing("number of beams")),
            ("FLASER -1", LineFault::OutOfRange { field: "number of beams", value: -1.0 }),
            ("FLASER 1.5", LineFault::OutOfRange { field: "number of beams", value: 1.5 }),
            ("FLASER 1e9", LineFault::OutOfRange { field: "number of beams", value: 1e9 }),
            ("FLASER 1 x", LineFault::NotANumber { field: "range", text: "x".to_owned() }),
            ("ODOM 1e7 0 0 0 0 0 1", LineFault::OutOfRange { field: "pose", value: 1e7 }),
            ("ODOM 0 0 0 0 0 0 -1", LineFault::OutOfRange { field: "time", value: -1.0 }),
            ("SONAR 9 0", LineFault::OutOfRange { field: "cone", value: 9.0 }),
            ("hello", LineFault::UnknownMessage("hello".to_owned())),
            ("PARAM x", LineFault::Missing("value")),
        ];
        for (line, fault) in table {
            assert_eq!(parse(line), Err(fault), "{line}");
        }
        assert!(matches!(
            parse("ODOM nan 0 0 0 0 0 1"),
            Err(LineFault::OutOfRange { field: "pose", .. })
        ));
    }

    #[test]
    fn comments_are_passed_over_and_other_messages_are_counted() {
        assert_eq!(parse("# FLASER"), Ok(None));
        assert_eq!(parse("   "), Ok(None));
        assert_eq!(parse("RLASER 0"), Ok(Some(Message::Ignored("RLASER".to_owned()))));
    }
}
