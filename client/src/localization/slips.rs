//! Wheels that slip badly, as a second opinion of where the robot is.
//!
//! Now and then wheels spin or slide by far more than their usual noise. A filter with one Gaussian either refuses what it
//! sees from then on, or must be so uncertain all the time that wrong walls fit. So there are two, a mixture after the
//! interacting multiple models of Blom and Bar-Shalom (1988): one that takes it that nothing has slipped since all was
//! clear, and one that takes it that something has. Looks shift the odds by how much better the one explains them. What is
//! claimed meanwhile is the mixture's mean and covariance; that allows for what may have happened and nobody has seen.

use mapfold_map::geometry::{Covariance, Level, Pose, Robot, UncertainPose};

use super::filter::{Filter, step_to};

/// How wheels slip badly, and when that is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlipConfig {
    /// How often on a metre.
    pub per_metre: f64,
    /// What it does: deviations ahead and aside, metres, and of the heading, radians.
    pub sd: [f64; 3],
    /// Nothing else is considered from this probability on.
    pub believed: f64,
    /// Less is as good as nothing.
    pub negligible: f64,
    /// Two opinions are the same if the one's mean square deviation from the other, in units of the other's covariance,
    /// is less; it would be 3 if they were equal.
    pub alike: f64,
}

impl SlipConfig {
    /// The defaults: once in 200 m, by 15 cm along the way.
    pub const STANDARD: Self = Self {
        per_metre: 1.0 / 200.0,
        sd: [0.15, 0.03, 0.03],
        believed: 0.99,
        negligible: 1e-6,
        alike: 4.5,
    };
}

/// Where the robot is if nothing has slipped, and if something has.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Opinions {
    without: Filter,
    /// With its probability.
    with: Option<(Filter, f64)>,
    /// Metres since slips were last allowed for.
    way: f64,
    /// Mean and covariance of both.
    claimed: UncertainPose<Level, Robot>,
}

impl Opinions {
    pub(super) fn new(fix: UncertainPose<Level, Robot>) -> Self {
        Self::of(Filter::new(fix))
    }

    /// Mean and covariance of both.
    pub(super) fn pose(&self) -> &UncertainPose<Level, Robot> {
        &self.claimed
    }

    /// Carries both on by a step of the robot's own frame.
    pub(super) fn moved(&mut self, step: &UncertainPose<Robot, Robot>) {
        self.way += step.pose.position().norm();
        self.each(|filter| filter.moved(step));
    }

    /// Does the same to both; answers what it came to in the likelier one.
    pub(super) fn each<T>(&mut self, mut act: impl FnMut(&mut Filter) -> T) -> T {
        let mut done = act(&mut self.without);
        if let Some((with, share)) = &mut self.with {
            let of_slipped = act(with);
            if *share > 0.5 {
                done = of_slipped;
            }
        }
        self.claim();
        done
    }

    /// A look, which `take` takes in and answers with its evidence: the logarithm of how likely it was. Answers what it came
    /// to in the likelier opinion, and whether it has now become certain that something had slipped.
    pub(super) fn look<T>(
        &mut self,
        config: &SlipConfig,
        mut take: impl FnMut(&mut Filter) -> (T, f64),
    ) -> (T, bool) {
        let branched = self.branched(config);
        let (looked, evidence) = take(&mut self.without);
        let Some((mut with, before)) = branched else {
            self.claim();
            return (looked, false);
        };
        let (of_slipped, evidence_of_slipped) = take(&mut with);
        let odds = (before / (1.0 - before)).ln() + evidence_of_slipped - evidence;
        let share = 1.0 / (1.0 + (-odds).exp());
        if share > config.believed {
            *self = Self::of(with);
            return (of_slipped, true);
        }
        let is_open = share > config.negligible && !self.is_like(&with, config.alike);
        self.with = is_open.then_some((with, share));
        self.claim();
        (if is_open && share > 0.5 { of_slipped } else { looked }, false)
    }

    /// What it is if something has slipped, on the way until now or before, and how probable that is; `None` if nothing can
    /// have. Of an earlier slip and one since the last look, the likelier is kept.
    fn branched(&mut self, config: &SlipConfig) -> Option<(Filter, f64)> {
        let slips = 1.0 - (-config.per_metre * std::mem::take(&mut self.way)).exp();
        let before = self.with.as_ref().map_or(0.0, |(_, share)| *share);
        let anew = (1.0 - before) * slips;
        match self.with.take() {
            Some((with, _)) if before >= anew => Some((with, before + anew)),
            _ if anew <= 0.0 => None,
            _ => {
                let mut with = self.without.clone();
                with.slip(&config.sd);
                Some((with, anew))
            }
        }
    }

    fn of(filter: Filter) -> Self {
        Self { claimed: *filter.pose(), without: filter, with: None, way: 0.0 }
    }

    /// Whether another opinion is the same as that without slips.
    fn is_like(&self, other: &Filter, alike: f64) -> bool {
        let (own, other) = (self.without.pose(), other.pose());
        let off = step_to(own, other);
        let spread = other.covariance.matrix() + off * off.transpose();
        own.covariance.information().is_some_and(|i| (i * spread).trace() < alike)
    }

    /// The mean and the covariance of the mixture: `P = (1 - w) P_0 + w P_1 + w (1 - w) d d^T`, `d` from one mean to the other.
    fn claim(&mut self) {
        self.claimed = *self.without.pose();
        let Some((with, w)) = &self.with else { return };
        let (a, b) = (*self.without.pose(), *with.pose());
        let off = step_to(&a, &b);
        let between = off * off.transpose() * (w * (1.0 - w));
        let within = a.covariance.scaled(1.0 - w) + b.covariance.scaled(*w);
        let Ok(covariance) = Covariance::new(within.matrix() + between) else { return };
        let mean =
            Pose::new(a.pose.x + w * off.x, a.pose.y + w * off.y, a.pose.heading() + w * off.z);
        self.claimed = UncertainPose { pose: mean, covariance };
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix1, Matrix1x3, Vector1};

    use super::super::filter::Measurement;
    use super::*;

    const CONFIG: SlipConfig = SlipConfig::STANDARD;

    fn put_down() -> Opinions {
        let pose = Pose::new(5.0, 0.0, 0.0);
        Opinions::new(UncertainPose { pose, covariance: Covariance::from_variances([1e-4; 3]) })
    }

    fn roll(opinions: &mut Opinions, way: f64) {
        let pose = Pose::new(way, 0.0, 0.0);
        opinions.moved(&UncertainPose { pose, covariance: Covariance::from_variances([1e-6; 3]) });
    }

    /// Looks at something ahead that tells x to a centimetre, or fits nothing beyond 5 deviations and then tells nothing.
    fn look(opinions: &mut Opinions, x: f64) -> bool {
        let take = |filter: &mut Filter| {
            let seen = Measurement {
                innovation: Vector1::new(x - filter.pose().pose.x),
                j_pose: Matrix1x3::new(1.0, 0.0, 0.0),
                j_errors: Vec::new(),
                noise: Matrix1::new(1e-4),
            };
            let Some((off_sq, ln_determinant)) = filter.deviation(&seen) else { return ((), 0.0) };
            if off_sq > 25.0 {
                return ((), 0.0);
            }
            filter.update(&seen);
            ((), -0.5 * (off_sq + ln_determinant))
        };
        opinions.look(&CONFIG, take).1
    }

    #[test]
    fn one_thing_that_goes_on_fitting_only_after_a_slip_proves_it() {
        let mut opinions = put_down();
        roll(&mut opinions, 0.3);
        // It has rolled 15 cm. Once, that may be anything; but the claim is wider than if nothing could have slipped.
        assert!(!look(&mut opinions, 5.15));
        let claimed = *opinions.pose();
        assert!(claimed.pose.x < 5.3 && claimed.covariance.sd(0) > 0.0145, "{claimed:?}");
        let mut looks = 1;
        while looks < 10 {
            roll(&mut opinions, 0.3);
            looks += 1;
            if look(&mut opinions, 5.15 + 0.3 * f64::from(looks - 1)) {
                break;
            }
        }
        assert!((2..=5).contains(&looks), "{looks}");
        let off = opinions.pose().pose.x - (5.15 + 0.3 * f64::from(looks - 1));
        assert!(off.abs() < 0.01, "{off}");
    }

    #[test]
    fn a_second_slip_soon_after_the_first_is_seen_too() {
        let mut opinions = put_down();
        let (mut x, mut seen) = (5.0, 0);
        for n in 0..12 {
            roll(&mut opinions, 0.3);
            x += if n == 0 || n == 6 { 0.15 } else { 0.3 };
            seen += u32::from(look(&mut opinions, x));
        }
        assert_eq!(seen, 2);
        assert!((opinions.pose().pose.x - x).abs() < 0.01);
    }

    #[test]
    fn where_nothing_tells_the_claim_grows_by_what_slips_do_on_average() {
        let mut opinions = put_down();
        for _ in 0..10 {
            roll(&mut opinions, 1.0);
            opinions.look(&CONFIG, |_| ((), 0.0));
        }
        // The odometry's variance is that of ten steps; of slips, the share of those that happened at least once.
        let usual = 1e-4 + 10.0 * 1e-6;
        let slipped = (1.0 - (-CONFIG.per_metre * 10.0).exp()) * CONFIG.sd[0].powi(2);
        let claimed = opinions.pose();
        assert!((claimed.pose.x - 15.0).abs() < 1e-9);
        let variance = claimed.covariance.matrix()[(0, 0)];
        assert!((variance / (usual + slipped) - 1.0).abs() < 0.01, "{variance}");
    }

    #[test]
    fn what_fits_leaves_one_opinion_and_one_that_is_never_asked_changes_nothing() {
        let mut opinions = put_down();
        for n in 1..=20 {
            roll(&mut opinions, 0.3);
            assert!(!look(&mut opinions, 5.0 + 0.3 * f64::from(n)));
        }
        let claimed = opinions.pose();
        assert!((claimed.pose.x - 11.0).abs() < 1e-3 && claimed.covariance.sd(0) < 0.01);
    }
}
