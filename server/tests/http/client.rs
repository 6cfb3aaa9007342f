//! Somebody who asks, and the answers.

use std::net::SocketAddr;

use mapfold_schema::codec;
use mapfold_schema::problem::{PROBLEM_JSON, Problem};
use reqwest::Method;
use reqwest::header::{HeaderMap, HeaderName, HeaderValue};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Somebody, with a token or without.
#[derive(Clone)]
pub(crate) struct Client {
    http: reqwest::Client,
    root: String,
    token: Option<String>,
}

/// What came back.
#[derive(Debug, Clone)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) headers: HeaderMap,
    pub(crate) body: Vec<u8>,
}

impl Client {
    pub(crate) fn new(address: SocketAddr, token: Option<&str>) -> Self {
        // A second server in this process finds it installed already.
        let _installed = rustls::crypto::ring::default_provider().install_default();
        // Answers are to be seen as they were sent, so nothing is unpacked.
        let http = reqwest::Client::builder().no_gzip().no_zstd().build().unwrap();
        Self { http, root: format!("http://{address}"), token: token.map(ToOwned::to_owned) }
    }

    /// A request that has not been sent yet.
    pub(crate) fn request(&self, method: Method, path: &str) -> reqwest::RequestBuilder {
        let request = self.http.request(method, format!("{}{path}", self.root));
        match &self.token {
            Some(token) => request.bearer_auth(token),
            None => request,
        }
    }

    pub(crate) async fn get(&self, path: &str) -> Answer {
        Answer::to(self.request(Method::GET, path)).await
    }

    /// `GET` with one more header.
    pub(crate) async fn get_with(&self, path: &str, name: HeaderName, value: &str) -> Answer {
        Answer::to(self.request(Method::GET, path).header(name, value)).await
    }

    pub(crate) async fn post<T: Serialize>(&self, path: &str, body: &T) -> Answer {
        let body = codec::to_json(body).unwrap();
        self.post_bytes(path, codec::JSON, body).await
    }

    pub(crate) async fn post_bytes(
        &self,
        path: &str,
        media_type: &str,
        body: impl Into<reqwest::Body>,
    ) -> Answer {
        let request = self.request(Method::POST, path).header("content-type", media_type);
        Answer::to(request.body(body)).await
    }
}

impl Answer {
    /// Sends a request and takes the whole answer.
    pub(crate) async fn to(request: reqwest::RequestBuilder) -> Self {
        let response = request.send().await.unwrap();
        Self {
            status: response.status().as_u16(),
            headers: response.headers().clone(),
            body: response.bytes().await.unwrap().to_vec(),
        }
    }

    /// The answer, if it has this status.
    #[track_caller]
    pub(crate) fn expect(self, status: u16) -> Self {
        assert_eq!(self.status, status, "{}", String::from_utf8_lossy(&self.body));
        self
    }

    /// The answer as data.
    #[track_caller]
    pub(crate) fn data<T: DeserializeOwned>(&self) -> T {
        codec::decode(self.header("content-type"), &self.body).unwrap()
    }

    /// The answer as a problem of this status.
    #[track_caller]
    pub(crate) fn problem(self, status: u16) -> Problem {
        let answer = self.expect(status);
        assert_eq!(answer.header("content-type"), PROBLEM_JSON);
        let problem: Problem = codec::from_json(&answer.body).unwrap();
        assert_eq!(problem.status, status);
        assert_eq!(problem.kind, format!("urn:mapfold:problem:{}", problem.code));
        assert_eq!(problem.request_id.as_deref(), Some(answer.header("x-request-id")));
        problem
    }

    /// The code of the problem.
    #[track_caller]
    pub(crate) fn code(self, status: u16) -> String {
        self.problem(status).code
    }

    /// A header's text; empty if there is none.
    pub(crate) fn header(&self, name: &str) -> &str {
        self.headers.get(name).map(HeaderValue::to_str).and_then(Result::ok).unwrap_or_default()
    }
}
