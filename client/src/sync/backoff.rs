//! How long to wait before another try: exponential, with full jitter, so that a fleet that lost
//! its server together does not come back together.

use std::time::Duration;

use rand::{Rng, RngExt};

/// The shape of a [`Backoff`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BackoffConfig {
    /// Longest wait before the first retry; it doubles with each further one.
    pub base: Duration,
    /// Longest wait of all that the server did not ask for.
    pub cap: Duration,
    /// Longest wait that the server may ask for; a longer one is cut to this.
    pub server_cap: Duration,
}

impl BackoffConfig {
    /// 0.2 s, doubling up to 10 s, and up to 5 minutes if the server says so: a robot is back soon
    /// after its server is.
    pub const QUICK: Self = Self {
        base: Duration::from_millis(200),
        cap: Duration::from_secs(10),
        server_cap: Duration::from_mins(5),
    };
}

/// Failures in a row, and the wait that follows from them.
#[derive(Debug, Clone)]
pub struct Backoff {
    config: BackoffConfig,
    failures: u32,
}

impl Backoff {
    /// No failure yet.
    pub fn new(config: BackoffConfig) -> Self {
        Self { config, failures: 0 }
    }

    /// Failures since the last success.
    pub fn failures(&self) -> u32 {
        self.failures
    }

    /// It worked.
    pub fn succeeded(&mut self) {
        self.failures = 0;
    }

    /// It did not: how long to wait now. Evenly spread over `0..min(cap, base * 2^n)` for the n-th
    /// failure in a row (full jitter); what the server asked for (`retry_after`) is waited for
    /// first, and the jitter comes on top, because it asked everybody for the same.
    pub fn failed(&mut self, retry_after: Option<Duration>, rng: &mut impl Rng) -> Duration {
        let doubled = self.config.base.saturating_mul(1_u32 << self.failures.min(31));
        let longest = doubled.min(self.config.cap);
        self.failures = self.failures.saturating_add(1);
        let asked = retry_after.unwrap_or_default().min(self.config.server_cap);
        asked + longest.mul_f64(rng.random::<f64>())
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand::rngs::StdRng;

    use super::*;

    const CONFIG: BackoffConfig = BackoffConfig {
        base: Duration::from_millis(200),
        cap: Duration::from_secs(10),
        server_cap: Duration::from_mins(1),
    };

    #[test]
    fn waits_are_spread_over_a_range_that_doubles_up_to_the_cap() {
        let mut rng = StdRng::seed_from_u64(1);
        let runs = 2000;
        for (n, longest_ms) in [200.0, 400.0, 800.0, 1600.0, 3200.0, 6400.0, 10_000.0, 10_000.0]
            .into_iter()
            .enumerate()
        {
            let waits: Vec<f64> = (0..runs)
                .map(|_| {
                    let mut backoff = Backoff::new(CONFIG);
                    backoff.failures = n as u32;
                    backoff.failed(None, &mut rng).as_secs_f64() * 1000.0
                })
                .collect();
            assert!(waits.iter().all(|w| (0.0..=longest_ms).contains(w)), "{n}");
            let mean = waits.iter().sum::<f64>() / f64::from(runs);
            // The mean of 2000 uniform waits has a standard deviation of 0.65 % of the range.
            assert!((mean / longest_ms - 0.5).abs() < 0.03, "{n}: mean {mean} of {longest_ms}");
        }
    }

    #[test]
    fn what_the_server_asks_for_is_waited_for_but_not_for_ever() {
        let mut rng = StdRng::seed_from_u64(2);
        let mut backoff = Backoff::new(CONFIG);
        for _ in 0..100 {
            let wait = backoff.failed(Some(Duration::from_secs(3)), &mut rng);
            assert!(wait >= Duration::from_secs(3) && wait <= Duration::from_secs(13), "{wait:?}");
        }
        let wait = backoff.failed(Some(Duration::from_secs(1 << 40)), &mut rng);
        assert!(wait <= Duration::from_secs(70), "{wait:?}");
    }

    #[test]
    fn a_success_starts_again_from_the_base_and_no_count_of_failures_overflows() {
        let mut rng = StdRng::seed_from_u64(3);
        let mut backoff = Backoff::new(CONFIG);
        backoff.failures = u32::MAX;
        assert!(backoff.failed(None, &mut rng) <= CONFIG.cap);
        assert_eq!(backoff.failures(), u32::MAX);
        backoff.succeeded();
        assert!(backoff.failed(None, &mut rng) <= CONFIG.base);
        assert_eq!(backoff.failures(), 1);
    }
}
