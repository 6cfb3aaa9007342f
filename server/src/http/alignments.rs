//! `L/alignments`: where robots' own frames lie on the level.

use axum::extract::{Path, State};
use axum::response::Response;
use mapfold_map::alignment::AlignmentConfig;
use mapfold_schema::border::alignment::{check_pose, wire_proposal};
use mapfold_schema::route;
use mapfold_schema::v1::{Alignment, Alignments, NewAlignment, UnalignedFrame};
use uuid::Uuid;

use super::access::{Edit, LevelFor, Read};
use super::answer::{Reader, created};
use super::body::Payload;
use super::check;
use super::problem::ApiError;
use super::state::App;
use crate::auth;
use crate::store::alignments::NewEntry;

/// Alignments of an answer.
const LISTED: u32 = 100;

/// Robots' own frames: those of which contributions are held, with the poses at which their maps fit the level's; and the
/// alignments in the log.
///
/// A robot that does not know where it is contributes with the provenance `own_map`, in a `frame` of its own; that
/// is held. Its map is held against the level's both ways; a pose is certain if the maps agree where both know,
/// share enough wall in enough directions, and no other pose comes near it. By rule a frame is then
/// aligned without being asked for, once 16 of its contributions are held, and later ones of it follow. Working a proposal out may take
/// seconds.
#[utoipa::path(
    get, path = route::ALIGNMENTS, operation_id = "read_alignments", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path)),
    responses((status = 200, body = Alignments, description = "Frames, and alignments"))
)]
pub(super) async fn read(
    State(app): State<App>,
    level: LevelFor<Read>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let level = level.level;
    let revision = level.snapshot().folded_revision();
    let config = AlignmentConfig::STANDARD;
    let mut unaligned = Vec::new();
    for held in level.held_frames().await? {
        let found = level.proposal(&held).await?;
        let count = held.revisions.len() as u32;
        unaligned.push(wire_proposal(held.frame, &held.robots, count, &found, &config));
    }
    let alignments = app.store().alignments(level.site(), level.level(), LISTED).await?;
    // Meanwhile some may have been aligned.
    let still = level.held_frames().await?;
    unaligned.retain(|told: &UnalignedFrame| still.iter().any(|held| held.frame == told.frame));
    reader.small(&Alignments { revision, unaligned, alignments })
}

/// Accepts where a robot's own frame lies: what is held of it goes into the map there. Needs `map:edit`.
///
/// At the pose that is named, or, without one, where it is certain to lie. An entry of the log with a revision of its own;
/// the map follows like after an upload, and can be had back by `DELETE`.
#[utoipa::path(
    post, path = route::ALIGNMENT, operation_id = "align", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path), ("frame" = Uuid, Path)),
    request_body = NewAlignment,
    responses(
        (status = 201, body = Alignment, description = "It is aligned"),
        (status = 409, description = "`nothing_held`: nothing of this frame is held; `frame_aligned`: it lies elsewhere, withdraw that first; `alignment_uncertain`: name the pose"),
        (status = 422, description = "`body_invalid`, with `errors`"),
    )
)]
pub(super) async fn accept(
    State(app): State<App>,
    level: LevelFor<Edit>,
    Path((_, _, frame)): Path<(String, String, String)>,
    reader: Reader,
    Payload(new): Payload<NewAlignment>,
) -> Result<Response, ApiError> {
    let frame = uuid(&frame)?;
    check::comment(&new.comment)?;
    if let Some(pose) = &new.pose {
        check_pose(pose, app.upload_limits.coordinate_max_m).map_err(ApiError::Invalid)?;
    }
    let entry = entry(&app, &level, new.comment.trim());
    let aligned = level.level.align(frame, new.pose, &entry).await?;
    let all = route::of_level(route::ALIGNMENTS, level.level.site(), level.level.level());
    created(&reader, Some(&all), &aligned)
}

/// Withdraws the alignments of a frame: the map is then bit for bit what it would have been without them, and its
/// contributions are held again. Needs `map:edit`.
#[utoipa::path(
    delete, path = route::ALIGNMENT, operation_id = "withdraw_alignment", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path), ("frame" = Uuid, Path)),
    responses(
        (status = 200, body = Vec<Alignment>, description = "The frame's alignments, withdrawn"),
        (status = 409, description = "`frame_not_aligned`; `frame_reverted`: contributions of it are reverted, undo that first"),
    )
)]
pub(super) async fn withdraw(
    State(app): State<App>,
    level: LevelFor<Edit>,
    Path((_, _, frame)): Path<(String, String, String)>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let frame = uuid(&frame)?;
    let entry = entry(&app, &level, "");
    level.level.withdraw(frame, &entry).await?;
    let (site, name) = (level.level.site(), level.level.level());
    let mut told = app.store().alignments(site, name, LISTED).await?;
    told.retain(|alignment| alignment.frame == frame);
    reader.small(&told)
}

fn entry(app: &App, level: &LevelFor<Edit>, comment: &str) -> NewEntry {
    let author = auth::granted_by(&level.caller).to_owned();
    NewEntry { author, comment: comment.to_owned(), at_us: app.now_us() }
}

fn uuid(frame: &str) -> Result<Uuid, ApiError> {
    Uuid::try_parse(frame).ok().ok_or_else(|| ApiError::not_found("frame", frame))
}
