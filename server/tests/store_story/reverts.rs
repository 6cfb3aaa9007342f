//! Acts in the store: what is taken out and put back, and what is refused.

use std::collections::BTreeSet;

use mapfold_schema::v1::{self, ContributionState, RobotShare};
use mapfold_server::store::acts::{ActKind, NewAct, RevertRefusal, Span, Targets};
use mapfold_server::store::contributions::{Appended, Place};
use mapfold_server::store::log::LogFilter;
use mapfold_server::store::{Store, StoreError};
use uuid::Uuid;

use crate::engines::Database;
use crate::log::{row, rows};
use crate::synthetic::{LEVEL, RECEIVED_US, SITE, START_US, furnish, looks, new_level};

on_each_engine!(
    a_revert_is_one_entry_of_the_log_and_is_undone_by_another,
    the_same_revert_asked_for_twice_is_taken_once,
    what_cannot_be_reverted_is_refused_and_nothing_changes,
    a_span_holds_its_first_instant_and_not_its_last,
    what_another_revert_covers_stays_out,
    reverts_are_listed_newest_first_in_pages,
    a_repeated_contribution_is_known_also_when_it_is_reverted,
    acts_of_two_stores_and_appends_leave_no_gap,
);

/// The `number`th act, with what it is asked for as its digest.
pub(crate) fn act(number: u128, targets: &Targets) -> NewAct {
    NewAct {
        id: Uuid::from_u128(0x0190_aaaa_0000_7000_8000_0000_0000_0000 + number),
        digest: format!("{targets:?}"),
        author: "an-operator".into(),
        reason: "its wheels slipped".into(),
        at_us: RECEIVED_US + number as i64,
    }
}

pub(crate) fn of_robot(robot: &str) -> Targets {
    Targets::Span(Span { robot: robot.into(), from_us: None, to_us: None })
}

pub(crate) fn these<'a>(looks: impl IntoIterator<Item = &'a v1::Contribution>) -> Targets {
    Targets::Contributions(looks.into_iter().map(|look| look.id).collect())
}

async fn revert(store: &Store, number: u128, targets: &Targets) -> v1::Revert {
    store.revert(SITE, LEVEL, &act(number, targets), targets).await.unwrap().unwrap()
}

async fn undo(store: &Store, revert: Uuid, number: u128) -> v1::Revert {
    let act = NewAct { reason: String::new(), ..act(number, &of_robot("-")) };
    store.restore(SITE, LEVEL, revert, &act).await.unwrap().unwrap()
}

/// Revisions of the log's contributions in a state, ascending.
async fn in_state(store: &Store, state: ContributionState) -> Vec<i64> {
    let filter = LogFilter { state: Some(state), ..LogFilter::default() };
    let page = store.log_page(SITE, LEVEL, &filter, None, 1000).await.unwrap();
    page.contributions.iter().rev().map(|entry| entry.revision).collect()
}

async fn a_revert_is_one_entry_of_the_log_and_is_undone_by_another(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    store.append(SITE, LEVEL, &rows(51, 9)).await.unwrap();
    let reverted = revert(&store, 1, &of_robot("bert")).await;
    assert_eq!((reverted.revision, reverted.contributions, reverted.taken_out), (10, 3, 3));
    assert_eq!(reverted.robots, [RobotShare { robot: "bert".into(), contributions: 3 }]);
    assert_eq!((reverted.author.as_str(), reverted.undone.as_ref()), ("an-operator", None));
    assert_eq!(in_state(&store, ContributionState::Reverted).await, [2, 5, 8]);
    let bert = store.robot(SITE, "bert").await.unwrap().unwrap();
    assert_eq!((bert.contributions, bert.reverted), (3, 3));

    // Contributions go on after it, and its robot's too.
    let later = store.append(SITE, LEVEL, &[row(&looks(52, 5)[1])]).await.unwrap();
    let place =
        Place { revision: 11, received_at_us: RECEIVED_US, state: ContributionState::Folded };
    assert_eq!(later, [Appended::New(place)]);
    let stretch = store.stretch_after(SITE, LEVEL, 0, 100).await.unwrap();
    assert_eq!((stretch.contributions.len(), stretch.end()), (9, Some(10)));
    let in_log = stretch.act.unwrap();
    assert_eq!(
        (in_log.kind, &in_log.moved, &in_log.covered),
        (ActKind::Revert, &vec![2, 5, 8], &vec![2, 5, 8])
    );
    let cut = store.stretch_after(SITE, LEVEL, 0, 9).await.unwrap();
    assert_eq!((cut.contributions.len(), cut.act), (9, None));
    let rest = store.stretch_after(SITE, LEVEL, 10, 9).await.unwrap();
    assert_eq!((rest.contributions.len(), rest.end()), (1, Some(11)));
    assert_eq!(store.stretch_after(SITE, LEVEL, 11, 9).await.unwrap().end(), None);

    let undone = undo(&store, reverted.id, 2).await;
    let how = undone.undone.clone().unwrap();
    assert_eq!((how.revision, how.put_back, undone.revision), (12, 3, 10));
    assert_eq!(in_state(&store, ContributionState::Reverted).await, [0; 0]);
    assert_eq!(store.robot(SITE, "bert").await.unwrap().unwrap().reverted, 0);
    assert_eq!(undo(&store, reverted.id, 3).await, undone, "once is enough");
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 12);
    let acts = store.acts_between(SITE, LEVEL, 0, 12).await.unwrap();
    assert_eq!(acts.iter().map(|act| act.revision).collect::<Vec<_>>(), [10, 12]);
    assert_eq!(acts[1].kind, ActKind::Restore);
    assert_eq!(store.acts_between(SITE, LEVEL, 10, 11).await.unwrap(), []);
}

async fn the_same_revert_asked_for_twice_is_taken_once(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    store.append(SITE, LEVEL, &rows(53, 6)).await.unwrap();
    let first = revert(&store, 1, &of_robot("anna")).await;
    assert_eq!(revert(&store, 1, &of_robot("anna")).await, first);
    let other = of_robot("bert");
    let refused = store.revert(SITE, LEVEL, &act(1, &other), &other).await.unwrap();
    assert_eq!(refused, Err(RevertRefusal::Conflict(7)));
    let undone = undo(&store, first.id, 2).await.undone.unwrap();
    let again = of_robot("anna");
    let refused = store.revert(SITE, LEVEL, &act(1, &again), &again).await.unwrap();
    assert_eq!(refused, Err(RevertRefusal::Undone(undone.revision)));
    // The id of a restore is taken too.
    let refused = store.revert(SITE, LEVEL, &act(2, &again), &again).await.unwrap();
    assert_eq!(refused, Err(RevertRefusal::Conflict(8)));
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 8);
}

async fn what_cannot_be_reverted_is_refused_and_nothing_changes(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let held = v1::RobotUpdate { state: Some(v1::RobotState::Held), ..v1::RobotUpdate::default() };
    store.update_robot(SITE, "sonja", &held).await.unwrap();
    let looks = looks(54, 9);
    store.append(SITE, LEVEL, &looks.iter().map(row).collect::<Vec<_>>()).await.unwrap();
    let refused = async |targets: &Targets| {
        let planned = store.plan_revert(SITE, LEVEL, targets).await.unwrap();
        let refused = store.revert(SITE, LEVEL, &act(9, targets), targets).await.unwrap();
        (planned.err(), refused.unwrap_err())
    };
    let stranger = Uuid::from_u128(7);
    let some = Targets::Contributions(vec![looks[0].id, stranger, looks[1].id, stranger]);
    let unknown = RevertRefusal::Unknown(vec![1, 3]);
    assert_eq!(refused(&some).await, (Some(unknown.clone()), unknown));
    let with_held = these(&looks[..3]);
    let holding = RevertRefusal::Held(vec![2]);
    assert_eq!(refused(&with_held).await, (Some(holding.clone()), holding));
    // Spans pass over what is held.
    assert_eq!(refused(&of_robot("sonja")).await, (None, RevertRefusal::Nothing));
    assert_eq!(refused(&of_robot("nobody")).await, (None, RevertRefusal::Nothing));
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 9);
    assert_eq!(in_state(&store, ContributionState::Reverted).await, [0; 0]);

    store.create_level(SITE, &new_level("attic")).await.unwrap();
    let elsewhere = these(&looks[..1]);
    let refused = store.revert(SITE, "attic", &act(9, &elsewhere), &elsewhere).await.unwrap();
    assert_eq!(refused, Err(RevertRefusal::Unknown(vec![0])));
    let nowhere = store.revert(SITE, "cellar", &act(9, &elsewhere), &elsewhere).await.unwrap_err();
    assert!(matches!(nowhere, StoreError::Missing { kind: "level", .. }), "{nowhere}");
    let nothing = act(9, &elsewhere);
    assert_eq!(store.restore(SITE, LEVEL, stranger, &nothing).await.unwrap(), None);
    assert_eq!(store.plan_restore(SITE, LEVEL, stranger).await.unwrap(), None);
}

async fn a_span_holds_its_first_instant_and_not_its_last(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    // Looks come every quarter of a second, in turn by three robots.
    store.append(SITE, LEVEL, &rows(55, 30)).await.unwrap();
    let at = |look: i64| Some(START_US + look * 7_200_000_000);
    let span = |from_us, to_us| Targets::Span(Span { robot: "anna".into(), from_us, to_us });
    let planned = async |from, to| {
        store.plan_revert(SITE, LEVEL, &span(from, to)).await.unwrap().unwrap().moved
    };
    assert_eq!(planned(at(3), at(9)).await, [4, 7]);
    assert_eq!(planned(at(3), at(9).map(|us| us + 1)).await, [4, 7, 10]);
    assert_eq!(planned(at(22), None).await, [25, 28]);
    assert_eq!(planned(None, at(6)).await, [1, 4]);
    assert_eq!(planned(at(9), at(9)).await, [0; 0]);
    let reverted = revert(&store, 1, &span(at(3), at(9))).await;
    assert_eq!(reverted.robot.as_deref(), Some("anna"));
    assert_eq!(reverted.from.as_deref(), Some(looks(55, 30)[3].observed_at.as_str()));
    assert_eq!(reverted.to.as_deref(), Some(looks(55, 30)[9].observed_at.as_str()));
    assert_eq!(in_state(&store, ContributionState::Reverted).await, [4, 7]);
}

async fn what_another_revert_covers_stays_out(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let looks = looks(56, 12);
    store.append(SITE, LEVEL, &looks.iter().map(row).collect::<Vec<_>>()).await.unwrap();
    let out = async || in_state(&store, ContributionState::Reverted).await;
    let one = revert(&store, 1, &these(&looks[..4])).await;
    let two = revert(&store, 2, &these(&looks[2..6])).await;
    assert_eq!((two.contributions, two.taken_out), (4, 2));
    let covered = these(&looks[..3]);
    let nothing = store.revert(SITE, LEVEL, &act(3, &covered), &covered).await.unwrap();
    assert_eq!(nothing, Err(RevertRefusal::Nothing));
    assert_eq!(out().await, [1, 2, 3, 4, 5, 6]);

    let plan = store.plan_restore(SITE, LEVEL, one.id).await.unwrap().unwrap();
    assert_eq!((plan.covered, plan.moved), (4, vec![1, 2]));
    assert_eq!(undo(&store, one.id, 4).await.undone.unwrap().put_back, 2);
    assert_eq!(out().await, [3, 4, 5, 6]);
    let plan = store.plan_restore(SITE, LEVEL, one.id).await.unwrap().unwrap();
    assert_eq!((plan.covered, plan.moved), (4, vec![]), "it is undone");
    let wide = revert(&store, 5, &these(&looks[..12])).await;
    assert_eq!((wide.contributions, wide.taken_out), (12, 8));
    assert_eq!(undo(&store, two.id, 6).await.undone.unwrap().put_back, 0);
    assert_eq!(out().await.len(), 12);
    let robots = store.robots(SITE).await.unwrap();
    assert!(robots.iter().all(|robot| robot.reverted == robot.contributions));
    assert_eq!(undo(&store, wide.id, 7).await.undone.unwrap().put_back, 12);
    assert_eq!(out().await, [0; 0]);
}

async fn reverts_are_listed_newest_first_in_pages(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let looks = looks(57, 12);
    store.append(SITE, LEVEL, &looks.iter().map(row).collect::<Vec<_>>()).await.unwrap();
    let mut made = Vec::new();
    for (number, look) in (1..).zip(&looks[..5]) {
        made.push(revert(&store, number, &these([look])).await);
    }
    made[1] = undo(&store, made[1].id, 100).await;
    made.reverse();
    let (mut listed, mut before) = (Vec::new(), None);
    loop {
        let page = store.revert_page(SITE, LEVEL, before, 2).await.unwrap();
        listed.extend(page.reverts);
        let Some(next) = page.next else { break };
        before = Some(next.parse().unwrap());
    }
    assert_eq!(listed, made);
    let record = store.revert_record(SITE, LEVEL, made[0].id).await.unwrap().unwrap();
    assert_eq!((record.revert, record.contributions), (made[0].clone(), vec![looks[4].id]));
    assert_eq!(store.revert_record(SITE, LEVEL, Uuid::from_u128(5)).await.unwrap(), None);
    assert_eq!(store.revert_page(SITE, "attic", None, 2).await.unwrap().reverts, []);
    // More than one statement holds, in the order of the log.
    let many = rows(58, 200);
    for piece in many.chunks(64) {
        store.append(SITE, LEVEL, piece).await.unwrap();
    }
    let all: Vec<Uuid> = many.iter().map(|row| row.id).collect();
    let mut shuffled = all.clone();
    shuffled.reverse();
    shuffled.push(all[7]);
    let reverted = revert(&store, 50, &Targets::Contributions(shuffled)).await;
    assert_eq!((reverted.contributions, reverted.taken_out), (200, 200));
    let record = store.revert_record(SITE, LEVEL, reverted.id).await.unwrap().unwrap();
    assert_eq!(record.contributions, all);
}

async fn a_repeated_contribution_is_known_also_when_it_is_reverted(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let batch = rows(59, 6);
    store.append(SITE, LEVEL, &batch).await.unwrap();
    revert(&store, 1, &of_robot("anna")).await;
    let place =
        Place { revision: 1, received_at_us: RECEIVED_US, state: ContributionState::Reverted };
    let again = store.append(SITE, LEVEL, &batch[..1]).await.unwrap();
    assert_eq!(again, [Appended::Known(place)]);
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 7);
}

async fn acts_of_two_stores_and_appends_leave_no_gap(database: Database) {
    let stores = [database.store().await, database.store().await];
    furnish(&stores[0]).await;
    let batch = rows(60, 90);
    let actor = |store: Store, robot: &'static str, number: u128| {
        tokio::spawn(async move {
            let mut taken = Vec::new();
            for turn in 0..10 {
                let targets = of_robot(robot);
                let act = act(number + turn, &targets);
                match store.revert(SITE, LEVEL, &act, &targets).await.unwrap() {
                    Ok(reverted) => {
                        taken.push(reverted.revision);
                        let undone = undo(&store, reverted.id, number + 100 + turn).await;
                        taken.push(undone.undone.unwrap().revision);
                    }
                    Err(refusal) => assert_eq!(refusal, RevertRefusal::Nothing),
                }
                tokio::task::yield_now().await;
            }
            taken
        })
    };
    let actors = [actor(stores[0].clone(), "anna", 1000), actor(stores[1].clone(), "anna", 2000)];
    let mut taken: Vec<i64> = Vec::new();
    for piece in batch.chunks(5) {
        for answer in stores[1].append(SITE, LEVEL, piece).await.unwrap() {
            let Appended::New(place) = answer else { panic!("{answer:?}") };
            taken.push(place.revision);
        }
    }
    for actor in actors {
        taken.extend(actor.await.unwrap());
    }
    taken.sort_unstable();
    assert!(taken.iter().copied().eq(1..=taken.len() as i64), "{taken:?}");
    let mut seen: BTreeSet<i64> = BTreeSet::new();
    let mut after = 0;
    loop {
        let stretch = stores[0].stretch_after(SITE, LEVEL, after, 7).await.unwrap();
        seen.extend(stretch.contributions.iter().map(|row| row.revision));
        seen.extend(stretch.act.iter().map(|act| act.revision));
        let Some(end) = stretch.end() else { break };
        after = end;
    }
    assert!(seen.into_iter().eq(taken), "a reader misses something");
}
