//! Taking contributions out and putting them back, as operators do.

use std::time::Duration;

use mapfold_schema::codec::{self, CBOR};
use mapfold_schema::route;
use mapfold_schema::v1::{
    ContributionEntry, ContributionPage, NewRevert, Receipt, Revert, RevertPage, RevertPreview,
    RevertRecord, RobotDescription, RobotShare, Scope,
};
use mapfold_server::auth::{self, Grant};
use mapfold_server::chance::Chance;
use mapfold_server::store::{Store, sqlite_url};
use reqwest::Method;
use serde_json::{Value, json};
use uuid::Uuid;

use crate::client::{Answer, Client};
use crate::server::Server;
use crate::world::{Level, id};

/// A level with four looks of `r1` and two of `r2`.
async fn furnished(server: &Server) -> Level {
    let floor = Level::create(&server.admin()).await;
    floor.enrol("r2").await;
    for number in 1..=4 {
        floor.contribute("r1", number).await;
    }
    for number in 5..=6 {
        floor.contribute("r2", number).await;
    }
    floor
}

fn of_robot(robot: &str) -> NewRevert {
    NewRevert {
        robot: Some(robot.to_owned()),
        reason: "the scanner was loose".to_owned(),
        ..NewRevert::default()
    }
}

async fn delete(client: &Client, path: &str) -> Answer {
    Answer::to(client.request(Method::DELETE, path)).await
}

fn geojson(floor: &Level) -> String {
    floor.path(route::EXPORTS).replace("{format}", "geojson")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robots_contributions_are_taken_out_and_put_back() {
    let server = Server::start().await;
    let admin = server.admin();
    let floor = furnished(&server).await;
    let reverts = floor.path(route::REVERTS);
    let full = admin.get(&geojson(&floor)).await.expect(200).body;
    let counts = floor.describe().await.counts;
    assert_eq!((counts.contributions, counts.in_force), (6, 6));

    let preview = format!("{reverts}?preview=true");
    let what = NewRevert { reason: String::new(), ..of_robot("r1") };
    let told: RevertPreview = admin.post(&preview, &what).await.expect(200).data();
    assert_eq!((told.revision, told.contributions, told.moved), (6, 4, 4));
    assert_eq!(told.robots, [RobotShare { robot: "r1".to_owned(), contributions: 4 }]);
    assert!(told.segments.changed + told.segments.removed + told.segments.new > 0, "{told:?}");
    assert!(told.tiles.changed + told.tiles.removed > 0 && told.bounds.is_some(), "{told:?}");
    assert_eq!(floor.describe().await.revision, 6, "a preview changes nothing");

    let made = admin.post(&reverts, &of_robot("r1")).await.expect(201);
    let here = made.header("location").to_owned();
    let made: Revert = made.data();
    assert_eq!((made.revision, made.contributions, made.taken_out), (7, 4, 4));
    assert_eq!((made.reason.as_str(), &made.undone), ("the scanner was loose", &None));
    assert_eq!(here, format!("{reverts}/{}", made.id));
    floor.folded(7).await;
    let counts = floor.describe().await.counts;
    assert_eq!((counts.contributions, counts.in_force), (6, 2));
    let robot: RobotDescription = admin.get(&route::robot("plant", "r1")).await.expect(200).data();
    assert_eq!((robot.contributions, robot.reverted), (4, 4));
    let log = format!("{}?state=reverted", floor.path(route::CONTRIBUTIONS));
    let page: ContributionPage = admin.get(&log).await.expect(200).data();
    let numbers: Vec<i64> = page.contributions.iter().map(|entry| entry.revision).collect();
    assert_eq!(numbers, [4, 3, 2, 1]);

    // The map is that of a level that never had them.
    let other = Server::start().await;
    let never = Level::create(&other.admin()).await;
    never.enrol("r2").await;
    for number in 5..=6 {
        never.contribute("r2", number).await;
    }
    let without = admin.get(&geojson(&floor)).await.expect(200).body;
    assert!(without != full);
    assert!(without == other.admin().get(&geojson(&never)).await.expect(200).body);

    let record: RevertRecord = admin.get(&here).await.expect(200).data();
    assert_eq!((&record.revert, record.contributions), (&made, (1..=4).map(id).collect()));
    let page: RevertPage = admin.get(&reverts).await.expect(200).data();
    assert_eq!((page.reverts, page.next), (vec![made.clone()], None));

    let told: RevertPreview =
        delete(&admin, &format!("{here}?preview=true")).await.expect(200).data();
    assert_eq!((told.revision, told.moved), (7, 4));
    let undone: Revert = delete(&admin, &here).await.expect(200).data();
    let how = undone.undone.clone().unwrap();
    assert_eq!((how.revision, how.put_back), (8, 4));
    floor.folded(8).await;
    assert!(admin.get(&geojson(&floor)).await.expect(200).body == full);
    assert_eq!(delete(&admin, &here).await.expect(200).data::<Revert>(), undone);
    assert_eq!(floor.describe().await.revision, 8, "once is enough");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_revert_sent_again_is_answered_the_same() {
    let server = Server::start().await;
    let admin = server.admin();
    let floor = furnished(&server).await;
    let reverts = floor.path(route::REVERTS);
    let named = |ids: &[u64], reason: &str| NewRevert {
        id: Some(Uuid::from_u128(77)),
        contributions: Some(ids.iter().copied().map(id).collect()),
        reason: reason.to_owned(),
        ..NewRevert::default()
    };
    let first: Revert = admin.post(&reverts, &named(&[1, 2], "drift")).await.expect(201).data();
    assert_eq!(first.id, Uuid::from_u128(77));
    for same in [named(&[1, 2], "drift"), named(&[2, 1, 1], " drift ")] {
        let again: Revert = admin.post(&reverts, &same).await.expect(201).data();
        assert_eq!(again, first);
    }
    // In CBOR too, where ids are bytes.
    let body = codec::to_cbor(&named(&[1, 2], "drift")).unwrap();
    let again: Revert = admin.post_bytes(&reverts, CBOR, body).await.expect(201).data();
    assert_eq!(again, first);
    for other in [named(&[1], "drift"), named(&[1, 2], "a drunken driver")] {
        assert_eq!(admin.post(&reverts, &other).await.code(409), "revert_conflict");
    }
    delete(&admin, &format!("{reverts}/{}", first.id)).await.expect(200);
    let late = admin.post(&reverts, &named(&[1, 2], "drift")).await;
    assert_eq!(late.code(409), "revert_undone");
    assert_eq!(floor.describe().await.revision, 8);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_reverted_is_refused_by_name() {
    let server = Server::start().await;
    let admin = server.admin();
    let floor = furnished(&server).await;
    let reverts = floor.path(route::REVERTS);
    let send =
        async |body: Value| admin.post_bytes(&reverts, "application/json", body.to_string()).await;
    let why = "because";
    for (body, pointers) in [
        (json!({"reason": why}), vec![""]),
        (json!({"reason": why, "robot": "r1", "contributions": [id(1)]}), vec![""]),
        (json!({"reason": why, "contributions": []}), vec!["/contributions"]),
        (json!({"reason": why, "contributions": [id(1)], "from": "x"}), vec!["/from"]),
        (json!({"reason": why, "robot": "R 1"}), vec!["/robot"]),
        (json!({"reason": "  ", "robot": "r1"}), vec!["/reason"]),
        (json!({"robot": "r1"}), vec!["/reason"]),
        (json!({"reason": "a\u{7}", "robot": "r1", "from": "today", "to": 7}), vec!["/to"]),
        (json!({"reason": "a\u{7}", "robot": "r1", "from": "today"}), vec!["/reason", "/from"]),
        (
            json!({"reason": why, "robot": "r1", "from": "2026-01-02T00:00:00Z",
                "to": "2026-01-02T00:00:00Z"}),
            vec!["/to"],
        ),
        (json!({"reason": why, "robot": "r1", "all": true}), vec!["/all"]),
    ] {
        let problem = send(body.clone()).await.problem(422);
        assert_eq!(problem.code, "body_invalid", "{body}");
        let found: Vec<&str> = problem.errors.iter().map(|e| e.pointer.as_str()).collect();
        assert_eq!(found, pointers, "{body}");
    }
    let strangers = json!({"reason": why, "contributions": [id(1), id(99), id(2), id(98)]});
    let problem = send(strangers).await.problem(422);
    assert_eq!(problem.code, "contributions_unknown");
    let found: Vec<&str> = problem.errors.iter().map(|e| e.pointer.as_str()).collect();
    assert_eq!(found, ["/contributions/1", "/contributions/3"]);
    let many: Vec<Uuid> = (0..1001).map(id).collect();
    let answer = send(json!({"reason": why, "contributions": many})).await;
    assert_eq!(answer.code(413), "too_many_items");
    let nothing = json!({"reason": why, "robot": "r1", "to": "1999-01-01T00:00:00Z"});
    let problem = send(nothing).await.problem(409);
    assert_eq!(problem.code, "nothing_to_revert");
    assert!(problem.detail.ends_with('.'), "{}", problem.detail);
    for path in [format!("{reverts}/{}", id(5)), format!("{reverts}/what")] {
        assert_eq!(admin.get(&path).await.code(404), "revert_not_found");
        assert_eq!(delete(&admin, &path).await.code(404), "revert_not_found");
        let preview = delete(&admin, &format!("{path}?preview=true")).await;
        assert_eq!(preview.code(404), "revert_not_found");
    }
    assert_eq!(admin.get(&format!("{reverts}?cursor=x")).await.code(400), "query_invalid");
    assert_eq!(admin.get(&format!("{reverts}?limit=0")).await.code(400), "query_invalid");
    assert_eq!(floor.describe().await.revision, 6, "nothing has changed");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_editor_may_and_is_named_and_a_session_too() {
    let server = Server::start().await;
    let floor = furnished(&server).await;
    let url = sqlite_url(&server.folder.path().join("data/mapfold.db"));
    let store = Store::connect(&url).await.unwrap();
    let grant = Grant {
        site: Some("plant".to_owned()),
        scopes: vec![Scope::MapRead, Scope::MapEdit],
        ..Grant::default()
    };
    let chance = Chance::from_system().unwrap();
    let token = auth::issue(&store, &chance, &grant, 0).await.unwrap();
    let editor = server.with(token.reveal());
    let reverts = floor.path(route::REVERTS);
    let made: Revert = editor.post(&reverts, &of_robot("r2")).await.expect(201).data();
    assert_eq!(made.author, token.id());

    let session = json!({"token": token.reveal()});
    let opened = server.anybody().post(route::SESSION, &session).await.expect(201);
    let cookie = opened.header("set-cookie").split(';').next().unwrap().to_owned();
    let from = |origin: String| {
        let request = server.anybody().request(Method::DELETE, &format!("{reverts}/{}", made.id));
        request.header("cookie", &cookie).header("origin", origin)
    };
    let foreign = Answer::to(from("http://evil.invalid".to_owned())).await;
    assert_eq!(foreign.code(403), "foreign_origin");
    let own = Answer::to(from(format!("http://{}", server.address()))).await.expect(200);
    assert_eq!(own.data::<Revert>().undone.unwrap().author, token.id());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_reverted_contribution_keeps_its_receipt_and_later_ones_count() {
    let server = Server::start().await;
    let admin = server.admin();
    let floor = furnished(&server).await;
    let look = floor.look("r1", 1).await;
    let log = floor.path(route::CONTRIBUTIONS);
    let receipt: Receipt = admin.post(&log, &look).await.expect(201).data();
    admin.post(&floor.path(route::REVERTS), &of_robot("r1")).await.expect(201);
    assert_eq!(admin.post(&log, &look).await.expect(201).data::<Receipt>(), receipt);
    let later = floor.contribute("r1", 9).await;
    assert_eq!(later.revision, 8);
    let counts = floor.describe().await.counts;
    assert_eq!((counts.contributions, counts.in_force), (7, 3));
    let entry: ContributionEntry = serde_json::from_value(
        admin.get(&format!("{log}/{}", look.id)).await.data::<Value>()["entry"].clone(),
    )
    .unwrap();
    assert_eq!(entry.revision, 1);
    assert_eq!(entry.state, mapfold_schema::v1::ContributionState::Reverted);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_live_stream_tells_of_acts() {
    let server = Server::start().await;
    let admin = server.admin();
    let floor = furnished(&server).await;
    let events = format!("{}?since=6", floor.path(route::EVENTS));
    let mut stream = admin.request(Method::GET, &events).send().await.unwrap();
    admin.post(&floor.path(route::REVERTS), &of_robot("r1")).await.expect(201);
    let mut text = String::new();
    while !text.contains("\"revision\":7") {
        let chunk = tokio::time::timeout(Duration::from_secs(20), stream.chunk()).await;
        text.push_str(&String::from_utf8_lossy(&chunk.unwrap().unwrap().unwrap()));
    }
    let data = text.lines().filter_map(|line| line.strip_prefix("data: ")).next_back().unwrap();
    let event: mapfold_schema::v1::LevelEvent = serde_json::from_str(data).unwrap();
    assert_eq!((event.revision, event.acts, event.robots.len()), (7, 1, 0));
    assert!(event.features + event.tiles > 0, "{event:?}");
}
