//! Why a request came to nothing, and whether the same one may succeed later.

use std::error::Error;
use std::time::Duration;

use mapfold_schema::codec::EncodeError;
use mapfold_schema::problem::Problem;

/// Why a request came to nothing.
///
/// Retryable are [`Self::Unreachable`], [`Self::Unavailable`] and [`Self::NotOurs`]: what was sent
/// may or may not have been taken, and sending it again is safe. All others are final.
#[derive(Debug, thiserror::Error)]
pub enum ApiError {
    /// No connection, a connection that broke, or no answer in time.
    #[error("no answer from {url}: {}", chain(.source))]
    Unreachable {
        /// What was asked for.
        url: String,
        /// What happened.
        source: reqwest::Error,
    },
    /// The server (or a proxy before it) cannot just now: 408, 425, 429, 500, 502, 503, 504, 507.
    #[error("{url} answers {status} for now: {detail}")]
    Unavailable {
        /// What was asked for.
        url: String,
        /// The HTTP status.
        status: u16,
        /// How long to wait, if the answer said so.
        retry_after: Option<Duration>,
        /// What the answer said.
        detail: String,
    },
    /// The server refused it: the same request will be refused again.
    #[error("refused with {} {}: {}", .0.status, .0.code, .0.detail)]
    Refused(Box<Problem>),
    /// Something answered that does not speak like the server: a captive portal, a proxy's error
    /// page, another server. It may go away.
    #[error("the answer of {url} (status {status}) is not from a Mapfold server: {what}")]
    NotOurs {
        /// What was asked for.
        url: String,
        /// The HTTP status.
        status: u16,
        /// What is strange about it.
        what: String,
    },
    /// The name of a site, level or robot is no slug.
    #[error(
        "{name:?} cannot name a site, level or robot: 1 to 64 lower-case letters, digits and inner \
         hyphens can"
    )]
    BadName {
        /// The name.
        name: String,
    },
    /// The server's address is none.
    #[error("{url:?} is not the address of a server: {why}")]
    BadUrl {
        /// The address.
        url: String,
        /// What is wrong with it.
        why: String,
    },
    /// The program forgot [`crate::sync::tls::install_provider`].
    #[error("no provider of TLS is installed in this process")]
    NoTlsProvider,
    /// The HTTP client cannot be made.
    #[error("no HTTP client can be made: {}", chain(.source))]
    NoHttpClient {
        /// Why.
        source: reqwest::Error,
    },
    /// What was to be sent cannot be encoded.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// What was to be sent cannot be packed.
    #[error("cannot pack what was to be sent: {0}")]
    Pack(std::io::Error),
}

impl ApiError {
    /// Whether the same request may succeed later.
    pub fn is_retryable(&self) -> bool {
        matches!(self, Self::Unreachable { .. } | Self::Unavailable { .. } | Self::NotOurs { .. })
    }

    /// How long the server asked to wait, if it did.
    pub fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Unavailable { retry_after, .. } => *retry_after,
            _ => None,
        }
    }

    /// The server's words for its refusal, if it is one.
    pub fn problem(&self) -> Option<&Problem> {
        match self {
            Self::Refused(problem) => Some(problem),
            _ => None,
        }
    }

    /// Whether the server refused it with a problem of this code.
    pub fn is_refusal(&self, code: &str) -> bool {
        self.problem().is_some_and(|problem| problem.code == code)
    }
}

/// An error with all that caused it: the HTTP client's own words stop at "error sending request".
fn chain(error: &dyn Error) -> String {
    let mut words = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        words.push_str(": ");
        words.push_str(&error.to_string());
        cause = error.source();
    }
    words
}
