//! `import`: a map of another program as a level's prior, or what would be found in it.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use mapfold_schema::v1::{ImportReport, ModelFormat};

use super::args::ImportCommand;
use super::{CommandError, import_building, import_model, say};
use crate::chance::Chance;
use crate::clock::{Clock as _, SystemClock};
use crate::config::Config;
use crate::exchange::nav2::{
    DESCRIPTION_BYTES_MAX, Description, IMAGE_BYTES_MAX, ImportError, Package, Trust,
};
use crate::running::{StartError, open_existing_store};
use crate::store::imports::NewImport;

/// Whom the log names as the author.
pub(super) const AUTHOR: &str = "command line";

pub(super) async fn run(
    config: &Config,
    command: &ImportCommand,
) -> Result<ExitCode, CommandError> {
    if is_building(&command.file) {
        return import_building::run(config, command).await;
    }
    if command.building_level.is_some() {
        return Err(refused("--building-level is of buildings (*.building.yaml) only"));
    }
    let map = command.into_gdb.then_some(ModelFormat::Nav2);
    if let Some(format) = map.or_else(|| import_model::format_of(&command.file)) {
        if command.trust.is_some() {
            return Err(refused("--trust is of map_server's maps only"));
        }
        return import_model::run(config, command, format).await;
    }
    if command.replace {
        return Err(refused("--replace is of buildings and models only"));
    }
    let trust = command.trust.map_or(Some(Trust::STANDARD), Trust::new);
    let trust = trust.ok_or_else(|| refused("--trust is from 0 to 1"))?;
    let package = read(&command.file)?;
    let store = open_existing_store(config).await?;
    let (site, name) = (&command.site, &command.level);
    let level = store.level(site, name).await?;
    let level = level.ok_or_else(|| refused(format!("there is no level {site:?}/{name:?}")))?;
    let import = package.import(level.resolution_m, trust).map_err(|e| untaken(&e))?;
    tell(&import.report)?;
    if !command.preview {
        let column = |tile| NewImport::column(tile).map_err(|e| refused(e.to_string()));
        let tiles = import.prior.tiles.iter().map(|(at, tile)| Ok((*at, column(tile)?)));
        let new = NewImport {
            id: Chance::from_system().map_err(StartError::from)?.uuid(),
            digest: package.digest(trust),
            author: AUTHOR.to_owned(),
            at_us: SystemClock::start().now_us(),
            tiles: tiles.collect::<Result<_, CommandError>>()?,
            report: Some(import.report),
        };
        let made = store.import(site, name, &new).await?;
        let revision = made.map_or(0, |made| made.revision);
        say(&format!("{site}/{name} has it as its prior since revision {revision}"))?;
    }
    store.close().await;
    Ok(ExitCode::SUCCESS)
}

fn is_building(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase());
    let ends = [".building.yaml", ".building.yml"];
    name.is_some_and(|name| ends.iter().any(|end| name.ends_with(end)))
}

pub(super) fn refused(words: impl Into<String>) -> CommandError {
    CommandError::Refused(words.into())
}

fn untaken(error: &ImportError) -> CommandError {
    refused(error.to_string())
}

/// A zip of the two files, or the YAML with the image that it names beside it.
pub(super) fn read(path: &Path) -> Result<Package, CommandError> {
    let is_zip = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("zip"));
    if is_zip {
        return Package::unzip(&bytes_of(path, IMAGE_BYTES_MAX)?).map_err(|e| untaken(&e));
    }
    let description = bytes_of(path, DESCRIPTION_BYTES_MAX)?;
    let (Description { image, .. }, _) =
        Description::read(&description).map_err(|e| untaken(&e))?;
    // A path in it is relative to it; an absolute one takes its place.
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    let image: PathBuf = folder.join(image);
    Ok(Package { description, image: bytes_of(&image, IMAGE_BYTES_MAX)? })
}

pub(super) fn bytes_of(path: &Path, most: usize) -> Result<Vec<u8>, CommandError> {
    let what = || format!("cannot read {}", path.display());
    let length = std::fs::metadata(path).map(|metadata| metadata.len());
    let length = length.map_err(|cause| CommandError::File { what: what(), cause })?;
    if length > most as u64 {
        let path = path.display();
        return Err(refused(format!("{path} has {length} bytes; {most} are the most")));
    }
    std::fs::read(path).map_err(|cause| CommandError::File { what: what(), cause })
}

fn tell(report: &ImportReport) -> Result<(), CommandError> {
    let ImportReport { columns, rows, occupied, free, unknown, tiles, .. } = report;
    say(&format!(
        "{}: {columns} by {rows} pixels of {} m; {occupied} occupied, {free} free, {unknown} unknown; {tiles} tiles",
        report.image, report.resolution_m
    ))?;
    report.warnings.iter().try_for_each(|warning| say(&format!("  {warning}")))
}
