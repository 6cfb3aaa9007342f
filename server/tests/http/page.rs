//! The operators' page, and what every answer says to browsers.

use reqwest::Method;

use crate::client::Answer;
use crate::server::Server;

#[tokio::test(flavor = "multi_thread")]
async fn every_answer_whatever_made_it_says_what_a_page_may_do() {
    let server = Server::start().await;
    for (method, path, status) in [
        (Method::GET, "/", 200),
        (Method::GET, "/livez", 200),
        (Method::GET, "/api/v1/sites", 401),
        (Method::GET, "/api/v1/nothing", 404),
        (Method::POST, "/nothing", 404),
        (Method::PUT, "/api/v1/sites", 405),
        (Method::GET, "/assets/../../Cargo.toml", 404),
        (Method::GET, "/%2e%2e%2fCargo.toml", 404),
        (Method::HEAD, "/nothing", 404),
    ] {
        let answer = Answer::to(server.anybody().request(method.clone(), path)).await;
        let answer = answer.expect(status);
        let policy = answer.header("content-security-policy");
        assert!(policy.starts_with("default-src 'none'; script-src 'self';"), "{policy}");
        assert!(policy.contains("frame-ancestors 'none'"), "{policy}");
        for (name, value) in [
            ("x-content-type-options", "nosniff"),
            ("referrer-policy", "no-referrer"),
            ("cross-origin-opener-policy", "same-origin"),
            ("cross-origin-resource-policy", "same-origin"),
        ] {
            assert_eq!(answer.header(name), value, "{method} {path}");
        }
        assert_eq!(answer.header("x-request-id").len(), 32);
        assert_eq!(answer.header("access-control-allow-origin"), "");
        assert_eq!(answer.header("server"), "");
        if status >= 400 && method != Method::HEAD {
            answer.problem(status);
        }
    }
    let answer = Answer::to(server.anybody().request(Method::PUT, "/api/v1/sites")).await;
    assert_eq!(answer.header("allow"), "GET,HEAD,POST");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_first_page_is_there_whether_or_not_it_was_built() {
    let server = Server::start().await;
    let answer = server.anybody().get("/").await.expect(200);
    assert_eq!(answer.header("content-type"), "text/html; charset=utf-8");
    let html = String::from_utf8(answer.body).unwrap();
    assert!(html.contains("Mapfold"), "{html}");
}
