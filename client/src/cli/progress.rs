//! How a replay is getting on: a bar on a terminal, a line now and then elsewhere.

use std::io::IsTerminal as _;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use mapfold_client::replay::ReplayProgress;
use tokio::sync::watch;
use tokio::time::{Instant, timeout};

use super::say;

/// Time between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(5);
/// Time between two drawings of the bar.
const DRAW_EVERY: Duration = Duration::from_millis(100);

/// Tells what is wrong with the log, if anything, then shows progress until its sender is gone.
pub(super) async fn show(mut progress: watch::Receiver<ReplayProgress>, robot: String) {
    // The log has been read when its readings are counted, or when nothing more comes.
    let _ = progress.wait_for(|now| now.readings > 0).await;
    let damage = progress.borrow().damage.clone();
    for line in &damage {
        say(line);
    }
    if std::io::stderr().is_terminal() {
        bar(&mut progress, robot).await;
    } else {
        lines(&mut progress, &robot).await;
    }
}

async fn bar(progress: &mut watch::Receiver<ReplayProgress>, robot: String) {
    let bar = ProgressBar::new(0);
    let template = "{prefix} [{bar:30}] {pos}/{len} {per_sec} {msg}";
    bar.set_style(
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar.set_prefix(robot);
    let mut open = true;
    while open {
        open = !matches!(timeout(DRAW_EVERY, progress.changed()).await, Ok(Err(_)));
        let now = progress.borrow_and_update().clone();
        bar.set_length(now.readings);
        bar.set_position(done(&now));
        bar.set_message(trouble(&now).unwrap_or_default().to_owned());
    }
    bar.finish_and_clear();
}

async fn lines(progress: &mut watch::Receiver<ReplayProgress>, robot: &str) {
    let mut due = Instant::now() + LINE_EVERY;
    let mut told = ReplayProgress::default();
    loop {
        let left = due.saturating_duration_since(Instant::now());
        match timeout(left, progress.changed()).await {
            Ok(Err(_)) => return,
            Ok(Ok(())) if Instant::now() < due => continue,
            _ => {}
        }
        due = Instant::now() + LINE_EVERY;
        let now = progress.borrow_and_update().clone();
        if now != told {
            let trouble = trouble(&now).map(|t| format!("; {t}")).unwrap_or_default();
            say(&format!(
                "{robot}: {} of {} readings with the server{trouble}",
                done(&now),
                now.readings
            ));
            told = now;
        }
    }
}

/// Contributions that are off the robot's hands.
fn done(progress: &ReplayProgress) -> u64 {
    let upload = &progress.upload;
    (progress.known + upload.acknowledged + upload.refused).min(progress.readings)
}

fn trouble(progress: &ReplayProgress) -> Option<&str> {
    progress.upload.trouble.as_deref().or(progress.trouble.as_deref())
}
