//! The only place that knows how log-odds are encoded.

/// Log-odds of "occupied" in steps of 0.01 nat, as stored and summed. Sums are not clamped;
/// reading as a probability is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct LogOdds(pub i32);

impl LogOdds {
    /// Steps in one nat.
    pub const STEPS_PER_NAT: f64 = 100.0;
    /// What is read is clamped to plus or minus this many nats.
    pub const READ_LIMIT_NAT: f64 = 5.0;

    /// The nearest step to a value in nats.
    pub fn from_nat(nat: f64) -> Self {
        Self((nat * Self::STEPS_PER_NAT).round() as i32)
    }

    /// The value in nats, not clamped.
    pub fn nat(self) -> f64 {
        f64::from(self.0) / Self::STEPS_PER_NAT
    }

    /// Probability of "occupied", from the clamped value.
    pub fn probability(self) -> f64 {
        let clamped = self.nat().clamp(-Self::READ_LIMIT_NAT, Self::READ_LIMIT_NAT);
        1.0 / (1.0 + (-clamped).exp())
    }
}
