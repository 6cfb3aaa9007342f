//! Contributions, between the wire and the map's types.

mod cluster;
mod evidence;
mod pose;
mod segment;

use mapfold_map::level::{Contribution, ContributionId};
use mapfold_map::raster;
use mapfold_map::vector::{ObservedCluster, ObservedEnd, ObservedSegment};
use uuid::{Uuid, Variant};

use super::number::read_instant;
use super::violations::{Place, Violation, Violations};
use super::{Limits, Target};
use crate::instant::to_rfc3339;
use crate::slug::is_slug;
use crate::v1;

/// The first microsecond of 2200.
const OBSERVED_BEFORE_US: i64 = 7_258_118_400_000_000;
/// Segments or clusters whose places fit the index of a feature's identity.
const FEATURES_MAX: usize = 1 << 16;

/// A contribution for the wire: what the map's type does not know is the level's `frame`,
/// whether the readings were `emulated`, and what the pose was told by.
pub fn wire_contribution(
    contribution: &Contribution,
    frame: Uuid,
    emulated: bool,
    basis: Option<v1::FixBasis>,
) -> v1::Contribution {
    let pose = &contribution.level_from_robot;
    v1::Contribution {
        id: Uuid::from_bytes(contribution.id.0),
        robot: contribution.robot.to_string(),
        frame,
        observed_at: to_rfc3339(contribution.observed_at_us),
        emulated,
        pose: v1::PoseEstimate {
            x_m: pose.pose.x,
            y_m: pose.pose.y,
            heading_rad: pose.pose.heading(),
            covariance: pose.covariance.rows(),
            provenance: contribution.provenance.into(),
            basis,
        },
        segments: contribution.segments.iter().map(wire_observed_segment).collect(),
        clusters: contribution.clusters.iter().map(wire_observed_cluster).collect(),
        evidence: contribution.evidence.iter().map(wire_evidence).collect(),
    }
}

fn wire_observed_segment(segment: &ObservedSegment) -> v1::ObservedSegment {
    v1::ObservedSegment {
        rho_m: segment.line.line.rho(),
        alpha_rad: segment.line.line.alpha(),
        covariance: segment.line.covariance.rows(),
        from_m: segment.from,
        to_m: segment.to,
        facing: segment.facing.into(),
        ends: segment
            .ends
            .map(|ObservedEnd { kind, sd }| v1::ObservedEnd { kind: kind.into(), sd_m: sd }),
        points: segment.points,
        seen_through_m: segment.seen_through.iter().map(|i| [i.from_m(), i.to_m()]).collect(),
    }
}

fn wire_observed_cluster(cluster: &ObservedCluster) -> v1::ObservedCluster {
    v1::ObservedCluster {
        hull_m: cluster.hull.iter().map(|p| [p.x, p.y]).collect(),
        centroid_m: [cluster.centroid.x, cluster.centroid.y],
        covariance: cluster.covariance.rows(),
        points: cluster.points,
    }
}

fn wire_evidence(evidence: &raster::EvidencePatch) -> v1::EvidencePatch {
    v1::EvidencePatch {
        sensor: evidence.class.into(),
        tiles: evidence
            .tiles
            .iter()
            .map(|(tile, patch)| v1::TilePatch {
                x: tile.x,
                y: tile.y,
                runs: patch
                    .runs()
                    .iter()
                    .flat_map(|r| [i32::from(r.start), i32::from(r.length), i32::from(r.value)])
                    .collect(),
            })
            .collect(),
    }
}

/// Checks a contribution against `target` and turns it into the map's own type.
///
/// What is only unusual is normalised, not refused: angles up to a full turn either way are
/// wrapped to (-pi, pi], -0 and subnormal numbers become 0, and covariances are floored, so that
/// no robot buys authority with a tiny one: a pose is uncertain by 5 mm and 0.05 degrees at least,
/// a line by 1 mm and 0.02 degrees, an end and a centroid by 1 mm. The log keeps what was sent.
///
/// # Errors
/// Everything that is wrong with it (at most 32 violations), each with the JSON pointer of its place.
pub fn check_contribution(
    contribution: &v1::Contribution,
    target: &Target,
) -> Result<Contribution, Vec<Violation>> {
    let limits = &target.limits;
    let root = Place::Root;
    let mut wrong = Violations::default();
    check_identity(contribution, target, &mut wrong);
    let observed_at =
        check_observed_at(&contribution.observed_at, &root.field("observed_at"), &mut wrong);
    let level_from_robot = pose::check(&contribution.pose, limits, &root.field("pose"), &mut wrong);
    let pose = level_from_robot.as_ref().map(|p| &p.pose);
    let segments = check_all(
        &contribution.segments,
        limits.segments_max,
        "segments",
        &mut wrong,
        |segment, place, wrong| segment::check(segment, pose, limits, place, wrong),
    );
    let clusters = check_all(
        &contribution.clusters,
        limits.clusters_max,
        "clusters",
        &mut wrong,
        |cluster, place, wrong| cluster::check(cluster, pose, limits, place, wrong),
    );
    check_extents(segments.as_deref(), clusters.as_deref(), limits, &mut wrong);
    let evidence =
        evidence::check(&contribution.evidence, target, &root.field("evidence"), &mut wrong);
    let assembled = || {
        Some(Contribution {
            id: ContributionId(contribution.id.into_bytes()),
            robot: contribution.robot.as_str().into(),
            observed_at_us: observed_at?,
            level_from_robot: level_from_robot?,
            provenance: contribution.pose.provenance.into(),
            segments: segments?,
            clusters: clusters?,
            evidence: evidence?,
        })
    };
    let assembled = assembled();
    wrong.none_or(assembled)
}

/// Whether all segments, and all clusters, are together no larger than one look can be.
fn check_extents(
    segments: Option<&[ObservedSegment]>,
    clusters: Option<&[ObservedCluster]>,
    limits: &Limits,
    wrong: &mut Violations,
) {
    let mut bound = |name, sum: f64, most: f64, code, of: &str| {
        if sum > most {
            let told = format_args!("{sum:.0} m of {of} in one look: {most} m is the most");
            wrong.add(&Place::Root.field(name), code, told);
        }
    };
    let length = segments.into_iter().flatten().map(|s| s.to - s.from).sum();
    bound("segments", length, limits.segments_length_max_m, "too_much_wall", "wall");
    let widths = clusters.into_iter().flatten().map(|c| cluster::width(&c.hull)).sum();
    bound("clusters", widths, limits.clusters_width_max_m, "too_wide_clusters", "clusters");
}

fn check_identity(contribution: &v1::Contribution, target: &Target, wrong: &mut Violations) {
    let root = Place::Root;
    let id = contribution.id;
    if id.get_version_num() != 7 || id.get_variant() != Variant::RFC4122 {
        wrong.add(&root.field("id"), "not_uuid_v7", "the id must be a UUID of version 7");
    }
    if !is_slug(&contribution.robot) {
        wrong.add(
            &root.field("robot"),
            "bad_slug",
            "a robot's name is 1 to 64 lower-case letters, digits and inner hyphens",
        );
    }
    let is_own = contribution.pose.provenance == v1::Provenance::OwnMap;
    if is_own && contribution.frame == target.frame {
        wrong.add(
            &root.field("frame"),
            "frame_mismatch",
            "this is the frame of the level: a robot's own map has a frame of its own",
        );
    }
    if !is_own && contribution.frame != target.frame {
        wrong.add(
            &root.field("frame"),
            "frame_mismatch",
            format_args!(
                "the frame of this level is {}: the pose and the evidence must be in it",
                target.frame
            ),
        );
    }
}

/// When it was seen: an instant from 1970 on and before 2200, which keeps every sum of instants
/// and every text form of one in range.
fn check_observed_at(text: &str, place: &Place<'_>, wrong: &mut Violations) -> Option<i64> {
    let instant = read_instant(text, place, wrong)?;
    if (0..OBSERVED_BEFORE_US).contains(&instant) {
        return Some(instant);
    }
    wrong.add(place, "out_of_range", "this must lie from 1970 on and before 2200: check the clock");
    None
}

/// Checks the members of the array `name`, unless there are too many of them.
fn check_all<W, V>(
    all: &[W],
    max: usize,
    name: &'static str,
    wrong: &mut Violations,
    check: impl Fn(&W, &Place<'_>, &mut Violations) -> Option<V>,
) -> Option<Vec<V>> {
    let root = Place::Root;
    let place = root.field(name);
    let max = max.min(FEATURES_MAX);
    if all.len() > max {
        let n = all.len();
        wrong.add(
            &place,
            &format!("too_many_{name}"),
            format_args!("{n} {name}: one look has at most {max}"),
        );
        return None;
    }
    let mut checked = Vec::with_capacity(all.len());
    for (i, one) in all.iter().enumerate() {
        if wrong.is_full() {
            return None;
        }
        checked.extend(check(one, &place.index(i), wrong));
    }
    Some(checked)
}
