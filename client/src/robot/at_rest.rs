//! What a robot reads while it stands is one look, and a better one.
//!
//! Fifty scans from one stop share the error of its pose: counted as fifty looks, a wall would seem
//! to be known fifty times. Their ranges, on the other hand, have noise of their own each. So all
//! scans of a stop become one, whose ranges are means of what agrees beam by beam: median and median
//! absolute deviation throw out what passed by, and single readings that went wrong.
//!
//! Rounds of a ring of sonars are one look too, but not a better one: what makes a sonar err does not change
//! from one to the next. What does change is another sonar's pulse, and it is told by that.

use mapfold_map::geometry::Pose;

use crate::log::{Observation, Reading};
use crate::sensor::robust::{SD_PER_MEDIAN_DEVIATION, middle};
use crate::sensor::{Ring, Scan, Sonar};

/// When a robot stands, and which readings of a stop agree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtRestConfig {
    /// A robot whose pose has moved no farther than this since the stop began stands, metres.
    pub moved_max: f64,
    /// The same for its heading, radians.
    pub turned_max: f64,
    /// Scans farther apart than this are of two stops, seconds.
    pub pause_max: f64,
    /// Fewer scans are left as they are: a median of two tells nothing.
    pub scans_min: usize,
    /// A longer stop is several looks.
    pub scans_max: usize,
    /// Echoes of one sonar that differ by more than this are not of one thing, metres.
    pub echoes_apart: f64,
    /// Readings that are off the median by more than this many deviations, by the median of these,
    /// are left out.
    pub deviations_max: f64,
    /// Least such deviation, metres: heads that tell whole centimetres seem to have none.
    pub deviation_min: f64,
    /// Greatest such deviation, metres: a beam that meets now one thing and now another has no mean.
    pub deviation_max: f64,
}

impl AtRestConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        moved_max: 0.002,
        turned_max: 0.1 * std::f64::consts::PI / 180.0,
        pause_max: 2.0,
        scans_min: 3,
        scans_max: 64,
        echoes_apart: 0.3,
        deviations_max: 3.5,
        deviation_min: 0.005,
        deviation_max: 0.1,
    };
}

/// Makes one scan of all that were taken in each stop, and one ring of all rounds of sonars; other
/// readings stay. Readings are numbered anew.
pub fn settle(readings: Vec<Reading>, config: &AtRestConfig) -> Vec<Reading> {
    let is_scan = |reading: &Reading| matches!(reading.observation, Observation::Scan(_));
    let (scans, rings) = readings.into_iter().partition(is_scan);
    let mut settled = settle_alike(scans, config);
    settled.append(&mut settle_alike(rings, config));
    settled.sort_by_key(|reading| reading.index);
    for (index, reading) in (0..).zip(&mut settled) {
        reading.index = index;
    }
    settled
}

/// The same for readings of one kind.
fn settle_alike(readings: Vec<Reading>, config: &AtRestConfig) -> Vec<Reading> {
    let mut settled: Vec<Reading> = Vec::with_capacity(readings.len());
    let mut stop: Vec<Reading> = Vec::new();
    for reading in readings {
        if stop.first().zip(stop.last()).is_some_and(|(first, last)| {
            stop.len() >= config.scans_max || !stands(first, last, &reading, config)
        }) {
            end(&mut stop, &mut settled, config);
        }
        stop.push(reading);
    }
    end(&mut stop, &mut settled, config);
    settled
}

/// Whether `next` may belong to the stop between `first` and `last`.
fn stands(first: &Reading, last: &Reading, next: &Reading, config: &AtRestConfig) -> bool {
    fn near<A: Copy, B: Copy>(a: &Pose<A, B>, b: &Pose<A, B>, config: &AtRestConfig) -> bool {
        let moved = a.inverse().compose(b);
        moved.position().norm() <= config.moved_max && moved.heading().abs() <= config.turned_max
    }
    let by_log = first.level_from_robot.as_ref().zip(next.level_from_robot.as_ref());
    let by_wheels = first.odom_from_robot.as_ref().zip(next.odom_from_robot.as_ref());
    let by_log = by_log.map(|(a, b)| near(a, b, config));
    let by_wheels = by_wheels.map(|(a, b)| near(a, b, config));
    let alike = match (&last.observation, &next.observation) {
        (Observation::Scan(a), Observation::Scan(b)) => {
            a.geometry == b.geometry
                && a.ranges.len() == b.ranges.len()
                && a.range_max.to_bits() == b.range_max.to_bits()
                && a.robot_from_sensor == b.robot_from_sensor
        }
        (Observation::Ring(a), Observation::Ring(b)) => {
            let mounts = a.sonars.iter().zip(&b.sonars);
            a.cone.to_bits() == b.cone.to_bits()
                && a.sonars.len() == b.sonars.len()
                && mounts.into_iter().all(|(a, b)| a.robot_from_sensor == b.robot_from_sensor)
        }
        _ => false,
    };
    let waited = next.time_s - last.time_s;
    alike
        && (0.0..=config.pause_max).contains(&waited)
        && by_log.or(by_wheels).is_some()
        && by_log.unwrap_or(true)
        && by_wheels.unwrap_or(true)
}

/// Lays the readings of a stop down, as one if they are enough.
fn end(stop: &mut Vec<Reading>, settled: &mut Vec<Reading>, config: &AtRestConfig) {
    let (mut scans, mut rings) = (Vec::new(), Vec::new());
    for reading in &*stop {
        match &reading.observation {
            Observation::Scan(scan) => scans.push(scan),
            Observation::Ring(ring) => rings.push(ring),
        }
    }
    let scan = mean(&scans, config).map(Observation::Scan);
    match scan.or_else(|| steady(&rings, config).map(Observation::Ring)) {
        Some(observation) => {
            settled.extend(stop.drain(..).next_back().map(|last| Reading { observation, ..last }));
        }
        None => settled.append(stop),
    }
}

/// The ring that the rounds of one stop come to, sonar by sonar; `None` of fewer than two. A sonar is
/// steady if more than half of its echoes are within [`AtRestConfig::echoes_apart`] of each other, or
/// if it mostly heard nothing.
pub fn steady(rounds: &[&Ring], config: &AtRestConfig) -> Option<Ring> {
    let first = rounds.first().filter(|_| rounds.len() > 1)?;
    let mut echoes: Vec<f64> = Vec::with_capacity(rounds.len());
    let sonars = first.sonars.iter().enumerate().map(|(index, sonar)| {
        echoes.clear();
        echoes.extend(rounds.iter().filter_map(|ring| ring.sonars.get(index)?.range));
        if 2 * echoes.len() < rounds.len() {
            return Sonar { range: None, ..*sonar };
        }
        echoes.sort_unstable_by(f64::total_cmp);
        let alike = (0..echoes.len()).map(|from| {
            let near = |echo: &&f64| **echo - echoes[from] <= config.echoes_apart;
            &echoes[from..from + echoes[from..].iter().take_while(near).count()]
        });
        let most = alike.max_by_key(|alike| alike.len()).unwrap_or_default();
        // Whatever the others are, before the nearest of all nothing was heard.
        let is_steady = 2 * most.len() > echoes.len();
        let range = if is_steady { most.get(most.len() / 2) } else { echoes.first() };
        Sonar { range: range.copied(), is_steady, ..*sonar }
    });
    Some(Ring { cone: first.cone, sonars: sonars.collect() })
}

/// The scan that scans of one stop come to, beam by beam; `None` if they are too few. A beam has a
/// return if at least half of them agree on one.
pub fn mean(scans: &[&Scan], config: &AtRestConfig) -> Option<Scan> {
    let first = scans.first().filter(|_| scans.len() >= config.scans_min)?;
    let mut settled = Scan { repeats: Vec::with_capacity(first.ranges.len()), ..(*first).clone() };
    let (mut returns, mut deviations) = (Vec::new(), Vec::new());
    for beam in 0..first.ranges.len() {
        let read = || scans.iter().filter_map(|scan| Some((scan, *scan.ranges.get(beam)?)));
        returns.clear();
        returns.extend(read().filter(|(scan, r)| scan.is_return(*r)).map(|(_, r)| r));
        let agreed = agreed(&mut returns, &mut deviations, config)
            .filter(|(count, _)| 2 * usize::from(*count) >= scans.len());
        let (count, range) = agreed.unwrap_or_else(|| {
            let none = read().find(|(scan, r)| !scan.is_return(*r)).map(|(_, r)| r);
            (1, none.unwrap_or(f64::NAN))
        });
        settled.ranges[beam] = range;
        settled.repeats.push(count);
    }
    Some(settled)
}

/// How many of the returns lie about their median, and the mean of those.
fn agreed(
    returns: &mut [f64],
    deviations: &mut Vec<f64>,
    config: &AtRestConfig,
) -> Option<(u16, f64)> {
    let median = median(returns, config.deviation_max)?;
    deviations.clear();
    deviations.extend(returns.iter().map(|r| (r - median).abs()));
    let deviation = (SD_PER_MEDIAN_DEVIATION * self::median(deviations, config.deviation_max)?)
        .clamp(config.deviation_min, config.deviation_max);
    let agree =
        returns.iter().filter(|r| (**r - median).abs() <= config.deviations_max * deviation);
    let (count, sum) = agree.fold((0_u16, 0.0), |(n, sum), r| (n.saturating_add(1), sum + r));
    Some((count, sum / f64::from(count)))
}

/// The middle one, or the mean of the two in the middle; if they are farther apart than `apart_max`,
/// the lower: one that was read, not one between two surfaces.
fn median(values: &mut [f64], apart_max: f64) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let [lower, upper] = middle(values)?;
    Some(if upper - lower > apart_max { lower } else { f64::midpoint(lower, upper) })
}

#[cfg(test)]
mod tests {
    #![expect(
        clippy::float_cmp,
        reason = "tests may stop at the first surprise, and numbers that pass through stay as they are"
    )]

    use rand::rngs::StdRng;
    use rand::{RngExt as _, SeedableRng};

    use super::*;
    use crate::sensor::{Ring, ScanGeometry};

    const CONFIG: AtRestConfig = AtRestConfig::STANDARD;

    fn scan(ranges: &[f64]) -> Scan {
        Scan {
            geometry: ScanGeometry { first_bearing: -1.0, increment: 0.01 },
            ranges: ranges.to_vec(),
            range_max: 8.0,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        }
    }

    fn reading(index: u32, time_s: f64, x: f64, range: f64) -> Reading {
        Reading {
            index,
            time_s,
            level_from_robot: None,
            odom_from_robot: Some(Pose::new(x, 0.0, 0.3)),
            observation: Observation::Scan(scan(&[range])),
        }
    }

    fn mean_of(scans: &[Scan]) -> Scan {
        mean(&scans.iter().collect::<Vec<_>>(), &CONFIG).unwrap()
    }

    #[test]
    fn the_scans_of_a_stop_are_one_look_and_those_on_the_way_stay() {
        let stop = |from: u32| (from..from + 4).map(|i| reading(i, f64::from(i), 2.0, 3.0));
        let way = |i: u32| reading(i, f64::from(i), f64::from(i), 1.0);
        let all: Vec<Reading> = (0..2).map(way).chain(stop(2)).chain((6..8).map(way)).collect();
        let settled = settle(all.clone(), &CONFIG);
        let numbers: Vec<u32> = settled.iter().map(|r| r.index).collect();
        assert_eq!(numbers, [0, 1, 2, 3, 4]);
        assert_eq!(settled[..2], all[..2]);
        assert_eq!(settled[2].time_s, 5.0, "told when the last of them was taken");
        let Observation::Scan(scan) = &settled[2].observation else { panic!("no scan") };
        assert_eq!((scan.ranges[0], scan.repeats[0]), (3.0, 4));
        assert_eq!(settled[3].observation, all[6].observation);
    }

    #[test]
    fn a_pause_a_move_a_pair_or_too_many_are_no_one_look() {
        let count = |readings: Vec<Reading>| settle(readings, &CONFIG).len();
        let at = |i: u32, x: f64| reading(i, f64::from(i), x, 3.0);
        assert_eq!(count((0..3).map(|i| at(i, 0.0)).collect()), 1);
        assert_eq!(count((0..2).map(|i| at(i, 0.0)).collect()), 2, "a pair");
        assert_eq!(count((0..3).map(|i| reading(i, 3.0 * f64::from(i), 0.0, 3.0)).collect()), 3);
        // Creeping: each step is small, their sum is not.
        assert_eq!(count((0..9).map(|i| at(i, 0.0015 * f64::from(i))).collect()), 9);
        assert_eq!(count((0..130).map(|i| at(i, 0.0)).collect()), 2 + 2);
        let lost = |i| Reading { odom_from_robot: None, ..at(i, 0.0) };
        assert_eq!(count((0..5).map(lost).collect()), 5, "nobody knows that it stands");
    }

    #[test]
    fn rings_keep_their_place() {
        let ring = |i: u32| Reading {
            observation: Observation::Ring(Ring { cone: 0.4, sonars: Vec::new() }),
            ..reading(i, f64::from(i), 0.0, 1.0)
        };
        let scan = |i: u32| reading(i, f64::from(i), 0.0, 1.0);
        let kinds = |settled: Vec<Reading>| -> String {
            let kind = |r: &Reading| matches!(r.observation, Observation::Ring(_));
            settled.iter().map(|r| if kind(r) { 'o' } else { 's' }).collect()
        };
        assert_eq!(kinds(settle(vec![scan(0), ring(1), scan(2)], &CONFIG)), "sos");
        assert_eq!(
            kinds(settle(vec![scan(0), ring(1), scan(2), scan(3), ring(4)], &CONFIG)),
            "oso"
        );
    }

    #[test]
    fn echoes_that_change_while_the_robot_stands_are_not_steady() {
        let ring = |ranges: [Option<f64>; 3]| Ring {
            cone: 0.4,
            sonars: ranges
                .map(|range| Sonar { robot_from_sensor: Pose::identity(), range, is_steady: true })
                .to_vec(),
        };
        let of = |rounds: &[[Option<f64>; 3]]| {
            let rings: Vec<Ring> = rounds.iter().map(|ranges| ring(*ranges)).collect();
            let settled = steady(&rings.iter().collect::<Vec<_>>(), &CONFIG)?;
            Some(settled.sonars.iter().map(|s| (s.range, s.is_steady)).collect::<Vec<_>>())
        };
        assert_eq!(of(&[[None; 3]]), None, "a single round");
        assert_eq!(
            of(&[[Some(2.0), Some(2.0), None], [Some(2.1), Some(2.4), Some(1.0)]]),
            Some(vec![(Some(2.1), true), (Some(2.0), false), (Some(1.0), true)]),
        );
        assert_eq!(
            of(&[
                [Some(2.0), Some(2.0), None],
                [Some(2.1), Some(1.0), None],
                [Some(0.7), Some(3.0), Some(1.0)]
            ]),
            Some(vec![(Some(2.1), true), (Some(1.0), false), (None, true)]),
            "two of three agree, none do, most heard nothing"
        );
    }

    #[test]
    fn what_passes_by_is_left_out_and_half_the_returns_make_one() {
        let scans: Vec<Scan> = [3.00, 3.01, 1.2, 2.99, 3.00].iter().map(|r| scan(&[*r])).collect();
        let settled = mean_of(&scans);
        assert!((settled.ranges[0] - 3.0).abs() < 1e-12 && settled.repeats[0] == 4);
        let of = |ranges: [f64; 4]| mean_of(&ranges.map(|r| scan(&[r]))).ranges[0];
        assert_eq!(of([2.0, 2.0, 8.0, 9.0]), 2.0);
        assert!(!scan(&[]).is_return(of([2.0, f64::INFINITY, 8.0, 0.0])));
        // A beam beside an edge: what lies between the two surfaces is none.
        assert!((of([2.0, 2.01, 4.0, 4.01]) - 2.005).abs() < 1e-12);
        let three = |ranges: [f64; 3]| mean_of(&ranges.map(|r| scan(&[r]))).ranges[0];
        assert!(!scan(&[]).is_return(three([2.0, 4.0, 8.0])), "one of three");
        assert!(!scan(&[]).is_return(three([2.0, 3.0, 4.0])), "no two agree");
    }

    #[test]
    fn the_mean_has_the_variance_that_it_claims() {
        let mut chance = StdRng::seed_from_u64(5);
        let mut normal = move || {
            let sum: f64 = (0..12).map(|_| chance.random::<f64>()).sum();
            sum - 6.0
        };
        let beams = 500;
        for stop in [3, 4, 6, 20] {
            let (mut square, mut claimed) = (0.0, 0.0);
            for _ in 0..20 {
                let scans: Vec<Scan> = (0..stop)
                    .map(|_| scan(&(0..beams).map(|_| 4.0 + 0.02 * normal()).collect::<Vec<_>>()))
                    .collect();
                let settled = mean_of(&scans);
                square += settled.ranges.iter().map(|r| (r - 4.0).powi(2)).sum::<f64>();
                claimed += (0..beams).map(|b| 4e-4 * settled.variance_share(b)).sum::<f64>();
            }
            let ratio = square / claimed;
            assert!((0.85..1.05).contains(&ratio), "{stop} scans: {ratio}");
        }
    }
}
