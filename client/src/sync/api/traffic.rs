//! What went over the wire: bodies as they were packed, without the heads of requests and answers.

use std::sync::atomic::{AtomicU64, Ordering};

/// Requests and bytes so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Traffic {
    /// Requests that reached somebody, repeated ones too.
    pub requests: u64,
    /// Bytes of bodies sent, packed.
    pub bytes_up: u64,
    /// Bytes of bodies received, packed.
    pub bytes_down: u64,
}

/// The running sums behind [`Traffic`].
#[derive(Debug, Default)]
pub(super) struct TrafficCounters {
    requests: AtomicU64,
    bytes_up: AtomicU64,
    bytes_down: AtomicU64,
}

impl TrafficCounters {
    pub(super) fn so_far(&self) -> Traffic {
        Traffic {
            requests: self.requests.load(Ordering::Relaxed),
            bytes_up: self.bytes_up.load(Ordering::Relaxed),
            bytes_down: self.bytes_down.load(Ordering::Relaxed),
        }
    }

    pub(super) fn sent(&self, bytes: usize) {
        self.requests.fetch_add(1, Ordering::Relaxed);
        self.bytes_up.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    pub(super) fn received(&self, bytes: usize) {
        self.bytes_down.fetch_add(bytes as u64, Ordering::Relaxed);
    }
}
