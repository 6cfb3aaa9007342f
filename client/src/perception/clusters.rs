//! What no line explains, as clusters in convex hulls.
//!
//! A hull claims all that it covers, so a cluster never grows beyond a given extent: what is
//! longer is cut, preferably where its points are far apart. Hulls are those of the raw points; their uncertainty stands
//! beside them and does not blow them up.

use std::ops::Range;

use mapfold_map::geometry::{Covariance, Point, convex_hull, distance_to_hull};

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
pub struct FoundCluster {
    /// Indices of its points, ascending.
    pub members: Vec<usize>,
    /// Convex hull, counter-clockwise.
    pub hull: Vec<Point>,
    /// Mean of the points.
    pub centroid: Point,
    /// Covariance of the mean.
    pub covariance: Covariance<2>,
}

/// A stretch of points that may join others.
struct Group {
    members: Vec<usize>,
    hull: Vec<Point>,
    min: Point,
    max: Point,
}

impl Group {
    fn new(points: &[ScanPoint], members: Vec<usize>) -> Self {
        let at: Vec<Point> = members.iter().map(|&i| points[i].at).collect();
        let (mut min, mut max) = (at[0], at[0]);
        for p in &at {
            min = min.inf(p);
            max = max.sup(p);
        }
        Self { hull: convex_hull(&at), members, min, max }
    }

    fn extent(&self) -> f64 {
        let mut longest: f64 = 0.0;
        for (i, a) in self.hull.iter().enumerate() {
            for b in &self.hull[i + 1..] {
                longest = longest.max((b - a).norm());
            }
        }
        longest
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

/// Gathers the stretches of points that no line took into clusters.
pub fn clusters(
    points: &[ScanPoint],
    loose: &[Range<usize>],
    config: &ClusterConfig,
) -> Vec<FoundCluster> {
    let mut groups: Vec<Group> = Vec::new();
    for stretch in loose {
        let mut waiting = vec![stretch.clone().collect::<Vec<_>>()];
        while let Some(mut members) = waiting.pop() {
            let group = Group::new(points, members.clone());
            let fits =
                group.extent() <= config.extent_max && group.hull.len() <= config.hull_points_max;
            if fits || members.len() < 2 {
                groups.push(group);
            } else {
                let right = members.split_off(best_cut(points, &members));
                waiting.push(right);
                waiting.push(members);
            }
        }
    }
    // Each group joins the first earlier one that is near enough and stays small enough with it.
    let mut joined: Vec<Group> = Vec::new();
    for group in groups {
        let union = joined.iter().enumerate().find_map(|(i, other)| {
            if !other.is_near(&group, config.join_distance) {
                return None;
            }
            let members = other.members.iter().chain(&group.members).copied().collect();
            let union = Group::new(points, members);
            (union.extent() <= config.extent_max && union.hull.len() <= config.hull_points_max)
                .then_some((i, union))
        });
        match union {
            Some((i, union)) => joined[i] = union,
            None => joined.push(group),
        }
    }
    joined
        .into_iter()
        .filter(|g| g.members.len() >= config.points_min)
        .map(|g| describe(points, g, config))
        .collect()
}

/// Where to cut: before a point that is far from its predecessor, and not too near either end.
fn best_cut(points: &[ScanPoint], members: &[usize]) -> usize {
    let mut best = (1, f64::NEG_INFINITY);
    for (i, pair) in members.windows(2).enumerate() {
        let gap = (points[pair[1]].at - points[pair[0]].at).norm();
        let smaller = (i + 1).min(members.len() - i - 1);
        let score = gap * smaller as f64;
        if score > best.1 {
            best = (i + 1, score);
        }
    }
    best.0
}

fn describe(points: &[ScanPoint], group: Group, config: &ClusterConfig) -> FoundCluster {
    let count = group.members.len() as f64;
    let mean = group.members.iter().map(|&i| points[i].at).sum::<Point>() / count;
    let shared = group.members.iter().map(|&i| points[i].variance_shared).sum::<f64>() / count;
    let floor = config.systematic_sd.powi(2) + shared;
    let summed =
        group.members.iter().fold(Covariance::zero(), |sum, &i| sum + points[i].covariance());
    FoundCluster {
        covariance: summed.scaled(1.0 / (count * count)) + Covariance::from_variances([floor; 2]),
        centroid: mean,
        hull: group.hull,
        members: group.members,
    }
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
        let found = clusters(&points, &[0..3, 3..5, 5..8, 8..9], &CONFIG);
        let members: Vec<_> = found.iter().map(|c| c.members.clone()).collect();
        assert_eq!(members, [vec![0, 1, 2, 3, 4], vec![5, 6, 7]]);
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
        let found = clusters(&points, std::slice::from_ref(&(0..6)), &CONFIG);
        let members: Vec<_> = found.iter().map(|c| c.members.clone()).collect();
        assert_eq!(members, [vec![0, 1, 2], vec![3, 4, 5]]);
    }

    #[test]
    fn the_mean_of_many_points_keeps_the_shared_error() {
        let points = points_at(&[(2.0, 0.0); 3]);
        let c = describe(&points, Group::new(&points, vec![0, 1, 2]), &CONFIG).covariance;
        assert!((c.matrix()[(0, 0)] - (4e-4 / 3.0 + 1e-4)).abs() < 1e-12);
    }
}
