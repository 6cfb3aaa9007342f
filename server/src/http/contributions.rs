//! `L/contributions`: uploads, and the log.

use axum::extract::{FromRequest, Path, Request, State};
use axum::response::Response;
use mapfold_schema::border::{self, Target};
use mapfold_schema::codec::{self, DecodeError};
use mapfold_schema::route;
use mapfold_schema::v1::{
    Contribution, ContributionPage, ContributionRecord, ContributionState, Receipt, UploadAnswer,
};
use serde::Deserialize;
use uuid::Uuid;

use super::access::{Contribute, LevelFor, Read};
use super::answer::{Reader, blocking, created};
use super::body;
use super::problem::ApiError;
use super::query::{QueryOf, before, page_limit};
use super::state::App;
use crate::auth::Principal;
use crate::level::{Accepted, SubmitError};
use crate::store::log::LogFilter;

/// Bodies longer than this are read and checked off the threads that serve other requests.
const LONG_BODY_BYTES: usize = 64 << 10;
/// Lines of a page of the log, if the request names no number; and at most.
const PAGE: u32 = 100;
const PAGE_MAX: u32 = 1000;

/// The body of an upload, unpacked but not yet read.
pub(super) struct Upload {
    media_type: String,
    bytes: axum::body::Bytes,
}

impl FromRequest<App> for Upload {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        let media_type = body::media_type(request.headers())?;
        let bytes = body::read(request, app.parts.limits.upload_bytes).await?;
        Ok(Self { media_type, bytes })
    }
}

/// Contributions of one upload, each checked or refused.
struct Judged {
    items: Vec<Result<Accepted, ApiError>>,
    is_array: bool,
}

/// What an upload holds, for the description of the API.
#[derive(utoipa::ToSchema, serde::Serialize)]
#[serde(untagged)]
#[expect(dead_code, reason = "only described: bodies are read item by item")]
pub(super) enum ContributionUpload {
    /// One.
    One(Box<Contribution>),
    /// At most 64.
    Many(Vec<Contribution>),
}

/// What an upload is answered, for the description of the API.
#[derive(utoipa::ToSchema, serde::Serialize)]
#[serde(untagged)]
#[expect(dead_code, reason = "only described: answers are written as they are")]
pub(super) enum ContributionUploaded {
    /// To one contribution.
    One(Receipt),
    /// To an array, in its order.
    Many(Vec<UploadAnswer>),
}

/// Takes a contribution, or an array of up to 64 of them, into the log.
///
/// The answer comes when it is on disk. Sending the same contribution again, under the same id,
/// gets the same receipt. Of an array each is answered for itself and in order, `{"receipt": ..}`
/// or `{"problem": ..}`, with status 201; only what stops all of them (a body that cannot be read, a full
/// queue) is a problem of the whole.
#[utoipa::path(
    post, path = route::CONTRIBUTIONS, operation_id = "contribute", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path)),
    request_body(
        content(
            (ContributionUpload = "application/json"),
            (ContributionUpload = "application/cbor"),
        ),
        description = "One contribution, or an array of up to 64. May be coded as gzip or zstd. \
            In CBOR a UUID (`id`, `frame`) is a byte string of 16 bytes, not text, and every \
            `number` is a float of any width, never an integer; all else is as in JSON.",
    ),
    responses(
        (status = 201, body = ContributionUploaded, description = "On disk. For an array: an array of \
            `{\"receipt\": ..}` or `{\"problem\": ..}`, in order."),
        (status = 403, description = "`other_robot`: the token speaks for another robot"),
        (status = 404, description = "`robot_not_found`: enrol the robot first"),
        (status = 409, description = "`contribution_conflict`: the id is taken by other content"),
        (status = 413, description = "`body_too_large`, `too_many_items`"),
        (status = 415, description = "`unsupported_media_type`, `unsupported_coding`"),
        (status = 422, description = "`contribution_invalid`, with `errors`"),
        (status = 503, description = "`queue_full`; see `Retry-After`"),
        (status = 507, description = "`storage_full`"),
    )
)]
pub(super) async fn upload(
    State(app): State<App>,
    level: LevelFor<Contribute>,
    reader: Reader,
    upload: Upload,
) -> Result<Response, ApiError> {
    let target = level.level.target(app.upload_limits);
    let (caller, received_at_us) = (level.caller.clone(), app.now_us());
    let is_long = upload.bytes.len() > LONG_BODY_BYTES;
    let judge = move || judge(&upload, &caller, &target, received_at_us);
    let judged = if is_long { blocking(judge).await? } else { judge()? };
    let frames: Vec<Uuid> = judged.items.iter().flatten().filter_map(Accepted::own_frame).collect();
    let answers = submit(&level, judged.items).await;
    if !frames.is_empty() {
        let level = level.level.clone();
        // The robot need not wait until it is known where it is.
        tokio::spawn(async move {
            if let Err(error) = level.follow_rule(&frames, received_at_us).await {
                tracing::warn!(site = level.site(), level = level.level(), %error, "alignment failed");
            }
        });
    }
    answer(&level, &reader, answers, judged.is_array)
}

fn judge(
    upload: &Upload,
    caller: &Principal,
    target: &Target,
    received_at_us: i64,
) -> Result<Judged, ApiError> {
    let limit = target.limits.batch_max;
    let (uploads, is_array) = decode(upload, limit)?;
    if uploads.len() > limit {
        return Err(ApiError::TooManyItems { limit });
    }
    let judge_one = |wire: Result<Contribution, DecodeError>| {
        let wire = wire.map_err(refused_body)?;
        if !caller.speaks_for(&wire.robot) {
            return Err(ApiError::OtherRobot { own: caller.robot.clone().unwrap_or_default() });
        }
        let checked = border::check_contribution(&wire, target);
        let checked = checked.map_err(ApiError::InvalidContribution)?;
        Ok(Accepted::new(wire, checked, received_at_us)?)
    };
    Ok(Judged { items: uploads.into_iter().map(judge_one).collect(), is_array })
}

type Uploads = Vec<Result<Contribution, DecodeError>>;

/// Reads the body. An array in which something has the wrong shape is read again, element by
/// element: one that cannot be read does not stop the others.
fn decode(upload: &Upload, limit: usize) -> Result<(Uploads, bool), ApiError> {
    let Upload { media_type, bytes } = upload;
    let error = match codec::decode_uploads(media_type, bytes) {
        Ok((uploads, is_array)) => return Ok((uploads.into_iter().map(Ok).collect(), is_array)),
        Err(error) => error,
    };
    match (&error, codec::split_array(media_type, bytes, limit)) {
        (DecodeError::Shape(_), Ok(elements)) => {
            let read = |element| codec::decode(media_type, element);
            Ok((elements.into_iter().map(read).collect(), true))
        }
        _ => Err(refused_body(error)),
    }
}

/// A body of the wrong shape is a contribution that cannot be taken, like one of wrong content.
fn refused_body(error: DecodeError) -> ApiError {
    match error {
        DecodeError::Shape(violation) => ApiError::InvalidContribution(vec![violation]),
        other => ApiError::Body(other),
    }
}

/// Hands in what was accepted; the answers are in the order of the upload.
async fn submit(
    level: &LevelFor<Contribute>,
    items: Vec<Result<Accepted, ApiError>>,
) -> Vec<Result<Receipt, ApiError>> {
    let (mut accepted, mut refusals) = (Vec::new(), Vec::new());
    for item in items {
        match item {
            Ok(item) => {
                accepted.push(item);
                refusals.push(None);
            }
            Err(refusal) => refusals.push(Some(refusal)),
        }
    }
    let mut receipts = level.level.submit_many(accepted).await.into_iter();
    let mut next = || receipts.next().unwrap_or(Err(SubmitError::Unavailable(String::new())));
    refusals
        .into_iter()
        .map(|refusal| refusal.map_or_else(|| next().map_err(ApiError::Submit), Err))
        .collect()
}

fn answer(
    level: &LevelFor<Contribute>,
    reader: &Reader,
    answers: Vec<Result<Receipt, ApiError>>,
    is_array: bool,
) -> Result<Response, ApiError> {
    let mut lines = Vec::with_capacity(answers.len());
    for answer in answers {
        match answer {
            Ok(receipt) if is_array => lines.push(UploadAnswer::Receipt(receipt)),
            Ok(receipt) => {
                let log =
                    route::of_level(route::CONTRIBUTIONS, level.level.site(), level.level.level());
                return created(reader, Some(&format!("{log}/{}", receipt.id)), &receipt);
            }
            // What the server cannot do now concerns all of them, and all are safe to send again.
            Err(refusal) if !is_array || refusal.problem().status >= 500 => return Err(refusal),
            Err(refusal) => lines.push(UploadAnswer::Problem(refusal.problem())),
        }
    }
    created(reader, None, &lines)
}

/// Which lines of the log are asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct LogQuery {
    /// Only of this robot.
    robot: Option<String>,
    /// Only in this state.
    #[param(inline)]
    state: Option<ContributionState>,
    /// Only after this revision.
    since: Option<i64>,
    /// Only from poses in this rectangle: `min_x,min_y,max_x,max_y` in metres.
    #[serde(default, deserialize_with = "super::query::bbox")]
    #[param(value_type = Option<String>)]
    bbox: Option<mapfold_schema::v1::Bounds>,
    /// `next` of the page before.
    cursor: Option<String>,
    /// Lines of a page, at most 1000; 100 if absent.
    limit: Option<u32>,
}

/// The log of a level, newest first, in pages.
#[utoipa::path(
    get, path = route::CONTRIBUTIONS, operation_id = "read_log", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path), LogQuery),
    responses((status = 200, body = ContributionPage, description = "A page of the log"))
)]
pub(super) async fn list(
    State(app): State<App>,
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<LogQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let before = before(query.cursor.as_deref())?;
    let limit = page_limit(query.limit, PAGE, PAGE_MAX)?;
    let filter =
        LogFilter { robot: query.robot, state: query.state, since: query.since, bbox: query.bbox };
    let (site, name) = (level.level.site(), level.level.level());
    reader.small(&app.store().log_page(site, name, &filter, before, limit).await?)
}

/// One contribution with all that was uploaded.
#[utoipa::path(
    get, path = route::CONTRIBUTION, operation_id = "read_contribution", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path), ("id" = Uuid, Path)),
    responses((status = 200, body = ContributionRecord, description = "The contribution and its receipt"))
)]
pub(super) async fn describe(
    State(app): State<App>,
    level: LevelFor<Read>,
    Path((_, _, id)): Path<(String, String, String)>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let missing = || ApiError::not_found("contribution", &id);
    let uuid = Uuid::try_parse(&id).ok().ok_or_else(missing)?;
    let (site, name) = (level.level.site(), level.level.level());
    let logged = app.store().contribution(site, name, uuid).await?.ok_or_else(missing)?;
    reader.small(&ContributionRecord {
        entry: logged.entry,
        digest: logged.digest,
        contribution: logged.contribution,
    })
}
