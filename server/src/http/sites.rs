//! `/sites`.

use axum::extract::State;
use axum::response::Response;
use mapfold_schema::route;
use mapfold_schema::v1::{NewSite, SiteDescription};

use super::access::{Admin, Allowed, Read};
use super::answer::{Reader, created};
use super::body::Payload;
use super::check;
use super::problem::ApiError;
use super::state::App;

/// The sites that the token reaches, by slug.
#[utoipa::path(
    get, path = route::SITES, operation_id = "list_sites", tag = "sites",
    responses((status = 200, body = Vec<SiteDescription>, description = "The sites"))
)]
pub(super) async fn list(
    State(app): State<App>,
    allowed: Allowed<Read>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let mut sites = app.store().sites().await?;
    sites.retain(|site| allowed.caller.reaches(&site.site));
    reader.small(&sites)
}

/// Makes a site. Needs `admin`.
#[utoipa::path(
    post, path = route::SITES, operation_id = "create_site", tag = "sites",
    request_body = NewSite,
    responses((status = 201, body = SiteDescription, description = "The new site"), (status = 409, description = "`site_exists`"))
)]
pub(super) async fn create(
    State(app): State<App>,
    allowed: Allowed<Admin>,
    reader: Reader,
    Payload(new): Payload<NewSite>,
) -> Result<Response, ApiError> {
    check::new_site(&new)?;
    if !allowed.caller.reaches(&new.site) {
        return Err(ApiError::not_found("site", new.site));
    }
    let name = new.name.as_deref().unwrap_or(&new.site);
    let site = app.store().create_site(&new.site, name, app.now_us()).await?;
    created(&reader, Some(&route::of_site(route::LEVELS, &site.site)), &site)
}
