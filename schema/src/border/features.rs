//! Published features and tiles, between the wire and the map's types, both ways and bit for bit.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_map::geometry::{Interval, Line, Point};
use mapfold_map::level::{self, ContributionId, FeatureId, RobotName};
use mapfold_map::raster::{LogOdds, TILE_CELLS, TILE_SIDE, Tile, TileIndex, TileKey};
use mapfold_map::vector::{Cluster, Segment, SolidInterval};
use uuid::Uuid;

use super::chains::{chain_id, read_chain, read_chain_id, wire_chain};
use super::number::{covariance, finite, read_instant};
use super::violations::{Place, Violation, Violations};
use crate::instant::to_rfc3339;
use crate::slug::is_slug;
use crate::v1;

/// Largest coordinate along a line that a millimetre text survives, metres: far beyond any level.
const ALONG_MAX_M: f64 = 1e9;

/// Farthest tile whose cells' numbers fit 32 bits.
pub(super) const TILE_INDEX_MAX: u32 = i32::MAX as u32 / TILE_SIDE as u32 - 1;

/// The text form of a feature's identity: `<contribution uuid>-<index>`.
pub fn feature_id(id: &FeatureId) -> String {
    format!("{}-{}", Uuid::from_bytes(id.contribution.0), id.index)
}

/// A feature's identity from its text form; `None` for anything that [`feature_id`] does not write.
pub fn parse_feature_id(text: &str) -> Option<FeatureId> {
    let (uuid, index) = text.rsplit_once('-')?;
    let id = FeatureId {
        contribution: ContributionId(Uuid::try_parse(uuid).ok()?.into_bytes()),
        index: index.parse().ok()?,
    };
    (feature_id(&id) == text).then_some(id)
}

/// A segment for the wire.
pub fn wire_segment(id: &FeatureId, segment: &Segment) -> v1::Segment {
    v1::Segment {
        id: feature_id(id),
        rho_m: segment.line.rho(),
        alpha_rad: segment.line.alpha(),
        covariance: (segment.independent + segment.dependent).rows(),
        covariance_independent: segment.independent.rows(),
        covariance_dependent: segment.dependent.rows(),
        facing: segment.facing.into(),
        solid: segment.solid.iter().map(wire_solid).collect(),
        quality: segment.looks,
        robots: segment.robots.iter().map(ToString::to_string).collect(),
        first_seen: to_rfc3339(segment.first_seen_us),
        last_seen: to_rfc3339(segment.last_seen_us),
    }
}

fn wire_solid(solid: &SolidInterval) -> v1::SolidInterval {
    v1::SolidInterval {
        from_m: solid.span.from_m(),
        to_m: solid.span.to_m(),
        ends: solid.ends.map(Into::into),
        existence_nat: solid.existence.nat(),
    }
}

/// A segment from the wire.
///
/// # Errors
/// The first thing that is wrong with it; the pointer is relative to the segment.
pub fn map_segment(segment: &v1::Segment) -> Result<(FeatureId, Segment), Violation> {
    alone(|wrong| read_segment(segment, &Place::Root, wrong))
}

/// A cluster for the wire.
pub fn wire_cluster(id: &FeatureId, cluster: &Cluster) -> v1::Cluster {
    v1::Cluster {
        id: feature_id(id),
        hull_m: cluster.hull.iter().map(|p| [p.x, p.y]).collect(),
        centroid_m: [cluster.centroid.x, cluster.centroid.y],
        covariance: cluster.covariance.rows(),
        points: cluster.points,
        quality: cluster.looks,
        robots: cluster.robots.iter().map(ToString::to_string).collect(),
        first_seen: to_rfc3339(cluster.first_seen_us),
        last_seen: to_rfc3339(cluster.last_seen_us),
    }
}

/// A cluster from the wire.
///
/// # Errors
/// The first thing that is wrong with it; the pointer is relative to the cluster.
pub fn map_cluster(cluster: &v1::Cluster) -> Result<(FeatureId, Cluster), Violation> {
    alone(|wrong| read_cluster(cluster, &Place::Root, wrong))
}

/// A tile for the wire: the longest possible runs, so that equal tiles give equal runs.
pub fn wire_tile(key: &TileKey, tile: &Tile) -> v1::TileEvidence {
    let (TileIndex { x, y }, runs) = (key.tile, wire_runs(tile));
    v1::TileEvidence { sensor: key.class.into(), x, y, runs }
}

/// Equal cells in a row as start, length, value.
fn wire_runs(tile: &Tile) -> Vec<i32> {
    let mut runs: Vec<i32> = Vec::new();
    let mut start = 0;
    for chunk in tile.cells().chunk_by(|a, b| a == b) {
        if chunk[0] != 0 {
            runs.extend([start, chunk.len() as i32, chunk[0]]);
        }
        start += chunk.len() as i32;
    }
    runs
}

/// A tile from the wire.
///
/// # Errors
/// The first thing that is wrong with it; the pointer is relative to the tile.
pub fn map_tile(tile: &v1::TileEvidence) -> Result<(TileKey, Tile), Violation> {
    alone(|wrong| read_tile(tile, &Place::Root, wrong))
}

/// A patch for the wire: what leads from revision `since` to `revision`, and whether there is
/// `more` to ask for.
pub fn wire_patch(patch: &level::Patch, since: i64, revision: i64, more: bool) -> v1::Patch {
    v1::Patch {
        since,
        revision,
        more,
        segments: patch.segments.iter().map(|(id, s)| wire_segment(id, s)).collect(),
        clusters: patch.clusters.iter().map(|(id, c)| wire_cluster(id, c)).collect(),
        chains: patch.chains.iter().map(|(id, c)| wire_chain(id, c)).collect(),
        tiles: patch.tiles.iter().map(|(key, t)| wire_tile(key, t)).collect(),
        prior: patch
            .prior
            .iter()
            .map(|(at, tile)| v1::PriorTile { x: at.x, y: at.y, runs: wire_runs(tile) })
            .collect(),
        removed: v1::Removed {
            segments: patch.removed_segments.iter().map(feature_id).collect(),
            clusters: patch.removed_clusters.iter().map(feature_id).collect(),
            chains: patch.removed_chains.iter().map(chain_id).collect(),
            tiles: patch.removed_tiles.iter().map(wire_tile_address).collect(),
            prior: patch
                .removed_prior
                .iter()
                .map(|at| v1::TilePlace { x: at.x, y: at.y })
                .collect(),
        },
    }
}

/// A tile's address for the wire.
pub fn wire_tile_address(key: &TileKey) -> v1::TileAddress {
    v1::TileAddress { sensor: key.class.into(), x: key.tile.x, y: key.tile.y }
}

/// A tile's address from the wire.
pub fn map_tile_address(address: &v1::TileAddress) -> TileKey {
    TileKey { class: address.sensor.into(), tile: TileIndex { x: address.x, y: address.y } }
}

/// A patch from the wire, for a mirror.
///
/// # Errors
/// Everything that is wrong with it (at most 32 violations), each with the JSON pointer of its place.
pub fn map_patch(patch: &v1::Patch) -> Result<level::Patch, Vec<Violation>> {
    let mut wrong = Violations::default();
    let root = Place::Root;
    let removed = root.field("removed");
    let read = level::Patch {
        segments: read_all(&patch.segments, &root.field("segments"), &mut wrong, read_segment),
        clusters: read_all(&patch.clusters, &root.field("clusters"), &mut wrong, read_cluster),
        chains: read_all(&patch.chains, &root.field("chains"), &mut wrong, read_chain),
        tiles: read_all(&patch.tiles, &root.field("tiles"), &mut wrong, read_tile),
        prior: read_all(&patch.prior, &root.field("prior"), &mut wrong, |tile, place, wrong| {
            read_cells([tile.x, tile.y], &tile.runs, place, wrong)
        }),
        removed_segments: read_ids(
            &patch.removed.segments,
            &removed.field("segments"),
            &mut wrong,
            read_id,
        ),
        removed_clusters: read_ids(
            &patch.removed.clusters,
            &removed.field("clusters"),
            &mut wrong,
            read_id,
        ),
        removed_chains: read_ids(
            &patch.removed.chains,
            &removed.field("chains"),
            &mut wrong,
            read_chain_id,
        ),
        removed_tiles: patch.removed.tiles.iter().map(map_tile_address).collect(),
        removed_prior: patch
            .removed
            .prior
            .iter()
            .map(|at| TileIndex { x: at.x, y: at.y })
            .collect(),
    };
    wrong.none_or(Some(read))
}

fn read_all<W, K: Ord, V>(
    all: &[W],
    place: &Place<'_>,
    wrong: &mut Violations,
    read: impl Fn(&W, &Place<'_>, &mut Violations) -> Option<(K, V)>,
) -> BTreeMap<K, Arc<V>> {
    let mut by_key = BTreeMap::new();
    for (i, one) in all.iter().enumerate() {
        let place = place.index(i);
        if let Some((key, value)) = read(one, &place, wrong)
            && by_key.insert(key, Arc::new(value)).is_some()
        {
            wrong.add(&place, "duplicate", "this is here twice: each must be here once");
        }
    }
    by_key
}

fn read_ids<K>(
    texts: &[String],
    place: &Place<'_>,
    wrong: &mut Violations,
    read: impl Fn(&str, &Place<'_>, &mut Violations) -> Option<K>,
) -> Vec<K> {
    texts.iter().enumerate().filter_map(|(i, text)| read(text, &place.index(i), wrong)).collect()
}

pub(super) fn alone<T>(read: impl FnOnce(&mut Violations) -> Option<T>) -> Result<T, Violation> {
    let mut wrong = Violations::default();
    let value = read(&mut wrong);
    wrong.none_or(value).map_err(|found| {
        found.into_iter().next().unwrap_or_else(|| Violation {
            pointer: String::new(),
            code: "unreadable".to_owned(),
            detail: "this cannot be read".to_owned(),
        })
    })
}

fn read_segment(
    segment: &v1::Segment,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<(FeatureId, Segment)> {
    let id = read_id(&segment.id, &place.field("id"), wrong);
    let line = read_line(segment, place, wrong);
    let independent =
        covariance(&segment.covariance_independent, &place.field("covariance_independent"), wrong);
    let dependent =
        covariance(&segment.covariance_dependent, &place.field("covariance_dependent"), wrong);
    let solid = read_solids(&segment.solid, &place.field("solid"), wrong);
    let seen = read_seen(&segment.robots, &segment.first_seen, &segment.last_seen, place, wrong);
    let (independent, dependent, seen) = (independent?, dependent?, seen?);
    if (independent + dependent).rows() != segment.covariance {
        wrong.add(
            &place.field("covariance"),
            "covariance_not_sum",
            "this must be the sum of covariance_independent and covariance_dependent",
        );
    }
    Some((
        id?,
        Segment {
            line: line?,
            independent,
            dependent,
            facing: segment.facing.into(),
            solid,
            looks: segment.quality,
            robots: seen.robots,
            first_seen_us: seen.first_us,
            last_seen_us: seen.last_us,
        },
    ))
}

/// The line, which must be in normal form already: bringing it there would change its bits.
fn read_line(
    segment: &v1::Segment,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Line<mapfold_map::geometry::Level>> {
    let rho = finite(segment.rho_m, &place.field("rho_m"), wrong);
    let alpha = finite(segment.alpha_rad, &place.field("alpha_rad"), wrong);
    let (rho, alpha) = (rho?, alpha?);
    let (line, turned) = Line::normal_form(rho, alpha);
    if turned {
        wrong.add(&place.field("rho_m"), "negative", "rho_m must not be negative");
    } else if line.alpha().to_bits() != alpha.to_bits() {
        wrong.add(&place.field("alpha_rad"), "not_wrapped", "alpha_rad must lie in (-pi, pi]");
    }
    Some(line)
}

fn read_solids(
    solids: &[v1::SolidInterval],
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Vec<SolidInterval> {
    let mut read: Vec<SolidInterval> = Vec::with_capacity(solids.len());
    for (i, solid) in solids.iter().enumerate() {
        let place = place.index(i);
        let from = millimetres(solid.from_m, &place.field("from_m"), wrong);
        let to = millimetres(solid.to_m, &place.field("to_m"), wrong);
        let existence = hundredths(solid.existence_nat, &place.field("existence_nat"), wrong);
        let (Some(from), Some(to), Some(existence)) = (from, to, existence) else { continue };
        if from >= to || read.last().is_some_and(|before| before.span.to > from) {
            wrong.add(
                &place,
                "out_of_order",
                "solid parts ascend, apart from each other, from_m before to_m",
            );
        }
        let ends = solid.ends.map(Into::into);
        read.push(SolidInterval { span: Interval { from, to }, ends, existence });
    }
    read
}

fn millimetres(metres: f64, place: &Place<'_>, wrong: &mut Violations) -> Option<i64> {
    let metres = finite(metres, place, wrong)?;
    if metres.abs() > ALONG_MAX_M {
        wrong.add(place, "out_of_range", "this lies beyond any level");
        return None;
    }
    let along = Interval::from_metres(metres, metres);
    if along.from_m().to_bits() != metres.to_bits() {
        wrong.add(place, "not_millimetres", "this must be a whole number of millimetres");
        return None;
    }
    Some(along.from)
}

fn hundredths(nat: f64, place: &Place<'_>, wrong: &mut Violations) -> Option<LogOdds> {
    let nat = finite(nat, place, wrong)?;
    let log_odds = LogOdds::from_nat(nat);
    if log_odds.nat().to_bits() != nat.to_bits() {
        wrong.add(place, "not_hundredths", "this must be a whole number of hundredths of a nat");
        return None;
    }
    Some(log_odds)
}

fn read_cluster(
    cluster: &v1::Cluster,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<(FeatureId, Cluster)> {
    let id = read_id(&cluster.id, &place.field("id"), wrong);
    let hull_place = place.field("hull_m");
    if cluster.hull_m.is_empty() {
        wrong.add(&hull_place, "empty", "a hull has at least one point");
    }
    let hull: Vec<Point> = cluster
        .hull_m
        .iter()
        .enumerate()
        .filter_map(|(i, p)| read_point(*p, &hull_place.index(i), wrong))
        .collect();
    let centroid = read_point(cluster.centroid_m, &place.field("centroid_m"), wrong);
    let covariance = covariance(&cluster.covariance, &place.field("covariance"), wrong);
    let seen = read_seen(&cluster.robots, &cluster.first_seen, &cluster.last_seen, place, wrong)?;
    Some((
        id?,
        Cluster {
            hull,
            centroid: centroid?,
            covariance: covariance?,
            points: cluster.points,
            looks: cluster.quality,
            robots: seen.robots,
            first_seen_us: seen.first_us,
            last_seen_us: seen.last_us,
        },
    ))
}

/// A point in metres, as two finite numbers.
pub(super) fn read_point(
    [x, y]: [f64; 2],
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Point> {
    let x = finite(x, &place.index(0), wrong);
    let y = finite(y, &place.index(1), wrong);
    Some(Point::new(x?, y?))
}

fn read_tile(
    tile: &v1::TileEvidence,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<(TileKey, Tile)> {
    let (at, cells) = read_cells([tile.x, tile.y], &tile.runs, place, wrong)?;
    Some((TileKey { class: tile.sensor.into(), tile: at }, cells))
}

fn read_cells(
    [x, y]: [i32; 2],
    runs: &[i32],
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<(TileIndex, Tile)> {
    for (at, name) in [(x, "x"), (y, "y")] {
        if at.unsigned_abs() > TILE_INDEX_MAX {
            wrong.add(&place.field(name), "out_of_range", "this lies beyond any level");
        }
    }
    let place = place.field("runs");
    let mut cells = Box::new([0; TILE_CELLS]);
    let (runs, rest) = runs.as_chunks::<3>();
    if !rest.is_empty() {
        wrong.add(
            &place,
            "not_triples",
            "runs are start, length, value, start, length, value, ...",
        );
        return None;
    }
    let mut free_from = 0;
    for (i, &[start, length, value]) in runs.iter().enumerate() {
        let range = usize::try_from(start).ok().zip(usize::try_from(length).ok());
        let range = range.map(|(start, length)| start..start.saturating_add(length));
        match range.filter(|r| r.start >= free_from && !r.is_empty() && value != 0) {
            Some(range) if range.end <= TILE_CELLS => {
                free_from = range.end;
                cells[range].fill(value);
            }
            _ => {
                wrong.add(
                    &place.index(3 * i),
                    "bad_run",
                    "runs ascend within the tile's 4096 cells, do not overlap and are not empty",
                );
                return None;
            }
        }
    }
    Some((TileIndex { x, y }, Tile::new(cells)))
}

pub(super) fn read_id(text: &str, place: &Place<'_>, wrong: &mut Violations) -> Option<FeatureId> {
    let id = parse_feature_id(text);
    if id.is_none() {
        wrong.add(place, "bad_feature_id", "this must be <contribution uuid>-<index>");
    }
    id
}

/// Who saw a feature, and when.
pub(super) struct Seen {
    pub(super) robots: Vec<RobotName>,
    pub(super) first_us: i64,
    pub(super) last_us: i64,
}

pub(super) fn read_seen(
    robots: &[String],
    first: &str,
    last: &str,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Seen> {
    let robots_place = place.field("robots");
    for (i, robot) in robots.iter().enumerate() {
        if !is_slug(robot) {
            wrong.add(&robots_place.index(i), "bad_slug", "this must be the name of a robot");
        }
    }
    let first = read_instant(first, &place.field("first_seen"), wrong);
    let last = read_instant(last, &place.field("last_seen"), wrong);
    Some(Seen {
        robots: robots.iter().map(|r| RobotName::from(r.as_str())).collect(),
        first_us: first?,
        last_us: last?,
    })
}
