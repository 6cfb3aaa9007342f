//! What can go wrong around a check, as opposed to what a check finds.

use std::path::PathBuf;

/// A fault of the surroundings: a program, a file, the network.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A log that is not what it should be.
    #[error("{path}, line {line}: {fault}")]
    Log {
        /// Which.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        fault: String,
    },
    /// A program that cannot be started, or that ended when it should not.
    #[error("{program}: {fault}")]
    Program {
        /// Which.
        program: String,
        /// What happened, with its last words.
        fault: String,
    },
    /// A request that got no answer.
    #[error("{url}: {source}")]
    Request {
        /// What was asked for.
        url: String,
        /// Why there was no answer.
        source: reqwest::Error,
    },
    /// An answer that is not what it should be.
    #[error("{url} answered {status}: {body}")]
    Answer {
        /// What was asked for.
        url: String,
        /// HTTP status.
        status: u16,
        /// The first words of the body, or what is wrong with it.
        body: String,
    },
    /// A robot that cannot survey.
    #[error("survey: {0}")]
    Survey(mapfold_client::robot::SurveyorError),
    /// The client library refuses, or has no answer.
    #[error("client: {0}")]
    Client(String),
    /// A floor with more surface than is held against a map.
    #[error("{0}")]
    Surface(mapfold_map::changes::TooMuchSurface),
    /// A script of the page's tests that failed.
    #[error("{script}: {told}")]
    Script {
        /// Which.
        script: String,
        /// How it ended, and all that it said.
        told: String,
    },
    /// A database that cannot be made.
    #[error("database: {0}")]
    Database(String),
    /// Something that did not happen in time.
    #[error("waited {seconds} s for {what}")]
    Late {
        /// For what.
        what: String,
        /// How long.
        seconds: u64,
    },
    /// A page without the place where a table belongs.
    #[error("{page}: no lines {begin:?} and {end:?}, in this order")]
    Markers {
        /// Which page.
        page: String,
        /// The line before the table.
        begin: String,
        /// The line behind it.
        end: String,
    },
}

impl Error {
    /// An input or output error at `path`.
    pub fn file(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Self::File { path: path.into(), source }
    }
}
