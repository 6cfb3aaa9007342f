//! What was thought of sonar readings, rule by rule, so that an operator sees what was refused and why.

use serde::{Serialize, Serializer};

/// Why a reading was refused or believed less. Of several that apply the first counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum SonarRule {
    /// Nearer than the transducer can hear: refused.
    TooNear,
    /// No echo: weak evidence for free space, for smooth walls are silent too.
    Silent,
    /// It changed while the robot stood: probably another sonar's pulse. Its arc, at the nearest that was
    /// heard, counts little, and it frees up to there.
    Crosstalk,
    /// From behind a wall that is known: a detour. Its arc is refused, and it frees up to the wall only.
    Ghost,
    /// Far beyond its neighbours' ranges: a smooth wall has probably thrown the pulse aside. Its arc is
    /// refused, and it frees no farther than its neighbours allow.
    Specular,
    /// No neighbour hears anything at this range: its arc counts less.
    NoSupport,
}

impl SonarRule {
    /// All of them, in the order in which they are asked.
    pub const ALL: [Self; 6] = [
        Self::TooNear,
        Self::Silent,
        Self::Crosstalk,
        Self::Ghost,
        Self::Specular,
        Self::NoSupport,
    ];

    /// In a word or two, for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::TooNear => "too near",
            Self::Crosstalk => "crosstalk",
            Self::Silent => "silent",
            Self::Ghost => "ghost",
            Self::Specular => "specular",
            Self::NoSupport => "no support",
        }
    }
}

/// Readings, and how many of them each rule applied to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SonarVerdicts {
    readings: u64,
    counts: [u64; SonarRule::ALL.len()],
}

impl SonarVerdicts {
    /// One more reading, and the rule that applied to it, if any did.
    pub(super) fn note(&mut self, rule: Option<SonarRule>) {
        self.readings += 1;
        if let Some(rule) = rule {
            self.counts[rule as usize] += 1;
        }
    }

    /// Adds those of another look.
    pub fn add(&mut self, other: &Self) {
        self.readings += other.readings;
        for (sum, more) in self.counts.iter_mut().zip(other.counts) {
            *sum += more;
        }
    }

    /// Readings in all.
    pub fn readings(&self) -> u64 {
        self.readings
    }

    /// Readings to which a rule applied.
    pub fn count(&self, rule: SonarRule) -> u64 {
        self.counts[rule as usize]
    }

    /// For people: how many of how many readings each rule applied to, rules that never did left out;
    /// `None` without readings.
    pub fn in_words(&self) -> Option<String> {
        let applied = SonarRule::ALL.into_iter().filter(|rule| self.count(*rule) > 0);
        let counts: Vec<String> =
            applied.map(|rule| format!("{} {}", self.count(rule), rule.name())).collect();
        let counts = if counts.is_empty() { "none".to_owned() } else { counts.join(", ") };
        (self.readings > 0)
            .then(|| format!("refused or doubted of {} sonar readings: {counts}", self.readings))
    }
}

impl Serialize for SonarVerdicts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let readings = std::iter::once(("readings", self.readings));
        let counts = SonarRule::ALL.into_iter().map(|rule| (rule.name(), self.count(rule)));
        serializer.collect_map(readings.chain(counts))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdicts_are_told_in_words_and_add_up() {
        let mut one = SonarVerdicts::default();
        assert_eq!(one.in_words(), None);
        one.note(None);
        assert_eq!(one.in_words().as_deref(), Some("refused or doubted of 1 sonar readings: none"));
        one.note(Some(SonarRule::Specular));
        one.note(Some(SonarRule::Crosstalk));
        let mut both = one;
        both.add(&one);
        let words = "refused or doubted of 6 sonar readings: 2 crosstalk, 2 specular";
        assert_eq!(both.in_words().as_deref(), Some(words));
    }
}
