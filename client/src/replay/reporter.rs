//! Tells the server what a robot knows of its place while it plays, so that people can watch it: also when it does not
//! know, and contributes nothing.

use std::time::Duration;

use mapfold_schema::v1;
use tokio::sync::watch;
use tokio::time::sleep;

use crate::sync::{Api, LevelAddress};

/// Least time between two reports.
const REPORT_EVERY: Duration = Duration::from_millis(500);

/// Reports until `fixes` ends; the last one always. A report that does not get through is not repeated: the next one
/// says more.
pub(super) async fn report(
    api: &Api,
    level: &LevelAddress,
    robot: &str,
    revision: i64,
    mut fixes: watch::Receiver<Option<v1::RobotFix>>,
) {
    while fixes.changed().await.is_ok() {
        let Some(fix) = fixes.borrow_and_update().clone() else { continue };
        let update = v1::RobotUpdate {
            fix: Some(fix),
            revision: Some(revision),
            ..v1::RobotUpdate::default()
        };
        if let Err(error) = api.update_robot(&level.site, robot, &update).await {
            tracing::debug!(%error, "the place was not reported");
        }
        sleep(REPORT_EVERY).await;
    }
}
