//! CARMEN logs of laser scanners, read for the measures and cut into the parts of a fleet.
//!
//! Knows `FLASER` and `ROBOTLASER1` lines, each with its corrected pose; everything else in a log
//! is carried along when the log is cut, and is not looked at.

use std::io::{Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;

use crate::Error;
use crate::plane::Point;

/// Readings below this are the sensor's own housing or its way to say nothing.
const RANGE_MIN_M: f64 = 0.05;

/// Readings within this share of the cap are "no return".
const CAP_SHARE: f64 = 0.999;

/// One sweep from its corrected pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Where the laser was.
    pub origin: Point,
    /// Where it looked, radians from x.
    pub heading: f64,
    /// Bearing of the first beam, radians from the heading.
    pub first_bearing: f64,
    /// Radians from beam to beam.
    pub step: f64,
    /// Ranges, metres, in the order of the beams.
    pub ranges: Vec<f64>,
    /// Seconds, by the log's clock.
    pub time: f64,
}

impl Scan {
    /// The ends of all beams that hit something nearer than `cap` metres.
    pub fn end_points(&self, cap: f64) -> impl Iterator<Item = Point> {
        self.ranges.iter().enumerate().filter(move |(_, range)| is_valid(**range, cap)).map(
            move |(index, range)| {
                let bearing = self.first_bearing + index as f64 * self.step;
                self.origin.towards(self.heading + bearing, *range)
            },
        )
    }
}

/// Whether a reading is a return: neither the housing nor at the cap.
pub fn is_valid(range: f64, cap: f64) -> bool {
    range > RANGE_MIN_M && range < cap * CAP_SHARE
}

/// A log: its lines, and the scans among them.
#[derive(Debug, Clone)]
pub struct Log {
    lines: Vec<String>,
    /// The line of each scan.
    places: Vec<usize>,
    /// The scans, in the order of the log.
    pub scans: Vec<Scan>,
    /// The largest range that a return can have, metres.
    pub cap: f64,
}

impl Log {
    /// Reads a log, gzip or plain.
    ///
    /// # Errors
    /// A file that cannot be read, a scan line that is too short or holds no numbers, no scans.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = text(path)?;
        let fault = |line: usize, fault: String| Error::Log { path: path.to_owned(), line, fault };

        let mut log =
            Self { lines: Vec::new(), places: Vec::new(), scans: Vec::new(), cap: f64::INFINITY };
        for (index, line) in text.lines().enumerate() {
            let words: Vec<&str> = line.split_whitespace().collect();
            let scan = match words.first() {
                Some(&"FLASER") => flaser(&words[1..]),
                Some(&"ROBOTLASER1") => robotlaser(&words[1..], &mut log.cap),
                Some(&"PARAM") if words.get(1) == Some(&"robot_front_laser_max") => {
                    log.cap = number(&words, 2).map_err(|e| fault(index + 1, e))?;
                    log.lines.push(line.to_owned());
                    continue;
                }
                _ => {
                    log.lines.push(line.to_owned());
                    continue;
                }
            };
            log.scans.push(scan.map_err(|e| fault(index + 1, e))?);
            log.places.push(log.lines.len());
            log.lines.push(line.to_owned());
        }
        if log.scans.is_empty() {
            return Err(fault(log.lines.len(), "no scans".to_owned()));
        }
        Ok(log)
    }

    /// The first scan of each of `parts` parts with equal numbers of scans, and the end.
    pub fn borders(&self, parts: usize) -> Vec<usize> {
        (0..=parts).map(|part| self.scans.len() * part / parts).collect()
    }

    /// Writes the scans `from..to` and everything between them as a log of its own (gzip). What
    /// stands before the first scan (parameters) goes into every part.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_part(&self, from: usize, to: usize, path: &Path) -> Result<(), Error> {
        let begin = if from == 0 { self.places[0] } else { self.places[from - 1] + 1 };
        let end = if to == self.scans.len() { self.lines.len() } else { self.places[to - 1] + 1 };
        let preamble = &self.lines[..self.places[0]];
        write(preamble.iter().chain(&self.lines[begin.max(self.places[0])..end]), path)
    }

    /// Writes a log of its own (gzip) that holds those scans by number that are wanted, and all else.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_those(&self, is_wanted: impl Fn(usize) -> bool, path: &Path) -> Result<(), Error> {
        let wanted = |line: &usize| self.places.binary_search(line).map_or(true, &is_wanted);
        write((0..self.lines.len()).filter(wanted).map(|line| &self.lines[line]), path)
    }
}

fn write<'a>(lines: impl Iterator<Item = &'a String>, path: &Path) -> Result<(), Error> {
    let text: String = lines.flat_map(|line| [line.as_str(), "\n"]).collect();
    let file = std::fs::File::create(path).map_err(|e| Error::file(path, e))?;
    let mut gzip = GzEncoder::new(file, Compression::fast());
    gzip.write_all(text.as_bytes())
        .and_then(|()| gzip.finish().map(drop))
        .map_err(|e| Error::file(path, e))
}

/// The text of a log, gzip or plain.
///
/// # Errors
/// A file that cannot be read.
pub fn text(path: &Path) -> Result<String, Error> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    let mut text = String::new();
    let mut plain: &[u8] = &bytes;
    let read = if bytes.starts_with(&[0x1f, 0x8b]) {
        GzDecoder::new(plain).read_to_string(&mut text)
    } else {
        plain.read_to_string(&mut text)
    };
    read.map(|_| text).map_err(|e| Error::file(path, e))
}

fn number(words: &[&str], at: usize) -> Result<f64, String> {
    let word = words.get(at).ok_or_else(|| format!("no word {at}"))?;
    word.parse().map_err(|e| format!("{word:?}: {e}"))
}

fn ranges(words: &[&str], at: usize) -> Result<(Vec<f64>, usize), String> {
    let count = number(words, at)? as usize;
    let ranges = (0..count).map(|i| number(words, at + 1 + i)).collect::<Result<_, _>>()?;
    Ok((ranges, at + 1 + count))
}

/// `n r1..rn x y theta odom_x odom_y odom_theta time host time`.
fn flaser(words: &[&str]) -> Result<Scan, String> {
    let (ranges, behind) = ranges(words, 0)?;
    // 180 or 181 beams are a degree apart, 360 or 361 half a degree: both begin at -90 degrees.
    let step = if ranges.len() > 181 { 0.5_f64 } else { 1.0 }.to_radians();
    Ok(Scan {
        origin: Point::new(number(words, behind)?, number(words, behind + 1)?),
        heading: number(words, behind + 2)?,
        first_bearing: -std::f64::consts::FRAC_PI_2,
        step,
        ranges,
        time: number(words, behind + 6)?,
    })
}

/// `type start fov step max accuracy remission n r1..rn n rem1..remn laser_x laser_y laser_theta
/// robot_x robot_y robot_theta ... time host time`.
fn robotlaser(words: &[&str], cap: &mut f64) -> Result<Scan, String> {
    let (first_bearing, step) = (number(words, 1)?, number(words, 3)?);
    *cap = number(words, 4)?;
    let (ranges, behind) = ranges(words, 7)?;
    let pose = behind + 1 + number(words, behind)? as usize;
    Ok(Scan {
        origin: Point::new(number(words, pose)?, number(words, pose + 1)?),
        heading: number(words, pose + 2)?,
        first_bearing,
        step,
        ranges,
        time: number(words, pose + 11)?,
    })
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "what is only read must come out as it went in")]
mod tests {
    use super::*;

    const LOG: &str = "# a log\nPARAM robot_front_laser_max 10\n\
        FLASER 2 1.0 10.0 0 0 1.5707963267948966 5 5 5 7.5 host 7.5\n\
        ODOM 1 2 3\n\
        ROBOTLASER1 0 -0.5 1 0.5 10 0.1 0 3 2 2 0.01 1 9 1 2 0 3 4 5 0 0 0 0 0 8.5 host 8.5\n\
        FLASER 1 3.0 0 0 0 5 5 5 9.5 host 9.5\n";

    fn log() -> (tempfile::TempDir, Log) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.log");
        std::fs::write(&path, LOG).unwrap();
        let log = Log::read(&path).unwrap();
        (folder, log)
    }

    #[test]
    fn both_kinds_of_lines_give_scans_with_their_corrected_poses() {
        let (_folder, log) = log();
        assert_eq!(log.cap, 10.0);
        assert_eq!(log.scans.iter().map(|scan| scan.time).collect::<Vec<_>>(), [7.5, 8.5, 9.5]);
        // A beam at -90 degrees of a robot that looks up goes to the right; the second is capped.
        let ends: Vec<Point> = log.scans[0].end_points(log.cap).collect();
        assert_eq!(ends.len(), 1);
        assert!(ends[0].distance(Point::new(1.0, 0.0)) < 1e-12);
        // The laser's pose, not the robot's; the third reading is the housing.
        assert_eq!(log.scans[1].origin, Point::new(1.0, 2.0));
        assert_eq!(log.scans[1].end_points(log.cap).count(), 2);
    }

    #[test]
    fn a_cut_log_has_every_line_once_and_the_parameters_in_each_part() {
        let (folder, log) = log();
        let mut lines = Vec::new();
        let borders = log.borders(3);
        assert_eq!(borders, [0, 1, 2, 3]);
        for part in 0..3 {
            let path = folder.path().join(format!("{part}.log.gz"));
            log.write_part(borders[part], borders[part + 1], &path).unwrap();
            let part = Log::read(&path).unwrap();
            assert_eq!(part.cap, 10.0);
            lines.extend(part.lines[2..].to_vec());
        }
        assert_eq!(lines, log.lines[2..]);
    }

    #[test]
    fn a_broken_line_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.log");
        std::fs::write(&path, "# x\nFLASER 2 1.0 two 0 0 0").unwrap();
        let error = Log::read(&path).unwrap_err().to_string();
        assert!(error.contains("line 2") && error.contains("two"), "{error}");
    }
}
