//! From pieces that are joined one after the other to chains whose outlines are valid.

use super::VectorConfig;
use super::chain::{Chain, ChainId, ChainKind, Vertex};
use super::crossing::{doubled_area, first_crossing};
use super::joinable::Joinable;
use super::joint::{Joint, free_end};
use super::piece::{Piece, PieceAt, PieceKey};
use super::slots::Slots;
use crate::geometry::Point;

/// A piece and how it is joined to the next one.
#[derive(Debug, Clone)]
pub(super) struct Link {
    pub(super) key: PieceKey,
    pub(super) at: PieceAt,
    pub(super) piece: Piece,
    /// From its head; `None` at the end of an open chain.
    pub(super) joint: Option<Joint>,
}

/// Pieces whose outline is valid.
#[derive(Debug)]
pub(super) struct SimplePart {
    pub(super) links: Vec<Link>,
    vertices: Vec<Vertex>,
    kind: ChainKind,
}

/// Fewest vertices of a ring.
const RING_MIN: usize = 3;

/// Takes joined pieces apart, at the worst joints, until no part meets itself or is too long.
/// What is left alone is not part of any chain.
pub(super) fn simple_parts(
    links: Vec<Link>,
    is_closed: bool,
    config: &VectorConfig,
) -> Vec<SimplePart> {
    let links = if is_closed {
        match ring(links, config) {
            Ring::Valid(part) => return vec![part],
            Ring::Opened(links) => links,
        }
    } else {
        links
    };
    let mut parts = Vec::new();
    let mut rest = vec![links];
    while let Some(links) = rest.pop() {
        if links.len() < 2 {
            continue;
        }
        let vertices = vertices(&links, false);
        let points: Vec<Point> = vertices.iter().map(|vertex| vertex.at).collect();
        let cut = if links.len() > config.chain_pieces_max {
            // In the middle half, so that halves come of it and not crumbs.
            let quarter = links.len() / 4;
            Some((quarter, links.len() - quarter))
        } else {
            // Two edges that meet have come together by the joints from one to the other.
            first_crossing(&points, false)
        };
        match cut {
            Some((from, to)) => {
                let at = worst_joint(&links, from, to);
                let mut head = links;
                let tail = head.split_off(at + 1);
                rest.extend([tail, head]);
            }
            None => parts.push(SimplePart { links, vertices, kind: ChainKind::Polyline }),
        }
    }
    parts
}

/// What comes of pieces that are joined full circle.
enum Ring {
    Valid(SimplePart),
    Opened(Vec<Link>),
}

/// A closed chain as a polygon or, if it would not be a valid one, opened at its worst joint.
fn ring(mut links: Vec<Link>, config: &VectorConfig) -> Ring {
    let vertices = vertices(&links, true);
    let points: Vec<Point> = vertices.iter().map(|vertex| vertex.at).collect();
    let doubled_area = doubled_area(&points);
    let is_valid = (RING_MIN..=config.chain_pieces_max).contains(&links.len())
        && first_crossing(&points, true).is_none()
        && doubled_area != 0.0;
    if is_valid {
        // Free space is on the left: inside of what runs counter-clockwise.
        let kind = if doubled_area > 0.0 { ChainKind::Room } else { ChainKind::Obstacle };
        return Ring::Valid(SimplePart { links, vertices, kind });
    }
    let count = links.len();
    let worst = worst_joint(&links, 0, count);
    links.rotate_left((worst + 1) % count.max(1));
    Ring::Opened(links)
}

/// The joint of the highest cost, among equals of the highest key, among those that leave the
/// links from `from` to before `to`.
fn worst_joint(links: &[Link], from: usize, to: usize) -> usize {
    let cost = |link: &Link| link.joint.map_or(f64::NEG_INFINITY, |joint| joint.cost);
    (from..to)
        .max_by(|a, b| {
            let (a, b) = (&links[*a], &links[*b]);
            cost(a).total_cmp(&cost(b)).then(a.key.cmp(&b.key))
        })
        .unwrap_or(from)
}

/// The vertices in order: of a closed chain as many as pieces, of an open one one more.
fn vertices(links: &[Link], is_closed: bool) -> Vec<Vertex> {
    let mut vertices = Vec::with_capacity(links.len() + 1);
    let Some((first, last)) = links.first().zip(links.last()) else { return vertices };
    vertices.push(match last.joint.filter(|_| is_closed) {
        Some(joint) => joint.vertex,
        None => free_end(&first.piece, &first.piece.tail),
    });
    for link in &links[..links.len() - 1] {
        vertices.push(match link.joint {
            Some(joint) => joint.vertex,
            None => free_end(&link.piece, &link.piece.head),
        });
    }
    if !is_closed {
        vertices.push(free_end(&last.piece, &last.piece.head));
    }
    vertices
}

impl SimplePart {
    /// The chain and its identity. A ring begins with the edge that it is called after.
    pub(super) fn chain(&self, joinable: &Slots<Box<Joinable>>) -> (ChainId, Chain) {
        let mut links: Vec<&Link> = self.links.iter().collect();
        let mut vertices = self.vertices.clone();
        let name = |link: &Link| {
            let segment = joinable.get(link.at.slot)?;
            let id = segment.chain_id(link.at.part);
            Some((segment.rank, id.piece.unsigned_abs(), id))
        };
        let names = links.iter().enumerate().filter_map(|(at, link)| Some((name(link)?, at)));
        let fallback = ChainId { segment: self.links[0].key.segment, piece: 0 };
        let (id, at) = names.min().map_or((fallback, 0), |((_, _, id), at)| (id, at));
        if self.kind.is_closed() {
            links.rotate_left(at);
            vertices.rotate_left(at);
        }
        let segments = || links.iter().map(|link| &link.piece.segment);
        let mut robots: Vec<_> = segments().flat_map(|s| s.robots.iter().cloned()).collect();
        robots.sort_unstable();
        robots.dedup();
        let chain = Chain {
            kind: self.kind,
            vertices,
            segments: links.iter().map(|link| link.key.segment).collect(),
            looks: segments().map(|s| s.looks).min().unwrap_or(0),
            robots,
            first_seen_us: segments().map(|s| s.first_seen_us).min().unwrap_or(0),
            last_seen_us: segments().map(|s| s.last_seen_us).max().unwrap_or(0),
        };
        (id, chain)
    }
}
