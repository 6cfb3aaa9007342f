//! `serve`: runs the server until it is told to stop.

use std::process::ExitCode;

use super::{CommandError, say};
use crate::config::Config;
use crate::running::start;

pub(super) async fn run(config: Config) -> Result<ExitCode, CommandError> {
    // Listened to from the beginning: whoever reads the address below may stop the server at once.
    let told_to_stop = stop_signals()?;
    let running = start(config).await?;
    running.record_process();
    say(&format!("Mapfold listens on http://{}", running.address()))?;
    if let Some(token) = running.admin_token() {
        say("This is the admin token. It is shown this once; keep it, and sign in with it:")?;
        say(token.reveal())?;
    }
    let status = tokio::select! {
        () = told_to_stop => ExitCode::SUCCESS,
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

/// Ctrl-C, and the signal by which services are stopped.
#[cfg(unix)]
fn stop_signals() -> Result<impl Future<Output = ()>, CommandError> {
    use tokio::signal::unix::{SignalKind, signal};
    let failed = |cause| {
        let what = "cannot listen to signals".to_owned();
        CommandError::File { what, cause }
    };
    let mut interrupt = signal(SignalKind::interrupt()).map_err(failed)?;
    let mut terminate = signal(SignalKind::terminate()).map_err(failed)?;
    Ok(async move {
        tokio::select! {
            _ = interrupt.recv() => {}
            _ = terminate.recv() => {}
        }
    })
}

/// Ctrl-C, where there are no such signals.
#[cfg(not(unix))]
fn stop_signals() -> Result<impl Future<Output = ()>, CommandError> {
    Ok(async {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    })
}
