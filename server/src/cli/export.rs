//! `export`: a level's map as a file of another program.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use mapfold_schema::geojson;

use super::args::{ExportCommand, ExportFormat};
use super::{CommandError, say};
use crate::clock::SystemClock;
use crate::config::Config;
use crate::exchange::nav2::Nav2Map;
use crate::level::{LevelOptions, Levels, Snapshot};
use crate::running::open_existing_store;

/// How long the rest of the log may take to be folded.
const PATIENCE: Duration = Duration::from_mins(10);

pub(super) async fn run(
    config: &Config,
    command: &ExportCommand,
) -> Result<ExitCode, CommandError> {
    let store = open_existing_store(config).await?;
    let clock = Arc::new(SystemClock::start());
    let levels = Levels::new(store.clone(), clock, LevelOptions::default());
    let opened = levels.open(&command.site, &command.level).await?;
    let (site, name) = (&command.site, &command.level);
    let level = opened
        .ok_or_else(|| CommandError::Refused(format!("there is no level {site:?}/{name:?}")))?;
    let newest = level.snapshot().revision();
    let snapshot = level.snapshot_at(newest, PATIENCE).await;
    let written = write(&snapshot, command);
    drop((level, snapshot));
    levels.shutdown().await;
    store.close().await;
    written
}

fn write(snapshot: &Snapshot, command: &ExportCommand) -> Result<ExitCode, CommandError> {
    let map = snapshot.map();
    match command.format {
        ExportFormat::Geojson => {
            to_file(&command.out, |file| geojson::write_map(&map, file))?;
        }
        ExportFormat::Nav2 => {
            let nav2 = Nav2Map::new(&map, snapshot.resolution_m())
                .map_err(|error| CommandError::Refused(error.to_string()))?;
            let image = image_beside(&command.out);
            let name = image.file_name().and_then(|name| name.to_str()).ok_or_else(|| {
                let path = command.out.display();
                CommandError::Refused(format!("{path} has no name that YAML can hold"))
            })?;
            to_file(&image, |file| nav2.write_pgm(file))?;
            to_file(&command.out, |file| file.write_all(nav2.yaml(name).as_bytes()))?;
        }
    }
    let (path, revision) = (command.out.display(), snapshot.folded_revision());
    say(&format!("{path} holds revision {revision}"))?;
    Ok(ExitCode::SUCCESS)
}

/// Where the image of a nav2 map goes whose description is `yaml`: `floor.pgm` beside `floor.yaml`.
fn image_beside(yaml: &Path) -> PathBuf {
    match yaml.extension() {
        Some(extension) if extension == "yaml" || extension == "yml" => yaml.with_extension("pgm"),
        // Any other end is part of the name; put after it, the image never takes its place.
        _ => {
            let mut image = yaml.as_os_str().to_owned();
            image.push(".pgm");
            image.into()
        }
    }
}

/// Writes a file whole: under another name first, so that nobody ever reads half of it.
fn to_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), CommandError> {
    let mut partial = path.as_os_str().to_owned();
    partial.push(".partial");
    let written = (|| {
        let mut file = BufWriter::new(File::create(&partial)?);
        write(&mut file)?;
        file.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        std::fs::rename(&partial, path)
    })();
    written.map_err(|cause| CommandError::File {
        what: format!("cannot write {}", path.display()),
        cause,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_image_bears_the_name_of_its_description_and_never_takes_its_place() {
        for (yaml, image) in [
            ("map.yaml", "map.pgm"),
            ("maps/floor.2.yml", "maps/floor.2.pgm"),
            ("floor.2", "floor.2.pgm"),
            ("map.pgm", "map.pgm.pgm"),
        ] {
            assert_eq!(image_beside(Path::new(yaml)), Path::new(image), "{yaml}");
        }
    }
}
