//! One request and its answer, for all endpoints.

use mapfold_schema::codec::{self, CBOR, JSON};
use reqwest::Method;
use reqwest::header::{ACCEPT, ACCEPT_ENCODING, CONTENT_ENCODING, CONTENT_TYPE};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::answer::Answer;
use super::{Api, ApiError};

/// What is sent along.
pub(super) struct Body {
    pub(super) media_type: &'static str,
    pub(super) coding: Option<&'static str>,
    pub(super) bytes: Vec<u8>,
}

impl Api {
    /// `GET`, and the answer as a value.
    pub(super) async fn get<T: DeserializeOwned>(&self, path: &str) -> Result<T, ApiError> {
        self.exchange(Method::GET, path, None).await?.decode()
    }

    /// Sends a value, and reads the answer as another.
    pub(super) async fn send_value<T: DeserializeOwned>(
        &self,
        method: Method,
        path: &str,
        value: &impl Serialize,
    ) -> Result<T, ApiError> {
        let body = Body { media_type: JSON, coding: None, bytes: codec::to_json(value)? };
        self.exchange(method, path, Some(body)).await?.decode()
    }

    /// Sends a request and reads the answer; an answer that is no success is an error.
    pub(super) async fn exchange(
        &self,
        method: Method,
        path: &str,
        body: Option<Body>,
    ) -> Result<Answer, ApiError> {
        let url = format!("{}{path}", self.base_url);
        let mut request = self
            .http
            .request(method, &url)
            .bearer_auth(&self.token)
            .header(ACCEPT, CBOR)
            .header(ACCEPT_ENCODING, "zstd, gzip");
        let mut bytes = 0;
        if let Some(body) = body {
            bytes = body.bytes.len();
            request = request.header(CONTENT_TYPE, body.media_type);
            if let Some(coding) = body.coding {
                request = request.header(CONTENT_ENCODING, coding);
            }
            request = request.body(body.bytes);
        }
        let outcome = request.send().await;
        // Of what failed on the way nobody knows how much was sent; of what found nobody, all do.
        if !outcome.as_ref().is_err_and(reqwest::Error::is_connect) {
            self.traffic.sent(bytes);
        }
        match outcome {
            Ok(response) => {
                Answer::read(url, response, self.options.answer_bytes_max, &self.traffic)
                    .await?
                    .succeeded()
            }
            Err(source) => Err(ApiError::Unreachable { url, source: source.without_url() }),
        }
    }
}
