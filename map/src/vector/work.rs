//! How much the fold of walls, clusters and chains has done, in counts: a function of what was folded
//! in which order, not of the machine.

use std::ops::{Add, Sub};

/// What has been done since a level was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Work {
    /// Pairs of observations that were held against each other.
    pub pairings: u64,
    /// Walls that were fused.
    pub walls_fused: u64,
    /// Walls that were held against the grid.
    pub walls_against_grid: u64,
    /// Walls whose published parts were determined.
    pub walls_published: u64,
    /// Pairs of ends that were held against each other.
    pub joints: u64,
    /// Gaps between ends that were held against the grid.
    pub gaps_against_grid: u64,
    /// Pieces of the chains that were formed.
    pub chain_pieces: u64,
}

impl Work {
    fn with(self, other: Self, combine: fn(u64, u64) -> u64) -> Self {
        Self {
            pairings: combine(self.pairings, other.pairings),
            walls_fused: combine(self.walls_fused, other.walls_fused),
            walls_against_grid: combine(self.walls_against_grid, other.walls_against_grid),
            walls_published: combine(self.walls_published, other.walls_published),
            joints: combine(self.joints, other.joints),
            gaps_against_grid: combine(self.gaps_against_grid, other.gaps_against_grid),
            chain_pieces: combine(self.chain_pieces, other.chain_pieces),
        }
    }
}

impl Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.with(other, u64::wrapping_add)
    }
}

impl Sub for Work {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.with(other, u64::wrapping_sub)
    }
}
