//! Every error of the HTTP side, and the problem (RFC 9457) that it becomes. The only place that
//! knows which error is which status.

pub(super) mod gdb;

use std::sync::Arc;

use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use mapfold_schema::border::{VIOLATIONS_MAX, Violation};
use mapfold_schema::codec::{DecodeError, EncodeError};
use mapfold_schema::problem::Problem;
use mapfold_schema::v1::Scope;

use crate::exchange::building::BuildingError;
use crate::exchange::incoming::FileFault;
use crate::exchange::nav2::{ImportError, Nav2Error};
use crate::level::alignments::AlignmentError;
use crate::level::changes::NotAcceptable;
use crate::level::learned::LearnedError;
use crate::level::{LevelError, RevertError, SinceError, SubmitError};
use crate::store::StoreError;
use crate::store::acts::RevertRefusal;
use crate::store::alignments::AlignmentRefusal;
use crate::store::payload::PayloadError;
use gdb::GdbRefusal;

/// Why a request is refused.
#[derive(Debug)]
pub(super) enum ApiError {
    /// No such path.
    NoRoute,
    /// A path, but not with this method.
    WrongMethod,
    /// No token, or (if one was `presented`) not a valid one.
    Unauthenticated { presented: bool },
    /// The token does not allow this.
    MissingScope(Scope),
    /// The token speaks for another robot.
    OtherRobot { own: String },
    /// A request with a session's cookie that another page may have sent.
    ForeignOrigin,
    /// Something that the path names is not there.
    NotFound { kind: &'static str, name: String },
    /// The query does not fit.
    Query(String),
    /// None of what is offered is accepted.
    NotAcceptable(&'static str),
    /// The body could not be read in time.
    BodyTimeout,
    /// The body is too large.
    BodyTooLarge { limit_bytes: usize },
    /// A body of more bytes than may come over the wire, packed or not.
    BodyTooLong { limit_bytes: usize },
    /// Too many items in one body.
    TooManyItems { limit: usize },
    /// The body broke off or cannot be unpacked.
    BodyBroken,
    /// The body is no zip.
    NotZip,
    /// A building of another program cannot be taken.
    Building(BuildingError),
    /// A model of another program cannot be taken.
    ModelFile(FileFault),
    /// A map of another program cannot be taken.
    Import(ImportError),
    /// The body is not of a known type, or cannot be read.
    Body(DecodeError),
    /// The body can be read, but not taken.
    Invalid(Vec<Violation>),
    /// The contribution can be read, but not taken.
    InvalidContribution(Vec<Violation>),
    /// As many live streams as there may be.
    StreamsExhausted,
    /// As many requests as there may be.
    Overloaded,
    /// The server is about to stop.
    Closing,
    /// A contribution was not acknowledged.
    Submit(SubmitError),
    /// Contributions were not taken out or put back.
    Revert(RevertError),
    /// A frame was not aligned, or an alignment not withdrawn.
    Align(AlignmentError),
    /// A revision that the map has not reached.
    Since(SinceError),
    /// Nobody knows any more what landmarks a reader was told.
    Forgotten { since: i64 },
    /// A level cannot be opened.
    Level(LevelError),
    /// The store failed.
    Store(StoreError),
    /// There is no image of this map.
    Nav2(Nav2Error),
    /// A change that robots found cannot be taken over as it is.
    NotAcceptableChange(NotAcceptable),
    /// The GDB was not changed, or cannot be shown.
    Gdb(Box<GdbRefusal>),
    /// A fault of ours.
    Internal(String),
}

impl From<StoreError> for ApiError {
    fn from(error: StoreError) -> Self {
        Self::Store(error)
    }
}

impl From<LevelError> for ApiError {
    fn from(error: LevelError) -> Self {
        Self::Level(error)
    }
}

impl From<LearnedError> for ApiError {
    fn from(error: LearnedError) -> Self {
        match error {
            LearnedError::Store(error) => Self::Store(error),
            LearnedError::Forgotten { since } => Self::Forgotten { since },
        }
    }
}

impl From<SinceError> for ApiError {
    fn from(error: SinceError) -> Self {
        Self::Since(error)
    }
}

impl From<RevertError> for ApiError {
    fn from(error: RevertError) -> Self {
        match error {
            RevertError::Store(error) => Self::Store(error),
            other => Self::Revert(other),
        }
    }
}

impl From<AlignmentError> for ApiError {
    fn from(error: AlignmentError) -> Self {
        match error {
            AlignmentError::Store(error) => Self::Store(error),
            other => Self::Align(other),
        }
    }
}

impl From<EncodeError> for ApiError {
    fn from(error: EncodeError) -> Self {
        Self::Internal(error.to_string())
    }
}

impl From<PayloadError> for ApiError {
    fn from(error: PayloadError) -> Self {
        Self::Internal(error.to_string())
    }
}

impl ApiError {
    /// Something that the path names is not there.
    pub(super) fn not_found(kind: &'static str, name: impl Into<String>) -> Self {
        Self::NotFound { kind, name: name.into() }
    }

    /// The problem that the client gets.
    pub(super) fn problem(&self) -> Problem {
        match self {
            Self::NoRoute => of(404, "not_found", "There is nothing at this path; see /docs."),
            Self::WrongMethod => {
                of(405, "method_not_allowed", "This path does not take this method; see `Allow`.")
            }
            Self::Unauthenticated { presented: false } => {
                of(401, "unauthenticated", "Send a token as `Authorization: Bearer`, or sign in.")
            }
            Self::Unauthenticated { presented: true } => {
                of(401, "invalid_token", "The token is unknown, has ended or was revoked.")
            }
            Self::MissingScope(scope) => of(
                403,
                "insufficient_scope",
                format!("The token lacks the scope {}.", word(*scope)),
            ),
            Self::OtherRobot { own } => {
                of(403, "other_robot", format!("The token speaks for the robot {own:?} only."))
            }
            Self::ForeignOrigin => of(
                403,
                "foreign_origin",
                "A request with a session's cookie must come from this server's own page.",
            ),
            Self::NotFound { kind, name } => missing(kind, name),
            Self::Query(detail) => of(400, "query_invalid", detail),
            Self::NotAcceptable(offered) => {
                of(406, "not_acceptable", format!("What can be had here is {offered}."))
            }
            Self::BodyTimeout => of(408, "body_timeout", "The body did not arrive in time."),
            Self::BodyTooLarge { limit_bytes } => body_too_large(format!(
                "A body may have {limit_bytes} bytes here once unpacked; send less at once, or have the server take more: \
                `upload_bytes` and `upload_compressed_bytes` under `[http]` of its configuration (`body_bytes` for all that \
                is no upload)."
            )),
            Self::BodyTooLong { limit_bytes } => body_too_large(format!(
                "A body may have {limit_bytes} bytes on its way here: pack it (`Content-Encoding: gzip` or `zstd`), send less at \
                once, or have the server take more: `upload_compressed_bytes` under `[http]` of its configuration."
            )),
            Self::TooManyItems { limit } => {
                of(413, "too_many_items", format!("One body may hold {limit} of these."))
            }
            Self::BodyBroken => {
                of(400, "body_broken", "The body broke off, or its content coding is damaged.")
            }
            Self::Body(error) => unreadable(error),
            Self::Invalid(errors) => {
                invalid("body_invalid", "Some fields of the body cannot be taken.", errors)
            }
            Self::InvalidContribution(errors) => {
                let detail = "Nothing of it was taken; `errors` names what is wrong.";
                invalid("contribution_invalid", detail, errors)
            }
            Self::StreamsExhausted => {
                of(429, "streams_exhausted", "As many live streams as there may be are open.")
            }
            Self::Overloaded => of(503, "overloaded", "Too many requests at once."),
            Self::Closing => of(503, "closing", "The server is about to stop."),
            Self::Submit(error) => unacknowledged(error),
            Self::Revert(error) => unreverted(error),
            Self::Align(error) => unaligned(error),
            Self::Since(error) => ahead(error),
            Self::Forgotten { since } => {
                let detail = format!(
                    "What you were told at revision {since} is not known here any more: forget it and read again from \
                    revision 0."
                );
                of(410, "cursor_expired", detail)
            }
            Self::Level(LevelError::Closing) => Self::Closing.problem(),
            Self::Level(LevelError::Store(error)) | Self::Store(error) => of_store(error),
            Self::NotZip => {
                let detail = "Send a zip of a YAML and its image, as `application/zip`; a building.yaml, as \
                    `application/yaml`; or a model, as `application/fg+json`.";
                of(415, "unsupported_media_type", detail)
            }
            Self::Import(error) => untaken(error),
            Self::NotAcceptableChange(why) => {
                of(409, "change_not_acceptable", sentence(&why.to_string()))
            }
            Self::Building(error) => of(422, "invalid_building", sentence(&error.to_string())),
            Self::ModelFile(fault) => {
                invalid("invalid_model_file", &sentence(&fault.to_string()), &fault.errors)
            }
            Self::Nav2(error) => {
                let code = match error {
                    Nav2Error::Empty | Nav2Error::EmptyBox => "map_empty",
                    Nav2Error::TooLarge { .. } => "map_too_large",
                    Nav2Error::NoTransparency => {
                        return of(400, "query_invalid", sentence(&error.to_string()));
                    }
                };
                of(409, code, sentence(&error.to_string()))
            }
            Self::Gdb(refusal) => gdb::problem(refusal),
            Self::Internal(_) => of(500, "internal", "The server is at fault; its log says more."),
        }
    }

    /// What the server's own log says, where the client is told less.
    fn cause(&self) -> Option<String> {
        match self {
            Self::Internal(cause) => Some(cause.clone()),
            Self::Level(error) => Some(error.to_string()),
            Self::Store(error) => Some(error.to_string()),
            Self::Submit(error) => Some(error.to_string()),
            _ => None,
        }
    }
}

/// A problem of the kind `code`, with the kind in words from its name.
fn of(status: u16, code: &str, detail: impl Into<String>) -> Problem {
    let mut title = code.replace('_', " ");
    title[..1].make_ascii_uppercase();
    Problem::new(status, code, &title, detail)
}

/// Words as a sentence.
fn sentence(words: &str) -> String {
    let mut chars = words.chars();
    let first = chars.next().map(|c| c.to_ascii_uppercase());
    first.into_iter().chain(chars).chain(['.']).collect()
}

fn invalid(code: &str, detail: &str, errors: &[Violation]) -> Problem {
    Problem { errors: errors.to_vec(), ..of(422, code, detail) }
}

fn missing(kind: &str, name: &str) -> Problem {
    let advice = match kind {
        "robot" => " Enrol it first: POST to the site's robots.",
        "site" | "level" => " Create it first, or use a token that reaches it.",
        _ => "",
    };
    let code = format!("{}_not_found", kind.replace(' ', "_"));
    of(404, &code, format!("There is no {kind} {name:?} here.{advice}"))
}

fn unreadable(error: &DecodeError) -> Problem {
    match error {
        DecodeError::MediaType(_) => of(415, "unsupported_media_type", error.to_string()),
        DecodeError::Json(_) | DecodeError::Cbor(_) => of(400, "body_malformed", error.to_string()),
        DecodeError::Shape(violation) => {
            invalid("body_invalid", &error.to_string(), std::slice::from_ref(violation))
        }
    }
}

fn unacknowledged(error: &SubmitError) -> Problem {
    match error {
        SubmitError::QueueFull { .. } => of(503, "queue_full", error.to_string()),
        SubmitError::Conflict { .. } => of(409, "contribution_conflict", error.to_string()),
        SubmitError::UnknownRobot { robot } => missing("robot", robot),
        SubmitError::DiskFull => of(507, "storage_full", error.to_string()),
        SubmitError::Unavailable(_) => {
            of(503, "unavailable", "The log cannot be written now; sending it again is safe.")
        }
    }
}

fn unreverted(error: &RevertError) -> Problem {
    let detail = error.to_string();
    let named = |code: &str, places: &[usize], fault: &str| {
        let violation = |place: &usize| Violation {
            pointer: format!("/contributions/{place}"),
            code: code.to_owned(),
            detail: fault.to_owned(),
        };
        let errors: Vec<Violation> = places.iter().take(VIOLATIONS_MAX).map(violation).collect();
        invalid(
            &format!("contributions_{code}"),
            &format!("{detail} Nothing has changed."),
            &errors,
        )
    };
    match error {
        RevertError::Refused(RevertRefusal::Unknown(places)) => {
            named("unknown", places, "this is not in the log of the level")
        }
        RevertError::Refused(RevertRefusal::Held(places)) => {
            named("held", places, "this is held, and so not in the map")
        }
        RevertError::Refused(RevertRefusal::Nothing) => of(409, "nothing_to_revert", detail),
        RevertError::Refused(RevertRefusal::Conflict(_)) => of(409, "revert_conflict", detail),
        RevertError::Refused(RevertRefusal::Undone(_)) => of(409, "revert_undone", detail),
        RevertError::Refused(RevertRefusal::TooMany(_)) => {
            of(413, "too_many_contributions", detail)
        }
        RevertError::Overtaken => of(409, "map_moved_on", detail),
        RevertError::Behind { .. } => of(503, "revision_not_reached", detail),
        RevertError::Store(error) => of_store(error),
    }
}

fn unaligned(error: &AlignmentError) -> Problem {
    let detail = error.to_string();
    match error {
        AlignmentError::Refused(AlignmentRefusal::NothingHeld) => of(409, "nothing_held", detail),
        AlignmentError::Refused(AlignmentRefusal::Aligned(_)) => of(409, "frame_aligned", detail),
        AlignmentError::Refused(AlignmentRefusal::NotAligned) => {
            of(409, "frame_not_aligned", detail)
        }
        AlignmentError::Refused(AlignmentRefusal::Reverted(_)) => of(409, "frame_reverted", detail),
        AlignmentError::Refused(AlignmentRefusal::TooMany(_)) => {
            of(413, "too_many_contributions", detail)
        }
        AlignmentError::Uncertain => of(409, "alignment_uncertain", detail),
        AlignmentError::Store(error) => of_store(error),
    }
}

fn untaken(error: &ImportError) -> Problem {
    let (status, code) = match error {
        ImportError::Zip(_) | ImportError::NoImage { .. } => (422, "invalid_map_package"),
        ImportError::Yaml { .. }
        | ImportError::MissingKey { .. }
        | ImportError::DescriptionTooLong { .. }
        | ImportError::Resolution { .. }
        | ImportError::Extent { .. } => (422, "invalid_map_metadata"),
        ImportError::ImageTooLarge { .. } | ImportError::ImageTooLong { .. } => {
            (413, "image_too_large")
        }
        ImportError::ImageFormat
        | ImportError::ImageEmpty { .. }
        | ImportError::Pgm { .. }
        | ImportError::Png(_) => (422, "invalid_map_data"),
    };
    of(status, code, sentence(&error.to_string()))
}

fn ahead(error: &SinceError) -> Problem {
    if error.since < 0 {
        of(400, "query_invalid", "`since` is a revision: 0 or more.")
    } else if error.since <= error.revision {
        of(503, "revision_not_reached", error.to_string())
    } else {
        let detail = format!("{error}: forget what you have and read again from revision 0.");
        of(410, "cursor_expired", detail)
    }
}

fn of_store(error: &StoreError) -> Problem {
    match error {
        StoreError::AlreadyExists { kind, name } => {
            of(409, &format!("{kind}_exists"), format!("There is a {kind} {name:?} already."))
        }
        StoreError::Missing { kind, name } => missing(kind, name),
        StoreError::DiskFull => of(507, "storage_full", error.to_string()),
        StoreError::ReadOnly | StoreError::Unavailable(_) | StoreError::Busy(_) => {
            of(503, "unavailable", "The database does not answer, or takes no changes, now.")
        }
        _ => ApiError::Internal(String::new()).problem(),
    }
}

/// The database does not answer a health check.
pub(super) fn not_ready() -> Problem {
    of(503, "unavailable", "The database does not answer.")
}

/// The scope as tokens name it.
pub(super) fn word(scope: Scope) -> &'static str {
    match scope {
        Scope::MapRead => "map:read",
        Scope::MapContribute => "map:contribute",
        Scope::MapEdit => "map:edit",
        Scope::MapPublish => "map:publish",
        Scope::Admin => "admin",
    }
}

/// A problem on its way out; [`super::layers`] writes it, with the request's id.
#[derive(Debug, Clone)]
pub(super) struct Outgoing(pub(super) Arc<Problem>);

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let problem = self.problem();
        if let Some(cause) = self.cause().filter(|_| problem.status >= 500) {
            tracing::error!(code = problem.code, cause, "request failed");
        }
        respond(problem)
    }
}

fn body_too_large(detail: String) -> Problem {
    of(413, "body_too_large", detail)
}

/// An answer that bears a problem.
pub(super) fn respond(problem: Problem) -> Response {
    let status = StatusCode::from_u16(problem.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
    let mut response = status.into_response();
    response.extensions_mut().insert(Outgoing(Arc::new(problem)));
    response
}

/// The problem of an answer that a layer gave with nothing but a status.
pub(super) fn of_status(status: StatusCode, limit_bytes: usize) -> Problem {
    match status {
        StatusCode::NOT_FOUND => ApiError::NoRoute.problem(),
        StatusCode::METHOD_NOT_ALLOWED => ApiError::WrongMethod.problem(),
        StatusCode::REQUEST_TIMEOUT => ApiError::BodyTimeout.problem(),
        StatusCode::PAYLOAD_TOO_LARGE => ApiError::BodyTooLong { limit_bytes }.problem(),
        StatusCode::UNSUPPORTED_MEDIA_TYPE => {
            of(415, "unsupported_coding", "A body may be coded as gzip or zstd, once.")
        }
        StatusCode::NOT_ACCEPTABLE => ApiError::NotAcceptable("no other content coding").problem(),
        StatusCode::GATEWAY_TIMEOUT => of(504, "timeout", "The answer took too long; try again."),
        StatusCode::SERVICE_UNAVAILABLE => ApiError::Overloaded.problem(),
        other if other.is_client_error() => {
            of(other.as_u16(), "refused", "The request cannot be understood.")
        }
        _ => ApiError::Internal(String::new()).problem(),
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    fn told(error: &ApiError) -> (u16, String, bool) {
        let problem = error.problem();
        (problem.status, problem.code, problem.retryable)
    }

    #[test]
    fn why_a_contribution_was_not_acknowledged_is_told_apart() {
        let (level, robot) = ("floor".to_owned(), "r1".to_owned());
        for (error, status, code, retryable) in [
            (SubmitError::QueueFull { level, capacity: 9 }, 503, "queue_full", true),
            (
                SubmitError::Conflict { id: Uuid::nil(), revision: 3 },
                409,
                "contribution_conflict",
                false,
            ),
            (SubmitError::UnknownRobot { robot }, 404, "robot_not_found", false),
            (SubmitError::DiskFull, 507, "storage_full", true),
            (SubmitError::Unavailable("secret".to_owned()), 503, "unavailable", true),
        ] {
            assert_eq!(told(&ApiError::Submit(error)), (status, code.to_owned(), retryable));
        }
    }

    #[test]
    fn faults_of_ours_tell_the_client_nothing_but_the_log_all() {
        let cause = "password=hunter2".to_owned();
        for error in [
            ApiError::Internal(cause.clone()),
            ApiError::Store(StoreError::Untrusted(cause.clone())),
            ApiError::Store(StoreError::DiskFailed(cause.clone())),
            ApiError::Submit(SubmitError::Unavailable(cause.clone())),
        ] {
            assert!(!serde_json::to_string(&error.problem()).unwrap().contains("hunter2"));
            assert!(error.cause().unwrap().contains("hunter2"));
        }
    }

    #[test]
    fn a_preview_that_comes_too_early_may_be_asked_for_again() {
        let behind = RevertError::Behind { folded_revision: 5, revision: 7 };
        let told = told(&ApiError::Revert(behind));
        assert_eq!(told, (503, "revision_not_reached".to_owned(), true));
    }

    #[test]
    fn a_revision_ahead_of_the_fold_is_worth_waiting_for_and_one_ahead_of_the_log_is_not() {
        let since = |since| ApiError::Since(SinceError { since, folded_revision: 5, revision: 7 });
        assert_eq!(told(&since(6)), (503, "revision_not_reached".to_owned(), true));
        assert_eq!(told(&since(8)), (410, "cursor_expired".to_owned(), false));
        assert_eq!(told(&since(-1)), (400, "query_invalid".to_owned(), false));
    }
}
