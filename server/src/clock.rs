//! Time of day and elapsed time, as a parameter: a run can then be repeated and a test needs no
//! luck. The only place of the server's library that reads the machine's clocks.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// What the server knows of time.
pub trait Clock: Send + Sync + std::fmt::Debug + 'static {
    /// Time of day, microseconds since 1970. May jump, also backwards; nothing is ordered by it.
    fn now_us(&self) -> i64;

    /// Time since some fixed moment. Never goes back; for durations.
    fn elapsed(&self) -> Duration;
}

/// A clock that is handed to every part that needs one.
pub type SharedClock = Arc<dyn Clock>;

/// The machine's clocks.
#[derive(Debug, Clone, Copy)]
pub struct SystemClock {
    started: Instant,
}

impl SystemClock {
    /// A clock whose elapsed time begins now.
    #[expect(clippy::disallowed_methods, reason = "this is the clock")]
    pub fn start() -> Self {
        Self { started: Instant::now() }
    }
}

impl Clock for SystemClock {
    #[expect(clippy::disallowed_methods, reason = "this is the clock")]
    fn now_us(&self) -> i64 {
        match SystemTime::now().duration_since(UNIX_EPOCH) {
            Ok(since) => i64::try_from(since.as_micros()).unwrap_or(i64::MAX),
            Err(before) => -i64::try_from(before.duration().as_micros()).unwrap_or(i64::MAX),
        }
    }

    fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }
}

/// A clock that stands still until it is told to move: for tests and simulations.
#[derive(Debug)]
pub struct ManualClock {
    now_us: AtomicI64,
    elapsed_us: AtomicI64,
}

impl ManualClock {
    /// A clock that stands at `now_us` microseconds since 1970.
    pub fn at(now_us: i64) -> Self {
        Self { now_us: AtomicI64::new(now_us), elapsed_us: AtomicI64::new(0) }
    }

    /// Lets time pass.
    pub fn advance(&self, by: Duration) {
        let us = i64::try_from(by.as_micros()).unwrap_or(i64::MAX);
        self.now_us.fetch_add(us, Ordering::SeqCst);
        self.elapsed_us.fetch_add(us, Ordering::SeqCst);
    }

    /// Sets the time of day, as an administrator or a time server would; elapsed time stays.
    pub fn jump_to(&self, now_us: i64) {
        self.now_us.store(now_us, Ordering::SeqCst);
    }
}

impl Clock for ManualClock {
    fn now_us(&self) -> i64 {
        self.now_us.load(Ordering::SeqCst)
    }

    fn elapsed(&self) -> Duration {
        Duration::from_micros(self.elapsed_us.load(Ordering::SeqCst).unsigned_abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_of_the_time_of_day_leaves_elapsed_time_alone() {
        let clock = ManualClock::at(1_000_000);
        clock.advance(Duration::from_millis(5));
        clock.jump_to(7);
        assert_eq!(clock.now_us(), 7);
        assert_eq!(clock.elapsed(), Duration::from_millis(5));
    }

    #[test]
    fn the_system_clock_stands_after_2020_and_does_not_go_back() {
        let clock = SystemClock::start();
        assert!(clock.now_us() > 1_577_836_800_000_000);
        let before = clock.elapsed();
        assert!(clock.elapsed() >= before);
    }
}
