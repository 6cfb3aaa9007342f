//! A real `mapfold-robot`, playing a log.

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::Duration;

use tokio::process::{Child, Command};

use crate::{Error, programs};

/// How long a replay may take.
const PATIENCE: Duration = Duration::from_mins(15);

/// Where a robot sends to.
#[derive(Debug, Clone)]
pub struct Target {
    /// The server, or a wire to it.
    pub url: String,
    /// The robot's right to contribute; an administrator's where the level is to be made.
    pub token: String,
    /// Slug of the site.
    pub site: String,
    /// Slug of the level.
    pub level: String,
}

/// One robot and the log that it plays.
#[derive(Debug, Clone)]
pub struct Robot {
    /// Its slug.
    pub name: String,
    /// Its log.
    pub log: PathBuf,
    /// Further options of `mapfold-robot replay`.
    pub options: Vec<String>,
}

/// A replay that is under way; dropping it kills it.
#[derive(Debug)]
pub struct Replay {
    child: Child,
    output: PathBuf,
}

impl Robot {
    /// A robot that plays a log at the log's corrected poses.
    pub fn new(name: &str, log: &Path) -> Self {
        let options = ["--poses", "log"].map(str::to_owned).to_vec();
        Self { name: name.to_owned(), log: log.to_owned(), options }
    }

    /// The same robot with further options.
    #[must_use]
    pub fn with(mut self, options: &[&str]) -> Self {
        self.options.extend(options.iter().map(|option| (*option).to_owned()));
        self
    }

    /// Starts to play. What the robot keeps (its outbox) and what it says goes into `folder`.
    ///
    /// # Errors
    /// The program is not there.
    pub fn start(&self, target: &Target, folder: &Path) -> Result<Replay, Error> {
        std::fs::create_dir_all(folder).map_err(|e| Error::file(folder, e))?;
        let output = folder.join(format!("{}.out", self.name));
        let file = std::fs::File::create(&output).map_err(|e| Error::file(&output, e))?;
        let errors = file.try_clone().map_err(|e| Error::file(&output, e))?;
        let child = Command::new(programs::path("mapfold-robot")?)
            .arg("replay")
            .arg(&self.log)
            .args(["--server", &target.url, "--token", &target.token])
            .args(["--site", &target.site, "--level", &target.level])
            .args(["--robot", &self.name, "--create"])
            .arg("--outbox")
            .arg(folder.join(&self.name))
            .args(&self.options)
            .stdin(Stdio::null())
            .stdout(file)
            .stderr(errors)
            .kill_on_drop(true)
            .spawn()
            .map_err(|e| fault(&self.name, &e.to_string(), &output))?;
        Ok(Replay { child, output })
    }
}

impl Replay {
    /// Waits until all of the log is acknowledged.
    ///
    /// # Errors
    /// The robot gives up, or takes too long.
    pub async fn finish(mut self) -> Result<(), Error> {
        match tokio::time::timeout(PATIENCE, self.child.wait()).await {
            Ok(Ok(status)) if status.success() => Ok(()),
            Ok(Ok(status)) => Err(fault("mapfold-robot", &status.to_string(), &self.output)),
            Ok(Err(e)) => Err(fault("mapfold-robot", &e.to_string(), &self.output)),
            Err(_) => Err(fault("mapfold-robot", "takes too long", &self.output)),
        }
    }

    /// Whether it is still playing.
    pub fn is_under_way(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }
}

fn fault(program: &str, what: &str, output: &Path) -> Error {
    let words = programs::last_words(output);
    Error::Program {
        program: program.to_owned(),
        fault: format!("{what}; its last words:\n{words}"),
    }
}
