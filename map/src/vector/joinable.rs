//! A published segment as what chains are made of: its pieces, and how each of them is joined.

use std::sync::Arc;

use super::chain::ChainId;
use super::gap::Gap;
use super::joint::Joint;
use super::leaders::Rank;
use super::piece::{Piece, PieceAt, PieceKey};
use super::{Segment, VectorConfig};
use crate::geometry::Point;
use crate::raster::{Blocks, TileIndex};

/// The pieces of a published segment.
#[derive(Debug, Clone)]
pub(super) struct Joinable {
    pub(super) pieces: Vec<Joined>,
    /// Of the founding observation; holds the segment's identity.
    pub(super) rank: Rank,
    /// The piece nearest to the middle of the founding observation.
    founding: u16,
}

/// A piece and its joints.
#[derive(Debug, Clone)]
pub(super) struct Joined {
    pub(super) piece: Piece,
    /// The joints that its head could be in.
    pub(super) possible: Vec<Possible>,
    /// The pieces whose heads could be joined with its tail.
    pub(super) before: Vec<PieceAt>,
    /// The piece that its head is joined with.
    pub(super) next: Option<PieceAt>,
    /// The piece that its tail is joined with.
    pub(super) previous: Option<PieceAt>,
    pub(super) chain: Option<ChainId>,
}

/// A joint that could be made, from the head of the piece that holds it to the tail of another.
#[derive(Debug, Clone)]
pub(super) struct Possible {
    pub(super) to: PieceAt,
    pub(super) joint: Joint,
    pub(super) gap: Gap,
    pub(super) depends_on: Vec<(TileIndex, Blocks)>,
    pub(super) is_seen_through: bool,
}

impl Joinable {
    /// The pieces of a segment whose founding observation has its middle at `middle`, not joined.
    pub(super) fn new(
        segment: &Arc<Segment>,
        rank: Rank,
        middle: &Point,
        config: &VectorConfig,
    ) -> Self {
        let pieces = Piece::of(segment, config).take(usize::from(u16::MAX));
        let pieces: Vec<Joined> = pieces
            .map(|piece| Joined {
                piece,
                possible: Vec::new(),
                before: Vec::new(),
                next: None,
                previous: None,
                chain: None,
            })
            .collect();
        let at = (segment.line.along(middle) * 1e3).round() as i64;
        let away = |part: &u16| {
            let span = segment.solid[usize::from(*part)].span;
            (span.from - at).max(at - span.to).max(0)
        };
        let founding = (0..pieces.len() as u16).min_by_key(away).unwrap_or(0);
        Self { pieces, rank, founding }
    }

    pub(super) fn key(&self, part: u16) -> PieceKey {
        PieceKey { segment: self.rank.id, part }
    }

    /// The identity of a chain that is called after one of these pieces.
    pub(super) fn chain_id(&self, part: u16) -> ChainId {
        let piece = i32::from(part) - i32::from(self.founding);
        ChainId { segment: self.rank.id, piece: piece.clamp(-32_768, 32_767) as i16 }
    }
}
