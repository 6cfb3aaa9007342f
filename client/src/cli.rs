//! The command line: words into options, outcomes into words and an exit status.
//!
//! 0: all was done, for a replay also acknowledged. 1: it was not, or the log is cut short (what it
//! still holds is done). 2: the command makes no sense.
//! 130: interrupted; what waits in the outbox goes on waiting.

mod calibrate;
mod extract;
mod locate;
mod mirror;
mod progress;
mod replay;

use std::fmt::Display;
use std::io::Write as _;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use rand::rngs::StdRng;

/// Exit status of a command that was interrupted (128 + SIGINT).
const INTERRUPTED: u8 = 130;

/// The robot's side of Mapfold: play logs, look at features, mirror maps, calibrate
/// scanners.
#[derive(Debug, Parser)]
#[command(name = "mapfold-robot", version, propagate_version = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Play a robot's log against a server, as the robot would have lived it.
    Replay(Box<replay::Replay>),
    /// Extract walls and clusters from a log's scans into a GeoJSON file; needs no server.
    Extract(extract::Extract),
    /// Find where each scan of a log was taken on a level, one line of JSON each.
    Locate(locate::Locate),
    /// Keep a local copy of a level up to date.
    Mirror(mirror::MirrorLevel),
    /// Make a scanner's profile, with a table that corrects its ranges, from readings of a flat
    /// target; needs no server.
    Calibrate(calibrate::Calibrate),
}

/// Runs a command.
pub(crate) async fn run(arguments: Arguments, rng: StdRng) -> ExitCode {
    let outcome = tokio::select! {
        outcome = dispatch(arguments.command, rng) => outcome,
        _ = tokio::signal::ctrl_c() => {
            say("interrupted; the same command goes on from here");
            return ExitCode::from(INTERRUPTED);
        }
    };
    match outcome {
        Ok(code) => code,
        Err(error) => failed(&*error),
    }
}

async fn dispatch(command: Command, rng: StdRng) -> Result<ExitCode, Box<dyn std::error::Error>> {
    match command {
        Command::Replay(replay) => Box::pin(replay.run(rng)).await,
        Command::Extract(extract) => extract.run(),
        Command::Locate(locate) => locate.run().await,
        Command::Mirror(mirror) => mirror.run(rng).await,
        Command::Calibrate(calibrate) => calibrate.run(),
    }
}

/// Says why a command failed.
pub(crate) fn failed(error: &(impl Display + ?Sized)) -> ExitCode {
    say(&format!("mapfold-robot: {error}"));
    ExitCode::FAILURE
}

/// A line for the person at the terminal.
fn say(line: &str) {
    // Nobody is left to tell if this fails.
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// Which level on which server.
#[derive(Debug, clap::Args)]
struct Where {
    /// Address of the server.
    #[arg(
        long,
        value_name = "URL",
        env = "MAPFOLD_SERVER",
        default_value = "http://127.0.0.1:7171"
    )]
    server: String,
    /// Token of the robot, or of an administrator.
    #[arg(long, value_name = "TOKEN", env = "MAPFOLD_TOKEN", hide_env_values = true)]
    token: String,
    /// Slug of the site.
    #[arg(long, value_name = "SLUG")]
    site: String,
    /// Slug of the level.
    #[arg(long, value_name = "SLUG")]
    level: String,
}

impl Where {
    fn api(&self) -> Result<mapfold_client::sync::Api, mapfold_client::sync::ApiError> {
        use mapfold_client::sync::{Api, ApiOptions};
        Api::new(&self.server, self.token.trim(), ApiOptions::STANDARD)
    }

    fn level(&self) -> mapfold_client::sync::LevelAddress {
        mapfold_client::sync::LevelAddress { site: self.site.clone(), level: self.level.clone() }
    }
}

/// Reads `--sensor`: the name of a preset, or a file of TOML or JSON.
fn sensors(text: &str) -> Result<mapfold_client::sensor::Sensors, String> {
    use mapfold_client::sensor::{PRESETS, Sensors, preset};
    if let Some(sensors) = preset(text) {
        return Ok(sensors);
    }
    let file = std::fs::read_to_string(text).map_err(|error| {
        format!("it is no preset ({}), and as a file: {error}", PRESETS.join(", "))
    })?;
    Sensors::parse(&file).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_command_line_makes_sense() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn a_sensor_is_a_preset_or_a_file_or_said_to_be_neither() {
        assert!(sensors("sick-lms").is_ok_and(|s| s.scanner.is_some()));
        let error = sensors("no-such-sensor").unwrap_err();
        assert!(error.contains("hokuyo-urg"), "{error}");
    }
}
