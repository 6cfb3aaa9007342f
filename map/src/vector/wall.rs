//! One wall: the fused line of a group and the parts of it that were seen.

use super::fusion::{FusedLine, fuse};
use super::seen_through::SeenThrough;
use super::sighting::Sighting;
use super::{EndKind, Facing, VectorConfig};
use crate::geometry::{
    Axes, Covariance, Interval, Level, Line, Point, UncertainLine, subtract_intervals, tangent,
    union_intervals, unit_normal,
};
use crate::level::{FeatureId, RobotName};
use crate::raster::LogOdds;

/// A wall before the grid and its neighbours have had their say about which parts are published.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wall {
    pub(super) line: Line<Level>,
    pub(super) axes: Axes,
    /// The direction in which free space lies.
    pub(super) towards_free: Point,
    pub(super) independent: Covariance<2>,
    pub(super) dependent: Covariance<2>,
    pub(super) facing: Facing,
    /// What was seen of it, ascending, disjoint, millimetres along `line`.
    pub(super) seen: Vec<Interval>,
    /// From where on how many looks cover it, ascending: millimetres along `line`, count.
    covers: Vec<(i64, i64)>,
    /// From where on how many looks say that they saw through it, ascending.
    throughs: Vec<(i64, i64)>,
    /// Where looks ended, and how: millimetres along `line`.
    ends: Vec<(i64, EndKind)>,
    pub(super) looks: u32,
    pub(super) robots: Vec<RobotName>,
    pub(super) first_seen_us: i64,
    pub(super) last_seen_us: i64,
}

/// How the directions in which two walls are free stand to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Facings {
    /// The same: they may be one wall seen twice.
    Same,
    /// Opposite: they may be the two faces of one wall.
    Opposite,
    /// Neither: they have nothing to tell of each other.
    Across,
}

/// Pieces that are not further apart than this count as one, millimetres.
const BRIDGE_MM: i64 = 150;
/// An end of a look counts for an end of the wall if it is not further from it, millimetres.
const END_MM: i64 = 150;

impl Wall {
    /// Fuses a group (canonical order) that `leader` leads. `None` if it carries no information.
    pub(super) fn new<'a>(
        group: impl Iterator<Item = (FeatureId, &'a Sighting)> + Clone,
        leader: &Sighting,
        config: &VectorConfig,
    ) -> Option<Self> {
        let fused = fuse(group.clone(), leader, config)?;
        let (line, independent, dependent, facing) = in_level_frame(&fused);
        let axes = Axes::of(&line);
        let mut seen = Vec::new();
        let mut covering: Vec<Vec<Interval>> = Vec::new();
        let mut openings: Vec<Vec<Interval>> = Vec::new();
        let mut ends = Vec::new();
        let mut robots = Vec::new();
        let mut last_look = None;
        let (mut looks, mut first_seen_us, mut last_seen_us) = (0, i64::MAX, i64::MIN);
        for (id, sighting) in group {
            let [a, b] = sighting.end_points().map(|p| axes.along(&p));
            let [sure_a, sure_b] = sighting.sure_ends(config).map(|p| axes.along(&p));
            let span = Interval::from_metres(sure_a, sure_b);
            seen.push(span);
            ends.push(((a * 1e3).round() as i64, sighting.ends[0].kind));
            ends.push(((b * 1e3).round() as i64, sighting.ends[1].kind));
            if last_look != Some(id.contribution) {
                looks += 1;
                last_look = Some(id.contribution);
                covering.push(Vec::new());
                openings.push(Vec::new());
            }
            if let (Some(covering), Some(openings)) = (covering.last_mut(), openings.last_mut()) {
                covering.push(span);
                openings.extend(sighting.openings().map(|ends| {
                    let [a, b] = ends.map(|p| axes.along(&p));
                    Interval::from_metres(a, b)
                }));
            }
            robots.push(sighting.robot.clone());
            first_seen_us = first_seen_us.min(sighting.observed_at_us);
            last_seen_us = last_seen_us.max(sighting.observed_at_us);
        }
        robots.sort_unstable();
        robots.dedup();
        ends.sort_unstable();
        let covers = looks_along(&covering);
        let throughs = looks_along(&openings);
        let not_there = [
            thinly_covered(&covers, config.thin_share, config.thin_reach),
            open(&covers, &throughs, config.through_share),
        ];
        let seen = subtract_intervals(
            &union_intervals(&seen, BRIDGE_MM),
            &union_intervals(&not_there.concat(), 0),
        );
        Some(Self {
            line,
            axes,
            towards_free: match facing {
                Facing::Origin => -axes.normal,
                Facing::Away => axes.normal,
            },
            independent,
            dependent,
            facing,
            seen,
            covers,
            throughs,
            ends,
            looks,
            robots,
            first_seen_us,
            last_seen_us,
        })
    }

    /// Lower left and upper right corner of what was seen.
    pub(super) fn extent(&self) -> (Point, Point) {
        let first = self.seen.first().map_or(0.0, Interval::from_m);
        let last = self.seen.last().map_or(0.0, Interval::to_m);
        let (a, b) = (self.axes.at(first), self.axes.at(last));
        (a.inf(&b), a.sup(&b))
    }

    /// How many looks cover the wall at `at` millimetres.
    pub(super) fn looks_at(&self, at: i64) -> i64 {
        count_at(&self.covers, at)
    }

    /// Log-odds that the wall is there, averaged along `piece`: every look that covers it speaks for
    /// it; every look that went through it speaks against it, whether it says so itself or the grid
    /// does (`through`), whichever tells of more.
    pub(super) fn existence(
        &self,
        piece: Interval,
        through: &SeenThrough,
        config: &VectorConfig,
    ) -> LogOdds {
        let (detection, alarm) = (config.detection_probability, config.false_alarm_probability);
        let in_grid: f64 = through
            .looks
            .iter()
            .map(|(stretch, looks)| stretch.overlap(&piece) as f64 * looks)
            .sum();
        let missed = in_grid.max(total(&self.throughs, piece) as f64);
        let seen = total(&self.covers, piece) as f64;
        let nat =
            (detection / alarm).ln() * seen + ((1.0 - detection) / (1.0 - alarm)).ln() * missed;
        LogOdds::from_nat(nat / piece.length().max(1) as f64)
    }

    /// How many looks cover the wall abreast of `p`.
    pub(super) fn looks_beside(&self, p: &Point) -> i64 {
        self.looks_at((self.axes.along(p) * 1e3).round() as i64)
    }

    /// How this wall and `other` stand to each other. Symmetric.
    pub(super) fn facings(&self, other: &Self, config: &VectorConfig) -> Facings {
        let cosine = self.towards_free.dot(&other.towards_free);
        let least = config.angle_max.cos();
        if cosine >= least {
            Facings::Same
        } else if cosine < -least {
            Facings::Opposite
        } else {
            Facings::Across
        }
    }

    /// Whether `other` may be the other face of this wall: it faces the opposite side and lies not
    /// further than `config.thickness_max` behind.
    pub(super) fn is_backed_by(&self, other: &Self, config: &VectorConfig) -> bool {
        let free = self.towards_free;
        let behind = |i: &Interval| {
            let p = other.axes.at(0.5 * (i.from_m() + i.to_m()));
            let depth = free.dot(&(self.axes.at(self.axes.along(&p)) - p));
            (-config.duplicate_offset..=config.thickness_max).contains(&depth)
        };
        self.facings(other, config) == Facings::Opposite && other.seen.iter().any(behind)
    }

    /// What is known of the wall's end at `at` millimetres: a corner rather than a physical end rather
    /// than the end of a view.
    pub(super) fn end_kind(&self, at: i64) -> Option<EndKind> {
        let from = self.ends.partition_point(|(end, _)| *end < at - END_MM);
        self.ends[from..].iter().take_while(|(end, _)| *end <= at + END_MM).map(|(_, k)| *k).min()
    }

    /// The parts of this wall, among `pieces`, that run along `other` not further than
    /// `config.duplicate_offset` from it and that face the same side: one wall seen twice.
    pub(super) fn duplicated(
        &self,
        pieces: &[Interval],
        other: &Self,
        other_pieces: impl Iterator<Item = Interval>,
        config: &VectorConfig,
    ) -> Vec<Interval> {
        if self.facings(other, config) != Facings::Same {
            return Vec::new();
        }
        let across = |t: f64| other.axes.across(&self.axes.at(t)).abs() <= config.duplicate_offset;
        let mut shared = Vec::new();
        for theirs in other_pieces {
            let [a, b] =
                [theirs.from_m(), theirs.to_m()].map(|t| self.axes.along(&other.axes.at(t)));
            let theirs = Interval::from_metres(a, b);
            for own in pieces {
                let both = Interval { from: own.from.max(theirs.from), to: own.to.min(theirs.to) };
                if both.length() > 0 && across(both.from_m()) && across(both.to_m()) {
                    shared.push(both);
                }
            }
        }
        union_intervals(&shared, 0)
    }
}

/// From where on how many looks tell of something, ascending. Two pieces of one look may tell of the
/// same: it counts once.
fn looks_along(told: &[Vec<Interval>]) -> Vec<(i64, i64)> {
    let once = told.iter().flat_map(|of_look| union_intervals(of_look, 0));
    counts(once.flat_map(|stretch| [(stretch.from, 1), (stretch.to, -1)]).collect())
}

/// From where on how many, ascending, from where each begins (+1) and ends (-1).
fn counts(mut changes: Vec<(i64, i64)>) -> Vec<(i64, i64)> {
    changes.sort_unstable();
    let mut count = 0;
    for (_, change) in &mut changes {
        count += *change;
        *change = count;
    }
    changes
}

fn count_at(counts: &[(i64, i64)], at: i64) -> i64 {
    let next = counts.partition_point(|(from, _)| *from <= at);
    next.checked_sub(1).map_or(0, |i| counts[i].1)
}

/// The sum of the counts of all millimetres of `piece`.
fn total(counts: &[(i64, i64)], piece: Interval) -> i64 {
    let first = counts.partition_point(|(from, _)| *from <= piece.from);
    let mut at = (piece.from, count_at(counts, piece.from));
    let mut sum = 0;
    for next in counts[first..].iter().take_while(|(from, _)| *from < piece.to) {
        sum += at.1 * (next.0 - at.0);
        at = *next;
    }
    sum + at.1 * (piece.to - at.0)
}

/// Where looks say that they saw through: any, where no look covers the wall; otherwise more than
/// one, and more than a `share` of those that do. Ascending.
fn open(covers: &[(i64, i64)], openings: &[(i64, i64)], share: f64) -> Vec<Interval> {
    let mut open = Vec::new();
    for pair in openings.windows(2) {
        let (stretch, through) = (Interval { from: pair[0].0, to: pair[1].0 }, pair[0].1);
        if through == 0 {
            continue;
        }
        // The counts of looks change within the stretch.
        let first = covers.partition_point(|(from, _)| *from <= stretch.from);
        let last = covers.partition_point(|(from, _)| *from < stretch.to);
        let edges = covers[first.min(last)..last].iter().map(|(at, _)| *at);
        let starts = std::iter::once(stretch.from).chain(edges.clone());
        for (from, to) in starts.zip(edges.chain([stretch.to])) {
            let looks = count_at(covers, from);
            if looks == 0 || (through > 1 && through as f64 > share * looks as f64) {
                open.push(Interval { from, to });
            }
        }
    }
    open
}

/// Where fewer than a `share` of the looks cover a wall than do within `reach` metres: looks that
/// err outwards, not the wall, go on there. Ascending, disjoint.
fn thinly_covered(covers: &[(i64, i64)], share: f64, reach: f64) -> Vec<Interval> {
    let reach = (reach * 1e3).round() as i64;
    let most = covers.iter().map(|(_, count)| *count).max().unwrap_or(0) as f64;
    let mut thin = Vec::new();
    for (k, pair) in covers.windows(2).enumerate() {
        let (step, count) = (Interval { from: pair[0].0, to: pair[1].0 }, pair[0].1);
        let outweighs = |other: i64| other as f64 * share > count as f64;
        if count == 0 || step.length() == 0 || most * share <= count as f64 {
            continue;
        }
        let before = covers[..=k]
            .windows(2)
            .rev()
            .take_while(|other| other[1].0 + reach > step.from)
            .find(|other| outweighs(other[0].1));
        if let Some(other) = before {
            thin.push(Interval { from: step.from, to: step.to.min(other[1].0 + reach) });
        }
        let after = covers[k + 1..]
            .iter()
            .take_while(|other| other.0 - reach < step.to)
            .find(|other| outweighs(other.1));
        if let Some(other) = after {
            thin.push(Interval { from: step.from.max(other.0 - reach), to: step.to });
        }
    }
    union_intervals(&thin, 0)
}

/// A fused line in normal form about the level's origin. Its normal points to free space; in normal
/// form it points away from the origin, which decides the facing.
fn in_level_frame(fused: &FusedLine) -> (Line<Level>, Covariance<2>, Covariance<2>, Facing) {
    let n = unit_normal(fused.alpha);
    let rho = fused.offset + n.dot(&fused.anchor);
    let lever = tangent(fused.alpha).dot(&fused.anchor);
    let about_origin =
        |c: &nalgebra::Matrix2<f64>| Covariance::symmetrised(super::sighting::about(c, lever));
    let (independent, turned) =
        UncertainLine::<Level>::normal_form(rho, fused.alpha, about_origin(&fused.independent));
    let (dependent, _) =
        UncertainLine::<Level>::normal_form(rho, fused.alpha, about_origin(&fused.dependent));
    let facing = if turned { Facing::Origin } else { Facing::Away };
    (independent.line, independent.covariance, dependent.covariance, facing)
}
