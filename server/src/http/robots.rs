//! `/sites/{site}/robots`, and robots' tokens.

use axum::extract::{Path, State};
use axum::response::Response;
use mapfold_schema::route;
use mapfold_schema::v1::{IssuedToken, NewRobot, NewToken, RobotDescription, RobotUpdate, Scope};

use super::access::{Admin, Contribute, Read, SiteFor};
use super::answer::{Reader, created};
use super::body::Payload;
use super::check;
use super::problem::ApiError;
use super::state::App;
use crate::auth::{self, Grant};

/// The robots of a site, by slug.
#[utoipa::path(
    get, path = route::ROBOTS, operation_id = "list_robots", tag = "robots",
    params(("site" = String, Path)),
    responses((status = 200, body = Vec<RobotDescription>, description = "The robots of the site"))
)]
pub(super) async fn list(
    State(app): State<App>,
    site: SiteFor<Read>,
    reader: Reader,
) -> Result<Response, ApiError> {
    reader.small(&app.store().robots(&site.site).await?)
}

/// Enrols a robot with its sensors. Needs `admin`.
#[utoipa::path(
    post, path = route::ROBOTS, operation_id = "enrol_robot", tag = "robots",
    params(("site" = String, Path)), request_body = NewRobot,
    responses((status = 201, body = RobotDescription, description = "The new robot"), (status = 409, description = "`robot_exists`"))
)]
pub(super) async fn enrol(
    State(app): State<App>,
    site: SiteFor<Admin>,
    reader: Reader,
    Payload(new): Payload<NewRobot>,
) -> Result<Response, ApiError> {
    check::new_robot(&new)?;
    let robot = app.store().create_robot(&site.site, &new, app.now_us()).await?;
    created(&reader, Some(&route::robot(&site.site, &robot.robot)), &robot)
}

/// One robot.
#[utoipa::path(
    get, path = route::ROBOT, operation_id = "describe_robot", tag = "robots",
    params(("site" = String, Path), ("robot" = String, Path)),
    responses((status = 200, body = RobotDescription, description = "The robot"))
)]
pub(super) async fn describe(
    State(app): State<App>,
    site: SiteFor<Read>,
    Path((_, robot)): Path<(String, String)>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let found = app.store().robot(&site.site, &robot).await?;
    reader.small(&found.ok_or_else(|| ApiError::not_found("robot", robot))?)
}

/// Changes a robot: what is absent stays. A robot may report its own `revision`,
/// `queue_length` and `fix`; all else needs `admin`.
#[utoipa::path(
    patch, path = route::ROBOT, operation_id = "update_robot", tag = "robots",
    params(("site" = String, Path), ("robot" = String, Path)), request_body = RobotUpdate,
    responses((status = 200, body = RobotDescription, description = "The robot as it is now"))
)]
pub(super) async fn update(
    State(app): State<App>,
    site: SiteFor<Contribute>,
    Path((_, robot)): Path<(String, String)>,
    reader: Reader,
    Payload(update): Payload<RobotUpdate>,
) -> Result<Response, ApiError> {
    check::robot_update(&update)?;
    may_update(&site, &robot, &update)?;
    let updated = app.store().update_robot(&site.site, &robot, &update).await?;
    reader.small(&updated.ok_or_else(|| ApiError::not_found("robot", robot))?)
}

fn may_update(
    site: &SiteFor<Contribute>,
    robot: &str,
    update: &RobotUpdate,
) -> Result<(), ApiError> {
    let RobotUpdate { name, sensors, state, revision: _, queue_length: _, fix: _ } = update;
    if !site.caller.speaks_for(robot) {
        return Err(ApiError::OtherRobot { own: site.caller.robot.clone().unwrap_or_default() });
    }
    let is_report = name.is_none() && sensors.is_none() && state.is_none();
    if is_report || site.caller.allows(Scope::Admin) {
        Ok(())
    } else {
        Err(ApiError::MissingScope(Scope::Admin))
    }
}

/// Makes a token with which the robot signs its requests. Shown this once. Needs `admin`.
#[utoipa::path(
    post, path = route::ROBOT_TOKENS, operation_id = "issue_robot_token", tag = "robots",
    params(("site" = String, Path), ("robot" = String, Path)), request_body = NewToken,
    responses((status = 201, body = IssuedToken, description = "The token, in clear this once"))
)]
pub(super) async fn issue_token(
    State(app): State<App>,
    site: SiteFor<Admin>,
    Path((_, robot)): Path<(String, String)>,
    reader: Reader,
    Payload(new): Payload<NewToken>,
) -> Result<Response, ApiError> {
    let grant = Grant {
        site: Some(site.site),
        robot: Some(robot),
        scopes: check::robot_scopes(new.scopes)?,
        expires_at_us: None,
    };
    let token = auth::issue(app.store(), &app.parts.chance, &grant, app.now_us()).await?;
    let issued = IssuedToken {
        id: token.id().to_owned(),
        token: token.reveal().to_owned(),
        scopes: grant.scopes,
    };
    created(&reader, None, &issued)
}
