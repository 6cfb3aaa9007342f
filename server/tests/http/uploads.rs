//! Contributions on their way in, and the log.

use std::collections::BTreeSet;

use mapfold_schema::border::{DEFAULT_LIMITS, Target};
use mapfold_schema::codec::{self, CBOR, JSON};
use mapfold_schema::digest::content_digest;
use mapfold_schema::v1::{ContributionPage, ContributionRecord, Receipt, UploadAnswer};
use mapfold_schema::{malformed, route};
use mapfold_server::level::LevelOptions;
use serde_json::{Value, json};

use crate::server::Server;
use crate::world::{Level, id};

#[tokio::test(flavor = "multi_thread")]
async fn the_same_contribution_gets_the_same_receipt_as_json_and_as_cbor() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::CONTRIBUTIONS);
    let look = floor.look("r1", 1).await;
    let first = server.admin().post(&path, &look).await.expect(201);
    let place = first.header("location").to_owned();
    let receipt: Receipt = first.data();
    assert_eq!(receipt.revision, 1);
    assert_eq!(receipt.digest, content_digest(&look).unwrap());
    let body = codec::to_cbor(&look).unwrap();
    let again = server.admin().post_bytes(&path, CBOR, body).await.expect(201);
    assert_eq!(again.data::<Receipt>(), receipt);

    let mut other = look.clone();
    other.pose.x_m += 1.0;
    let problem = server.admin().post(&path, &other).await.problem(409);
    assert_eq!((problem.code.as_str(), problem.retryable), ("contribution_conflict", false));
    let record: ContributionRecord = server.admin().get(&place).await.expect(200).data();
    assert_eq!(record.contribution, look);
    assert_eq!((record.entry.revision, record.digest), (1, receipt.digest));
}

#[tokio::test(flavor = "multi_thread")]
async fn of_an_array_each_is_answered_for_itself_in_order() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::CONTRIBUTIONS);
    floor.contribute("r1", 1).await;
    let mut taken = floor.look("r1", 1).await;
    taken.pose.y_m += 1.0;
    let mut indefinite = json!(floor.look("r1", 2).await);
    indefinite["pose"]["covariance"][0][0] = json!(-1.0);
    let mut shapeless = json!(floor.look("r1", 3).await);
    shapeless["pose"]["x_m"] = json!("here");
    let body = json!([
        floor.look("r1", 4).await,
        taken,
        indefinite,
        shapeless,
        floor.look("stranger", 5).await,
        floor.look("r1", 6).await,
        floor.look("r1", 1).await,
    ]);
    let answers: Vec<UploadAnswer> = server.admin().post(&path, &body).await.expect(201).data();
    let words: Vec<String> = answers
        .iter()
        .map(|answer| match answer {
            UploadAnswer::Receipt(receipt) => format!("revision {}", receipt.revision),
            UploadAnswer::Problem(problem) => format!("{} {}", problem.status, problem.code),
        })
        .collect();
    assert_eq!(
        words,
        [
            "revision 2",
            "409 contribution_conflict",
            "422 contribution_invalid",
            "422 contribution_invalid",
            "404 robot_not_found",
            "revision 3",
            "revision 1",
        ]
    );
    let wire: Value =
        serde_json::from_slice(&server.admin().post(&path, &body).await.body).unwrap();
    assert!(wire[0]["receipt"]["revision"] == 2 && wire[1]["problem"]["status"] == 409, "{wire}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_array_of_cbor_is_taken_apart_too() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let look = codec::to_cbor(&floor.look("r1", 1).await).unwrap();
    // An array of two: a contribution, and the number 7.
    let body = [&[0x82], look.as_slice(), &[0x07]].concat();
    let request = server.admin().request(reqwest::Method::POST, &floor.path(route::CONTRIBUTIONS));
    let request = request.header("content-type", CBOR).header("accept", CBOR).body(body);
    let answer = crate::client::Answer::to(request).await.expect(201);
    assert_eq!(answer.header("content-type"), CBOR);
    let answers: Vec<UploadAnswer> = answer.data();
    assert!(matches!(answers[..], [UploadAnswer::Receipt(_), UploadAnswer::Problem(_)]));
}

#[tokio::test(flavor = "multi_thread")]
async fn more_than_64_at_once_are_refused_and_64_are_taken() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::CONTRIBUTIONS);
    let mut looks = Vec::new();
    for number in 0..65 {
        looks.push(floor.look("r1", number).await);
    }
    assert_eq!(server.admin().post(&path, &looks).await.code(413), "too_many_items");
    assert_eq!(floor.describe().await.revision, 0);
    let answers: Vec<UploadAnswer> =
        server.admin().post(&path, &&looks[..64]).await.expect(201).data();
    assert_eq!(answers.len(), 64);
    floor.folded(64).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_finds_no_place_in_the_queue_is_to_be_sent_again() {
    let levels = LevelOptions { queue_capacity: 2, ..LevelOptions::default() };
    let server = Server::start_as(|_| {}, levels).await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::CONTRIBUTIONS);
    let looks = [floor.look("r1", 1).await, floor.look("r1", 2).await, floor.look("r1", 3).await];
    let answer = server.admin().post(&path, &looks).await;
    assert_eq!(answer.header("retry-after"), "1");
    let problem = answer.problem(503);
    assert_eq!((problem.code.as_str(), problem.retryable), ("queue_full", true));
    assert_eq!(floor.describe().await.revision, 0);
    let answers: Vec<UploadAnswer> =
        server.admin().post(&path, &&looks[..2]).await.expect(201).data();
    assert!(answers.iter().all(|answer| matches!(answer, UploadAnswer::Receipt(_))));
}

#[tokio::test(flavor = "multi_thread")]
async fn every_malformed_contribution_is_refused_by_name_and_changes_nothing() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::CONTRIBUTIONS);
    let level = floor.describe().await;
    let target =
        Target { frame: level.frame, resolution_m: level.resolution_m, limits: DEFAULT_LIMITS };
    let catalogue = malformed::catalogue(id(1), "r1", &target);
    assert!(catalogue.len() >= 40);
    for malformed in catalogue {
        let problem = server.admin().post(&path, &malformed.body).await.problem(422);
        assert_eq!(problem.code, "contribution_invalid", "{}", malformed.name);
        let named = problem
            .errors
            .iter()
            .any(|e| e.code == malformed.code && e.pointer == malformed.pointer);
        assert!(named, "{}: {:?}", malformed.name, problem.errors);
    }
    assert_eq!(floor.describe().await, level);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_is_no_upload_is_refused_by_name() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::CONTRIBUTIONS);
    let deep = "[".repeat(100_000);
    let look = serde_json::to_string(&floor.look("r1", 1).await).unwrap();
    let huge_number = look.replacen("\"rho_m\":2.0", "\"rho_m\":1e400", 1);
    assert_ne!(look, huge_number);
    let twice = look.replacen("\"robot\":", "\"robot\":\"r1\",\"robot\":", 1);
    for (media_type, body, status, code) in [
        (JSON, String::new(), 400, "body_malformed"),
        (JSON, "{".to_owned(), 400, "body_malformed"),
        (JSON, deep, 400, "body_malformed"),
        (JSON, huge_number, 422, "contribution_invalid"),
        (JSON, look.replacen("2.0", "NaN", 1), 400, "body_malformed"),
        (JSON, twice, 422, "contribution_invalid"),
        (JSON, "{}".to_owned(), 422, "contribution_invalid"),
        (JSON, "7".to_owned(), 422, "contribution_invalid"),
        (CBOR, look.clone(), 400, "body_malformed"),
        (CBOR, "\u{7f}\u{7f}".to_owned(), 400, "body_malformed"),
        ("text/plain", look.clone(), 415, "unsupported_media_type"),
        ("", look.clone(), 415, "unsupported_media_type"),
    ] {
        let answer = server.admin().post_bytes(&path, media_type, body.clone()).await;
        let start = &body[..body.len().min(40)];
        let problem = answer.problem(status);
        assert_eq!(problem.code, code, "{media_type} {start}: {}", problem.detail);
    }
    assert_eq!(floor.describe().await.revision, 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_log_is_read_in_pages_newest_first_and_filtered() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    floor.enrol("r2").await;
    for number in 1..=7 {
        floor.contribute(if number % 2 == 0 { "r2" } else { "r1" }, number).await;
    }
    let path = floor.path(route::CONTRIBUTIONS);
    let page = |query: String| {
        let (client, path) = (server.admin(), path.clone());
        async move {
            client.get(&format!("{path}?{query}")).await.expect(200).data::<ContributionPage>()
        }
    };
    let revisions =
        |page: &ContributionPage| page.contributions.iter().map(|c| c.revision).collect::<Vec<_>>();
    let mut seen = Vec::new();
    let mut query = "limit=3".to_owned();
    loop {
        let page = page(query).await;
        seen.extend(revisions(&page));
        let Some(next) = page.next else { break };
        query = format!("limit=3&cursor={next}");
    }
    assert_eq!(seen, [7, 6, 5, 4, 3, 2, 1]);
    assert_eq!(revisions(&page("robot=r2".to_owned()).await), [6, 4, 2]);
    assert_eq!(revisions(&page("since=5".to_owned()).await), [7, 6]);
    assert_eq!(revisions(&page("state=held".to_owned()).await), [0; 0]);
    let ids: BTreeSet<_> =
        page("state=folded".to_owned()).await.contributions.into_iter().map(|c| c.id).collect();
    assert_eq!(ids, (1..=7).map(id).collect());
    for bad in ["limit=0", "limit=1001", "cursor=x", "state=lost", "colour=red", "bbox=1,2"] {
        let answer = server.admin().get(&format!("{path}?{bad}")).await;
        assert_eq!(answer.code(400), "query_invalid", "{bad}");
    }
    let missing = server.admin().get(&format!("{path}/{}", id(99))).await;
    assert_eq!(missing.code(404), "contribution_not_found");
}
