//! `export`: a level's map as a file of another program.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use mapfold_map::raster::SensorClass;
use mapfold_schema::geojson;

use super::args::{
    ContentName, ExportCommand, ExportFormat, ImageName, LayerName, ModeName, Nav2Options,
};
use super::{CommandError, export_model, say};
use crate::clock::SystemClock;
use crate::config::Config;
use crate::exchange::layers::{Layer, LayerId};
use crate::exchange::nav2::{Content, ImageFormat, Mode, Nav2Error, Nav2Map, Style};
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
    let of_model = !matches!(command.of, None | Some(ContentName::Map));
    let is_model = of_model
        || matches!(command.format, ExportFormat::Jsonfg | ExportFormat::Dxf | ExportFormat::Glb);
    let written = if is_model {
        export_model::write(&store, &level, &snapshot, command).await
    } else if command.state.is_some() || command.height_m.is_some() {
        Err(CommandError::Refused("--state and --height-m are of models only".to_owned()))
    } else {
        write(&snapshot, command)
    };
    drop((level, snapshot));
    levels.shutdown().await;
    store.close().await;
    written
}

fn write(snapshot: &Snapshot, command: &ExportCommand) -> Result<ExitCode, CommandError> {
    match command.format {
        ExportFormat::Jsonfg | ExportFormat::Dxf | ExportFormat::Glb => {}
        ExportFormat::Geojson if !command.nav2.is_empty() => {
            let words = "geojson takes none of --mode, --image, --layer and --bbox";
            return Err(CommandError::Refused(words.to_owned()));
        }
        ExportFormat::Geojson => {
            to_file(&command.out, |file| geojson::write_map(&snapshot.map(), file))?;
        }
        ExportFormat::Nav2 => {
            let refused = |error: Nav2Error| CommandError::Refused(error.to_string());
            let (content, style) = (command.nav2.content(), command.nav2.style());
            let style = style.map_err(refused)?;
            let nav2 = Nav2Map::new(snapshot, snapshot.resolution_m(), content, style);
            let nav2 = nav2.map_err(refused)?;
            let image = image_beside(&command.out, nav2.format());
            let name = image.file_name().and_then(|name| name.to_str()).ok_or_else(|| {
                let path = command.out.display();
                CommandError::Refused(format!("{path} has no name that YAML can hold"))
            })?;
            let yaml = nav2.description(name).to_string();
            to_file(&image, |file| nav2.write_image(file))?;
            to_file(&command.out, |file| file.write_all(yaml.as_bytes()))?;
        }
    }
    let (path, revision) = (command.out.display(), snapshot.folded_revision());
    say(&format!("{path} holds revision {revision}"))?;
    Ok(ExitCode::SUCCESS)
}

impl Nav2Options {
    pub(super) fn is_empty(&self) -> bool {
        matches!(self, Self { mode: None, image: None, layer: None, bbox: None })
    }

    fn content(&self) -> Content {
        let layer = match self.layer.unwrap_or(LayerName::All) {
            LayerName::All => Layer::All,
            LayerName::Scanner => Layer::Only(LayerId::Sensor(SensorClass::Scanner)),
            LayerName::Sonar => Layer::Only(LayerId::Sensor(SensorClass::Sonar)),
            LayerName::Prior => Layer::Only(LayerId::Prior),
            LayerName::Walls => Layer::Only(LayerId::Walls),
        };
        Content { layer, bbox: self.bbox }
    }

    fn style(&self) -> Result<Style, Nav2Error> {
        let mode = match self.mode.unwrap_or(ModeName::Trinary) {
            ModeName::Trinary => Mode::Trinary,
            ModeName::Scale => Mode::Scale,
            ModeName::Raw => Mode::Raw,
        };
        let format = self.image.map(|image| match image {
            ImageName::Pgm => ImageFormat::Pgm,
            ImageName::Png => ImageFormat::Png,
        });
        Style::new(mode, format)
    }
}

/// Where the image of a nav2 map goes whose description is `yaml`: `floor.pgm` beside `floor.yaml`.
fn image_beside(yaml: &Path, format: ImageFormat) -> PathBuf {
    match yaml.extension() {
        Some(extension) if extension == "yaml" || extension == "yml" => {
            yaml.with_extension(format.extension())
        }
        // Any other end is part of the name; put after it, the image never takes its place.
        _ => {
            let mut image = yaml.as_os_str().to_owned();
            image.push(".");
            image.push(format.extension());
            image.into()
        }
    }
}

/// Writes a file whole: under another name first, so that nobody ever reads half of it.
pub(super) fn to_file(
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
            let beside = image_beside(Path::new(yaml), ImageFormat::Pgm);
            assert_eq!(beside, Path::new(image), "{yaml}");
        }
    }
}
