//! The API's answers, as they should be and as they should not.

use std::time::Duration;

use mapfold_schema::v1;

use super::*;
use crate::sync::tests::stub::Stub;
use crate::sync::tests::{api, contribution, contributions, level};

fn api_of(stub: &Stub) -> Api {
    api(&stub.url(), ApiOptions::STANDARD)
}

#[tokio::test(flavor = "multi_thread")]
async fn receipts_come_in_the_order_of_what_was_sent_and_the_same_again() {
    let stub = Stub::start();
    let api = api_of(&stub);
    let sent = contributions(0..5);
    let answers = api.contribute(&level(), &sent).await.unwrap();
    for (n, (answer, contribution)) in answers.iter().zip(&sent).enumerate() {
        let v1::UploadAnswer::Receipt(receipt) = answer else { panic!("{answer:?}") };
        assert_eq!((receipt.id, receipt.revision), (contribution.id, n as i64 + 1));
    }
    assert_eq!(api.contribute(&level(), &sent).await.unwrap(), answers);
    let traffic = api.clone().traffic();
    assert_eq!((traffic.requests, traffic.bytes_up), (2, stub.ledger().bytes_in));
    assert!(traffic.bytes_down > 5 * 64);
}

#[tokio::test(flavor = "multi_thread")]
async fn one_bad_contribution_gets_its_problem_and_the_others_their_receipts() {
    let stub = Stub::start();
    stub.ledger().refused.insert(contribution(1).id);
    let answers = api_of(&stub).contribute(&level(), &contributions(0..3)).await.unwrap();
    let kinds: Vec<bool> =
        answers.iter().map(|a| matches!(a, v1::UploadAnswer::Receipt(_))).collect();
    assert_eq!(kinds, [true, false, true]);
}

#[tokio::test(flavor = "multi_thread")]
async fn values_are_read_whatever_they_are_packed_and_encoded_as() {
    let stub = Stub::start();
    stub.ledger().take(&contributions(0..3));
    let api = api_of(&stub);
    assert_eq!(api.sites().await.unwrap()[0].levels, ["ground"], "JSON in gzip");
    assert_eq!(api.level(&level()).await.unwrap().revision, 3, "CBOR as it is");
    let page = api.patches(&level(), 1, 1000).await.unwrap();
    assert_eq!((page.since, page.revision), (1, 3), "CBOR in zstd");
    let vector = api.vector(&level(), 0).await.unwrap();
    assert_eq!(vector.segments.len(), stub.ledger().map().segments.len());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refusal_is_final_and_bears_the_servers_words() {
    let stub = Stub::start();
    let api = api_of(&stub);
    let new = v1::NewSite { site: "plant".to_owned(), name: None };
    let error = api.create_site(&new).await.unwrap_err();
    assert!(error.is_refusal("site_exists") && !error.is_retryable(), "{error}");
    assert_eq!(error.to_string(), "refused with 409 site_exists: the stub says site_exists");
    let error = api.patches(&level(), 9, 10).await.unwrap_err();
    assert!(error.is_refusal("cursor_expired") && !error.is_retryable());
    let error = api.with_token("wrong").level(&level()).await.unwrap_err();
    assert_eq!(error.problem().unwrap().status, 401);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_path_that_another_server_does_not_know_is_no_refusal_of_ours() {
    let stub = Stub::start();
    // The stub answers 404 without a problem there, like any web server.
    let error = api_of(&stub).robots("plant").await.unwrap_err();
    assert!(matches!(error, ApiError::NotOurs { status: 404, .. }), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_there_is_retryable() {
    let mut stub = Stub::start();
    stub.kill();
    let error = api_of(&stub).level(&level()).await.unwrap_err();
    assert!(matches!(error, ApiError::Unreachable { .. }) && error.is_retryable());
    // Refused, or reset while the listener is still going down: the system's words are told.
    assert!(error.to_string().contains("os error"), "the cause is told: {error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_does_not_end_is_cut_off() {
    let stub = Stub::start();
    stub.ledger().take(&contributions(0..20));
    let options = ApiOptions { answer_bytes_max: 1000, ..ApiOptions::STANDARD };
    let error = api(&stub.url(), options).patches(&level(), 0, 20_000).await.unwrap_err();
    assert!(error.to_string().contains("longer than 1000 bytes"), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn silence_has_an_end() {
    let stub = Stub::start();
    stub.ledger().delay = Duration::from_secs(5);
    let options =
        ApiOptions { request_timeout: Duration::from_millis(100), ..ApiOptions::STANDARD };
    let api = api(&stub.url(), options);
    let error = api.contribute(&level(), &contributions(0..1)).await.unwrap_err();
    assert!(error.is_retryable() && error.to_string().contains("timed out"), "{error}");
}

#[tokio::test]
async fn what_cannot_stand_in_a_path_is_not_sent() {
    let api = api("http://127.0.0.1:1", ApiOptions::STANDARD);
    for name in ["", "../admin", "Plant", "a b", "a/b", "a?b", "-a"] {
        let error = api.robot("plant", name).await.unwrap_err();
        assert!(matches!(error, ApiError::BadName { .. }), "{name:?}");
        assert!(matches!(api.levels(name).await, Err(ApiError::BadName { .. })));
        let address = LevelAddress { site: "plant".to_owned(), level: name.to_owned() };
        assert!(matches!(api.level(&address).await, Err(ApiError::BadName { .. })));
    }
    assert_eq!(api.traffic(), Traffic::default());
}

#[test]
fn addresses_that_are_none_are_refused_by_name() {
    tls::install_provider();
    for url in ["", "127.0.0.1:7171", "ftp://server", "http://", "file:///etc/passwd", "http://a b"]
    {
        let error = Api::new(url, "token", ApiOptions::STANDARD).unwrap_err();
        assert!(matches!(error, ApiError::BadUrl { .. }), "{url:?}: {error}");
    }
    let api = Api::new("http://127.0.0.1:7171/", "token", ApiOptions::STANDARD).unwrap();
    assert_eq!(&*api.base_url, "http://127.0.0.1:7171");
}

#[test]
fn the_token_is_not_shown() {
    let api = api("http://127.0.0.1:1", ApiOptions::STANDARD).with_token("very-secret");
    assert!(!format!("{api:?}").contains("very-secret"));
}
