//! A server's start, its stop, and the program around it.

use std::net::SocketAddr;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use mapfold_schema::route;
use mapfold_schema::v1::SiteDescription;
use mapfold_server::auth::Token;
use mapfold_server::config::Config;
use serde_json::Value;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader, Lines};
use tokio::process::ChildStdout;

use crate::client::Client;
use crate::server::{ADMIN, Server};
use crate::world::Level;

const PATIENCE: Duration = Duration::from_secs(20);

fn program(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_mapfold-server"));
    command.arg("--data-dir").arg(folder.join("data")).env_remove("MAPFOLD_ADMIN_TOKEN");
    command
}

fn run(folder: &std::path::Path, args: &[&str]) -> Output {
    program(folder).args(args).output().unwrap()
}

fn printed(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_acknowledged_is_there_after_a_restart() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    floor.contribute("r1", 1).await;
    let map = server.admin().get(&floor.path(route::VECTOR)).await.expect(200);
    let folder = server.shutdown().await;

    let config = Config {
        listen: "127.0.0.1:0".parse().unwrap(),
        data_dir: folder.path().join("data"),
        ..Config::default()
    };
    let again = mapfold_server::start(config).await.unwrap();
    assert!(again.admin_token().is_none(), "only the very first start makes an admin token");
    let admin = Client::new(again.address(), Some(ADMIN));
    assert_eq!(admin.get(&floor.path(route::VECTOR)).await.expect(200).body, map.body);
    again.shutdown().await;
    let verified = run(folder.path(), &["verify"]);
    assert!(verified.status.success(), "{verified:?}");
    assert!(printed(&verified).starts_with("plant/floor: sound; revision 1"));
}

/// The program, serving.
struct Serving {
    child: tokio::process::Child,
    lines: Lines<BufReader<ChildStdout>>,
    address: SocketAddr,
}

impl Serving {
    async fn start(folder: &Path) -> Self {
        let mut command = tokio::process::Command::from(program(folder));
        command.args(["--listen", "127.0.0.1:0"]).stdout(Stdio::piped()).kill_on_drop(true);
        let mut child = command.spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let greeting = lines.next_line().await.unwrap().unwrap();
        let address = greeting.rsplit_once("http://").unwrap().1.parse().unwrap();
        Self { child, lines, address }
    }

    /// Tells it to stop; answers what else it printed.
    async fn stop(mut self) -> Vec<String> {
        let id = self.child.id().unwrap().to_string();
        assert!(Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
        let status = tokio::time::timeout(PATIENCE, self.child.wait()).await;
        assert!(status.expect("it stops").unwrap().success());
        let mut rest = Vec::new();
        while let Some(line) = self.lines.next_line().await.unwrap() {
            rest.push(line);
        }
        rest
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_program_prints_its_admin_token_once_and_stops_when_told_to() {
    let folder = tempfile::tempdir().unwrap();
    let first = Serving::start(folder.path()).await;
    let address = first.address;
    let mut printed = first.stop().await;
    assert_eq!(printed.len(), 2, "{printed:?}");
    let token = printed.pop().unwrap();
    assert!(token.starts_with("mapd_"), "{token}");
    assert!(tokio::net::TcpStream::connect(address).await.is_err(), "nobody listens any more");

    let second = Serving::start(folder.path()).await;
    let admin = Client::new(second.address, Some(&token));
    assert_eq!(admin.get(route::SITES).await.expect(200).data::<Vec<SiteDescription>>(), []);
    // The program's figures are those of the whole process.
    let floor = Level::create(&admin).await;
    floor.contribute("r1", 1).await;
    let figures = admin.get("/metrics").await.expect(200);
    let figures = String::from_utf8(figures.body).unwrap();
    assert!(figures.contains("mapfold_log_append_duration_seconds_bucket"), "{figures}");
    drop((admin, floor));
    assert_eq!(second.stop().await, [""; 0], "the token is printed only once");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_in_flight_is_finished_when_the_server_stops() {
    let server = Server::start_with(|config| config.http.drain_delay_ms = 500).await;
    let (address, body) = (server.address(), br#"{"site":"late"}"#);
    let mut socket = tokio::net::TcpStream::connect(address).await.unwrap();
    let head = format!(
        "POST /api/v1/sites HTTP/1.1\r\nhost: x\r\nauthorization: Bearer {ADMIN}\r\n\
         content-type: application/json\r\ncontent-length: {}\r\n\r\n",
        body.len()
    );
    socket.write_all(head.as_bytes()).await.unwrap();
    let (anybody, stopping) = (server.anybody(), tokio::spawn(server.shutdown()));
    // While a balancer is given time to notice, the server answers, and says that it is stopping.
    tokio::time::sleep(Duration::from_millis(150)).await;
    let problem = anybody.get("/readyz").await.problem(503);
    assert_eq!((problem.code.as_str(), problem.retryable), ("closing", true));
    tokio::time::sleep(Duration::from_millis(700)).await;
    assert!(tokio::net::TcpStream::connect(address).await.is_err(), "nobody listens any more");

    socket.write_all(body).await.unwrap();
    let mut answer = String::new();
    socket.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 201"), "{answer}");
    stopping.await.unwrap();
}

#[test]
fn tokens_are_made_listed_and_revoked_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let made = run(folder.path(), &["token", "create", "--scope", "map:read", "--days", "7"]);
    let token = Token::parse(printed(&made).trim()).unwrap();
    let list = || -> Vec<Value> {
        let listed = printed(&run(folder.path(), &["token", "list"]));
        listed.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    let listed = list();
    assert_eq!(listed.len(), 1);
    assert_eq!(listed[0]["id"], token.id());
    assert_eq!(listed[0]["scopes"], serde_json::json!(["map:read"]));
    assert!(listed[0]["expires_at"].is_string() && listed[0]["revoked_at"].is_null());
    assert!(!listed[0].to_string().contains(token.reveal().rsplit_once('_').unwrap().1));
    assert!(run(folder.path(), &["token", "revoke", token.id()]).status.success());
    assert!(list()[0]["revoked_at"].is_string());
    assert_eq!(run(folder.path(), &["token", "revoke", "nobody"]).status.code(), Some(1));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_is_a_database_that_verifies() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    floor.contribute("r1", 1).await;
    let folder = server.folder.path();
    std::fs::create_dir(folder.join("copy")).unwrap();
    let copy = folder.join("copy/mapfold.db").display().to_string();
    // While the server runs.
    let backup = run(folder, &["backup", &copy]);
    assert!(backup.status.success(), "{backup:?}");
    assert_eq!(run(folder, &["backup", &copy]).status.code(), Some(1), "it exists already");
    let copied = folder.join("copy").display().to_string();
    let verified = run(folder, &["verify", "--data-dir", &copied]);
    assert!(verified.status.success(), "{verified:?}");
    assert!(printed(&verified).contains("; 1 contributions, "));
    let elsewhere = run(folder, &["verify", "--site", "a", "--level", "b"]);
    assert!(!elsewhere.status.success(), "{elsewhere:?}");
    assert!(String::from_utf8_lossy(&elsewhere.stderr).contains("no level"), "{elsewhere:?}");
    server.shutdown().await;
}

#[test]
fn a_program_that_is_called_wrongly_says_so() {
    let folder = tempfile::tempdir().unwrap();
    for (args, status, words) in [
        (vec!["serve", "--listen", "0.0.0.0:0"], 1, "--insecure-http"),
        (vec!["--database", "mysql://x"], 1, "sqlite://"),
        (vec!["--config", "/nowhere.toml"], 1, "/nowhere.toml"),
        (vec!["--log", "a=b=c"], 1, "log"),
        (vec!["import", "x"], 2, "import"),
        (vec!["export", "stl"], 2, "stl"),
        (vec!["export", "geojson", "--site", "a", "--level", "b", "--out", "x"], 1, "no database"),
        (vec!["verify", "--site", "a", "--level", "b"], 1, "no database"),
        (vec!["backup", "x"], 1, "no database"),
        (vec!["token", "create", "--scope", "map:read", "--site", "a"], 1, "no site"),
        (vec!["token", "create", "--scope", "map:read", "--robot", "a"], 2, "--site"),
    ] {
        let output = run(folder.path(), &args);
        assert_eq!(output.status.code(), Some(status), "{args:?}: {output:?}");
        let complaint = String::from_utf8(output.stderr).unwrap();
        assert!(complaint.contains(words), "{args:?}: {complaint}");
    }
    let weak = program(folder.path()).env("MAPFOLD_ADMIN_TOKEN", "short").output().unwrap();
    assert_eq!(weak.status.code(), Some(1));
    assert!(String::from_utf8(weak.stderr).unwrap().contains("16 to 256"));
}
