//! An answer: read to its end within bounds, unpacked, and judged for whether it is the server's.

use std::io::Read as _;
use std::time::Duration;

use mapfold_schema::codec;
use mapfold_schema::problem::Problem;
use reqwest::Response;
use reqwest::header::{CONTENT_ENCODING, CONTENT_TYPE, DATE, HeaderMap, HeaderName, RETRY_AFTER};
use serde::de::DeserializeOwned;
use time::PrimitiveDateTime;
use time::macros::format_description;

use super::ApiError;
use super::traffic::TrafficCounters;

/// Every problem of the server is of a kind that begins so.
const PROBLEM_KIND: &str = "urn:mapfold:problem:";
/// Longest piece of a strange answer that an error repeats, bytes.
const ECHO_LENGTH_MAX: usize = 200;

/// What came back.
#[derive(Debug)]
pub(super) struct Answer {
    url: String,
    status: u16,
    media_type: String,
    retry_after: Option<Duration>,
    body: Vec<u8>,
}

impl Answer {
    /// Reads an answer of at most `bytes_max` bytes, packed or unpacked.
    pub(super) async fn read(
        url: String,
        mut response: Response,
        bytes_max: usize,
        traffic: &TrafficCounters,
    ) -> Result<Self, ApiError> {
        let status = response.status().as_u16();
        let media_type = text(response.headers(), &CONTENT_TYPE).unwrap_or_default().to_owned();
        let coding = text(response.headers(), &CONTENT_ENCODING).map(str::to_owned);
        let retry_after = retry_after(response.headers());
        let strange = |what: String| ApiError::NotOurs { url: url.clone(), status, what };
        let mut packed = Vec::new();
        loop {
            match response.chunk().await {
                Ok(None) => break,
                Ok(Some(chunk)) => {
                    traffic.received(chunk.len());
                    if packed.len() + chunk.len() > bytes_max {
                        return Err(strange(format!("it is longer than {bytes_max} bytes")));
                    }
                    packed.extend_from_slice(&chunk);
                }
                Err(source) => {
                    return Err(ApiError::Unreachable { url, source: source.without_url() });
                }
            }
        }
        let body = unpacked(coding.as_deref(), packed, bytes_max).map_err(strange)?;
        Ok(Self { url, status, media_type, retry_after, body })
    }

    /// The answer if it is a success, else the error that it means.
    pub(super) fn succeeded(self) -> Result<Self, ApiError> {
        match self.status {
            200..=299 => Ok(self),
            408 | 425 | 429 | 500 | 502..=504 | 507 => Err(ApiError::Unavailable {
                detail: self.problem().map_or_else(|| self.echo(), |problem| problem.detail),
                url: self.url,
                status: self.status,
                retry_after: self.retry_after,
            }),
            _ => match self.problem() {
                Some(problem) => Err(ApiError::Refused(Box::new(problem))),
                None => Err(self.not_ours("no such status is expected without a problem")),
            },
        }
    }

    /// The body as a value.
    pub(super) fn decode<T: DeserializeOwned>(&self) -> Result<T, ApiError> {
        codec::decode(&self.media_type, &self.body).map_err(|e| self.not_ours(&e.to_string()))
    }

    /// The error of an answer that the server would not have given.
    pub(super) fn not_ours(&self, what: &str) -> ApiError {
        ApiError::NotOurs {
            url: self.url.clone(),
            status: self.status,
            what: format!("{what}; it begins with {:?}", self.echo()),
        }
    }

    fn problem(&self) -> Option<Problem> {
        let problem: Problem = codec::from_json(&self.body).ok()?;
        is_ours(&problem).then_some(problem)
    }

    /// The beginning of the body, as text.
    fn echo(&self) -> String {
        let begin = &self.body[..self.body.len().min(ECHO_LENGTH_MAX)];
        String::from_utf8_lossy(begin).into_owned()
    }
}

/// Whether a problem is in the server's words.
pub(super) fn is_ours(problem: &Problem) -> bool {
    problem.kind.starts_with(PROBLEM_KIND)
}

/// A body without its coding, at most `bytes_max` long.
fn unpacked(coding: Option<&str>, packed: Vec<u8>, bytes_max: usize) -> Result<Vec<u8>, String> {
    let coding = coding.map(|coding| coding.trim().to_ascii_lowercase());
    let mut reader: Box<dyn std::io::Read + '_> = match coding.as_deref() {
        None | Some("" | "identity") => return Ok(packed),
        Some("zstd") => Box::new(
            zstd::stream::read::Decoder::with_buffer(packed.as_slice())
                .map_err(|e| e.to_string())?,
        ),
        Some("gzip") => Box::new(flate2::read::MultiGzDecoder::new(packed.as_slice())),
        Some(other) => return Err(format!("it is packed as {other:?}, which was not asked for")),
    };
    let mut body = Vec::new();
    let read = reader.by_ref().take(bytes_max as u64 + 1).read_to_end(&mut body);
    match read {
        Ok(length) if length > bytes_max => {
            Err(format!("it is longer than {bytes_max} bytes once unpacked"))
        }
        Ok(_) => Ok(body),
        Err(error) => Err(format!("it cannot be unpacked: {error}")),
    }
}

fn text<'h>(headers: &'h HeaderMap, name: &HeaderName) -> Option<&'h str> {
    headers.get(name)?.to_str().ok()
}

/// RFC 9110, section 10.2.3: seconds, or a date; the latter against the answer's own date, so that
/// no clock is asked and the robot's may be wrong.
fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    let asked = text(headers, &RETRY_AFTER)?.trim();
    if let Ok(seconds) = asked.parse() {
        return Some(Duration::from_secs(seconds));
    }
    let (then, now) = (http_date(asked)?, http_date(text(headers, &DATE)?)?);
    Some((then - now).try_into().unwrap_or_default())
}

/// The one form of date that HTTP still writes: `Sun, 06 Nov 1994 08:49:37 GMT`.
fn http_date(text: &str) -> Option<PrimitiveDateTime> {
    let format = format_description!(
        "[weekday repr:short], [day] [month repr:short] [year] [hour]:[minute]:[second] GMT"
    );
    PrimitiveDateTime::parse(text.trim(), format).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(pairs: &[(HeaderName, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect()
    }

    #[test]
    fn retry_after_is_seconds_or_a_date_against_the_answers_own() {
        let of = |pairs: &[(HeaderName, &str)]| retry_after(&headers(pairs));
        let date = (DATE, "Sun, 06 Nov 1994 08:49:37 GMT");
        assert_eq!(of(&[(RETRY_AFTER, "7")]), Some(Duration::from_secs(7)));
        let later = (RETRY_AFTER, "Sun, 06 Nov 1994 08:50:07 GMT");
        assert_eq!(of(&[later.clone(), date.clone()]), Some(Duration::from_secs(30)));
        let earlier = (RETRY_AFTER, "Sun, 06 Nov 1994 08:00:00 GMT");
        assert_eq!(of(&[earlier, date.clone()]), Some(Duration::ZERO));
        assert_eq!(of(&[later]), None, "without a date of the answer there is nothing to subtract");
        for nonsense in ["soon", "-1", "1.5", "", "99999999999999999999999"] {
            assert_eq!(of(&[(RETRY_AFTER, nonsense), date.clone()]), None, "{nonsense:?}");
        }
        assert_eq!(of(&[]), None);
    }

    #[test]
    fn what_swells_beyond_the_bound_is_cut_off() {
        let bomb = zstd::encode_all(vec![0_u8; 1 << 20].as_slice(), 3).unwrap();
        assert!(bomb.len() < 1000);
        assert!(unpacked(Some("zstd"), bomb.clone(), 1 << 20).is_ok_and(|b| b.len() == 1 << 20));
        assert!(unpacked(Some("zstd"), bomb, (1 << 20) - 1).unwrap_err().contains("longer than"));
        assert!(unpacked(Some("zstd"), b"not zstd".to_vec(), 100).is_err());
        assert!(unpacked(Some("gzip"), b"not gzip".to_vec(), 100).is_err());
        assert!(unpacked(Some("br"), Vec::new(), 100).is_err());
        assert_eq!(unpacked(None, b"plain".to_vec(), 100).unwrap(), b"plain");
    }
}
