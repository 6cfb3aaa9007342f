//! A real `mapfold-server`, started on a free port with a folder of its own; it can be killed and
//! started again on the same port and data.

use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use tempfile::TempDir;
use tokio::process::{Child, Command};

use crate::api::Api;
use crate::database::Database;
use crate::{Error, programs};

/// How long a server may take to be ready, or to stop.
const PATIENCE: Duration = Duration::from_mins(1);

/// The admin token of every server that is started here; it is bound to loopback and short-lived.
const ADMIN_TOKEN: &str = "mft-check-0123456789abcdef0123456789abcdef";

/// A running server; dropping it kills it.
#[derive(Debug)]
pub struct Server {
    child: Child,
    folder: TempDir,
    database: Database,
    listen: String,
}

impl Server {
    /// Starts a server on a free port and waits until it is ready.
    ///
    /// # Errors
    /// The program is not there, ends early, or is not ready in time.
    pub async fn start(database: Database) -> Result<Self, Error> {
        let folder = tempfile::tempdir().map_err(|e| Error::file("a temporary folder", e))?;
        let listen = free_address()?;
        let child = spawn(&folder, &database, &listen)?;
        let mut server = Self { child, folder, database, listen };
        server.wait_until_ready().await?;
        Ok(server)
    }

    /// Where it answers.
    pub fn url(&self) -> String {
        format!("http://{}", self.listen)
    }

    /// Host and port.
    pub fn address(&self) -> &str {
        &self.listen
    }

    /// A token that may do everything.
    pub fn admin_token(&self) -> &'static str {
        ADMIN_TOKEN
    }

    /// A figure of its memory in kilobytes, as the kernel names it: `VmRSS`, or `VmHWM` for the most that it ever was.
    ///
    /// # Errors
    /// It has ended, or the kernel does not say.
    pub fn memory_kb(&self, name: &str) -> Result<u64, Error> {
        let path = PathBuf::from(format!("/proc/{}/status", self.child.id().unwrap_or_default()));
        let status = std::fs::read_to_string(&path).map_err(|e| Error::file(&path, e))?;
        let line = status.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'));
        let figure = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        figure.ok_or_else(|| self.fault(&format!("has no {name}")))
    }

    /// What it keeps its levels in.
    pub fn database(&self) -> &Database {
        &self.database
    }

    /// The folder with its data and its log.
    pub fn folder(&self) -> &std::path::Path {
        self.folder.path()
    }

    /// Its HTTP API, as an administrator.
    ///
    /// # Errors
    /// No HTTP client can be made.
    pub fn api(&self) -> Result<Api, Error> {
        Api::new(&self.url(), ADMIN_TOKEN)
    }

    /// Its latest lines of log.
    pub fn last_words(&self) -> String {
        programs::last_words(&self.log())
    }

    /// Everything that it logged.
    pub fn logged(&self) -> String {
        std::fs::read_to_string(self.log()).unwrap_or_default()
    }

    fn log(&self) -> PathBuf {
        self.folder.path().join("server.log")
    }

    /// `kill -9`: it gets no chance to write anything.
    ///
    /// # Errors
    /// It was gone already.
    pub async fn kill(&mut self) -> Result<(), Error> {
        if let Ok(Some(status)) = self.child.try_wait() {
            return Err(self.fault(&format!("had ended before it was killed: {status}")));
        }
        let killed = self.child.kill().await;
        killed.map_err(|e| self.fault(&e.to_string()))
    }

    /// Starts it again after it was killed or stopped: same port, same data.
    ///
    /// # Errors
    /// As for [`Server::start`].
    pub async fn start_again(&mut self) -> Result<(), Error> {
        self.child = spawn(&self.folder, &self.database, &self.listen)?;
        self.wait_until_ready().await
    }

    /// Asks it to stop (SIGTERM) and waits until it has.
    ///
    /// # Errors
    /// It does not stop in time.
    pub async fn stop(&mut self) -> Result<ExitStatus, Error> {
        if let Some(id) = self.child.id() {
            let sent = Command::new("kill").args(["-TERM", &id.to_string()]).status().await;
            sent.map_err(|e| self.fault(&e.to_string()))?;
        }
        match tokio::time::timeout(PATIENCE, self.child.wait()).await {
            Ok(status) => status.map_err(|e| self.fault(&e.to_string())),
            Err(_) => Err(self.fault("does not stop")),
        }
    }

    /// Runs another command of the program on the same data, and answers what it prints.
    ///
    /// # Errors
    /// It fails.
    pub async fn command(&self, arguments: &[&str]) -> Result<String, Error> {
        let output = command(&self.folder, &self.database)?.args(arguments).output().await;
        let output = output.map_err(|e| self.fault(&e.to_string()))?;
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        if !output.status.success() {
            let complaint = String::from_utf8_lossy(&output.stderr).into_owned();
            return Err(self.fault(&format!("{arguments:?} failed: {printed}{complaint}")));
        }
        Ok(printed)
    }

    /// `verify`: refolds the log from nothing, and answers the digest of the map.
    ///
    /// # Errors
    /// What is stored is not what the log makes.
    pub async fn verify(&self) -> Result<String, Error> {
        let printed = self.command(&["verify"]).await?;
        let digest = printed.trim().rsplit_once("; map ").map(|(_, digest)| digest.to_owned());
        digest.ok_or_else(|| self.fault(&format!("verify prints no digest: {printed}")))
    }

    async fn wait_until_ready(&mut self) -> Result<(), Error> {
        let api = self.api()?;
        let begin = tokio::time::Instant::now();
        while begin.elapsed() < PATIENCE {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Err(self.fault(&format!("ended early: {status}")));
            }
            if api.get("/readyz", "*/*").await.is_ok_and(|answer| answer.status == 200) {
                return Ok(());
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
        Err(self.fault("is not ready in time"))
    }

    fn fault(&self, fault: &str) -> Error {
        let fault = format!("{fault}; its last words:\n{}", self.last_words());
        Error::Program { program: "mapfold-server".to_owned(), fault }
    }
}

fn free_address() -> Result<String, Error> {
    let address = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr());
    address.map(|address| address.to_string()).map_err(|e| Error::file("127.0.0.1:0", e))
}

/// The program with its data, whatever it is to do.
fn command(folder: &TempDir, database: &Database) -> Result<Command, Error> {
    let mut command = Command::new(programs::path("mapfold-server")?);
    command.arg("--data-dir").arg(folder.path().join("data")).stdin(Stdio::null());
    if let Database::Postgres(url) = database {
        command.args(["--database", url]);
    }
    Ok(command)
}

fn spawn(folder: &TempDir, database: &Database, listen: &str) -> Result<Child, Error> {
    let log = folder.path().join("server.log");
    let file = std::fs::OpenOptions::new().create(true).append(true).open(&log);
    let file = file.map_err(|e| Error::file(&log, e))?;
    let errors = file.try_clone().map_err(|e| Error::file(&log, e))?;
    let mut command = command(folder, database)?;
    command
        .args(["serve", "--listen", listen])
        .env("MAPFOLD_ADMIN_TOKEN", ADMIN_TOKEN)
        .stdout(file)
        .stderr(errors)
        .kill_on_drop(true);
    command
        .spawn()
        .map_err(|e| Error::Program { program: "mapfold-server".to_owned(), fault: e.to_string() })
}
