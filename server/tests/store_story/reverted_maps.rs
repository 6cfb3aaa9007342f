//! Open levels under reverts: the map is bit for bit what it would have been, for every reader, on
//! every replica, and after every restart.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use mapfold_map::level::diff;
use mapfold_schema::v1::{self, ContributionState};
use mapfold_server::level::{Accepted, LevelHandle, LevelOptions, RevertError, Snapshot};
use mapfold_server::maintenance::verify;
use mapfold_server::store::Store;
use mapfold_server::store::acts::{RevertRefusal, Targets};
use uuid::Uuid;

use crate::engines::{Database, killed_after};
use crate::levels_in_memory::{Mirror, bits, open, reached, still, submit_all};
use crate::reverts::{act, of_robot, these};
use crate::synthetic::{LEVEL, Numbers, SITE, accepted, folded, furnish, looks};

on_each_engine!(
    a_reverted_map_is_what_it_would_have_been_and_back,
    any_story_of_acts_is_the_same_map_everywhere,
    a_killed_level_comes_back_with_its_acts,
    a_preview_tells_what_changes_and_changes_nothing,
    a_reverted_contribution_keeps_its_receipt,
    what_is_wrong_with_acts_is_found,
);

async fn revert(level: &LevelHandle, number: u128, targets: &Targets) -> v1::Revert {
    level.revert(&act(number, targets), targets).await.unwrap()
}

async fn undo(level: &LevelHandle, revert: Uuid, number: u128) -> i64 {
    let undone = level.undo(revert, &act(number, &of_robot("-"))).await.unwrap().unwrap();
    undone.undone.unwrap().revision
}

async fn sound(store: &Store) -> mapfold_server::maintenance::Report {
    let report = verify(store, SITE, LEVEL).await.unwrap().unwrap();
    assert_eq!(report.faults, Vec::<String>::new());
    report
}

async fn a_reverted_map_is_what_it_would_have_been_and_back(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (levels, level) = open(&store, still()).await;
    let all = looks(61, 120);
    let full = submit_all(&level, &all).await;
    let mut mirror = Mirror::default();
    mirror.follow(&full, 50);
    let mut events = level.events();

    let reverted = revert(&level, 1, &of_robot("bert")).await;
    let snapshot = reached(&level, reverted.revision).await;
    let kept: Vec<v1::Contribution> =
        all.iter().filter(|look| look.robot != "bert").cloned().collect();
    assert_eq!(&*snapshot.map(), folded(&kept).map());
    assert_ne!(&*snapshot.map(), &*full.map());
    let counts = snapshot.counts();
    assert_eq!((counts.contributions, counts.in_force), (120, 80));
    // A snapshot is there a moment before its event: one of the looks may still be told of.
    let mut event = events.recv().await.unwrap();
    while event.revision <= full.revision() {
        event = events.recv().await.unwrap();
    }
    assert_eq!((event.revision, event.acts, event.robots.len()), (121, 1, 0));
    mirror.follow(&snapshot, 10);
    assert_eq!(&mirror.map, &*snapshot.map());
    // All that it changed, it changed at its one revision.
    let patch = snapshot.patches_since(120, 1).unwrap();
    assert_eq!((patch.revision, patch.more), (121, false));

    let revision = undo(&level, reverted.id, 2).await;
    let back = reached(&level, revision).await;
    assert_eq!(&*back.map(), &*full.map());
    assert_eq!(back.counts().in_force, 120);
    mirror.follow(&back, 10);
    assert_eq!(&mirror.map, &*full.map());
    drop(level);
    levels.shutdown().await;
    let report = sound(&store).await;
    assert_eq!((report.revision, report.contributions, report.acts), (122, 120, 2));
    assert_eq!((report.folded_revision, report.reverted), (122, 0));
}

/// A moment of a story: what is published, and which looks should be in force.
struct Moment {
    snapshot: Arc<Snapshot>,
    in_force: BTreeSet<usize>,
}

/// Contributions, reverts and undoings in an order drawn from `seed`.
async fn story(level: &LevelHandle, seed: u64, all: &[v1::Contribution]) -> Vec<Moment> {
    let mut numbers = Numbers::seeded(seed);
    let (mut sent, mut moments) = (0, Vec::new());
    let mut standing: Vec<(Uuid, BTreeSet<usize>)> = Vec::new();
    let mut turn = 0;
    while sent < all.len() {
        turn += 1;
        let revision = match numbers.below(4) {
            0 if sent > 0 => {
                let picked: BTreeSet<usize> =
                    (0..=numbers.below(12)).map(|_| numbers.below(sent as u64) as usize).collect();
                let looks: Vec<v1::Contribution> = chosen(all, &picked);
                let targets = these(&looks);
                match level.revert(&act(turn, &targets), &targets).await {
                    Ok(reverted) => {
                        standing.push((reverted.id, picked));
                        reverted.revision
                    }
                    Err(RevertError::Refused(RevertRefusal::Nothing)) => continue,
                    Err(other) => panic!("{other}"),
                }
            }
            1 if !standing.is_empty() => {
                let (id, _) = standing.swap_remove(numbers.below(standing.len() as u64) as usize);
                undo(level, id, turn + 10_000).await
            }
            _ => {
                let until = (sent + 1 + numbers.below(7) as usize).min(all.len());
                let batch: Vec<Accepted> = all[sent..until].iter().map(accepted).collect();
                sent = until;
                let receipts = level.submit_many(batch).await;
                receipts.into_iter().map(|receipt| receipt.unwrap().revision).max().unwrap()
            }
        };
        let in_force =
            (0..sent).filter(|i| !standing.iter().any(|(_, out)| out.contains(i))).collect();
        moments.push(Moment { snapshot: reached(level, revision).await, in_force });
    }
    moments
}

fn chosen(all: &[v1::Contribution], in_force: &BTreeSet<usize>) -> Vec<v1::Contribution> {
    in_force.iter().map(|i| all[*i].clone()).collect()
}

async fn any_story_of_acts_is_the_same_map_everywhere(database: Database) {
    let stores = [database.store().await, database.store().await];
    furnish(&stores[0]).await;
    let options = LevelOptions { write_behind_revisions: 23, ..still() };
    let (levels, level) = open(&stores[0], options).await;
    // Another replica, which learns of everything from the log.
    let polling = LevelOptions { poll_interval: Duration::from_millis(5), ..still() };
    let (_others, other) = open(&stores[1], polling).await;
    let all = looks(62, 110);
    let moments = story(&level, 7, &all).await;
    let mut mirrors: Vec<Mirror> = Vec::new();
    for Moment { snapshot, in_force } in &moments {
        let expected = folded(&chosen(&all, in_force));
        assert_eq!(&*snapshot.map(), expected.map(), "{snapshot:?}");
        assert_eq!(snapshot.counts().in_force, in_force.len() as i64);
        let mut mirror = Mirror::default();
        mirror.follow(snapshot, 40);
        mirrors.push(mirror);
    }
    let in_force = moments.last().unwrap().in_force.clone();
    assert!(in_force.len() < all.len() && mirrors.len() > 20, "{} turns", mirrors.len());
    let here = level.snapshot();
    let end = here.folded_revision();
    let there = reached(&other, end).await;
    for since in (0..=end).step_by(3) {
        assert!(bits(&here, since) == bits(&there, since), "the replicas differ since {since}");
    }
    // Whatever revision a reader has seen, on whichever replica: patches lead on.
    for mut mirror in mirrors {
        let from = mirror.revision;
        mirror.follow(&there, 3);
        assert_eq!(&mirror.map, &*here.map(), "a reader of revision {from}");
    }
    drop(level);
    levels.shutdown().await;
    let report = sound(&stores[0]).await;
    assert_eq!(report.reverted, all.len() - in_force.len());
    // A level that never had them has the same digest.
    let folder = tempfile::tempdir().unwrap();
    let url = mapfold_server::store::sqlite_url(&folder.path().join("other.db"));
    let never = Database { engine: crate::engines::Engine::Sqlite, url }.store().await;
    furnish(&never).await;
    let (_never, level) = open(&never, still()).await;
    submit_all(&level, &chosen(&all, &in_force)).await;
    assert_eq!(sound(&never).await.map_digest, report.map_digest);
}

async fn a_killed_level_comes_back_with_its_acts(database: Database) {
    let all = looks(63, 90);
    // Killed with everything, something and nothing of the map in its rows.
    for (site, write_behind_revisions) in [(1, i64::MAX), (2, 17), (3, 1)] {
        let dying = Database { engine: database.engine, url: database.url.clone() };
        let looks = looks(63, 90);
        let first = site == 1;
        let (before, in_force) = killed_after(move || async move {
            let store = dying.store().await;
            if first {
                furnish(&store).await;
            }
            let options = LevelOptions { write_behind_revisions, ..still() };
            let (_levels, level) = open(&store, options).await;
            let (snapshot, in_force) = if first {
                let last = story(&level, 11, &looks).await.pop().unwrap();
                (last.snapshot, last.in_force)
            } else {
                // Goes on where the last life ended: a robot's out, then back.
                let targets = of_robot("anna");
                let reverted = revert(&level, 50_000 + site, &targets).await;
                reached(&level, reverted.revision).await;
                let back = undo(&level, reverted.id, 60_000 + site).await;
                (reached(&level, back).await, BTreeSet::new())
            };
            let last = snapshot.folded_revision();
            let told: Vec<Vec<u8>> =
                (0..=last).step_by(5).map(|since| bits(&snapshot, since)).collect();
            (told, in_force)
        })
        .await;
        let store = database.store().await;
        let (_levels, level) = open(&store, still()).await;
        let snapshot = level.snapshot();
        for (since, before) in (0..).step_by(5).zip(&before) {
            assert!(bits(&snapshot, since) == *before, "life {site}: since {since} differs");
        }
        if first {
            assert_eq!(&*snapshot.map(), folded(&chosen(&all, &in_force)).map());
        }
        sound(&store).await;
    }
}

async fn a_preview_tells_what_changes_and_changes_nothing(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (_levels, level) = open(&store, still()).await;
    let all = looks(64, 60);
    let before = submit_all(&level, &all).await;
    let check = async |preview: &v1::RevertPreview, to: &mapfold_map::level::LevelMap| {
        let patch = diff(&level.snapshot().map(), to);
        let told = [preview.segments, preview.clusters, preview.chains, preview.tiles]
            .map(|counts| [(counts.new + counts.changed) as usize, counts.removed as usize]);
        let changed = [
            [patch.segments.len(), patch.removed_segments.len()],
            [patch.clusters.len(), patch.removed_clusters.len()],
            [patch.chains.len(), patch.removed_chains.len()],
            [patch.tiles.len(), patch.removed_tiles.len()],
        ];
        assert_eq!(told, changed);
        let features: usize = changed[..3].iter().flatten().sum();
        assert_eq!(preview.features.len(), features.min(200));
        assert_eq!(preview.more_features, features > 200);
    };
    let preview = level.preview(&of_robot("anna")).await.unwrap();
    assert_eq!((preview.revision, preview.contributions, preview.moved), (60, 20, 20));
    let kept: Vec<_> = all.iter().filter(|look| look.robot != "anna").cloned().collect();
    check(&preview, folded(&kept).map()).await;
    assert!(preview.segments.changed > 0 && preview.tiles.changed > 0, "{preview:?}");
    let bounds = preview.bounds.unwrap();
    let level_bounds = level.snapshot().bounds().unwrap();
    assert!(bounds.min_x_m >= level_bounds.min_x_m - 1.0 && bounds.max_x_m > bounds.min_x_m);
    assert!(bits(&level.snapshot(), 0) == bits(&before, 0));
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 60);
    assert_eq!(level.preview(&of_robot("nobody")).await.unwrap().moved, 0);

    let reverted = revert(&level, 1, &of_robot("anna")).await;
    let without = reached(&level, reverted.revision).await;
    assert_eq!(&*without.map(), folded(&kept).map(), "the preview left nothing behind");
    let preview = level.preview_undo(reverted.id).await.unwrap().unwrap();
    assert_eq!((preview.revision, preview.contributions, preview.moved), (61, 20, 20));
    check(&preview, &before.map()).await;
    assert_eq!(level.preview_undo(Uuid::from_u128(1)).await.unwrap(), None);
    undo(&level, reverted.id, 2).await;
    let preview = level.preview_undo(reverted.id).await.unwrap().unwrap();
    assert_eq!((preview.moved, preview.bounds), (0, None));
}

async fn a_reverted_contribution_keeps_its_receipt(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (_levels, level) = open(&store, still()).await;
    let all = looks(65, 30);
    let receipt = level.submit(accepted(&all[0])).await.unwrap();
    submit_all(&level, &all).await;
    let reverted = revert(&level, 1, &these(&all[..1])).await;
    reached(&level, reverted.revision).await;
    assert_eq!(level.submit(accepted(&all[0])).await.unwrap(), receipt);
    assert_eq!(receipt.state, ContributionState::Folded);
    // What the robot sends from now on goes into the map.
    let more = submit_all(&level, &looks(65, 33)).await;
    assert_eq!(&*more.map(), folded(&looks(65, 33)[1..]).map());
    assert_eq!(more.folded_revision(), 34);
}

async fn what_is_wrong_with_acts_is_found(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (levels, level) = open(&store, still()).await;
    let all = looks(66, 40);
    submit_all(&level, &all).await;
    let reverted = revert(&level, 1, &these(&all[3..6])).await;
    reached(&level, reverted.revision).await;
    drop(level);
    levels.shutdown().await;
    sound(&store).await;
    let faults = async || verify(&store, SITE, LEVEL).await.unwrap().unwrap().faults;

    let spoilt =
        database.meddle("update contributions set state = 'folded' where revision = 5").await;
    assert_eq!(spoilt, 1);
    assert_eq!(faults().await, ["revision 5 is reverted, but says otherwise"]);
    database.meddle("update contributions set state = 'reverted' where revision = 5").await;
    assert_eq!(faults().await, [""; 0]);

    // The list of what was moved: 4, 5, 6 becomes 4, 5, and then what nobody can read.
    database.meddle("update acts set moved = substr(moved, 1, 2)").await;
    let found = faults().await;
    assert!(found.iter().any(|fault| fault.contains("moved 2 contributions where 3")), "{found:?}");
    assert!(found.iter().any(|fault| fault.contains("is stored")), "{found:?}");
}
