//! What no line explains, as clusters in convex hulls.
//!
//! A hull claims all that it covers, so a cluster never grows beyond a given extent: what is
//! longer is cut, preferably where its points are far apart. Hulls are those of the raw points; their uncertainty stands
//! beside them and does not blow them up.

use std::ops::Range;

use mapfold_map::geometry::{
    Covariance, Point, convex_hull_into, convex_hull_of_sweep, distance_to_hull,
};
use nalgebra::Matrix2;

use super::points::ScanPoint;
use crate::sensor::ScannerProfile;

/// What makes a cluster.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClusterConfig {
    /// Fewest points.
    pub points_min: usize,
    /// Stretches of points whose hulls are closer than this are one thing, metres.
    pub join_distance: f64,
    /// Largest distance between two points of one cluster, metres.
    pub extent_max: f64,
    /// Most points of a hull.
    pub hull_points_max: usize,
    /// Error that all beams share, metres.
    pub systematic_sd: f64,
}

impl ClusterConfig {
    /// The settings that follow from a scanner's profile.
    pub fn for_scanner(profile: &ScannerProfile) -> Self {
        Self {
            points_min: 3,
            join_distance: 0.15,
            extent_max: 1.0,
            hull_points_max: 64,
            systematic_sd: profile.systematic_sd_m,
        }
    }
}

/// A cluster in the sensor frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FoundCluster {
    /// Convex hull, counter-clockwise.
    pub(super) hull: Vec<Point>,
    /// Corners of the box around it.
    min: Point,
    max: Point,
    /// Number of points.
    pub(super) count: usize,
    /// Sum of the points.
    sum: Point,
    /// Sum of their covariances: xx, xy, yy.
    variances: [f64; 3],
    /// Sum of the variances that neighbours share.
    shared: f64,
}

impl FoundCluster {
    /// Mean of the points.
    pub(super) fn centroid(&self) -> Point {
        self.sum / self.count as f64
    }

    /// Covariance of the mean: more points do not average out what all beams share.
    pub(super) fn covariance(&self, config: &ClusterConfig) -> Covariance<2> {
        let share = 1.0 / (self.count as f64 * self.count as f64);
        let [xx, xy, yy] = self.variances;
        let floor = config.systematic_sd * config.systematic_sd + self.shared / self.count as f64;
        let own = Covariance::new(Matrix2::new(xx, xy, xy, yy)).unwrap_or_else(|_not_finite| {
            // Points without a finite variance have no finite mean either.
            Covariance::zero()
        });
        own.scaled(share) + Covariance::from_variances([floor; 2])
    }

    fn add(&mut self, other: &Self) {
        self.min = self.min.inf(&other.min);
        self.max = self.max.sup(&other.max);
        self.count += other.count;
        self.sum += other.sum;
        self.shared += other.shared;
        for (own, more) in self.variances.iter_mut().zip(other.variances) {
            *own += more;
        }
    }

    fn is_near(&self, other: &Self, distance: f64) -> bool {
        let apart = (self.min - other.max).sup(&(other.min - self.max));
        if apart.x > distance || apart.y > distance {
            return false;
        }
        let reaches =
            |hull: &[Point], to: &[Point]| hull.iter().any(|p| distance_to_hull(p, to) < distance);
        reaches(&self.hull, &other.hull) || reaches(&other.hull, &self.hull)
    }
}

/// A stretch of points and the cluster that it went into.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Part {
    /// The points.
    pub(super) points: Range<usize>,
    /// Index of the cluster.
    pub(super) cluster: usize,
}

/// Gathers clusters; what it allocates it uses again.
#[derive(Debug, Default)]
pub(super) struct Gatherer {
    /// The clusters, those with too few points among them.
    pub(super) found: Vec<FoundCluster>,
    /// What they are made of.
    pub(super) parts: Vec<Part>,
    waiting: Vec<Range<usize>>,
    corners: Vec<Point>,
    hull: Vec<Point>,
    /// Hulls that are no longer needed.
    spare: Vec<Vec<Point>>,
}

impl Gatherer {
    /// Takes back a hull that was given away.
    pub(super) fn recycle(&mut self, hull: Vec<Point>) {
        self.spare.push(hull);
    }

    /// Gathers the stretches of points that no line took into clusters.
    pub(super) fn gather(
        &mut self,
        points: &[ScanPoint],
        loose: &[Range<usize>],
        config: &ClusterConfig,
    ) {
        // Hulls that were given away come back by themselves.
        let left = self.found.drain(..).map(|cluster| cluster.hull).filter(|h| h.capacity() > 0);
        self.spare.extend(left);
        self.parts.clear();
        // Room for any stretch: how long they are is chance. Each side of a hull is begun with all of its points.
        self.corners.clear();
        self.corners.reserve(points.len());
        self.hull.clear();
        self.hull.reserve(2 * points.len());
        for stretch in loose {
            self.waiting.push(stretch.clone());
            while let Some(range) = self.waiting.pop() {
                if let Some(cluster) = self.whole(points, &range, config) {
                    self.join(range, cluster, config);
                } else {
                    let cut = best_cut(points, &range);
                    self.waiting.push(cut..range.end);
                    self.waiting.push(range.start..cut);
                }
            }
        }
    }

    /// A stretch as one cluster, unless it is too large for that.
    fn whole(
        &mut self,
        points: &[ScanPoint],
        range: &Range<usize>,
        config: &ClusterConfig,
    ) -> Option<FoundCluster> {
        let first = points[range.start].at;
        let (mut min, mut max, mut sum) = (first, first, Point::zeros());
        let (mut variances, mut shared) = ([0.0; 3], 0.0);
        for point in &points[range.clone()] {
            min = min.inf(&point.at);
            max = max.sup(&point.at);
            sum += point.at;
            let (xx, xy, yy) = point.entries();
            shared += point.variance_shared;
            variances = [variances[0] + xx, variances[1] + xy, variances[2] + yy];
        }
        let several = range.len() > 1;
        if several && (max - min).max() > config.extent_max {
            return None;
        }
        self.corners.clear();
        self.corners.extend(points[range.clone()].iter().map(|p| p.at));
        let [first, last] = [&points[range.start], &points[range.end - 1]];
        if range.len() > 2 && first.direction.perp(&last.direction) > 0.0 {
            convex_hull_of_sweep(&self.corners, &mut self.hull);
        } else {
            convex_hull_into(&mut self.corners, &mut self.hull);
        }
        let hull = self.kept_hull(config, several)?;
        Some(FoundCluster { hull, min, max, count: range.len(), sum, variances, shared })
    }

    /// The hull of the points in `corners`, unless it must be small and is not.
    fn hull_of_corners(&mut self, config: &ClusterConfig, small: bool) -> Option<Vec<Point>> {
        convex_hull_into(&mut self.corners, &mut self.hull);
        self.kept_hull(config, small)
    }

    /// A copy of the last hull, unless it must be small and is not.
    fn kept_hull(&mut self, config: &ClusterConfig, small: bool) -> Option<Vec<Point>> {
        if small && !is_small(&self.hull, config) {
            return None;
        }
        let room = || Vec::with_capacity(config.hull_points_max);
        let mut hull = self.spare.pop().unwrap_or_else(room);
        hull.clear();
        hull.extend_from_slice(&self.hull);
        Some(hull)
    }

    /// Joins a cluster to the first that is near enough and stays small enough with it.
    fn join(&mut self, points: Range<usize>, cluster: FoundCluster, config: &ClusterConfig) {
        for at in 0..self.found.len() {
            let other = &self.found[at];
            let extent = (other.max.sup(&cluster.max) - other.min.inf(&cluster.min)).max();
            if extent > config.extent_max || !other.is_near(&cluster, config.join_distance) {
                continue;
            }
            self.corners.clear();
            self.corners.extend(other.hull.iter().chain(&cluster.hull));
            if let Some(hull) = self.hull_of_corners(config, true) {
                let other = &mut self.found[at];
                self.spare.push(std::mem::replace(&mut other.hull, hull));
                other.add(&cluster);
                self.spare.push(cluster.hull);
                self.parts.push(Part { points, cluster: at });
                return;
            }
        }
        self.parts.push(Part { points, cluster: self.found.len() });
        self.found.push(cluster);
    }
}

fn is_small(hull: &[Point], config: &ClusterConfig) -> bool {
    let limit = config.extent_max * config.extent_max;
    hull.len() <= config.hull_points_max
        && hull
            .iter()
            .enumerate()
            .all(|(i, a)| hull[i + 1..].iter().all(|b| (b - a).norm_squared() <= limit))
}

/// Where to cut: before a point that is far from its predecessor, and not too near either end.
fn best_cut(points: &[ScanPoint], range: &Range<usize>) -> usize {
    let mut best = (range.start + 1, f64::NEG_INFINITY);
    for cut in range.start + 1..range.end {
        let gap = (points[cut].at - points[cut - 1].at).norm();
        let smaller = (cut - range.start).min(range.end - cut);
        let score = gap * smaller as f64;
        if score > best.1 {
            best = (cut, score);
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perception::points::NoiseConfig;

    const NOISE: NoiseConfig =
        NoiseConfig { range_sd: 0.02, range_sd_per_metre: 0.0, bearing_sd: 0.002 };
    const CONFIG: ClusterConfig = ClusterConfig {
        points_min: 3,
        join_distance: 0.15,
        extent_max: 1.0,
        hull_points_max: 64,
        systematic_sd: 0.01,
    };

    fn points_at(at: &[(f64, f64)]) -> Vec<ScanPoint> {
        at.iter()
            .enumerate()
            .map(|(i, &(x, y))| {
                let p = Point::new(x, y);
                ScanPoint::new(i, p.norm(), p / p.norm(), &NOISE)
            })
            .collect()
    }

    /// The cluster of each stretch.
    fn gathered(points: &[ScanPoint], loose: &[Range<usize>]) -> Vec<usize> {
        let mut gatherer = Gatherer::default();
        gatherer.gather(points, loose, &CONFIG);
        assert_eq!(gatherer.parts.len(), loose.len());
        gatherer.parts.iter().map(|part| part.cluster).collect()
    }

    #[test]
    fn near_stretches_join_and_far_ones_do_not() {
        let points = points_at(&[
            (2.0, 0.0),
            (2.05, 0.05),
            (2.0, 0.1), // one stretch
            (2.1, 0.15),
            (2.15, 0.2), // another, 11 cm from it
            (3.0, 1.0),
            (3.1, 1.0),
            (3.0, 1.1), // far away
            (5.0, 0.0), // alone
        ]);
        assert_eq!(gathered(&points, &[0..3, 3..5, 5..8, 8..9]), [0, 0, 1, 2]);
    }

    #[test]
    fn what_is_too_long_is_cut_at_its_widest_gap() {
        let points = points_at(&[
            (2.0, 0.0),
            (2.0, 0.2),
            (2.05, 0.4),
            (2.0, 0.75),
            (2.0, 0.95),
            (2.05, 1.15),
        ]);
        let mut gatherer = Gatherer::default();
        gatherer.gather(&points, std::slice::from_ref(&(0..6)), &CONFIG);
        let parts = [Part { points: 0..3, cluster: 0 }, Part { points: 3..6, cluster: 1 }];
        assert_eq!(gatherer.parts, parts);
    }

    #[test]
    fn the_mean_of_many_points_keeps_the_shared_error() {
        let points = points_at(&[(2.0, 0.0); 3]);
        let mut gatherer = Gatherer::default();
        gatherer.gather(&points, std::slice::from_ref(&(0..3)), &CONFIG);
        let c = gatherer.found[0].covariance(&CONFIG);
        assert!((c.matrix()[(0, 0)] - (4e-4 / 3.0 + 1e-4)).abs() < 1e-12);
    }
}
