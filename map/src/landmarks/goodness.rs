//! How good a landmark is to find oneself by: a fuzzy judgement of its accuracy, uniqueness, the walls that it is made
//! of, and whether it is there at all, which can say why (after Skrzypczynski 1998, whose rules are not public; these
//! are ours). Sugeno inference of order zero: "and" is the least, "not" the complement, and the outputs of the rules are
//! averaged by how far each applies.

use std::fmt;

use super::{Fix, Landmark, LandmarkTable, LocateConfig, Sight, locate};
use crate::geometry::Covariance;

/// What is known of a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Traits {
    /// Root of the trace of the covariance of its place, metres.
    pub sd: f64,
    /// How few other places look like its surroundings, 0 to 1: [`LandmarkTable::uniqueness`].
    pub uniqueness: f64,
    /// Length of the shorter wall that it is made of, metres.
    pub wall: f64,
    /// How likely it is there, 0 to 1.
    pub existence: f64,
}

/// Where the memberships begin and end: 0 at the first, 1 at the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoodnessConfig {
    /// "Accurate", by the deviation of the place, metres.
    pub accurate: (f64, f64),
    /// "Long", by the length of the walls, metres.
    pub long: (f64, f64),
    /// "Apart", by the bearing from those that are chosen already, radians.
    pub apart: (f64, f64),
    /// Landmarks that are worse than this are not used.
    pub gate: f64,
}

impl GoodnessConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        accurate: (0.08, 0.02),
        long: (0.2, 1.0),
        apart: (std::f64::consts::PI / 12.0, std::f64::consts::PI / 3.0),
        gate: 0.3,
    };
}

/// A rule and how far it applies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Applied {
    /// In words.
    pub rule: &'static str,
    /// How far it applies, 0 to 1.
    pub degree: f64,
    /// What it says of the landmark, 0 to 1.
    pub output: f64,
}

/// A judgement, with its reasons.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goodness {
    /// From 0 to 1.
    pub value: f64,
    /// All rules.
    pub rules: [Applied; 7],
}

impl Goodness {
    /// Judges a landmark.
    pub fn of(traits: &Traits, config: &GoodnessConfig) -> Self {
        let accurate = ramp(traits.sd, config.accurate);
        let long = ramp(traits.wall, config.long);
        let (unique, sure) = (traits.uniqueness.clamp(0.0, 1.0), traits.existence.clamp(0.0, 1.0));
        let all = |degrees: &[f64]| degrees.iter().copied().fold(1.0, f64::min);
        let not = |degree: f64| 1.0 - degree;
        let rule = |rule, degree, output| Applied { rule, degree, output };
        let rules = [
            rule(
                "accurate, unique, of long walls, sure",
                all(&[accurate, unique, long, sure]),
                1.0,
            ),
            rule("accurate, unique, sure", all(&[accurate, unique, sure, not(long)]), 0.7),
            rule("accurate, of long walls, sure", all(&[accurate, long, sure, not(unique)]), 0.5),
            rule("unique, of long walls, not accurate", all(&[not(accurate), unique, long]), 0.4),
            rule("neither accurate nor unique", all(&[not(accurate), not(unique)]), 0.1),
            rule("neither accurate nor of long walls", all(&[not(accurate), not(long)]), 0.1),
            rule("not sure", not(sure), 0.05),
        ];
        let total: f64 = rules.iter().map(|r| r.degree).sum();
        let said: f64 = rules.iter().map(|r| r.degree * r.output).sum();
        Self { value: if total > 0.0 { said / total } else { 0.0 }, rules }
    }

    /// The rule that applies most.
    pub fn reason(&self) -> &Applied {
        let first = &self.rules[0];
        self.rules.iter().fold(first, |most, r| if r.degree > most.degree { r } else { most })
    }
}

impl fmt::Display for Goodness {
    /// `0.82: accurate, unique, of long walls, sure (0.80)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Applied { rule, degree, .. } = self.reason();
        write!(f, "{:.2}: {rule} ({degree:.2})", self.value)
    }
}

/// From 0 at `from` to 1 at `to`, either of which may be the larger.
pub(super) fn ramp(value: f64, (from, to): (f64, f64)) -> f64 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}

/// So many landmarks about one are its surroundings at most, the nearest ones.
const SURROUNDINGS: usize = 8;
/// They lie within this, metres.
const WITHIN: f64 = 8.0;

impl LandmarkTable {
    /// How few places of the table look like the surroundings of one of its landmarks: one over their number, its
    /// own included; 0 if its surroundings are too poor to tell, or none of it.
    pub fn uniqueness(&self, number: u32) -> f64 {
        let Some(landmark) = self.landmarks.get(number as usize) else { return 0.0 };
        let mut about: Vec<(f64, u32, &Landmark)> = self
            .near(landmark.at, WITHIN)
            .map(|(number, other)| ((other.at - landmark.at).norm_squared(), number, other))
            .collect();
        about.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let seen: Vec<Landmark> = about
            .iter()
            .take(SURROUNDINGS)
            .map(|(_, _, other)| Landmark {
                at: other.at - landmark.at,
                covariance: other.covariance + Covariance::from_variances([1e-4; 2]),
                ..**other
            })
            .collect();
        let sight = Sight { range: 0.0, half_field: std::f64::consts::PI };
        match locate(self, &seen, &sight, None, None, &LocateConfig::STANDARD) {
            Fix::Unique(_) => 1.0,
            Fix::Ambiguous(candidates) if !candidates.is_empty() => 1.0 / candidates.len() as f64,
            Fix::Ambiguous(_) | Fix::NoMatch => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::LandmarkKind;
    use super::*;
    use crate::chance::Chance;
    use crate::geometry::Point;

    const BEST: Traits = Traits { sd: 0.01, uniqueness: 1.0, wall: 2.0, existence: 1.0 };

    #[test]
    fn judgements_are_those_of_the_rules_and_say_why() {
        let of = |traits: Traits| Goodness::of(&traits, &GoodnessConfig::STANDARD);
        let best = of(BEST);
        assert!((best.value - 1.0).abs() < 1e-12);
        assert_eq!(best.to_string(), "1.00: accurate, unique, of long walls, sure (1.00)");
        let short = of(Traits { wall: 0.2, ..BEST });
        assert!((short.value - 0.7).abs() < 1e-12, "{short}");
        let common = of(Traits { uniqueness: 0.0, ..BEST });
        assert!((common.value - 0.5).abs() < 1e-12, "{common}");
        let coarse = of(Traits { sd: 0.1, ..BEST });
        assert!((coarse.value - 0.4).abs() < 1e-12, "{coarse}");
        let unsure = of(Traits { existence: 0.0, ..BEST });
        assert_eq!(unsure.reason().rule, "not sure");
        assert!(unsure.value < GoodnessConfig::STANDARD.gate);
    }

    #[test]
    fn worse_traits_never_make_a_better_landmark_of_a_good_one() {
        let of = |traits: Traits| Goodness::of(&traits, &GoodnessConfig::STANDARD).value;
        for step in 0..100 {
            let (here, next) = (f64::from(step) / 100.0, f64::from(step + 1) / 100.0);
            assert!(of(Traits { sd: 0.1 * next, ..BEST }) <= of(Traits { sd: 0.1 * here, ..BEST }));
            assert!(of(Traits { wall: here, ..BEST }) <= of(Traits { wall: next, ..BEST }));
            let by_existence = |existence| of(Traits { existence, ..BEST });
            assert!(by_existence(here) <= by_existence(next));
        }
    }

    #[test]
    fn of_two_equal_rooms_each_corner_is_half_as_unique() {
        let mut chance = Chance(3);
        let room: Vec<Landmark> = (0..5)
            .map(|_| Landmark {
                kind: LandmarkKind::ConcaveCorner,
                at: Point::new(6.0 * chance.share(), 6.0 * chance.share()),
                direction: 6.0 * chance.share() - 3.0,
                covariance: Covariance::from_variances([1e-4; 2]),
                direction_sd: 0.03,
            })
            .collect();
        let moved = |by: f64| {
            let at = |l: &Landmark| l.at + Point::new(by, 0.0);
            room.iter().map(move |l| Landmark { at: at(l), ..*l }).collect::<Vec<_>>()
        };
        let alone = LandmarkTable::new(moved(0.0));
        assert!((alone.uniqueness(0) - 1.0).abs() < 1e-12);
        let twice = LandmarkTable::new([moved(0.0), moved(40.0)].concat());
        assert!((twice.uniqueness(0) - 0.5).abs() < 1e-12, "{}", twice.uniqueness(0));
        assert!(alone.uniqueness(99) < 1e-12);
    }
}
