//! `import` of a model of another program: into the draft of a level's GDB and the library of its site, or what it would
//! change.

use std::path::Path;
use std::process::ExitCode;

use mapfold_schema::v1::{ModelFormat, ModelReport};

use super::args::{DrawingOptions, ImportCommand};
use super::import::{self, bytes_of, refused};
use super::import_draft::{Draft, new_entry, tell_findings, unreadable, unwritten};
use super::{CommandError, say};
use crate::config::Config;
use crate::exchange::incoming::{FILE_BYTES_MAX, Incoming};
use crate::exchange::{dxf, geojson, glb, jsonfg};
use crate::level::gdb::columns;
use crate::store::gdb::{Expected, GdbVersion};
use crate::store::library::LibraryOutcome;

/// The format of a file, by the end of its name, if it is a model.
pub(super) fn format_of(path: &Path) -> Option<ModelFormat> {
    let end = path.extension()?.to_string_lossy().to_ascii_lowercase();
    match end.as_str() {
        "json" | "jsonfg" => Some(ModelFormat::Jsonfg),
        "geojson" => Some(ModelFormat::Geojson),
        "dxf" => Some(ModelFormat::Dxf),
        "glb" => Some(ModelFormat::Glb),
        _ => None,
    }
}

pub(super) async fn run(
    config: &Config,
    command: &ImportCommand,
    format: ModelFormat,
) -> Result<ExitCode, CommandError> {
    let bytes = bytes_of(&command.file, FILE_BYTES_MAX)?;
    let draft = Draft::open(config, command).await?;
    let (frame, known) = (draft.level.frame, draft.model.library());
    let read = match format {
        ModelFormat::Jsonfg => jsonfg::read(&bytes, frame, known),
        ModelFormat::Glb => glb::read(&bytes, frame, known),
        ModelFormat::Nav2 => {
            let package = import::read(&command.file)?;
            package.walls(frame, known).map(|(incoming, _)| incoming)
        }
        ModelFormat::Dxf | ModelFormat::Geojson => {
            let DrawingOptions { layers, unit_m, wall_height_m } = &command.drawing;
            let options = dxf::Options::new(layers.as_deref(), *unit_m, *wall_height_m);
            let options = options.map_err(refused)?;
            if format == ModelFormat::Dxf {
                dxf::read(&bytes, frame, known, &options)
            } else {
                let dxf::Options { unit_m, wall_height_m, .. } = options;
                geojson::read(&bytes, frame, known, &geojson::Options { unit_m, wall_height_m })
            }
        }
    };
    let Incoming { objects, prototypes, report } = read.map_err(|e| refused(e.to_string()))?;
    tell(&report)?;
    let (after, change) =
        draft.model.taking(objects, command.replace).map_err(|error| unwritten(&error))?;
    let grows = !prototypes.is_empty();
    let mut library = known.clone();
    library.extend(prototypes);
    let columns = columns(&library).map_err(|error| unwritten(&error))?;
    tell_findings(&draft.model.with_library(after, library).map_err(unreadable)?)?;
    if !command.preview {
        let comment = format!("a model as {format:?}").to_lowercase();
        let mut new = new_entry(comment, Expected::Any)?;
        let mut version = draft.state.draft;
        if grows {
            let seen = [version.library];
            let put = draft.store.put_library(&command.site, &new, Some(&seen), &columns);
            match put.await? {
                LibraryOutcome::Is(library) => version = GdbVersion { library, ..version },
                LibraryOutcome::Stale { .. } => {
                    return Err(refused("somebody edits the library now; try again"));
                }
            }
        }
        new.expected = Expected::OneOf(vec![version]);
        draft.edit(command, &new, &change).await?;
    }
    draft.store.close().await;
    Ok(ExitCode::SUCCESS)
}

fn tell(report: &ModelReport) -> Result<(), CommandError> {
    let kind = |k: &mapfold_schema::v1::KindCount| format!("{} {:?}", k.count, k.kind);
    let kinds: Vec<String> = report.kinds.iter().map(|k| kind(k).to_lowercase()).collect();
    say(&format!(
        "{}; {} of them instances, {} new prototypes; {} m a unit",
        if kinds.is_empty() { "nothing".to_owned() } else { kinds.join(", ") },
        report.instances,
        report.prototypes.len(),
        report.scale_m
    ))?;
    for left in &report.left_out {
        say(&format!("  left out: {} {}: {}", left.count, left.what, left.why))?;
    }
    report.warnings.iter().try_for_each(|warning| say(&format!("  {warning}")))
}
