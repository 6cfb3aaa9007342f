//! The HTTP API as a stranger would use it: paths from the contract, wire types, no client library.

use std::sync::Once;
use std::time::Duration;

use mapfold_schema::codec::{self, CBOR, JSON};
use reqwest::header::{ACCEPT, CONTENT_TYPE, IF_MATCH};
use reqwest::{Client, Method, RequestBuilder};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::Error;

/// One server, spoken to with one token.
#[derive(Debug, Clone)]
pub struct Api {
    http: Client,
    url: String,
    token: String,
}

/// What came back.
#[derive(Debug, Clone)]
pub struct Answer {
    /// What was asked for.
    pub url: String,
    /// HTTP status.
    pub status: u16,
    /// `Content-Type`.
    pub content_type: String,
    /// `ETag`, if there was one.
    pub etag: Option<String>,
    /// Body, decompressed.
    pub body: Vec<u8>,
}

impl Answer {
    /// The body as a value, from JSON or CBOR as its content type says.
    ///
    /// # Errors
    /// A status other than 2xx, or a body that does not fit.
    pub fn decode<T: DeserializeOwned>(&self) -> Result<T, Error> {
        if !(200..300).contains(&self.status) {
            return Err(self.fault(self.text()));
        }
        self.decode_any()
    }

    /// The body as a value whatever the status: problems too.
    ///
    /// # Errors
    /// A body that does not fit.
    pub fn decode_any<T: DeserializeOwned>(&self) -> Result<T, Error> {
        let value = if self.content_type.starts_with(CBOR) {
            codec::from_cbor(&self.body)
        } else {
            codec::from_json(&self.body)
        };
        value.map_err(|e| self.fault(e.to_string()))
    }

    /// The beginning of the body as text.
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).chars().take(400).collect()
    }

    fn fault(&self, body: String) -> Error {
        Error::Answer { url: self.url.clone(), status: self.status, body }
    }
}

impl Api {
    /// The API at `url`, as the holder of `token`.
    ///
    /// # Errors
    /// No HTTP client can be made.
    pub fn new(url: &str, token: &str) -> Result<Self, Error> {
        static PROVIDER: Once = Once::new();
        // The HTTP client is built for TLS, and asks for a provider even if it never speaks it.
        PROVIDER.call_once(|| {
            let _ = rustls::crypto::ring::default_provider().install_default();
        });
        let http = Client::builder()
            .timeout(Duration::from_mins(1))
            .no_proxy()
            .build()
            .map_err(|source| Error::Request { url: url.to_owned(), source })?;
        Ok(Self { http, url: url.to_owned(), token: token.to_owned() })
    }

    /// The same server, with another token.
    #[must_use]
    pub fn with_token(&self, token: &str) -> Self {
        Self { token: token.to_owned(), ..self.clone() }
    }

    /// `GET`.
    ///
    /// # Errors
    /// No answer.
    pub async fn get(&self, path: &str, accept: &str) -> Result<Answer, Error> {
        self.send(Method::GET, path, accept, None).await
    }

    /// `GET` of JSON that must be there.
    ///
    /// # Errors
    /// No answer, a status other than 2xx, or a body that does not fit.
    pub async fn fetch<T: DeserializeOwned>(&self, path: &str) -> Result<T, Error> {
        self.get(path, JSON).await?.decode()
    }

    /// `POST` of bytes with a content type.
    ///
    /// # Errors
    /// No answer.
    pub async fn post(&self, path: &str, kind: &str, body: Vec<u8>) -> Result<Answer, Error> {
        self.send(Method::POST, path, JSON, Some((kind, body))).await
    }

    /// `POST` of a value as JSON.
    ///
    /// # Errors
    /// No answer, or a value that JSON cannot hold.
    pub async fn post_json<T: Serialize>(&self, path: &str, value: &T) -> Result<Answer, Error> {
        let body = codec::to_json(value).map_err(|e| Error::Answer {
            url: path.to_owned(),
            status: 0,
            body: e.to_string(),
        })?;
        self.post(path, JSON, body).await
    }

    /// The server's address.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// `POST` of nothing, for the version that `if_match` names.
    ///
    /// # Errors
    /// No answer.
    pub async fn post_matching(&self, path: &str, if_match: &str) -> Result<Answer, Error> {
        let url = format!("{}{path}", self.url);
        let request = self.http.post(&url).header(ACCEPT, JSON).header(CONTENT_TYPE, JSON);
        self.answer(url, request.header(IF_MATCH, if_match).body("null")).await
    }

    /// `PUT` of a value as JSON, in the place of the version that `if_match` names.
    ///
    /// # Errors
    /// No answer, or a value that JSON cannot hold.
    pub async fn put_json<T: Serialize>(
        &self,
        path: &str,
        if_match: &str,
        value: &T,
    ) -> Result<Answer, Error> {
        let body = codec::to_json(value).map_err(|e| Error::Answer {
            url: path.to_owned(),
            status: 0,
            body: e.to_string(),
        })?;
        let url = format!("{}{path}", self.url);
        let request = self.http.put(&url).header(ACCEPT, JSON).header(CONTENT_TYPE, JSON);
        self.answer(url, request.header(IF_MATCH, if_match).body(body)).await
    }

    /// `DELETE`.
    ///
    /// # Errors
    /// No answer.
    pub async fn delete(&self, path: &str) -> Result<Answer, Error> {
        self.send(Method::DELETE, path, JSON, None).await
    }

    async fn send(
        &self,
        method: Method,
        path: &str,
        accept: &str,
        body: Option<(&str, Vec<u8>)>,
    ) -> Result<Answer, Error> {
        let url = format!("{}{path}", self.url);
        let mut request = self.http.request(method, &url).header(ACCEPT, accept);
        if let Some((kind, body)) = body {
            request = request.header(CONTENT_TYPE, kind).body(body);
        }
        self.answer(url, request).await
    }

    async fn answer(&self, url: String, mut request: RequestBuilder) -> Result<Answer, Error> {
        let fault = |source| Error::Request { url: url.clone(), source };
        if !self.token.is_empty() {
            request = request.bearer_auth(&self.token);
        }
        let response = request.send().await.map_err(fault)?;
        let header = |name: &str| {
            let value = response.headers().get(name);
            value.and_then(|value| value.to_str().ok()).map(str::to_owned)
        };
        let (status, content_type) = (response.status().as_u16(), header("content-type"));
        let etag = header("etag");
        let body = response.bytes().await.map_err(fault)?.to_vec();
        Ok(Answer { url, status, content_type: content_type.unwrap_or_default(), etag, body })
    }
}
