//! `serve`: runs the server until it is told to stop.

use std::process::ExitCode;

use tokio::signal;

use super::{CommandError, say};
use crate::config::Config;
use crate::running::start;

pub(super) async fn run(config: Config) -> Result<ExitCode, CommandError> {
    let running = start(config).await?;
    say(&format!("Mapfold listens on http://{}", running.address()))?;
    if let Some(token) = running.admin_token() {
        say("This is the admin token. It is shown this once; keep it, and sign in with it:")?;
        say(token.reveal())?;
    }
    let status = tokio::select! {
        () = told_to_stop() => ExitCode::SUCCESS,
        cause = running.disk_failed() => {
            // What is on the disk is uncertain: only a restart reads back what is really there.
            tracing::error!(cause, "the disk of the database failed; stopping");
            ExitCode::FAILURE
        }
    };
    tracing::info!("stopping");
    running.shutdown().await;
    Ok(status)
}

/// Ctrl-C, or (where there is such a thing) the signal by which services are stopped.
async fn told_to_stop() {
    let interrupted = async {
        if signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    #[cfg(unix)]
    let terminated = async {
        match signal::unix::signal(signal::unix::SignalKind::terminate()) {
            Ok(mut signals) => {
                signals.recv().await;
            }
            Err(_) => std::future::pending().await,
        }
    };
    #[cfg(not(unix))]
    let terminated = std::future::pending::<()>();
    tokio::select! {
        () = interrupted => {}
        () = terminated => {}
    }
}
