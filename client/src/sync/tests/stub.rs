//! A server for tests: it keeps a log as the real one does, in memory, and misbehaves as it is
//! told. It runs on a runtime of its own, so that it can be killed with all its connections and
//! come back on the same port with the same log.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use mapfold_map::level::{Level, LevelConfig, LevelMap, diff};
use mapfold_schema::border::{DEFAULT_LIMITS, Target, check_contribution, wire_patch};
use mapfold_schema::codec::{self, CBOR};
use mapfold_schema::digest::content_digest;
use mapfold_schema::problem::{PROBLEM_JSON, Problem};
use mapfold_schema::{route, v1};
use tokio::runtime::Runtime;
use uuid::Uuid;

use super::FRAME;

pub(in crate::sync) const TOKEN: &str = "the-robots-token";
const RESOLUTION_M: f64 = 0.05;

/// One thing that goes wrong with one upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::sync) enum Fault {
    /// The connection breaks before anything is taken.
    DropBefore,
    /// It breaks after everything is taken and before the answer.
    DropAfter,
    /// 503 with `Retry-After` in seconds.
    Busy(u64),
    /// 500.
    Broken,
    /// 200 and a page to sign in.
    Portal,
    /// 201 and receipts for content that was never sent.
    OtherContent,
    /// 201 and one receipt less.
    OneLess,
    /// 201, well-formed, cut off in the middle.
    Torn,
    /// 302 to somewhere else.
    Redirect,
    /// No answer for this many milliseconds.
    Silence(u64),
}

/// What the server is and does.
#[derive(Debug)]
pub(in crate::sync) struct Ledger {
    /// Faults of the uploads to come, one each.
    pub(in crate::sync) faults: VecDeque<Fault>,
    /// Contributions that are refused with 422.
    pub(in crate::sync) refused: BTreeSet<Uuid>,
    /// Contributions that make the whole upload be refused with 422.
    pub(in crate::sync) unreadable: BTreeSet<Uuid>,
    /// Contributions over which the server falls, with 500.
    pub(in crate::sync) poison: BTreeSet<Uuid>,
    /// Longest upload, unpacked.
    pub(in crate::sync) bytes_max: usize,
    /// How many contributions an upload may hold.
    pub(in crate::sync) count_max: usize,
    /// How long an upload takes.
    pub(in crate::sync) delay: Duration,
    /// The token that is valid.
    pub(in crate::sync) token: String,
    /// The level's frame.
    pub(in crate::sync) frame: Uuid,
    /// Ids of every upload that was read, taken or not.
    pub(in crate::sync) uploads: Vec<Vec<Uuid>>,
    /// Uploads in hand at the same time, at most.
    pub(in crate::sync) busiest: usize,
    /// Bytes of all uploads, packed.
    pub(in crate::sync) bytes_in: u64,
    /// Pages of patches that were asked for.
    pub(in crate::sync) pages: usize,
    /// What the level is said to hold, if not what it holds.
    pub(in crate::sync) counts: Option<v1::Counts>,
    /// Landmarks of the level, with the revision at which each came.
    pub(in crate::sync) landmarks: Vec<(i64, v1::Landmark)>,
    /// Landmarks that are no more, with the revision at which each went.
    pub(in crate::sync) gone: Vec<(i64, String)>,
    /// The published model's plan and its publication.
    pub(in crate::sync) plan: Option<(i64, v1::GdbPlan)>,
    /// What questions for landmarks are answered with instead, once each.
    pub(in crate::sync) refuses_landmarks: VecDeque<(u16, &'static str)>,
    /// Questions for plans.
    pub(in crate::sync) plans: usize,
    in_hand: usize,
    receipts: BTreeMap<Uuid, v1::Receipt>,
    /// The map at each revision, from 0 on; every acknowledged contribution is one revision.
    history: Vec<Level>,
}

impl Ledger {
    fn new() -> Self {
        Self {
            faults: VecDeque::new(),
            refused: BTreeSet::new(),
            unreadable: BTreeSet::new(),
            poison: BTreeSet::new(),
            bytes_max: 16 << 20,
            count_max: 64,
            delay: Duration::ZERO,
            token: TOKEN.to_owned(),
            frame: FRAME,
            uploads: Vec::new(),
            busiest: 0,
            bytes_in: 0,
            pages: 0,
            counts: None,
            landmarks: Vec::new(),
            gone: Vec::new(),
            plan: None,
            refuses_landmarks: VecDeque::new(),
            plans: 0,
            in_hand: 0,
            receipts: BTreeMap::new(),
            history: vec![Level::new(LevelConfig::standard(RESOLUTION_M))],
        }
    }

    /// What was acknowledged, and at which revision.
    pub(in crate::sync) fn log(&self) -> BTreeMap<Uuid, i64> {
        self.receipts.iter().map(|(id, receipt)| (*id, receipt.revision)).collect()
    }

    /// Sets the server back to an older backup.
    pub(in crate::sync) fn set_back(&mut self, revision: i64) {
        self.receipts.retain(|_, receipt| receipt.revision <= revision);
        self.history.truncate(revision as usize + 1);
    }

    /// Makes the level anew.
    pub(in crate::sync) fn make_anew(&mut self, frame: Uuid) {
        self.set_back(0);
        self.frame = frame;
    }

    /// The newest map.
    pub(in crate::sync) fn map(&self) -> &LevelMap {
        self.history.last().unwrap().map()
    }

    pub(in crate::sync) fn revision(&self) -> i64 {
        self.history.len() as i64 - 1
    }

    /// Takes contributions as if they had been uploaded.
    pub(in crate::sync) fn take(&mut self, contributions: &[v1::Contribution]) {
        for contribution in contributions {
            assert!(matches!(self.answer(contribution), v1::UploadAnswer::Receipt(_)));
        }
    }

    fn answer(&mut self, contribution: &v1::Contribution) -> v1::UploadAnswer {
        let digest = content_digest(contribution).unwrap();
        if let Some(receipt) = self.receipts.get(&contribution.id) {
            return if receipt.digest == digest {
                v1::UploadAnswer::Receipt(receipt.clone())
            } else {
                v1::UploadAnswer::Problem(problem(409, "contribution_conflict"))
            };
        }
        if self.refused.contains(&contribution.id) {
            return v1::UploadAnswer::Problem(problem(422, "contribution_invalid"));
        }
        let target =
            Target { frame: self.frame, resolution_m: RESOLUTION_M, limits: DEFAULT_LIMITS };
        let Ok(checked) = check_contribution(contribution, &target) else {
            return v1::UploadAnswer::Problem(problem(422, "contribution_invalid"));
        };
        let mut level = self.history.last().unwrap().clone();
        level.fold([&checked]);
        self.history.push(level);
        let receipt = v1::Receipt {
            id: contribution.id,
            revision: self.revision(),
            received_at: "2026-11-22T04:00:01.000000Z".to_owned(),
            state: v1::ContributionState::Folded,
            digest,
        };
        self.receipts.insert(contribution.id, receipt.clone());
        v1::UploadAnswer::Receipt(receipt)
    }
}

fn problem(status: u16, code: &str) -> Problem {
    Problem::new(status, code, code, format!("the stub says {code}"))
}

type Shared = Arc<Mutex<Ledger>>;

/// The server.
#[derive(Debug)]
pub(in crate::sync) struct Stub {
    ledger: Shared,
    address: SocketAddr,
    runtime: Option<Runtime>,
}

impl Stub {
    pub(in crate::sync) fn start() -> Self {
        let ledger = Arc::new(Mutex::new(Ledger::new()));
        let (address, runtime) = serve(&ledger, SocketAddr::from(([127, 0, 0, 1], 0)));
        Self { ledger, address, runtime: Some(runtime) }
    }

    pub(in crate::sync) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    pub(in crate::sync) fn ledger(&self) -> MutexGuard<'_, Ledger> {
        self.ledger.lock().unwrap()
    }

    /// Ends at once, in the middle of whatever it was doing.
    pub(in crate::sync) fn kill(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
            self.ledger().in_hand = 0;
        }
    }

    /// Comes back where it was.
    pub(in crate::sync) fn restart(&mut self) {
        self.kill();
        self.runtime = Some(serve(&self.ledger, self.address).1);
    }
}

impl Drop for Stub {
    fn drop(&mut self) {
        self.kill();
    }
}

fn serve(ledger: &Shared, address: SocketAddr) -> (SocketAddr, Runtime) {
    let runtime =
        tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap();
    let routes = Router::new()
        .route(route::CONTRIBUTIONS, post(upload))
        .route(route::LEVEL, get(describe))
        .route(route::PATCHES, get(patches))
        .route(route::VECTOR, get(vector))
        .route(route::LANDMARKS, get(landmarks))
        .route(route::GDB_PLAN, get(plan))
        .route(route::SITES, get(sites).post(sites))
        .with_state(Arc::clone(ledger));
    // Bound on a thread of its own: a runtime's thread may not wait for another runtime.
    let (listener, runtime) = std::thread::spawn(move || {
        let bind = async {
            loop {
                match tokio::net::TcpListener::bind(address).await {
                    // The old one may not be gone yet.
                    Err(e) if e.kind() == std::io::ErrorKind::AddrInUse => {
                        tokio::time::sleep(Duration::from_millis(5)).await;
                    }
                    listener => return listener.unwrap(),
                }
            }
        };
        (runtime.block_on(bind), runtime)
    })
    .join()
    .unwrap();
    let address = listener.local_addr().unwrap();
    runtime.spawn(async move { axum::serve(listener, routes).await });
    (address, runtime)
}

/// Ends the connection without an answer: its task is gone, and the socket with it. Not to be done
/// while the ledger is locked.
fn hang_up() -> ! {
    std::panic::resume_unwind(Box::new("hung up"))
}

fn written(status: u16, value: &impl serde::Serialize) -> Response {
    let body = codec::to_cbor(value).unwrap();
    (StatusCode::from_u16(status).unwrap(), [(header::CONTENT_TYPE, CBOR)], body).into_response()
}

fn refused(problem: &Problem) -> Response {
    let mut response = Response::new(Body::from(codec::to_json(problem).unwrap()));
    *response.status_mut() = StatusCode::from_u16(problem.status).unwrap();
    response.headers_mut().insert(header::CONTENT_TYPE, PROBLEM_JSON.parse().unwrap());
    response
}

fn is_allowed(ledger: &Ledger, headers: &HeaderMap) -> bool {
    let expected = format!("Bearer {}", ledger.token);
    headers.get(header::AUTHORIZATION).is_some_and(|value| value == expected.as_str())
}

async fn upload(
    State(shared): State<Shared>,
    Path((site, level)): Path<(String, String)>,
    headers: HeaderMap,
    packed: Bytes,
) -> Response {
    assert_eq!((site.as_str(), level.as_str()), ("plant", "ground"));
    assert_eq!(headers[header::CONTENT_TYPE], CBOR);
    assert_eq!(headers[header::CONTENT_ENCODING], "zstd");
    let body = zstd::stream::decode_all(packed.as_ref()).unwrap();
    let (contributions, is_array) = codec::decode_uploads(CBOR, &body).unwrap();
    assert!(is_array);
    let ids: Vec<Uuid> = contributions.iter().map(|c| c.id).collect();
    let (delay, fault) = {
        let mut ledger = shared.lock().unwrap();
        if !is_allowed(&ledger, &headers) {
            return refused(&problem(401, "invalid_token"));
        }
        ledger.bytes_in += packed.len() as u64;
        ledger.uploads.push(ids.clone());
        ledger.in_hand += 1;
        ledger.busiest = ledger.busiest.max(ledger.in_hand);
        (ledger.delay, ledger.faults.pop_front())
    };
    tokio::time::sleep(delay).await;
    if let Some(Fault::Silence(ms)) = fault {
        tokio::time::sleep(Duration::from_millis(ms)).await;
    }
    {
        let mut ledger = shared.lock().unwrap();
        ledger.in_hand = ledger.in_hand.saturating_sub(1);
    }
    if let Some(response) = fault.and_then(fault_before) {
        return response;
    }
    let mut ledger = shared.lock().unwrap();
    if body.len() > ledger.bytes_max {
        return refused(&problem(413, "body_too_large"));
    }
    if contributions.len() > ledger.count_max {
        return refused(&problem(413, "too_many_items"));
    }
    if ids.iter().any(|id| ledger.unreadable.contains(id)) {
        return refused(&problem(422, "body_invalid"));
    }
    if ids.iter().any(|id| ledger.poison.contains(id)) {
        return refused(&problem(500, "internal"));
    }
    let answers: Vec<v1::UploadAnswer> =
        contributions.iter().map(|contribution| ledger.answer(contribution)).collect();
    drop(ledger);
    answered(fault, answers)
}

fn fault_before(fault: Fault) -> Option<Response> {
    match fault {
        Fault::DropBefore => hang_up(),
        Fault::Busy(seconds) => {
            let mut response = refused(&problem(503, "queue_full"));
            response.headers_mut().insert(header::RETRY_AFTER, seconds.into());
            Some(response)
        }
        Fault::Broken => Some(StatusCode::INTERNAL_SERVER_ERROR.into_response()),
        Fault::Portal => {
            let page = "<html><body>Welcome! Please sign in to our network.</body></html>";
            Some(([(header::CONTENT_TYPE, "text/html")], page).into_response())
        }
        Fault::Redirect => {
            let to = [(header::LOCATION, "http://portal.invalid/login")];
            Some((StatusCode::FOUND, to).into_response())
        }
        _ => None,
    }
}

fn answered(fault: Option<Fault>, mut answers: Vec<v1::UploadAnswer>) -> Response {
    match fault {
        Some(Fault::DropAfter) => hang_up(),
        Some(Fault::OneLess) => {
            answers.pop();
        }
        Some(Fault::OtherContent) => {
            for answer in &mut answers {
                if let v1::UploadAnswer::Receipt(receipt) = answer {
                    receipt.digest = "0".repeat(64);
                }
            }
        }
        Some(Fault::Torn) => {
            let mut body = codec::to_cbor(&answers).unwrap();
            body.truncate(body.len() / 2);
            return (StatusCode::CREATED, [(header::CONTENT_TYPE, CBOR)], body).into_response();
        }
        _ => {}
    }
    written(201, &answers)
}

async fn describe(State(shared): State<Shared>, headers: HeaderMap) -> Response {
    let ledger = shared.lock().unwrap();
    if !is_allowed(&ledger, &headers) {
        return refused(&problem(401, "invalid_token"));
    }
    written(
        200,
        &v1::LevelDescription {
            site: "plant".to_owned(),
            level: "ground".to_owned(),
            name: "Ground floor".to_owned(),
            frame: ledger.frame,
            resolution_m: RESOLUTION_M,
            tile_cells: 64,
            elevation_m: 0.0,
            evidence_slice_s: 86_400,
            revision: ledger.revision(),
            folded_revision: ledger.revision(),
            bounds: None,
            counts: ledger.counts.unwrap_or_else(|| counts(ledger.map())),
            published: None,
        },
    )
}

async fn landmarks(State(shared): State<Shared>, Query(asked): Query<Since>) -> Response {
    let mut ledger = shared.lock().unwrap();
    if let Some((status, code)) = ledger.refuses_landmarks.pop_front() {
        return refused(&problem(status, code));
    }
    let told = ledger.landmarks.iter().filter(|(revision, _)| *revision > asked.since);
    let gone = ledger.gone.iter().filter(|(revision, _)| *revision > asked.since);
    let table = v1::LandmarkTable {
        revision: ledger.revision(),
        publication: ledger.plan.as_ref().map_or(0, |(publication, _)| *publication),
        height_m: 0.3,
        landmarks: told.map(|(_, landmark)| landmark.clone()).collect(),
        removed: gone.map(|(_, id)| id.clone()).collect(),
    };
    written(200, &table)
}

async fn plan(State(shared): State<Shared>) -> Response {
    let mut ledger = shared.lock().unwrap();
    ledger.plans += 1;
    ledger.plan.as_ref().map_or_else(
        || refused(&problem(404, "publication_not_found")),
        |(_, plan)| written(200, plan),
    )
}

fn counts(map: &LevelMap) -> v1::Counts {
    v1::Counts {
        contributions: 0,
        in_force: 0,
        segments: map.segments.len() as i64,
        clusters: map.clusters.len() as i64,
        chains: map.chains.len() as i64,
        tiles: map.tiles.len() as i64,
        prior_tiles: map.prior.len() as i64,
    }
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Since {
    since: i64,
    limit: Option<usize>,
}

async fn patches(State(shared): State<Shared>, Query(query): Query<Since>) -> Response {
    let mut ledger = shared.lock().unwrap();
    ledger.pages += 1;
    let newest = ledger.revision();
    if query.since > newest {
        return refused(&problem(410, "cursor_expired"));
    }
    let map = |revision: i64| ledger.history[revision as usize].map();
    let (mut to, mut patch) = (query.since, diff(map(query.since), map(query.since)));
    let limit = query.limit.unwrap();
    while to < newest && patch.segments.len() + patch.clusters.len() + patch.tiles.len() < limit {
        to += 1;
        patch = diff(map(query.since), map(to));
    }
    let page = wire_patch(&patch, query.since, to, to < newest);
    let body = zstd::encode_all(codec::to_cbor(&page).unwrap().as_slice(), 3).unwrap();
    let head = [(header::CONTENT_TYPE, CBOR), (header::CONTENT_ENCODING, "zstd")];
    (head, body).into_response()
}

async fn vector(State(shared): State<Shared>, Query(query): Query<Since>) -> Response {
    let ledger = shared.lock().unwrap();
    let patch = diff(ledger.history[query.since as usize].map(), ledger.map());
    let patch = wire_patch(&patch, query.since, ledger.revision(), false);
    let v1::Patch { since, revision, segments, clusters, chains, removed, .. } = patch;
    written(200, &v1::VectorPatch { since, revision, segments, clusters, chains, removed })
}

/// A site that is there already, or a page in gzip, whatever is asked for.
async fn sites(method: axum::http::Method) -> Response {
    if method == axum::http::Method::POST {
        return refused(&problem(409, "site_exists"));
    }
    let site = v1::SiteDescription {
        site: "plant".to_owned(),
        name: "Plant".to_owned(),
        levels: vec!["ground".to_owned()],
    };
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut gzip, &codec::to_json(&[site]).unwrap()).unwrap();
    let head = [(header::CONTENT_TYPE, "application/json"), (header::CONTENT_ENCODING, "gzip")];
    (head, gzip.finish().unwrap()).into_response()
}
