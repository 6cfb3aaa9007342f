//! The append to a log, and reading it.

use mapfold_schema::digest::content_digest;
use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1::{self, ContributionState, RobotState};
use mapfold_server::store::contributions::{Appended, NewContribution, Place};
use mapfold_server::store::log::LogFilter;
use mapfold_server::store::{Store, StoreError, payload};

use crate::engines::Database;
use crate::synthetic::{LEVEL, RECEIVED_US, SITE, checked, furnish, looks};

on_each_engine!(
    revisions_are_dense_and_rows_come_back_as_they_were,
    the_same_id_is_appended_once,
    a_bad_neighbour_disturbs_nobody,
    what_a_held_robot_sends_is_kept_but_not_folded,
    the_last_pose_is_the_newest_look,
    pages_of_the_log_filter_and_follow_each_other,
    a_level_that_is_not_there_takes_nothing,
);

/// The row of a look.
pub(crate) fn row(look: &v1::Contribution) -> NewContribution {
    NewContribution {
        id: look.id,
        digest: content_digest(look).unwrap(),
        robot: look.robot.clone(),
        observed_at_us: checked(look).observed_at_us,
        received_at_us: RECEIVED_US,
        emulated: look.emulated,
        segment_count: look.segments.len() as u32,
        cluster_count: look.clusters.len() as u32,
        tile_count: look.evidence.iter().map(|e| e.tiles.len() as u32).sum(),
        frame: None,
        pose: [look.pose.x_m, look.pose.y_m, look.pose.heading_rad],
        pose_covariance: look.pose.covariance,
        payload: payload::split(look.clone()).unwrap(),
    }
}

pub(crate) fn rows(seed: u64, count: usize) -> Vec<NewContribution> {
    looks(seed, count).iter().map(row).collect()
}

fn place(revision: i64) -> Place {
    Place { revision, received_at_us: RECEIVED_US, state: ContributionState::Folded }
}

async fn append(store: &Store, batch: &[NewContribution]) -> Vec<Appended> {
    store.append(SITE, LEVEL, batch).await.unwrap()
}

async fn revisions_are_dense_and_rows_come_back_as_they_were(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    // Every size of statement, and more than one of the largest would hold.
    let looks = looks(1, 64 + 23 + 1);
    let batch: Vec<NewContribution> = looks.iter().map(row).collect();
    let mut answers = append(&store, &batch[..64]).await;
    answers.extend(append(&store, &batch[64..87]).await);
    answers.extend(append(&store, &batch[87..]).await);
    let expected: Vec<Appended> = (1..=88).map(|r| Appended::New(place(r))).collect();
    assert_eq!(answers, expected);
    assert_eq!(store.level(SITE, LEVEL).await.unwrap().unwrap().revision, 88);
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 88);

    let log = store.log_after(SITE, LEVEL, 0, 1000).await.unwrap();
    let features = store.features_after(SITE, LEVEL, 0, 88, 1000).await.unwrap();
    assert_eq!((log.len(), features.len()), (88, 88));
    for (i, look) in looks.iter().enumerate() {
        assert_eq!(log[i].revision, i as i64 + 1);
        assert_eq!(log[i].digest, batch[i].digest);
        assert_eq!(log[i].payload, batch[i].payload);
        let whole = payload::join(&log[i].payload.features, &log[i].payload.evidence).unwrap();
        assert_eq!(&whole, look);
        assert_eq!(content_digest(&whole).unwrap(), log[i].digest);
        let bare = payload::without_evidence(&features[i].features).unwrap();
        assert_eq!(bare, v1::Contribution { evidence: Vec::new(), ..look.clone() });
    }
    let middle = store.features_after(SITE, LEVEL, 10, 20, 5).await.unwrap();
    let revisions: Vec<i64> = middle.iter().map(|row| row.revision).collect();
    assert_eq!(revisions, [11, 12, 13, 14, 15]);
    assert_eq!(store.log_after(SITE, LEVEL, 88, 10).await.unwrap(), []);

    let record = store.contribution(SITE, LEVEL, looks[5].id).await.unwrap().unwrap();
    assert_eq!(record.contribution, looks[5]);
    assert_eq!(record.digest, batch[5].digest);
    assert_eq!(record.entry.revision, 6);
    assert_eq!(record.entry.received_at, to_rfc3339(RECEIVED_US));
    assert_eq!(record.entry.observed_at, looks[5].observed_at);
    assert_eq!(record.entry.emulated, looks[5].emulated);
    assert_eq!(record.entry.segments as usize, looks[5].segments.len());
    assert_eq!(record.entry.tiles as usize, looks[5].evidence[0].tiles.len());
    assert_eq!(store.contribution(SITE, "attic", looks[5].id).await.unwrap(), None);
}

async fn the_same_id_is_appended_once(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let batch = rows(2, 6);
    append(&store, &batch[..3]).await;
    // Known ones between new ones, one of them twice.
    let mixed: Vec<NewContribution> =
        [1, 3, 0, 3, 4].iter().map(|i| batch[*i as usize].clone()).collect();
    let answers = append(&store, &mixed).await;
    assert_eq!(
        answers,
        [
            Appended::Known(place(2)),
            Appended::New(place(4)),
            Appended::Known(place(1)),
            Appended::Known(place(4)),
            Appended::New(place(5)),
        ]
    );
    assert_eq!(store.log_after(SITE, LEVEL, 0, 100).await.unwrap().len(), 5);
    assert_eq!(append(&store, &[]).await, []);
    let robots = store.robots(SITE).await.unwrap();
    let counts: Vec<i64> = robots.iter().map(|r| r.contributions).collect();
    assert_eq!(counts, [2, 2, 1], "a repeated contribution is not counted again");
}

async fn a_bad_neighbour_disturbs_nobody(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let batch = rows(3, 6);
    append(&store, &batch[..1]).await;
    let other = NewContribution { id: batch[0].id, ..batch[1].clone() };
    let stranger = NewContribution { robot: "zoe".into(), ..batch[2].clone() };
    let twin = NewContribution { digest: "0".repeat(64), ..batch[4].clone() };
    let mixed = [batch[3].clone(), other, stranger, batch[4].clone(), twin, batch[5].clone()];
    assert_eq!(
        append(&store, &mixed).await,
        [
            Appended::New(place(2)),
            Appended::Conflict(1),
            Appended::UnknownRobot,
            Appended::New(place(3)),
            Appended::Conflict(3),
            Appended::New(place(4)),
        ]
    );
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 4);
}

async fn what_a_held_robot_sends_is_kept_but_not_folded(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let update = v1::RobotUpdate { state: Some(RobotState::Held), ..v1::RobotUpdate::default() };
    store.update_robot(SITE, "bert", &update).await.unwrap();
    let batch = rows(4, 3);
    let held = Place { state: ContributionState::Held, ..place(2) };
    assert_eq!(
        append(&store, &batch).await,
        [Appended::New(place(1)), Appended::New(held), Appended::New(place(3))]
    );
    assert_eq!(append(&store, &batch[1..2]).await, [Appended::Known(held)]);
    let states: Vec<ContributionState> =
        store.log_after(SITE, LEVEL, 0, 9).await.unwrap().iter().map(|row| row.state).collect();
    assert_eq!(
        states,
        [ContributionState::Folded, ContributionState::Held, ContributionState::Folded]
    );
}

async fn the_last_pose_is_the_newest_look(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let looks = looks(5, 9);
    let anna: Vec<&v1::Contribution> = looks.iter().filter(|l| l.robot == "anna").collect();
    let last_pose = async || store.robot(SITE, "anna").await.unwrap().unwrap().last_pose;
    let expected = |look: &v1::Contribution| {
        Some(v1::LastPose {
            level: LEVEL.into(),
            x_m: look.pose.x_m,
            y_m: look.pose.y_m,
            heading_rad: look.pose.heading_rad,
            covariance: look.pose.covariance,
            observed_at: look.observed_at.clone(),
        })
    };
    append(&store, &[row(anna[1])]).await;
    assert_eq!(last_pose().await, expected(anna[1]));
    append(&store, &[row(anna[0])]).await;
    assert_eq!(last_pose().await, expected(anna[1]), "an old look comes late");
    append(&store, &[row(anna[2]), row(&looks[1])]).await;
    assert_eq!(last_pose().await, expected(anna[2]));
    assert_eq!(store.robot(SITE, "anna").await.unwrap().unwrap().contributions, 3);
}

async fn pages_of_the_log_filter_and_follow_each_other(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let looks = looks(6, 30);
    let batch: Vec<NewContribution> = looks.iter().map(row).collect();
    append(&store, &batch).await;
    let revisions = async |filter: &LogFilter, limit: u32| {
        let (mut all, mut before, mut pages) = (Vec::new(), None, 0);
        loop {
            let page = store.log_page(SITE, LEVEL, filter, before, limit).await.unwrap();
            assert!(page.contributions.len() <= limit as usize);
            all.extend(page.contributions.iter().map(|entry| entry.revision));
            pages += 1;
            let Some(next) = page.next else { return (all, pages) };
            before = Some(next.parse().unwrap());
        }
    };
    let newest_first: Vec<i64> = (1..=30).rev().collect();
    assert_eq!(revisions(&LogFilter::default(), 7).await, (newest_first.clone(), 5));
    assert_eq!(revisions(&LogFilter::default(), 30).await, (newest_first, 1));

    let of_bert = LogFilter { robot: Some("bert".into()), ..LogFilter::default() };
    let expected: Vec<i64> = (1..=30).rev().filter(|r| r % 3 == 2).collect();
    assert_eq!(revisions(&of_bert, 4).await.0, expected);
    let late = LogFilter { since: Some(27), ..LogFilter::default() };
    assert_eq!(revisions(&late, 10).await.0, [30, 29, 28]);
    let held = LogFilter { state: Some(ContributionState::Held), ..LogFilter::default() };
    assert_eq!(revisions(&held, 10).await, (Vec::new(), 1));
    let bbox = v1::Bounds { min_x_m: -4.0, min_y_m: -3.0, max_x_m: 5.0, max_y_m: 2.0 };
    let near = LogFilter { bbox: Some(bbox), ..LogFilter::default() };
    let inside = |look: &v1::Contribution| {
        (bbox.min_x_m..=bbox.max_x_m).contains(&look.pose.x_m)
            && (bbox.min_y_m..=bbox.max_y_m).contains(&look.pose.y_m)
    };
    let expected: Vec<i64> = (1..=30).rev().filter(|r| inside(&looks[*r as usize - 1])).collect();
    assert!(!expected.is_empty() && expected.len() < 30);
    assert_eq!(revisions(&near, 3).await.0, expected);
}

async fn a_level_that_is_not_there_takes_nothing(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let refused = store.append(SITE, "attic", &rows(7, 2)).await.unwrap_err();
    assert!(matches!(refused, StoreError::Missing { kind: "level", .. }), "{refused}");
    let robots = store.robots(SITE).await.unwrap();
    assert!(robots.iter().all(|robot| robot.contributions == 0));
}
