//! Any order, any batches, any detour through removals, and restoring: the same bits.

use mapfold_map::level::{
    Batch, Changes, Contribution, Level, LevelConfig, LevelMap, Misplaced, apply, diff,
};
use proptest::prelude::*;

use crate::world::{Chance, NOISE, looks};

fn folded<'a>(looks: impl IntoIterator<Item = &'a Contribution>) -> Level {
    let mut level = Level::new(LevelConfig::standard(0.05));
    level.fold(looks);
    level
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_order_and_any_batches_give_the_same_bits(
        seed: u64,
        count in prop_oneof![Just(40_u64), Just(200)],
        batch in 1_usize..40,
    ) {
        let looks = looks(seed, count, NOISE);
        let at_once = folded(&looks);
        prop_assert!(at_once.map().segments.len() >= 4);
        // In the end robots have looked through everything that may have been there.
        prop_assert!(count > 40 || !at_once.map().clusters.is_empty());
        prop_assert!(!at_once.map().tiles.is_empty());
        let mut one_by_one = Level::new(LevelConfig::standard(0.05));
        let shuffled = Chance(seed).shuffled(looks.clone());
        for some in shuffled.chunks(batch) {
            one_by_one.fold(some);
        }
        prop_assert_eq!(one_by_one.map(), at_once.map());
    }

    #[test]
    fn what_is_taken_out_was_never_there(seed: u64, out in 1_u64..199) {
        let all = looks(seed, 200, NOISE);
        let mut chance = Chance(seed ^ 1);
        let (removed, kept): (Vec<_>, Vec<_>) =
            all.iter().cloned().partition(|_| chance.bits() % 200 < out);
        let mut level = folded(&chance.shuffled(all.clone()));
        for some in chance.shuffled(removed.clone()).chunks(7) {
            level.unfold(some);
        }
        let never = folded(&kept);
        prop_assert_eq!(level.map(), never.map());
        level.fold(&removed);
        let back = folded(&all);
        prop_assert_eq!(level.map(), back.map());
    }

    #[test]
    fn a_batch_is_the_same_as_its_contributions(seed: u64, out in 1_u64..39) {
        let all = looks(seed, 40, NOISE);
        let mut chance = Chance(seed ^ 1);
        let (mut batch, mut kept) = (Batch::new(&LevelConfig::standard(0.05)), Vec::new());
        for look in chance.shuffled(all.clone()) {
            if chance.bits() % 40 < out {
                batch.add(look.clone());
                batch.add(look);
            } else {
                kept.push(look);
            }
        }
        let (never, full) = (folded(&kept), folded(&all));
        let mut level = full.clone();
        let before = level.map().clone();
        let removed: Vec<Contribution> =
            all.iter().filter(|look| !never.in_force().contains(&look.id)).cloned().collect();
        prop_assert_eq!(batch.len(), removed.len());
        let expected = full.clone().unfold(&removed);
        prop_assert_eq!(level.unfold_batch(&batch), Ok(expected));
        prop_assert_eq!(level.map(), never.map());
        prop_assert_eq!(level.in_force(), never.in_force());
        if let Some(first) = removed.iter().map(|look| look.id).min() {
            prop_assert_eq!(level.unfold_batch(&batch), Err(Misplaced(first)));
            prop_assert_eq!(level.map(), never.map());
            level.fold_batch(&batch).unwrap();
            prop_assert_eq!(level.fold_batch(&batch), Err(Misplaced(first)));
        }
        prop_assert_eq!(level.map(), &before);
    }

    #[test]
    fn restoring_and_going_on_is_the_same_as_folding(seed: u64, stored in 0_usize..40) {
        let looks = looks(seed, 40, NOISE);
        let mut before = Level::new(LevelConfig::standard(0.05));
        let slices = before.fold(&looks[..stored]).slices;
        let sums = slices.iter().map(|at| (*at, before.sums(at).unwrap().clone()));
        let bare: Vec<Contribution> = looks[..stored]
            .iter()
            .map(|c| Contribution { evidence: Vec::new(), ..c.clone() })
            .collect();
        let mut restored = Level::restore(LevelConfig::standard(0.05), sums, &bare);
        prop_assert_eq!(restored.map(), before.map());
        restored.fold(&looks[stored..]);
        let at_once = folded(&looks);
        prop_assert_eq!(restored.map(), at_once.map());
    }

    #[test]
    fn patches_lead_from_any_state_to_any_other(seed: u64, a in 0_usize..40, b in 0_usize..40) {
        let looks = looks(seed, 40, NOISE);
        let (from, to) = (folded(&looks[..a]), folded(&looks[..b]));
        let mut map: LevelMap = from.map().clone();
        apply(&diff(from.map(), to.map()), &mut map);
        prop_assert_eq!(&map, to.map());
        prop_assert!(diff(to.map(), &map).is_empty());
    }

    #[test]
    fn changes_name_exactly_what_changed(seed: u64, stored in 0_usize..39) {
        let looks = looks(seed, 40, NOISE);
        let mut level = folded(&looks[..stored]);
        let before = level.map().clone();
        let changes = level.fold(&looks[stored..=stored]);
        let patch = diff(&before, level.map());
        let changed: Vec<_> = patch.segments.keys().chain(&patch.removed_segments).copied().collect();
        for id in &changed {
            prop_assert!(changes.segments.contains(id));
        }
        let changed: Vec<_> = patch.clusters.keys().chain(&patch.removed_clusters).copied().collect();
        for id in &changed {
            prop_assert!(changes.clusters.contains(id));
        }
        let changed: Vec<_> = patch.chains.keys().chain(&patch.removed_chains).copied().collect();
        for id in &changed {
            prop_assert!(changes.chains.contains(id));
        }
        let changed: Vec<_> = patch.tiles.keys().chain(&patch.removed_tiles).copied().collect();
        for key in &changed {
            prop_assert!(changes.tiles.contains(key));
            prop_assert!(changes.slices.iter().any(|at| at.key == *key));
        }
    }
}

#[test]
fn folding_the_same_contribution_twice_changes_nothing() {
    let looks = looks(7, 10, NOISE);
    let mut level = folded(&looks);
    let before = level.map().clone();
    let changes = level.fold(&looks);
    assert_eq!(level.map(), &before);
    assert_eq!(changes, Changes::default());
}
