//! The whole API on one screen.

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::routing::{get, post};
use mapfold_schema::route;

use super::problem::ApiError;
use super::state::App;
use super::{
    alignments, batch, changes, contributions, docs, events, exports, gdb, health, imports,
    landmarks, layers, levels, model_exports, page, patches, plan, prototypes, raster, reverts,
    robots, session, sites, tiles, vector,
};

/// All routes, with all layers around them.
pub fn router(app: &App) -> Router {
    let upload_bytes = app.parts.limits.upload_bytes;
    let routes = Router::new()
        .route(route::SITES, get(sites::list).post(sites::create))
        .route(route::LEVELS, get(levels::list).post(levels::create))
        .route(route::LEVEL, get(levels::describe))
        .route(route::ROBOTS, get(robots::list).post(robots::enrol))
        .route(route::ROBOT, get(robots::describe).patch(robots::update))
        .route(route::ROBOT_TOKENS, post(robots::issue_token))
        .route(
            route::CONTRIBUTIONS,
            get(contributions::list)
                .post(contributions::upload)
                .layer(DefaultBodyLimit::max(upload_bytes)),
        )
        .route(route::CONTRIBUTION, get(contributions::describe))
        .route(route::REVERTS, get(reverts::list).post(reverts::create))
        .route(route::REVERT, get(reverts::describe).delete(reverts::undo))
        .route(route::ALIGNMENTS, get(alignments::read))
        .route(route::ALIGNMENT, post(alignments::accept).delete(alignments::withdraw))
        .route(route::VECTOR, get(vector::read))
        .route(route::RASTER, get(raster::changes))
        .route(route::RASTER_BATCH, get(batch::read))
        .route(route::RASTER_TILE, get(raster::tile))
        .route(route::TILES, get(tiles::read))
        .route(route::PATCHES, get(patches::read))
        .route(route::EVENTS, get(events::follow))
        .route(route::EXPORTS, get(exports::read))
        .route(
            route::IMPORTS,
            get(imports::list)
                .post(imports::create)
                .delete(imports::remove)
                .layer(DefaultBodyLimit::max(upload_bytes)),
        )
        .route(
            route::GDB,
            get(gdb::read)
                .put(gdb::replace)
                .patch(gdb::edit)
                .layer(DefaultBodyLimit::max(upload_bytes)),
        )
        .route(route::GDB_PUBLICATIONS, post(gdb::publish))
        .route(route::GDB_ENTRIES, get(gdb::entries))
        .route(route::GDB_FINDINGS, get(plan::findings))
        .route(route::GDB_PLAN, get(plan::read))
        .route(route::GDB_PRIOR, post(plan::make_prior))
        .route(route::CHANGES, get(changes::read))
        .route(route::CHANGE, post(changes::answer))
        .route(route::GDB_GLB, get(model_exports::glb))
        .route(route::LANDMARKS, get(landmarks::read))
        .route(
            route::PROTOTYPES,
            get(prototypes::read)
                .put(prototypes::replace)
                .layer(DefaultBodyLimit::max(upload_bytes)),
        )
        .route(
            route::SESSION,
            get(session::describe).post(session::sign_in).delete(session::sign_out),
        )
        .route("/livez", get(health::live))
        .route("/readyz", get(health::ready))
        .route("/metrics", get(health::metrics))
        .route(docs::DESCRIPTION, get(docs::description))
        .route("/docs", get(docs::redirect))
        .route("/docs/", get(docs::index))
        .route("/docs/{*path}", get(docs::asset))
        .route("/", get(page::index))
        .fallback(page::asset)
        .method_not_allowed_fallback(async || ApiError::WrongMethod)
        .with_state(app.clone());
    layers::around(routes, app)
}
