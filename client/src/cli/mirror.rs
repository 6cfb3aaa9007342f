//! `mapfold-robot mirror`.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use mapfold_client::sync::{Mirror, MirrorConfig, MirrorError, Refreshed};
use rand::rngs::StdRng;
use tokio::sync::watch;

use super::{Where, say};

/// What the map is written as beside the mirror's own file.
const GEOJSON: &str = "map.geojson";

#[derive(Debug, Args)]
pub(super) struct MirrorLevel {
    #[command(flatten)]
    place: Where,
    /// The folder for the mirror and for map.geojson.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Bring it up to date once and stop.
    #[arg(long, conflicts_with = "follow")]
    once: bool,
    /// Follow the level until interrupted, through outages too (the default).
    #[arg(long)]
    follow: bool,
    /// Seconds between two looks at the server.
    #[arg(long, value_name = "S", default_value_t = 2.0, value_parser = interval)]
    interval: f64,
}

impl MirrorLevel {
    pub(super) async fn run(self, mut rng: StdRng) -> Result<ExitCode, Box<dyn std::error::Error>> {
        let api = self.place.api()?;
        let mut mirror = Mirror::open(&self.out, &self.place.level(), MirrorConfig::STANDARD)?;
        if self.once {
            let refreshed = mirror.refresh(&api).await?;
            write_map(&mirror, &self.out)?;
            say(&in_words(&refreshed));
            return Ok(ExitCode::SUCCESS);
        }
        let (stopped, stop) = watch::channel(false);
        let mut failed = None;
        let tell = |mirror: &Mirror, outcome: Result<Refreshed, &MirrorError>| match outcome {
            Ok(refreshed) => {
                if refreshed.changes > 0 || refreshed.resync.is_some() {
                    say(&in_words(&refreshed));
                    if let Err(error) = write_map(mirror, &self.out) {
                        // Following a map that cannot be written is of no use to anybody.
                        failed = Some(error);
                        stopped.send_replace(true);
                    }
                }
            }
            Err(error) => say(&format!("{error}; trying again")),
        };
        let interval = Duration::from_secs_f64(self.interval);
        mirror.follow(&api, interval, stop, &mut rng, tell).await?;
        match failed {
            Some(error) => Err(error.into()),
            None => Ok(ExitCode::SUCCESS),
        }
    }
}

/// Writes the map beside its old self and puts it in its place whole.
fn write_map(mirror: &Mirror, folder: &Path) -> Result<(), std::io::Error> {
    let (half, whole) = (folder.join(format!("{GEOJSON}.half")), folder.join(GEOJSON));
    let mut file = std::io::BufWriter::new(std::fs::File::create(&half)?);
    mirror.write_geojson(&mut file)?;
    file.flush()?;
    std::fs::rename(half, whole)
}

fn in_words(refreshed: &Refreshed) -> String {
    let Refreshed { from_revision, to_revision, changes, resync } = refreshed;
    let anew = resync.map(|reason| format!(" (read anew: {reason:?})")).unwrap_or_default();
    format!("revision {from_revision} to {to_revision}: {changes} changes{anew}")
}

fn interval(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.05..=86_400.0).contains(&seconds) => Ok(seconds),
        Ok(_) => Err("it must lie between 0.05 and 86400".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}
