//! `L/landmarks`: what robots find themselves by.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::response::Response;
use mapfold_map::gdb::{Landmark, LandmarkId};
use mapfold_map::geometry::Point;
use mapfold_map::landmarks::LandmarkKind;
use mapfold_schema::border::gdb::{landmark_id, wire_gdb_landmark};
use mapfold_schema::v1::LandmarkTable;
use mapfold_schema::{codec, route};
use serde::Deserialize;

use super::access::{LevelFor, Read};
use super::answer::{DATA, Reader};
use super::plan::height;
use super::problem::ApiError;
use super::query::QueryOf;
use crate::level::SinceError;
use crate::level::gdb::GdbModel;

/// Sensors that a robot has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Competence {
    /// Both.
    #[default]
    Both,
    /// Scanners.
    Scanner,
    /// Sonars only.
    Sonar,
}

impl Competence {
    /// Whether such a robot can tell a landmark of this kind by its readings.
    ///
    /// To a sonar, two walls that meet in a room send the echo back from wherever they are seen; an edge and
    /// the end of a wall only scatter, and a doorway is narrower than the cone from 2 m on (Leonard and
    /// Durrant-Whyte 1992; Kleeman and Kuc 1995).
    fn sees(self, kind: LandmarkKind) -> bool {
        match self {
            Self::Both | Self::Scanner => true,
            Self::Sonar => kind == LandmarkKind::ConcaveCorner,
        }
    }
}

/// Which landmarks are asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct LandmarkQuery {
    /// Only what changed after this revision; 0 gives all.
    #[serde(default)]
    since: i64,
    /// Only within `radius_m` of this place: `x,y` in metres.
    near: Option<String>,
    /// See `near`.
    radius_m: Option<f64>,
    /// `both` (if absent), `scanner`, or `sonar`: only what such sensors can tell.
    #[serde(default)]
    #[param(inline)]
    competence: Competence,
    /// Height of the sensor above the level's floor; 0.3 if absent.
    height_m: Option<f64>,
}

/// A circle.
type Circle = (Point, f64);

impl LandmarkQuery {
    fn circle(&self) -> Result<Option<Circle>, ApiError> {
        let (near, radius) = match (&self.near, self.radius_m) {
            (None, None) => return Ok(None),
            (Some(near), Some(radius)) => (near, radius),
            _ => {
                let words = "`near` and `radius_m` come together.";
                return Err(ApiError::Query(words.to_owned()));
            }
        };
        let place: Result<Vec<f64>, _> = near.split(',').map(str::parse).collect();
        match place.as_deref() {
            Ok([x, y]) if x.is_finite() && y.is_finite() && radius >= 0.0 => {
                Ok(Some((Point::new(*x, *y), radius)))
            }
            _ => Err(ApiError::Query(
                "`near` is two numbers, x,y in metres, and `radius_m` is not negative.".to_owned(),
            )),
        }
    }
}

/// The landmarks of the published model at a sensor's height: corners, free ends and doorways, each with
/// its direction and covariance; or what changed of them.
#[utoipa::path(
    get, path = route::LANDMARKS, operation_id = "read_landmarks", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), LandmarkQuery),
    responses(
        (status = 200, description = "The landmarks", content(
            (LandmarkTable = "application/json"), (LandmarkTable = "application/cbor"),
        )),
        (status = 410, description = "`cursor_expired`: `since` is ahead of the log; read from 0"),
    )
)]
pub(super) async fn read(
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<LandmarkQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(DATA)?;
    let (height_m, circle) = (height(query.height_m)?, query.circle()?);
    let level = &level.level;
    // First how far the log has come: what is published up to there stays so.
    let revision = level.log_revision().await?;
    let since = query.since;
    if !(0..=revision).contains(&since) {
        return Err(ApiError::Since(SinceError { since, folded_revision: revision, revision }));
    }
    let published = level.gdb_publication(revision).await?;
    let before = if since > 0 { level.gdb_publication(since).await? } else { None };
    let now = match published {
        Some(publication) => Some(level.gdb_model(publication.version).await?),
        None => None,
    };
    let then = match before {
        Some(publication) => Some(level.gdb_model(publication.version).await?),
        None => None,
    };
    let competence = query.competence;
    let write = move || {
        let table = |model: Option<Arc<GdbModel>>| -> Result<_, ApiError> {
            let all = model.map(|model| model.landmarks(height_m)).transpose()?;
            Ok(all.map(|all| chosen(&all, competence, circle)).unwrap_or_default())
        };
        let (now, then) = (table(now)?, table(then)?);
        let changed = now.values().filter(|landmark| then.get(&landmark.id) != Some(landmark));
        let removed = then.keys().filter(|id| !now.contains_key(id));
        Ok(codec::encode(
            media_type,
            &LandmarkTable {
                revision,
                publication: published.map_or(0, |published| published.revision),
                height_m,
                landmarks: changed.map(wire_gdb_landmark).collect(),
                removed: removed.map(landmark_id).collect(),
            },
        )?)
    };
    reader.data(revision, media_type, write).await
}

fn chosen(
    landmarks: &[Landmark],
    competence: Competence,
    circle: Option<Circle>,
) -> BTreeMap<LandmarkId, Landmark> {
    let is_near = |landmark: &&Landmark| {
        circle.is_none_or(|(place, radius)| (landmark.at - place).norm() <= radius)
    };
    let seen = landmarks.iter().filter(|landmark| competence.sees(landmark.id.kind));
    seen.filter(is_near).map(|landmark| (landmark.id, *landmark)).collect()
}
