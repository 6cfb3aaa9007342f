//! `L/landmarks`: what robots find themselves by.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use axum::response::Response;
use mapfold_map::gdb::{LandmarkId, PlannedLandmark};
use mapfold_map::geometry::Point;
use mapfold_map::landmarks::{Landmark, LandmarkKind, LearnedId};
use mapfold_schema::border::gdb::{
    landmark_id, learned_id, wire_gdb_landmark, wire_learned_landmark,
};
use mapfold_schema::v1::LandmarkTable;
use mapfold_schema::{codec, route};
use serde::Deserialize;

use super::access::{LevelFor, REPLICA_PATIENCE, Read};
use super::answer::{DATA, Reader};
use super::plan::height;
use super::problem::ApiError;
use super::query::QueryOf;
use crate::level::gdb::GdbModel;
use crate::level::learned::Learned;
use crate::level::{LevelHandle, SinceError};
use crate::store::gdb::Publication;

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

/// Landmarks at a sensor's height: corners, free ends and doorways, each with its direction and covariance; or what
/// changed of them.
///
/// Those of the published model, and those that robots taught (`source: learned`), which three looks or more support and the
/// model does not have within the errors of both. A learned one changes with the looks that support it, and goes when its
/// walls go, when the model gets it, and when its contributions are reverted.
#[utoipa::path(
    get, path = route::LANDMARKS, operation_id = "read_landmarks", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), LandmarkQuery),
    responses(
        (status = 200, description = "The landmarks", content(
            (LandmarkTable = "application/json"), (LandmarkTable = "application/cbor"),
        )),
        (status = 410, description = "`cursor_expired`: `since` is ahead of the log, or what was told then is not known any \
            more (after a restart, or by another replica); read from 0"),
    )
)]
pub(super) async fn read(
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<LandmarkQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(DATA)?;
    let (height_m, circle) = (height(query.height_m)?, query.circle()?);
    let since = query.since;
    let log = level.level.log_revision().await?;
    if !(0..=log).contains(&since) {
        return Err(ApiError::Since(SinceError { since, folded_revision: log, revision: log }));
    }
    let reached = level.snapshot_since(since).await?.folded_revision();
    // Who has published, reads it next.
    let newest = level.level.gdb_publication(log).await?.map_or(0, |newest| newest.revision);
    if reached < newest {
        level.level.snapshot_at(newest, REPLICA_PATIENCE).await;
    }
    let level = level.level.clone();
    let learned = level.learned(since).await?;
    // Model and map as of one revision: what is published up to there stays so.
    let revision = learned.revision();
    let published = level.gdb_publication(revision).await?;
    let before = if since > 0 { level.gdb_publication(since).await? } else { None };
    let model = async |publication: Option<Publication>| match publication {
        Some(publication) => level.gdb_model(publication.version).await.map(Some),
        None => Ok(None),
    };
    let (now, then) = (model(published).await?, model(before).await?);
    let wanted = Wanted { competence: query.competence, circle };
    let level = level.clone();
    let write = move || {
        let now = Told::of(&level, &learned, now.as_deref(), height_m)?;
        let then = Told::of(&level, &learned, then.as_deref(), height_m)?;
        let mut table = LandmarkTable {
            revision,
            publication: published.map_or(0, |published| published.revision),
            height_m,
            landmarks: Vec::new(),
            removed: Vec::new(),
        };
        wanted.planned(&now, &then, &mut table);
        wanted.learned(&learned, &now, &then, since, &mut table);
        Ok(codec::encode(media_type, &table)?)
    };
    reader.data(revision, media_type, write).await
}

/// What a model says.
struct Told {
    planned: BTreeMap<LandmarkId, PlannedLandmark>,
    /// Which of the learned landmarks are among them.
    learned: Arc<BTreeSet<LearnedId>>,
}

impl Told {
    fn of(
        level: &LevelHandle,
        learned: &Learned,
        model: Option<&GdbModel>,
        height_m: f64,
    ) -> Result<Self, ApiError> {
        let Some(model) = model else {
            return Ok(Self { planned: BTreeMap::new(), learned: Arc::default() });
        };
        let planned = model.landmarks(height_m)?;
        let planned = planned.iter().map(|planned| (planned.id, *planned)).collect();
        Ok(Self { planned, learned: level.told_by(learned, model, height_m)? })
    }
}

/// Which landmarks a reader asks for.
#[derive(Debug, Clone, Copy)]
struct Wanted {
    competence: Competence,
    circle: Option<Circle>,
}

impl Wanted {
    fn takes(self, landmark: &Landmark) -> bool {
        let is_near =
            self.circle.is_none_or(|(place, radius)| (landmark.at - place).norm() <= radius);
        is_near && self.competence.sees(landmark.kind)
    }

    fn planned(self, now: &Told, then: &Told, table: &mut LandmarkTable) {
        let of = |told: &Told, id: &LandmarkId| {
            told.planned.get(id).copied().filter(|planned| self.takes(&planned.landmark))
        };
        for (id, planned) in &now.planned {
            if self.takes(&planned.landmark) && of(then, id).as_ref() != Some(planned) {
                table.landmarks.push(wire_gdb_landmark(planned));
            }
        }
        let before = then.planned.keys().filter(|id| of(then, id).is_some());
        table.removed.extend(before.filter(|id| of(now, id).is_none()).map(landmark_id));
    }

    fn learned(
        self,
        learned: &Learned,
        now: &Told,
        then: &Told,
        since: i64,
        table: &mut LandmarkTable,
    ) {
        let mut here: Vec<_> = learned.live().collect();
        here.sort_unstable_by_key(|(_, landmark)| landmark.id);
        for (changed_at, landmark) in here {
            let (id, taken) = (&landmark.id, self.takes(&landmark.landmark));
            let is_told = taken && !now.learned.contains(id);
            // What has changed since may have been told, or not: saying so once more does no harm.
            let is_changed = changed_at > since;
            let was_told = taken && !then.learned.contains(id);
            if is_told && (is_changed || !was_told) {
                table.landmarks.push(wire_learned_landmark(landmark));
            } else if since > 0 && !is_told && (is_changed || was_told) {
                table.removed.push(learned_id(id));
            }
        }
        if since > 0 {
            let seen = learned.gone(since).filter(|id| self.competence.sees(id.kind));
            table.removed.extend(seen.map(|id| learned_id(&id)));
        }
    }
}
