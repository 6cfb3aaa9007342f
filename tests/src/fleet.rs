//! A fleet: one log cut into parts, each played by a robot of its own, all at the same time.

use std::path::Path;
use std::time::Duration;

use crate::Error;
use crate::carmen::Log;
use crate::meter::Meter;
use crate::robot::{Robot, Target};
use crate::server::Server;

/// What a fleet's run took.
#[derive(Debug, Clone, Copy)]
pub struct Run {
    /// From the first start to the last acknowledgement.
    pub wall: Duration,
    /// Bytes from the robots to the server, headers and all.
    pub bytes_up: u64,
    /// Bytes from the server to the robots, headers and all.
    pub bytes_down: u64,
}

/// The names of a fleet's robots, in the order of their parts of the log.
pub const NAMES: [&str; 3] = ["anna", "bruno", "clara"];

/// Cuts a log into as many parts as there are names, with equal numbers of scans, into `folder`.
///
/// # Errors
/// A file that cannot be written.
pub fn cut(log: &Log, folder: &Path) -> Result<Vec<Robot>, Error> {
    let borders = log.borders(NAMES.len());
    let part = |(index, name): (usize, &&str)| {
        let path = folder.join(format!("{name}.log.gz"));
        log.write_part(borders[index], borders[index + 1], &path)?;
        Ok(Robot::new(name, &path))
    };
    NAMES.iter().enumerate().map(part).collect()
}

/// Plays all robots' logs at the same time into one level, over a metered wire.
///
/// # Errors
/// A robot gives up.
pub async fn play(
    server: &Server,
    site: &str,
    level: &str,
    robots: &[Robot],
    folder: &Path,
) -> Result<Run, Error> {
    let meter = Meter::to(server.address()).await?;
    let target = Target {
        url: meter.url(),
        token: server.admin_token().to_owned(),
        site: site.to_owned(),
        level: level.to_owned(),
    };
    let begin = tokio::time::Instant::now();
    let replays =
        robots.iter().map(|robot| robot.start(&target, folder)).collect::<Result<Vec<_>, _>>()?;
    for replay in replays {
        replay.finish().await?;
    }
    Ok(Run { wall: begin.elapsed(), bytes_up: meter.up(), bytes_down: meter.down() })
}
