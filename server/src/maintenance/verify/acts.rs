//! What the acts of a log say by themselves, without any contribution: which are out when, and
//! whether each act moved what those before it left to be moved.

use std::collections::{BTreeMap, BTreeSet};

use mapfold_schema::v1::ContributionState;

use crate::store::acts::{ActKind, ActRow, Force};

/// The acts of a log up to where it is checked.
#[derive(Debug, Default)]
pub(super) struct Acts {
    /// In force at the revision of the stored map.
    pub(super) stored: Force,
    /// In force at the end.
    pub(super) end: Force,
    /// How many there are.
    pub(super) count: usize,
}

impl Acts {
    /// Reads the acts, in the order of the log; what is wrong with them goes to `fault`.
    pub(super) fn new(
        acts: &[ActRow],
        folded_revision: i64,
        mut fault: impl FnMut(String),
    ) -> Self {
        // By how many reverts that stand each contribution is covered.
        let mut covers: BTreeMap<i64, u32> = BTreeMap::new();
        let mut aligned: BTreeSet<i64> = BTreeSet::new();
        for act in acts {
            let mut moved = Vec::new();
            for revision in &act.covered {
                let cover = covers.entry(*revision).or_default();
                match act.kind {
                    ActKind::Align => {
                        if aligned.insert(*revision) {
                            moved.push(*revision);
                        }
                    }
                    ActKind::Withdraw => {
                        if aligned.remove(revision) && *cover == 0 {
                            moved.push(*revision);
                        }
                    }
                    ActKind::Revert => {
                        *cover += 1;
                        if *cover == 1 {
                            moved.push(*revision);
                        }
                    }
                    ActKind::Restore => {
                        *cover = cover.saturating_sub(1);
                        if *cover == 0 {
                            moved.push(*revision);
                        }
                    }
                }
            }
            if moved != act.moved {
                fault(format!(
                    "revision {}: the act moved {} contributions where {} were to be moved",
                    act.revision,
                    act.moved.len(),
                    moved.len()
                ));
            }
        }
        let stored = acts.iter().filter(|act| act.revision <= folded_revision);
        Self { stored: Force::after(stored), end: Force::after(acts), count: acts.len() }
    }

    /// Whether a row may say of itself that it is in `state`.
    pub(super) fn allow(&self, revision: i64, state: ContributionState) -> bool {
        match state {
            ContributionState::Reverted => self.end.out.contains(&revision),
            ContributionState::Folded => !self.end.out.contains(&revision),
            ContributionState::Held => {
                !self.end.out.contains(&revision) && !self.end.aligned.contains(&revision)
            }
        }
    }
}
