//! Signing in on the page.

use mapfold_schema::route;
use mapfold_schema::v1::{NewSession, NewSite, Scope, SessionDescription};
use mapfold_server::store::{Store, sqlite_url};
use reqwest::Method;
use reqwest::header::{COOKIE, ORIGIN};

use crate::client::Answer;
use crate::server::{ADMIN, Server};
use crate::world::Level;

fn sign_in(token: &str) -> NewSession {
    NewSession { token: token.to_owned() }
}

/// The cookie that an answer sets, as a browser sends it back.
fn cookie(answer: &Answer) -> String {
    answer.header("set-cookie").split(';').next().unwrap().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_operator_signs_in_reads_and_signs_out() {
    let server = Server::start().await;
    let browser = server.anybody();
    let answer = browser.post(route::SESSION, &sign_in(&format!(" {ADMIN}\n"))).await.expect(201);
    let set = answer.header("set-cookie");
    for attribute in ["HttpOnly", "SameSite=Strict", "Path=/"] {
        assert!(set.contains(attribute), "{set}");
    }
    assert!(!set.contains(ADMIN), "the cookie is not the token itself");
    let session: SessionDescription = answer.data();
    assert_eq!(session.scopes, [Scope::Admin]);
    assert!(session.expires_at.is_some());

    let cookie = cookie(&answer);
    let who = browser.get_with(route::SESSION, COOKIE, &cookie).await.expect(200);
    assert_eq!(who.data::<SessionDescription>(), session);
    browser.get_with(route::SITES, COOKIE, &cookie).await.expect(200);

    let origin = format!("http://{}", server.address());
    let sign_out = browser.request(Method::DELETE, route::SESSION);
    let sign_out = sign_out.header(COOKIE, &cookie).header(ORIGIN, origin);
    let out = Answer::to(sign_out).await.expect(204);
    assert!(out.header("set-cookie").contains("Max-Age=0"));
    assert_eq!(browser.get_with(route::SITES, COOKIE, &cookie).await.code(401), "invalid_token");
    server.admin().get(route::SITES).await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_session_ends_with_the_token_it_was_made_from() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let token = floor.token("r1").await;
    let answer = server.anybody().post(route::SESSION, &sign_in(&token)).await.expect(201);
    let cookie = cookie(&answer);
    let session: SessionDescription = answer.data();
    assert_eq!(session.site.as_deref(), Some("plant"));
    let path = floor.path(route::LEVEL);
    server.anybody().get_with(&path, COOKIE, &cookie).await.expect(200);

    let parent = session.id.split_once('-').unwrap().0;
    assert!(token.contains(parent), "the session names its parent");
    let file = server.folder.path().join("data/mapfold.db");
    let store = Store::connect(&sqlite_url(&file)).await.unwrap();
    assert!(store.revoke_token(parent, 1).await.unwrap());
    let after = server.anybody().get_with(&path, COOKIE, &cookie).await;
    assert_eq!(after.code(401), "invalid_token");
}

#[tokio::test(flavor = "multi_thread")]
async fn another_pages_request_changes_nothing() {
    let server = Server::start().await;
    let browser = server.anybody();
    let answer = browser.post(route::SESSION, &sign_in(ADMIN)).await.expect(201);
    let cookie = cookie(&answer);
    let make = |site: &str, origin: Option<String>| {
        let body = serde_json::to_vec(&NewSite { site: site.to_owned(), name: None }).unwrap();
        let request = browser.request(Method::POST, route::SITES).header(COOKIE, &cookie);
        let request = request.header("content-type", "application/json").body(body);
        match origin {
            Some(origin) => request.header(ORIGIN, origin),
            None => request,
        }
    };
    for foreign in [None, Some("http://evil.invalid".to_owned()), Some("null".to_owned())] {
        let answer = Answer::to(make("evil", foreign)).await;
        assert_eq!(answer.code(403), "foreign_origin");
    }
    Answer::to(make("good", Some(format!("http://{}", server.address())))).await.expect(201);
    // Nor can it sign a browser in as somebody else.
    let body = serde_json::to_vec(&sign_in(ADMIN)).unwrap();
    let login = browser.request(Method::POST, route::SESSION).header(ORIGIN, "http://evil.invalid");
    let login = login.header("content-type", "application/json").body(body);
    assert_eq!(Answer::to(login).await.code(403), "foreign_origin");
    let bad = browser.post(route::SESSION, &sign_in("not-a-token-of-this-server")).await;
    assert_eq!(bad.code(401), "invalid_token");
}
