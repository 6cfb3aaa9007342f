//! Who may do what: every operation asked by everybody.

use std::collections::BTreeSet;

use mapfold_schema::route;
use mapfold_schema::v1::{NewRobot, NewSite, Scope};
use mapfold_server::auth::{self, Grant, Token};
use mapfold_server::chance::Chance;
use mapfold_server::store::{Store, sqlite_url};
use reqwest::Method;
use reqwest::header::AUTHORIZATION;
use serde_json::{Value, json};

use crate::client::{Answer, Client};
use crate::server::Server;
use crate::world::{Level, scanner};

/// What each is answered: nobody, a robot of the site, a robot of another site, a reader of the
/// site, the administrator.
type Row = (&'static str, String, Value, [u16; 5]);

fn table(floor: &Level, look: &Value) -> Vec<Row> {
    let robot = route::robot(&floor.site, "r1");
    let level = |template: &str| floor.path(template);
    let site = |template: &str| route::of_site(template, &floor.site);
    let contribution = format!("{}/{}", level(route::CONTRIBUTIONS), look["id"].as_str().unwrap());
    let revert = level(route::REVERT).replace("{id}", look["id"].as_str().unwrap());
    let alignment = level(route::ALIGNMENT).replace("{frame}", look["id"].as_str().unwrap());
    let change = level(route::CHANGE).replace("{id}", "new");
    let tile = level(route::TILES).replace("{z}/{row}/{col}", "6/0/0.png");
    let cells = level(route::RASTER_TILE).replace("{x}/{y}", "0/0");
    let export = |format| level(route::EXPORTS).replace("{format}", format);
    let none = Value::Null;
    let read = [401, 200, 404, 200, 200];
    let administer = [401, 403, 404, 403, 201];
    vec![
        // Everybody with a token has a list of sites: of those that the token reaches.
        ("GET", route::SITES.to_owned(), none.clone(), [401, 200, 200, 200, 200]),
        ("POST", route::SITES.to_owned(), json!({"site": "new"}), [401, 403, 403, 403, 201]),
        ("GET", site(route::LEVELS), none.clone(), read),
        ("POST", site(route::LEVELS), json!({"level": "new"}), administer),
        ("GET", level(route::LEVEL), none.clone(), read),
        ("GET", site(route::ROBOTS), none.clone(), read),
        ("POST", site(route::ROBOTS), json!({"robot": "new", "sensors": []}), administer),
        ("GET", robot.clone(), none.clone(), read),
        ("PATCH", robot.clone(), json!({"queue_length": 3}), [401, 200, 404, 403, 200]),
        ("PATCH", robot.clone(), json!({"state": "active"}), [401, 403, 404, 403, 200]),
        (
            "PATCH",
            route::robot(&floor.site, "r2"),
            json!({"queue_length": 3}),
            [401, 403, 404, 403, 200],
        ),
        ("POST", format!("{robot}/tokens"), json!({}), administer),
        ("GET", level(route::CONTRIBUTIONS), none.clone(), read),
        ("POST", level(route::CONTRIBUTIONS), look.clone(), [401, 201, 404, 403, 201]),
        ("GET", contribution, none.clone(), read),
        ("GET", level(route::REVERTS), none.clone(), read),
        (
            "POST",
            format!("{}?preview=true", level(route::REVERTS)),
            json!({"robot": "r1"}),
            [401, 403, 404, 403, 200],
        ),
        (
            "POST",
            level(route::REVERTS),
            json!({"robot": "r3", "reason": "drift"}),
            [401, 403, 404, 403, 409],
        ),
        ("GET", revert.clone(), none.clone(), [401, 404, 404, 404, 404]),
        ("DELETE", revert, none.clone(), [401, 403, 404, 403, 404]),
        ("GET", level(route::ALIGNMENTS), none.clone(), read),
        ("POST", alignment.clone(), json!({}), [401, 403, 404, 403, 409]),
        ("DELETE", alignment, none.clone(), [401, 403, 404, 403, 409]),
        ("GET", level(route::VECTOR), none.clone(), read),
        ("GET", level(route::RASTER), none.clone(), read),
        ("GET", cells, none.clone(), read),
        ("GET", format!("{}?tiles=0,0", level(route::RASTER_BATCH)), none.clone(), read),
        ("GET", tile, none.clone(), read),
        ("GET", level(route::PATCHES), none.clone(), read),
        ("GET", level(route::EVENTS), none.clone(), read),
        ("GET", export("geojson"), none.clone(), read),
        ("GET", export("nav2"), none.clone(), read),
        ("GET", level(route::IMPORTS), none.clone(), read),
        ("POST", level(route::IMPORTS), json!("no model"), [401, 403, 404, 403, 422]),
        ("DELETE", level(route::IMPORTS), none.clone(), [401, 403, 404, 403, 404]),
        ("GET", level(route::GDB), none.clone(), read),
        ("PUT", level(route::GDB), json!({}), [401, 403, 404, 403, 428]),
        ("PATCH", level(route::GDB), json!({}), [401, 403, 404, 403, 428]),
        ("POST", level(route::GDB_PUBLICATIONS), none.clone(), [401, 403, 404, 403, 428]),
        ("GET", level(route::GDB_ENTRIES), none.clone(), read),
        ("GET", level(route::GDB_FINDINGS), none.clone(), read),
        ("GET", level(route::GDB_PLAN), none.clone(), read),
        ("POST", level(route::GDB_PRIOR), none.clone(), [401, 403, 404, 403, 404]),
        ("GET", level(route::GDB_GLB), none.clone(), read),
        ("GET", level(route::CHANGES), none.clone(), read),
        ("POST", change, json!({"answer": "dismiss"}), [401, 403, 404, 403, 404]),
        ("GET", level(route::LANDMARKS), none.clone(), read),
        ("GET", site(route::PROTOTYPES), none.clone(), read),
        ("PUT", site(route::PROTOTYPES), json!({}), [401, 403, 404, 403, 428]),
        ("GET", route::SESSION.to_owned(), none.clone(), [401, 200, 200, 200, 200]),
        ("DELETE", route::SESSION.to_owned(), none, [401, 204, 204, 204, 204]),
    ]
}

async fn status(client: &Client, method: &str, path: &str, body: &Value) -> u16 {
    let mut request = client.request(Method::from_bytes(method.as_bytes()).unwrap(), path);
    if !body.is_null() {
        request = request.header("content-type", "application/json").body(body.to_string());
    }
    // Only the head: a live stream has no end.
    request.send().await.unwrap().status().as_u16()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_operation_answers_everybody_as_the_table_says() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    floor.enrol("r2").await;
    let elsewhere = Level::create_at(&server.admin(), "elsewhere", "floor").await;
    floor.contribute("r1", 1).await;
    let look = serde_json::to_value(floor.look("r1", 1).await).unwrap();
    let reader = token(&server, Some("plant"), None, &[Scope::MapRead]).await;
    let everybody = [
        server.anybody(),
        server.with(&floor.token("r1").await),
        server.with(&elsewhere.token("r1").await),
        server.with(&reader),
        server.admin(),
    ];

    let table = table(&floor, &look);
    for (method, path, body, expected) in &table {
        for (who, (client, expected)) in everybody.iter().zip(expected).enumerate() {
            let status = status(client, method, path, body).await;
            assert_eq!(status, *expected, "{method} {path} asked by number {who}");
        }
    }

    // No operation that the API describes is missing in the table.
    let asked: BTreeSet<(String, String)> =
        table.iter().map(|(method, path, ..)| ((*method).to_owned(), template_of(path))).collect();
    let description = serde_json::to_value(mapfold_server::http::openapi()).unwrap();
    for (path, item) in description["paths"].as_object().unwrap() {
        for method in item.as_object().unwrap().keys() {
            let operation = (method.to_uppercase(), path.clone());
            let is_open = ["/livez", "/readyz", "/metrics"].contains(&path.as_str())
                || operation == ("POST".to_owned(), route::SESSION.to_owned());
            assert!(is_open || asked.contains(&operation), "{operation:?} is not in the table");
        }
    }
}

/// The template that a path of the table was made from.
fn template_of(path: &str) -> String {
    let mut parts: Vec<&str> = path.split('/').collect();
    let names = [(4, "{site}"), (6, "{level}")];
    for (index, name) in names {
        if parts.len() > index {
            parts[index] = name;
        }
    }
    match parts.get(5..) {
        Some(["robots", robot, ..]) if robot.starts_with('{') => parts[6] = "{robot}",
        Some([_, _, "contributions" | "reverts" | "changes", _]) => parts[8] = "{id}",
        Some([_, _, "alignments", _]) => parts[8] = "{frame}",
        Some([_, _, "tiles", ..]) => {
            parts.splice(8.., ["{z}", "{row}", "{col}.png"]).for_each(drop);
        }
        Some([_, _, "raster", batch]) if batch.starts_with("batch?") => parts[8] = "batch",
        Some([_, _, "raster", _, _]) => parts.splice(8.., ["{x}", "{y}"]).for_each(drop),
        Some([_, _, "exports", _]) => parts[8] = "{format}",
        _ => {}
    }
    parts.join("/")
}

/// A token that only the command line makes.
pub(crate) async fn token(
    server: &Server,
    site: Option<&str>,
    robot: Option<&str>,
    scopes: &[Scope],
) -> String {
    let store = store(server).await;
    let grant = Grant {
        site: site.map(ToOwned::to_owned),
        robot: robot.map(ToOwned::to_owned),
        scopes: scopes.to_vec(),
        expires_at_us: None,
    };
    let token = auth::issue(&store, &Chance::from_system().unwrap(), &grant, 0).await.unwrap();
    store.close().await;
    token.reveal().to_owned()
}

async fn store(server: &Server) -> Store {
    Store::connect(&sqlite_url(&server.folder.path().join("data/mapfold.db"))).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_bound_to_a_site_learns_of_no_other() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    Level::create_at(&server.admin(), "secret", "vault").await;
    let robot = server.with(&floor.token("r1").await);
    let sites: Vec<Value> = robot.get(route::SITES).await.expect(200).data();
    assert_eq!(sites.len(), 1);
    // What is there and what never was sound the same.
    let there = robot.get(&route::level("secret", "vault")).await.problem(404);
    let never = robot.get(&route::level("never", "vault")).await.problem(404);
    assert_eq!((there.code.as_str(), never.code.as_str()), ("site_not_found", "site_not_found"));
    assert_eq!(there.detail.replace("secret", "never"), never.detail);
    // An administrator of one site is none of another, and makes none.
    let local = token(&server, Some("plant"), None, &[Scope::Admin]).await;
    let local = server.with(&local);
    local.post(route::SITES, &NewSite { site: "mine".to_owned(), name: None }).await.problem(404);
    let robot = NewRobot { robot: "spy".to_owned(), name: None, sensors: vec![scanner()] };
    local.post(&route::of_site(route::ROBOTS, "secret"), &robot).await.problem(404);
    local.post(&route::of_site(route::ROBOTS, "plant"), &robot).await.expect(201);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_contributes_only_as_itself_and_an_administrator_as_any_enrolled_one() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    floor.enrol("r2").await;
    let path = floor.path(route::CONTRIBUTIONS);
    let robot = server.with(&floor.token("r1").await);
    let other = floor.look("r2", 1).await;
    assert_eq!(robot.post(&path, &other).await.code(403), "other_robot");
    server.admin().post(&path, &other).await.expect(201);
    let stranger = floor.look("r3", 2).await;
    let problem = server.admin().post(&path, &stranger).await.problem(404);
    assert_eq!(problem.code, "robot_not_found");
    assert!(problem.detail.contains("Enrol"), "{}", problem.detail);
}

#[tokio::test(flavor = "multi_thread")]
async fn challenges_name_the_scheme_and_the_fault() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let challenge = |answer: &Answer| answer.header("www-authenticate").to_owned();
    let nobody = server.anybody().get(route::SITES).await;
    assert_eq!(challenge(&nobody), "Bearer realm=\"mapfold\"");
    assert_eq!(nobody.code(401), "unauthenticated");
    for bad in ["x", "mapd_000000000000_0000000000000000000000000000000000000000000", "ü"] {
        let (anybody, header) = (server.anybody(), format!("Bearer {bad}"));
        let answer = anybody.get_with(route::SITES, AUTHORIZATION, &header).await;
        if bad.is_ascii() {
            assert!(challenge(&answer).contains("invalid_token"), "{bad}");
            assert_eq!(answer.code(401), "invalid_token");
        } else {
            // Not text, so no token was named at all.
            assert_eq!(answer.code(401), "unauthenticated");
        }
    }
    let robot = server.with(&floor.token("r1").await);
    let answer = robot.post(route::SITES, &NewSite { site: "x".to_owned(), name: None }).await;
    assert!(challenge(&answer).contains("insufficient_scope"));
    assert_eq!(answer.code(403), "insufficient_scope");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_is_worth_nothing_once_it_is_revoked_or_has_ended() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let text = floor.token("r1").await;
    let robot = server.with(&text);
    robot.get(&floor.path(route::LEVEL)).await.expect(200);
    let store = store(&server).await;
    let id = Token::parse(&text).unwrap().id().to_owned();
    assert!(store.revoke_token(&id, 1).await.unwrap());
    assert_eq!(robot.get(&floor.path(route::LEVEL)).await.code(401), "invalid_token");
    // Nothing of a secret is stored, and a wrong one under a right id is refused.
    let row = store.token_by_id(&id).await.unwrap().unwrap();
    assert!(!format!("{row:?}").contains(text.rsplit_once('_').unwrap().1));
    let grant = Grant { scopes: vec![Scope::MapRead], expires_at_us: Some(5), ..Grant::default() };
    let ended = auth::issue(&store, &Chance::from_system().unwrap(), &grant, 0).await.unwrap();
    assert_eq!(server.with(ended.reveal()).get(route::SITES).await.code(401), "invalid_token");
    let mut wrong = floor.token("r1").await;
    let last = if wrong.pop() == Some('a') { 'b' } else { 'a' };
    wrong.push(last);
    assert_eq!(server.with(&wrong).get(route::SITES).await.code(401), "invalid_token");
}
