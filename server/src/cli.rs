//! The commands of `mapfold-server`. Each file has one; what they print goes to standard output,
//! what the server logs to standard error.

mod args;
mod backup;
mod export;
mod export_model;
mod import;
mod import_building;
mod import_draft;
mod import_model;
mod serve;
mod token;
mod verify;

use std::ffi::OsString;
use std::io::Write as _;
use std::process::ExitCode;

use clap::Parser as _;

use crate::config::{Config, ConfigError};
use crate::level::LevelError;
use crate::running::StartError;
use crate::store::StoreError;
use args::{Arguments, Command};

/// Why a command failed.
#[derive(Debug, thiserror::Error)]
enum CommandError {
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Start(#[from] StartError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Level(#[from] LevelError),
    #[error("{what}: {cause}")]
    File { what: String, cause: std::io::Error },
    #[error("{0}")]
    Refused(String),
}

/// Runs the program and answers its exit status: 0 if all went well, 1 if it did not, 2 if it was
/// called wrongly.
pub async fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let arguments = match Arguments::try_parse_from(args) {
        Ok(arguments) => arguments,
        Err(error) => {
            let status = if error.use_stderr() { 2 } else { 0 };
            // Help that cannot be printed has nowhere to be complained about.
            let _: std::io::Result<()> = error.print();
            return ExitCode::from(status);
        }
    };
    match dispatch(arguments).await {
        Ok(status) => status,
        Err(error) => {
            let _: std::io::Result<()> =
                writeln!(std::io::stderr().lock(), "mapfold-server: {error}");
            ExitCode::FAILURE
        }
    }
}

async fn dispatch(arguments: Arguments) -> Result<ExitCode, CommandError> {
    let Arguments { config, settings, command } = arguments;
    let config = Config::load(config.as_deref(), &settings)?;
    start_log(&config)?;
    match command.unwrap_or(Command::Serve) {
        Command::Serve => serve::run(config).await,
        Command::Token(command) => token::run(&config, command).await,
        Command::Export(command) => export::run(&config, &command).await,
        Command::Import(command) => import::run(&config, &command).await,
        Command::Verify(command) => verify::run(&config, &command).await,
        Command::Backup(command) => backup::run(&config, &command).await,
    }
}

fn start_log(config: &Config) -> Result<(), CommandError> {
    let filter = tracing_subscriber::EnvFilter::try_new(&config.log)
        .map_err(|error| CommandError::Refused(format!("log = {:?}: {error}", config.log)))?;
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(false)
        .finish();
    // Fails only where somebody else logs already, who then gets our lines too.
    let _: Result<(), _> = tracing::subscriber::set_global_default(subscriber);
    Ok(())
}

/// Prints a line for people or scripts.
fn say(line: &str) -> Result<(), CommandError> {
    let mut out = std::io::stdout().lock();
    let written = writeln!(out, "{line}").and_then(|()| out.flush());
    written.map_err(|cause| CommandError::File { what: "cannot print".to_owned(), cause })
}
