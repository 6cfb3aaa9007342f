//! A server's HTTP side as small as a robot's tests need it: it keeps what it is sent in memory,
//! answers in the schema's types, and can be told to fail.

use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};

use axum::body::Bytes;
use axum::extract::{Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use mapfold_schema::problem::Problem;
use mapfold_schema::{codec, digest, route, v1};
use uuid::Uuid;

/// What the server knows, and how it misbehaves.
#[derive(Debug, Default)]
pub(crate) struct World {
    pub(crate) sites: BTreeSet<String>,
    pub(crate) levels: BTreeMap<(String, String), v1::LevelDescription>,
    pub(crate) robots: BTreeMap<String, v1::NewRobot>,
    /// Content digest and revision of every contribution.
    pub(crate) taken: BTreeMap<Uuid, (String, i64)>,
    /// The contributions themselves.
    pub(crate) contributions: BTreeMap<Uuid, v1::Contribution>,
    /// Sizes of the batches that came.
    pub(crate) batches: Vec<usize>,
    /// So many requests that upload are answered 503 before they are taken.
    pub(crate) unavailable: usize,
    /// So many are taken, and answered 502 as if they were not.
    pub(crate) answers_lost: usize,
    /// Contributions of which the id ends in this byte are refused.
    pub(crate) refuses: Option<u8>,
    /// The only token that opens anything.
    pub(crate) token: String,
}

/// A running server.
#[derive(Debug)]
pub(crate) struct Server {
    pub(crate) url: String,
    pub(crate) world: Arc<Mutex<World>>,
    task: tokio::task::JoinHandle<()>,
    address: SocketAddr,
}

impl Server {
    pub(crate) async fn start(token: &str) -> Self {
        let world = World { token: token.to_owned(), ..World::default() };
        Self::serve(Arc::new(Mutex::new(world)), "127.0.0.1:0".parse().unwrap()).await
    }

    async fn serve(world: Arc<Mutex<World>>, address: SocketAddr) -> Self {
        let listener = tokio::net::TcpListener::bind(address).await.unwrap();
        let address = listener.local_addr().unwrap();
        let app = Router::new()
            .route(route::SITES, post(create_site))
            .route(route::LEVELS, post(create_level))
            .route(route::LEVEL, get(level))
            .route(route::ROBOTS, post(create_robot))
            .route(route::ROBOT, get(robot).patch(update_robot))
            .route(route::CONTRIBUTIONS, post(contribute))
            .with_state(Arc::clone(&world));
        let task = tokio::spawn(async move { axum::serve(listener, app).await.unwrap() });
        Self { url: format!("http://{address}"), world, task, address }
    }

    /// Goes away in the middle of whatever it does, and comes back with what it had taken.
    pub(crate) async fn restart_after(self, pause: std::time::Duration) -> Self {
        self.task.abort();
        let _ = self.task.await;
        tokio::time::sleep(pause).await;
        Self::serve(self.world, self.address).await
    }
}

type Shared = State<Arc<Mutex<World>>>;

fn problem(status: u16, code: &str) -> Response {
    let body = codec::to_json(&Problem::new(status, code, code, "as the test wants it")).unwrap();
    let status = StatusCode::from_u16(status).unwrap();
    (status, [(header::CONTENT_TYPE, "application/problem+json")], body).into_response()
}

fn authorised(world: &World, headers: &HeaderMap) -> bool {
    let bearer = headers.get(header::AUTHORIZATION).and_then(|v| v.to_str().ok());
    bearer.and_then(|b| b.strip_prefix("Bearer ")) == Some(world.token.as_str())
}

/// The body as the robot meant it, whatever its coding and format.
fn decode<T: serde::de::DeserializeOwned>(headers: &HeaderMap, body: &Bytes) -> T {
    let text = |name| headers.get(name).and_then(|v| v.to_str().ok()).unwrap_or_default();
    let unpacked = match text(header::CONTENT_ENCODING) {
        "zstd" => zstd::decode_all(body.as_ref()).unwrap(),
        _ => body.to_vec(),
    };
    codec::decode(text(header::CONTENT_TYPE), &unpacked).unwrap()
}

async fn create_site(State(world): Shared, headers: HeaderMap, body: Bytes) -> Response {
    let mut world = world.lock().unwrap();
    if !authorised(&world, &headers) {
        return problem(401, "token_unknown");
    }
    let new: v1::NewSite = decode(&headers, &body);
    if !world.sites.insert(new.site.clone()) {
        return problem(409, "site_exists");
    }
    let site = v1::SiteDescription { name: new.site.clone(), site: new.site, levels: Vec::new() };
    (StatusCode::CREATED, Json(site)).into_response()
}

async fn create_level(
    State(world): Shared,
    Path(site): Path<String>,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    let mut world = world.lock().unwrap();
    if !world.sites.contains(&site) {
        return problem(404, "site_not_found");
    }
    let new: v1::NewLevel = decode(&headers, &body);
    let frame = Uuid::from_u128(world.levels.len() as u128 + 1);
    let level = v1::LevelDescription {
        site: site.clone(),
        level: new.level.clone(),
        name: new.level.clone(),
        frame,
        resolution_m: new.resolution_m.unwrap_or(0.05),
        tile_cells: 64,
        elevation_m: 0.0,
        evidence_slice_s: 86_400,
        revision: 0,
        folded_revision: 0,
        bounds: None,
        counts: v1::Counts::default(),
        published: None,
    };
    world.levels.insert((site, new.level), level.clone());
    (StatusCode::CREATED, Json(level)).into_response()
}

async fn level(
    State(world): Shared,
    Path(address): Path<(String, String)>,
    headers: HeaderMap,
) -> Response {
    let world = world.lock().unwrap();
    if !authorised(&world, &headers) {
        return problem(401, "token_unknown");
    }
    match world.levels.get(&address) {
        Some(level) => {
            let revision = world.taken.len() as i64;
            Json(v1::LevelDescription { revision, folded_revision: revision, ..level.clone() })
                .into_response()
        }
        None => problem(404, "level_not_found"),
    }
}

async fn create_robot(State(world): Shared, headers: HeaderMap, body: Bytes) -> Response {
    let new: v1::NewRobot = decode(&headers, &body);
    let mut world = world.lock().unwrap();
    world.robots.insert(new.robot.clone(), new.clone());
    (StatusCode::CREATED, Json(described(&new))).into_response()
}

async fn robot(State(world): Shared, Path((_, name)): Path<(String, String)>) -> Response {
    let world = world.lock().unwrap();
    world
        .robots
        .get(&name)
        .map_or_else(|| problem(404, "robot_not_found"), |r| Json(described(r)).into_response())
}

async fn update_robot(
    State(world): Shared,
    Path((_, name)): Path<(String, String)>,
    headers: HeaderMap,
    body: Bytes,
) -> Response {
    let update: v1::RobotUpdate = decode(&headers, &body);
    let mut world = world.lock().unwrap();
    let Some(robot) = world.robots.get_mut(&name) else { return problem(404, "robot_not_found") };
    if let Some(sensors) = update.sensors {
        robot.sensors = sensors;
    }
    Json(described(robot)).into_response()
}

fn described(robot: &v1::NewRobot) -> v1::RobotDescription {
    v1::RobotDescription {
        robot: robot.robot.clone(),
        name: robot.robot.clone(),
        sensors: robot.sensors.clone(),
        competence: robot.sensors.iter().map(|s| s.kind).collect(),
        state: v1::RobotState::Active,
        last_pose: None,
        revision: None,
        queue_length: None,
        fix: None,
        contributions: 0,
        reverted: 0,
    }
}

async fn contribute(State(world): Shared, headers: HeaderMap, body: Bytes) -> Response {
    let mut world = world.lock().unwrap();
    if !authorised(&world, &headers) {
        return problem(401, "token_unknown");
    }
    if world.unavailable > 0 {
        world.unavailable -= 1;
        return problem(503, "queue_full");
    }
    let batch: Vec<v1::Contribution> = decode(&headers, &body);
    world.batches.push(batch.len());
    let answers: Vec<v1::UploadAnswer> =
        batch.into_iter().map(|contribution| world.take(contribution)).collect();
    if world.answers_lost > 0 {
        world.answers_lost -= 1;
        return problem(502, "bad_gateway");
    }
    (StatusCode::CREATED, Json(answers)).into_response()
}

impl World {
    fn take(&mut self, contribution: v1::Contribution) -> v1::UploadAnswer {
        let refuse = |status, code| {
            v1::UploadAnswer::Problem(Problem::new(status, code, code, "as the test wants it"))
        };
        let id = contribution.id;
        if self.refuses.is_some_and(|byte| id.as_bytes()[15] == byte) {
            return refuse(422, "contribution_invalid");
        }
        let digest = digest::content_digest(&contribution).unwrap();
        let next = self.taken.len() as i64 + 1;
        let (known, revision) =
            self.taken.entry(id).or_insert_with(|| (digest.clone(), next)).clone();
        if known != digest {
            return refuse(409, "contribution_conflict");
        }
        self.contributions.insert(id, contribution);
        v1::UploadAnswer::Receipt(v1::Receipt {
            id,
            revision,
            received_at: "2026-11-22T04:00:00.000000Z".to_owned(),
            state: v1::ContributionState::Folded,
            digest,
        })
    }
}
