//! The description of the API (OpenAPI 3.1), made from the handlers and the wire types.

use mapfold_schema::problem::{PROBLEM_JSON, Problem};
use mapfold_schema::v1;
use utoipa::openapi::path::Operation;
use utoipa::openapi::security::{ApiKey, ApiKeyValue, HttpAuthScheme, HttpBuilder, SecurityScheme};
use utoipa::openapi::{ContentBuilder, OpenApi, Ref, RefOr, ResponseBuilder};
use utoipa::{Modify, OpenApi as _};

use super::access::SESSION_COOKIE;
use super::problem::ApiError;
use super::{
    alignments, batch, changes, contributions, events, exports, gdb, health, imports, landmarks,
    levels, model_exports, patches, plan, prototypes, raster, reverts, robots, session, sites,
    tiles, vector,
};

/// What stands at the head of the description.
const PREFACE: &str = "Mapfold keeps one shared map for a mixed fleet.

Lengths are metres, angles radians, instants RFC 3339 in UTC. Reads answer JSON or CBOR (the same \
types) by `Accept`, bear a strong `ETag`, take `If-None-Match`, and name the revision they show in \
`Mapfold-Revision`. Bodies are JSON or CBOR, but for maps of other programs, and may be coded as gzip or zstd. In CBOR a UUID is a \
byte string of 16 bytes, not text, and what the schema calls a `number` is a float of any width, \
never an integer; all else is as in JSON. Every refusal is an \
RFC 9457 problem (`application/problem+json`) with a stable `code`; where it is `retryable`, \
`Retry-After` says when to try again. What a token does not reach is not found.";

/// Tags of what is read with a validator.
const TAGS_WITH_VALIDATORS: [&str; 6] =
    ["sites", "levels", "robots", "contributions", "map", "gdb"];

#[derive(utoipa::OpenApi)]
#[openapi(
    info(title = "Mapfold", description = PREFACE, license(name = "MIT OR Apache-2.0")),
    paths(
        sites::list, sites::create,
        levels::list, levels::create, levels::describe,
        robots::list, robots::enrol, robots::describe, robots::update, robots::issue_token,
        contributions::upload, contributions::list, contributions::describe,
        reverts::create, reverts::list, reverts::describe, reverts::undo,
        alignments::read, alignments::accept, alignments::withdraw,
        vector::read, raster::changes, raster::tile, batch::read, tiles::read, patches::read,
        events::follow, exports::read, imports::create, imports::list, imports::remove,
        gdb::read, gdb::replace, gdb::edit, gdb::publish, gdb::entries,
        plan::findings, plan::read, plan::make_prior, landmarks::read,
        changes::read, changes::answer,
        model_exports::glb, prototypes::read, prototypes::replace,
        session::sign_in, session::describe, session::sign_out,
        health::live, health::ready, health::metrics,
    ),
    components(schemas(Problem, v1::UploadAnswer, v1::BuildingImport, v1::ModelImport, v1::GdbDocument)),
    modifiers(&Common),
    security(("token" = []), ("session" = [])),
    tags(
        (name = "sites", description = "Plants or buildings: the unit of permissions"),
        (name = "levels", description = "Floors, each with a frame of its own"),
        (name = "robots", description = "Who contributes, with which sensors"),
        (name = "contributions", description = "Uploads, the log that they make, and reverts"),
        (name = "map", description = "The shared map, folded from all contributions"),
        (name = "gdb", description = "The building as it was meant to be: drafts, publications, plans, landmarks, changes that robots found"),
        (name = "session", description = "Signing in on the page"),
        (name = "health", description = "For those who run the server"),
    ),
)]
struct Description;

/// What all operations have in common.
struct Common;

impl Modify for Common {
    fn modify(&self, openapi: &mut OpenApi) {
        let components = openapi.components.get_or_insert_default();
        let bearer = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).build();
        components.add_security_scheme("token", SecurityScheme::Http(bearer));
        let cookie = ApiKey::Cookie(ApiKeyValue::new(SESSION_COOKIE));
        components.add_security_scheme("session", SecurityScheme::ApiKey(cookie));
        for item in openapi.paths.paths.values_mut() {
            let operations =
                [&mut item.get, &mut item.put, &mut item.post, &mut item.delete, &mut item.patch];
            operations.into_iter().flatten().for_each(with_problems);
            if let Some(read) = &mut item.get {
                with_validator(read);
            }
        }
    }
}

/// Gives every refusal the problem as its content, also those that are not listed by status.
fn with_problems(operation: &mut Operation) {
    let content =
        || ContentBuilder::new().schema(Some(RefOr::Ref(Ref::from_schema_name("Problem")))).build();
    for (status, response) in &mut operation.responses.responses {
        if let RefOr::T(response) = response
            && status.starts_with(['4', '5'])
        {
            response.content.insert(PROBLEM_JSON.to_owned(), RefOr::T(content()));
        }
    }
    let any = ResponseBuilder::new()
        .description("Refused; `code` says why")
        .content(PROBLEM_JSON, content())
        .build();
    operation.responses.responses.insert("default".to_owned(), RefOr::T(any));
}

/// Reads bear an `ETag`: whoever has what would be answered is told only that.
fn with_validator(read: &mut Operation) {
    let tagged = read.tags.iter().flatten().any(|tag| TAGS_WITH_VALIDATORS.contains(&tag.as_str()));
    // A stream of events has no end that could be validated.
    if tagged && read.operation_id.as_deref() != Some("follow") {
        let unchanged = ResponseBuilder::new()
            .description("Not modified: `If-None-Match` has the `ETag` of what would be answered")
            .build();
        read.responses.responses.insert("304".to_owned(), RefOr::T(unchanged));
    }
}

/// The description.
pub fn openapi() -> OpenApi {
    Description::openapi()
}

/// The description as it is served, and kept in `schema/openapi.json`.
pub(super) fn text() -> Result<String, ApiError> {
    let text = openapi().to_pretty_json();
    text.map(|text| text + "\n").map_err(|error| ApiError::Internal(error.to_string()))
}
