//! What one more contribution costs in small and in vast maps.

use std::collections::BTreeSet;

use mapfold_map::level::Level;
use tokio::time::Instant;

use super::rooms::Rooms;
use crate::statistics::quantile;

/// Rooms around a measured one that have got evidence too: further away nothing depends on it.
const REACH: u64 = 2;

/// A level in which contributions are measured.
struct Place {
    rooms: Rooms,
    level: Level,
    /// Where.
    measured: Vec<u64>,
    /// Memory for each segment, bytes, where the system tells.
    bytes: Option<f64>,
    samples: Samples,
}

/// Microseconds, one entry for each contribution.
#[derive(Debug, Clone, Default)]
struct Samples {
    first: Vec<f64>,
    next: Vec<f64>,
    out: Vec<f64>,
}

/// The distribution of some times, microseconds.
#[derive(Debug, Clone, Copy)]
pub struct Spread {
    /// Half of them are below.
    pub median: f64,
    /// One in twenty is above.
    pub p95: f64,
}

impl Spread {
    fn of(times: &[f64]) -> Self {
        Self { median: quantile(times, 0.5), p95: quantile(times, 0.95) }
    }
}

/// What contributions cost in a map of some size.
#[derive(Debug, Clone)]
pub struct Cost {
    /// Segments in the map.
    pub segments: usize,
    /// Contributions in force.
    pub contributions: usize,
    /// Memory for each segment, bytes, where the system tells.
    pub bytes: Option<f64>,
    /// Folding one in at a place where nothing was folded lately.
    pub first: Spread,
    /// Folding another in there.
    pub next: Spread,
    /// Taking it out again.
    pub out: Spread,
}

impl Place {
    fn with_segments(segments: u64, count: usize) -> Self {
        let before = resident_bytes();
        let mut rooms = Rooms::at_least(segments.div_ceil(4));
        let mut level = rooms.level();
        let bytes = before.zip(resident_bytes()).map(|(before, after)| {
            after.saturating_sub(before) as f64 / level.map().segments.len() as f64
        });
        let measured: Vec<u64> = (0..count).map(|_| rooms.inner(REACH)).collect();
        let surroundings: BTreeSet<u64> =
            measured.iter().flat_map(|room| rooms.around(*room, REACH)).collect();
        for room in surroundings {
            level.fold([&rooms.look_with_evidence(room)]);
        }
        Self { rooms, level, measured, bytes, samples: Samples::default() }
    }

    /// Folds two contributions in at a place and takes them out, so that the map stays as it is.
    fn measure(&mut self, at: usize) {
        let room = self.measured[at];
        let looks = [0; 2].map(|_| self.rooms.look_with_evidence(room));
        let samples = &mut self.samples;
        let begin = Instant::now();
        self.level.fold([&looks[0]]);
        samples.first.push(micros(begin));
        let begin = Instant::now();
        self.level.fold([&looks[1]]);
        samples.next.push(micros(begin));
        for look in looks.iter().rev() {
            let begin = Instant::now();
            self.level.unfold([look]);
            samples.out.push(micros(begin));
        }
    }
}

fn micros(begin: Instant) -> f64 {
    begin.elapsed().as_secs_f64() * 1e6
}

/// Measures `count` contributions in maps of so many segments each, in turns of `turn` of them, so
/// that what else the machine does falls on all alike.
pub fn measure(segments: &[u64], count: usize, turn: usize) -> Vec<Cost> {
    let mut places: Vec<Place> =
        segments.iter().map(|segments| Place::with_segments(*segments, count)).collect();
    for from in (0..count).step_by(turn) {
        for place in &mut places {
            for at in from..count.min(from + turn) {
                place.measure(at);
            }
        }
    }
    places
        .into_iter()
        .map(|place| Cost {
            segments: place.level.map().segments.len(),
            contributions: place.level.in_force().len(),
            bytes: place.bytes,
            first: Spread::of(&place.samples.first),
            next: Spread::of(&place.samples.next),
            out: Spread::of(&place.samples.out),
        })
        .collect()
}

/// Memory of this process that is not swapped out, bytes; only Linux tells.
fn resident_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024)
}
