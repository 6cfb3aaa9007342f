//! What an answer means for what was sent. Pure: nothing is sent or moved here.

use mapfold_schema::problem::Problem;
use mapfold_schema::v1::UploadAnswer;

use crate::sync::ApiError;

/// What one contribution of a batch came to.
#[derive(Debug)]
pub(super) enum ItemVerdict {
    /// It is on the server's disk, at this revision.
    Acknowledged(i64),
    /// Not now.
    Later(Box<Problem>),
    /// Never: the contribution is at fault.
    Refused(Box<Problem>),
    /// The robot, the token or the level is at fault, and so nothing else will be taken either.
    Stop(Box<Problem>),
}

/// What a batch came to that was answered as a whole and not taken.
#[derive(Debug)]
pub(super) enum BatchVerdict {
    /// Not now, whatever is in it.
    Later,
    /// Not now, and perhaps because of one that is in it: the server fell over it.
    LaterApart,
    /// It is larger than the server takes.
    TooLarge,
    /// Something in it is at fault, and the answer does not say for the others.
    Refused,
    /// Nothing of this robot will be taken.
    Stop,
}

/// What one of a batch's answers means.
pub(super) fn of_answer(answer: UploadAnswer) -> ItemVerdict {
    let problem = match answer {
        UploadAnswer::Receipt(receipt) => return ItemVerdict::Acknowledged(receipt.revision),
        UploadAnswer::Problem(problem) => Box::new(problem),
    };
    match problem.status {
        401 | 403 | 404 => ItemVerdict::Stop(problem),
        408 | 425 | 429 | 500.. => ItemVerdict::Later(problem),
        _ if problem.retryable => ItemVerdict::Later(problem),
        _ => ItemVerdict::Refused(problem),
    }
}

/// What an error of the whole request means.
pub(super) fn of_error(error: &ApiError) -> BatchVerdict {
    match error {
        ApiError::Unavailable { status: 500, .. } => BatchVerdict::LaterApart,
        error if error.is_retryable() => BatchVerdict::Later,
        ApiError::Refused(problem) => match problem.status {
            413 => BatchVerdict::TooLarge,
            400 | 409 | 422 => BatchVerdict::Refused,
            _ if problem.retryable => BatchVerdict::Later,
            _ => BatchVerdict::Stop,
        },
        _ => BatchVerdict::Stop,
    }
}
