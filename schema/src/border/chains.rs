//! Published chains, between the wire and the map's types, both ways and bit for bit.

use mapfold_map::vector::{Chain, ChainId, ChainKind, Vertex};

use super::features::{alone, feature_id, parse_feature_id, read_id, read_point, read_seen};
use super::number::covariance;
use super::violations::{Place, Violation, Violations};
use crate::instant::to_rfc3339;
use crate::v1;

/// Fewest vertices of a closed chain.
const CLOSED_MIN: usize = 3;

/// The text form of a chain's identity: `<segment id>.<piece>`.
pub fn chain_id(id: &ChainId) -> String {
    format!("{}.{}", feature_id(&id.segment), id.piece)
}

/// A chain's identity from its text form; `None` for anything that [`chain_id`] does not write.
pub fn parse_chain_id(text: &str) -> Option<ChainId> {
    let (segment, piece) = text.rsplit_once('.')?;
    let id = ChainId { segment: parse_feature_id(segment)?, piece: piece.parse().ok()? };
    (chain_id(&id) == text).then_some(id)
}

/// A chain for the wire.
pub fn wire_chain(id: &ChainId, chain: &Chain) -> v1::Chain {
    v1::Chain {
        id: chain_id(id),
        kind: chain.kind.into(),
        closed: chain.kind.is_closed(),
        vertices_m: chain.vertices.iter().map(|vertex| [vertex.at.x, vertex.at.y]).collect(),
        covariances: chain.vertices.iter().map(|vertex| vertex.covariance.rows()).collect(),
        segments: chain.segments.iter().map(feature_id).collect(),
        quality: chain.looks,
        robots: chain.robots.iter().map(ToString::to_string).collect(),
        first_seen: to_rfc3339(chain.first_seen_us),
        last_seen: to_rfc3339(chain.last_seen_us),
    }
}

/// A chain from the wire.
///
/// # Errors
/// The first thing that is wrong with it; the pointer is relative to the chain.
pub fn map_chain(chain: &v1::Chain) -> Result<(ChainId, Chain), Violation> {
    alone(|wrong| read_chain(chain, &Place::Root, wrong))
}

pub(super) fn read_chain(
    chain: &v1::Chain,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<(ChainId, Chain)> {
    let id = read_chain_id(&chain.id, &place.field("id"), wrong);
    let kind = ChainKind::from(chain.kind);
    if chain.closed != kind.is_closed() {
        wrong.add(&place.field("closed"), "kind_mismatch", "all but polylines are closed");
    }
    let vertices = read_vertices(chain, place, wrong);
    let count = chain.vertices_m.len();
    let (least, edges) = if kind.is_closed() { (CLOSED_MIN, count) } else { (2, count.max(1) - 1) };
    if count < least {
        let place = place.field("vertices_m");
        wrong.add(&place, "too_few", "a polyline has at least two vertices, a polygon three");
    }
    let segments_place = place.field("segments");
    if chain.segments.len() != edges {
        wrong.add(&segments_place, "wrong_count", "there is one segment for each edge");
    }
    let segments = chain
        .segments
        .iter()
        .enumerate()
        .filter_map(|(i, text)| read_id(text, &segments_place.index(i), wrong))
        .collect();
    let seen = read_seen(&chain.robots, &chain.first_seen, &chain.last_seen, place, wrong)?;
    Some((
        id?,
        Chain {
            kind,
            vertices,
            segments,
            looks: chain.quality,
            robots: seen.robots,
            first_seen_us: seen.first_us,
            last_seen_us: seen.last_us,
        },
    ))
}

fn read_vertices(chain: &v1::Chain, place: &Place<'_>, wrong: &mut Violations) -> Vec<Vertex> {
    let covariances = place.field("covariances");
    if chain.covariances.len() != chain.vertices_m.len() {
        wrong.add(&covariances, "wrong_count", "there is one covariance for each vertex");
    }
    let vertices = place.field("vertices_m");
    let both = chain.vertices_m.iter().zip(&chain.covariances).enumerate();
    both.filter_map(|(i, (at, rows))| {
        let at = read_point(*at, &vertices.index(i), wrong);
        let covariance = covariance(rows, &covariances.index(i), wrong);
        Some(Vertex { at: at?, covariance: covariance? })
    })
    .collect()
}

pub(super) fn read_chain_id(
    text: &str,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<ChainId> {
    let id = parse_chain_id(text);
    if id.is_none() {
        wrong.add(place, "bad_chain_id", "this must be <segment id>.<piece>");
    }
    id
}
