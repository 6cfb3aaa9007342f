//! Landmarks of a plan: corners, free ends and doorways that a robot can find itself on.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Matrix2;

use super::contours::Bordering;
use super::exact::PlanPoint;
use super::{ObjectId, Opening, Outline, Plan, Sheet};
use crate::geometry::{Covariance, Point, wrap};
use crate::landmarks::{Landmark, LandmarkKind};

/// What counts as a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LandmarkConfig {
    /// Both walls of a corner are at least this long, metres: less does not give a line.
    pub wall_min: f64,
    /// Sine of the least angle between the walls of a corner (20 degrees).
    pub corner_sine_min: f64,
    /// Sine of the most angle at which a wall still goes on as itself.
    pub straight_sine_max: f64,
    /// Corners nearer to each other than this are one, metres: what snapping and drawing leave.
    pub detail_min: f64,
    /// Whatever two walls leave within this of where their lines meet is a detail of their corner, metres.
    pub bevel_max: f64,
}

impl LandmarkConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        wall_min: 0.25,
        corner_sine_min: 0.35,
        straight_sine_max: 0.02,
        detail_min: 0.001,
        bevel_max: 0.05,
    };
}

/// Identity of a landmark: what it is, whose, and where. Nothing else in the model can rename it, and plans of
/// different heights agree on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LandmarkId {
    /// What it is.
    pub kind: LandmarkKind,
    /// The objects that make it, the smaller first: the owners of a corner's walls, a doorway and its wall. The same
    /// twice if there is one only.
    pub objects: [ObjectId; 2],
    /// Where.
    pub at: PlanPoint,
}

/// A landmark of the a-priori model; its covariance comes from the tolerances of the objects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedLandmark {
    /// Which one.
    pub id: LandmarkId,
    /// What, where and with which direction: that of a doorway is in (-pi/2, pi/2], since it is the same from both
    /// sides.
    pub landmark: Landmark,
    /// The angle of free space at a corner, radians; the width of a doorway or an end, metres (0 for the end of
    /// a sheet).
    pub extent: f64,
}

/// The landmarks of a plan, in the order of their ids.
pub fn landmarks(plan: &Plan, config: &LandmarkConfig) -> Vec<PlannedLandmark> {
    let mut jambs: Vec<PlanPoint> =
        plan.openings.iter().flat_map(|o| &o.sides).flat_map(|s| [s.from, s.to]).collect();
    jambs.sort_unstable();
    let finder = Finder { plan, config, jambs };
    let mut found: Vec<PlannedLandmark> = Vec::new();
    for Outline { edges } in &plan.outlines {
        let runs = finder.runs(edges, true);
        if runs.len() > 1 {
            finder.of_outline(&runs, &mut found);
        }
    }
    for Sheet { edges, ends_free } in &plan.sheets {
        finder.of_sheet(&finder.runs(edges, false), *ends_free, &mut found);
    }
    found.extend(plan.openings.iter().filter_map(|opening| finder.of_opening(opening)));
    found.sort_by_key(|landmark| landmark.id);
    found.dedup_by_key(|landmark| landmark.id);
    found
}

/// A straight stretch, however many objects it is made of.
#[derive(Debug, Clone, Copy)]
struct Run {
    from: PlanPoint,
    to: PlanPoint,
    /// Owners of its first and its last edge.
    owners: [u32; 2],
}

impl Run {
    fn step(&self) -> Point {
        self.to.metres() - self.from.metres()
    }

    fn direction(&self) -> Point {
        self.step().normalize()
    }

    fn length(&self) -> f64 {
        self.step().norm()
    }
}

struct Finder<'a> {
    plan: &'a Plan,
    config: &'a LandmarkConfig,
    /// Ends of openings' sides, sorted: what is there belongs to the doorway.
    jambs: Vec<PlanPoint>,
}

impl Finder<'_> {
    /// The straight stretches of an outline or a sheet.
    fn runs(&self, edges: &[Bordering], closed: bool) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        for edge in edges {
            let next = Run { from: edge.from, to: edge.to, owners: [edge.owner; 2] };
            match runs.last_mut() {
                Some(last) if self.goes_on(last, &next) => join(last, &next),
                _ => runs.push(next),
            }
        }
        // The outline starts somewhere along a wall, if the smallest vertex is a seam.
        while closed && runs.len() > 2 && self.goes_on(&runs[runs.len() - 1], &runs[0]) {
            if let Some(mut last) = runs.pop() {
                join(&mut last, &runs[0]);
                runs[0] = last;
            }
        }
        runs
    }

    fn goes_on(&self, last: &Run, next: &Run) -> bool {
        if last.length() < self.config.detail_min || next.length() < self.config.detail_min {
            return true;
        }
        let (u, v) = (last.direction(), next.direction());
        u.perp(&v).abs() <= self.config.straight_sine_max && u.dot(&v) > 0.0
    }

    fn is_jamb(&self, at: PlanPoint) -> bool {
        self.jambs.binary_search(&at).is_ok()
    }

    /// Corners and ends of an outline: of each two walls that follow each other, with nothing or with details between them.
    fn of_outline(&self, runs: &[Run], found: &mut Vec<PlannedLandmark>) {
        let long = |run: &Run| run.length() >= self.config.wall_min;
        let walls: Vec<usize> = (0..runs.len()).filter(|k| long(&runs[*k])).collect();
        if walls.len() < 2 {
            return;
        }
        for (number, from) in walls.iter().enumerate() {
            let to = walls[(number + 1) % walls.len()];
            let (first, second) = (&runs[*from], &runs[to]);
            let between: Vec<Run> = (from + 1..from + runs.len())
                .map(|k| k % runs.len())
                .take_while(|k| *k != to)
                .map(|k| runs[k])
                .collect();
            found.extend(if between.is_empty() {
                self.corner(first, second, false)
            } else {
                let rounded = self.cut_corner(first, &between, second);
                rounded.or_else(|| self.thin_end(first, &between, second))
            });
        }
    }

    /// The corner of two walls that lack a little of it: where their lines meet, if all of the way from the one to the
    /// other is near there. So a bevel is none, nor are the steps that doubly drawn or sharply turning walls leave.
    fn cut_corner(&self, first: &Run, between: &[Run], second: &Run) -> Option<PlannedLandmark> {
        let (u, v) = (first.direction(), second.direction());
        let gap = second.from.metres() - first.to.metres();
        // From the end of the first wall: u s = gap + v t.
        let at = first.to.metres() + u * (gap.perp(&v) / u.perp(&v));
        let near = |p: PlanPoint| (p.metres() - at).norm() <= self.config.bevel_max;
        if !near(first.to) || !between.iter().all(|run| near(run.to)) {
            return None;
        }
        if between.iter().any(|run| self.is_jamb(run.to)) {
            return None;
        }
        let at = PlanPoint::nearest(&at)?;
        self.corner_at(at, first, second, false)
    }

    /// The corner between two runs with free space on their left; on their right, if it is seen from behind.
    fn corner(&self, first: &Run, second: &Run, from_behind: bool) -> Option<PlannedLandmark> {
        self.corner_at(first.to, first, second, from_behind)
    }

    fn corner_at(
        &self,
        at: PlanPoint,
        first: &Run,
        second: &Run,
        from_behind: bool,
    ) -> Option<PlannedLandmark> {
        let config = self.config;
        let (u, v) = (first.direction(), second.direction());
        let sine = u.perp(&v);
        if sine.abs() < config.corner_sine_min
            || first.length() < config.wall_min
            || second.length() < config.wall_min
            || self.is_jamb(first.to)
        {
            return None;
        }
        let turn = sine.atan2(u.dot(&v));
        // Free on the left: a turn to the left narrows the free space.
        let free = if from_behind { PI + turn } else { PI - turn };
        let kind = if free > PI { LandmarkKind::ConvexCorner } else { LandmarkKind::ConcaveCorner };
        // Half of the free angle from the second wall, to its left (or to its right).
        let along = v.y.atan2(v.x);
        let heading = wrap(if from_behind { along - free / 2.0 } else { along + free / 2.0 });
        let owners = [first.owners[1], second.owners[0]];
        let sds = owners.map(|owner| self.plan.owner(owner).tolerance);
        // An error of either wall across itself moves the corner along the other: x = A^-1 (d1, d2), A the normals.
        let normals = Matrix2::new(-u.y, u.x, -v.y, v.x);
        let inverse = Matrix2::new(v.x, -u.x, v.y, -u.y) / sine;
        debug_assert!((normals * inverse - Matrix2::identity()).amax() < 1e-6);
        let mut variances = Matrix2::from_diagonal(&[sds[0] * sds[0], sds[1] * sds[1]].into());
        if owners[0] == owners[1] {
            // Both walls move with their object: the errors across them are parts of one.
            let together = normals * normals.transpose() * (sds[0] * sds[0]);
            variances = together;
        }
        let place = inverse * variances * inverse.transpose();
        // The mean of two directions, whatever they share: no standard deviation is more than the mean of theirs.
        let turns = [(sds[0], first), (sds[1], second)].map(|(sd, run)| turn_sd(sd, run.length()));
        let heading_sd = f64::midpoint(turns[0], turns[1]);
        let error = (Covariance::symmetrised(place), heading_sd);
        Some(self.landmark(kind, owners, at, heading, error, free))
    }

    /// The end of something too thin for corners: a short way to the right between two walls that go back alongside each
    /// other, straight or in small steps.
    fn thin_end(&self, before: &Run, between: &[Run], after: &Run) -> Option<PlannedLandmark> {
        let config = self.config;
        let across = after.from.metres() - before.to.metres();
        let width = across.norm();
        let (u, v, w) = (before.direction(), across / width, after.direction());
        let square = (1.0 - config.corner_sine_min.powi(2)).sqrt();
        let turns_right = u.perp(&v) < -square && v.perp(&w) < -square;
        let way: f64 = between.iter().map(Run::length).sum();
        if !turns_right || width >= config.wall_min || way > width + 2.0 * config.bevel_max {
            return None;
        }
        if self.is_jamb(before.to) || between.iter().any(|run| self.is_jamb(run.to)) {
            return None;
        }
        let outward = (u - w).normalize();
        let owners = [between.first()?.owners[0], between.last()?.owners[1]];
        let sd = self.plan.owner(owners[0]).tolerance.max(self.plan.owner(owners[1]).tolerance);
        // Two faces tell the direction of one wall.
        let length = before.length().min(after.length());
        let error = (Covariance::from_variances([sd * sd, sd * sd]), turn_sd(sd, length));
        let heading = outward.y.atan2(outward.x);
        let middle = middle(before.to, after.from);
        Some(self.landmark(LandmarkKind::WallEnd, owners, middle, heading, error, width))
    }

    fn of_sheet(&self, runs: &[Run], ends_free: [bool; 2], found: &mut Vec<PlannedLandmark>) {
        for pair in runs.windows(2) {
            found.extend(
                [false, true]
                    .into_iter()
                    .filter_map(|behind| self.corner(&pair[0], &pair[1], behind)),
            );
        }
        let (Some(first), Some(last)) = (runs.first(), runs.last()) else { return };
        if first.from == last.to {
            if runs.len() > 2 {
                found.extend(
                    [false, true].into_iter().filter_map(|behind| self.corner(last, first, behind)),
                );
            }
            return;
        }
        let back =
            Run { from: first.to, to: first.from, owners: [first.owners[1], first.owners[0]] };
        for (run, free) in [(back, ends_free[0]), (*last, ends_free[1])] {
            if free && run.length() >= self.config.wall_min && !self.is_jamb(run.to) {
                let sd = self.plan.owner(run.owners[1]).tolerance;
                let place = Covariance::from_variances([sd * sd, sd * sd]);
                let error = (place, turn_sd(sd, run.length()));
                let u = run.direction();
                let owners = [run.owners[1]; 2];
                let heading = u.y.atan2(u.x);
                found.push(self.landmark(
                    LandmarkKind::WallEnd,
                    owners,
                    run.to,
                    heading,
                    error,
                    0.0,
                ));
            }
        }
    }

    fn of_opening(&self, opening: &Opening) -> Option<PlannedLandmark> {
        let length = |side: &&super::OpeningSide| side.from.distance(side.to);
        let widest =
            opening.sides.iter().max_by(|a, b| length(a).total_cmp(&length(b)).then(b.cmp(a)))?;
        let width = length(&widest);
        let u = (widest.to.metres() - widest.from.metres()) / width;
        // The other face of the wall, if it is open too: as wide as this one, up to how far it is askew.
        let across = |side: &&super::OpeningSide| {
            let v = side.to.metres() - side.from.metres();
            *side != widest && u.dot(&v) < -width / 2.0
        };
        let opposite =
            opening.sides.iter().filter(across).max_by(|a, b| length(a).total_cmp(&length(b)));
        let at = match opposite {
            Some(other) => middle(middle(widest.from, widest.to), middle(other.from, other.to)),
            None => middle(widest.from, widest.to),
        };
        let doorway = self.plan.owner_of(opening.doorway)?;
        let wall = self.plan.owner_of(widest.wall)?;
        let normal = (-u.x).atan2(u.y);
        let heading = if normal > FRAC_PI_2 {
            normal - PI
        } else if normal <= -FRAC_PI_2 {
            normal + PI
        } else {
            normal
        };
        // Along the wall it is the doorway's place that matters, across it the wall's.
        let turned = Matrix2::new(u.x, -u.y, u.y, u.x);
        let variances = [doorway.tolerance.powi(2), wall.tolerance.powi(2)];
        let place = turned * Matrix2::from_diagonal(&variances.into()) * turned.transpose();
        let id =
            LandmarkId { kind: LandmarkKind::Doorway, objects: sorted([doorway.id, wall.id]), at };
        let landmark = Landmark {
            kind: id.kind,
            at: at.metres(),
            direction: heading,
            covariance: Covariance::symmetrised(place),
            direction_sd: turn_sd(wall.tolerance, width),
        };
        Some(PlannedLandmark { id, landmark, extent: width })
    }

    fn landmark(
        &self,
        kind: LandmarkKind,
        owners: [u32; 2],
        at: PlanPoint,
        direction: f64,
        (covariance, direction_sd): (Covariance<2>, f64),
        extent: f64,
    ) -> PlannedLandmark {
        let objects = sorted(owners.map(|owner| self.plan.owner(owner).id));
        let id = LandmarkId { kind, objects, at };
        let landmark = Landmark { kind, at: at.metres(), direction, covariance, direction_sd };
        PlannedLandmark { id, landmark, extent }
    }
}

fn join(last: &mut Run, next: &Run) {
    last.to = next.to;
    last.owners[1] = next.owners[1];
}

fn sorted(mut objects: [ObjectId; 2]) -> [ObjectId; 2] {
    objects.sort_unstable();
    objects
}

fn middle(a: PlanPoint, b: PlanPoint) -> PlanPoint {
    PlanPoint { x: (a.x + b.x).div_euclid(2), y: (a.y + b.y).div_euclid(2) }
}

/// Standard deviation of a direction, both ends of `length` being off by `sd` across it. Never more than that of
/// a direction of which nothing is known.
fn turn_sd(sd: f64, length: f64) -> f64 {
    (std::f64::consts::SQRT_2 * sd / length).min(PI / 3.0_f64.sqrt())
}
