//! `import` of a model of another program: into the draft of a level's GDB and the library of its site, or what it would
//! change.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::ExitCode;

use mapfold_map::gdb::Severity;
use mapfold_schema::border::gdb::OBJECTS_MAX;
use mapfold_schema::v1::{ModelFormat, ModelReport};

use super::args::{DrawingOptions, ImportCommand};
use super::import::{self, AUTHOR, bytes_of, refused};
use super::import_building::{TOLD_MAX, unreadable};
use super::{CommandError, say};
use crate::chance::Chance;
use crate::clock::{Clock as _, SystemClock};
use crate::config::Config;
use crate::exchange::incoming::{FILE_BYTES_MAX, Incoming};
use crate::exchange::{dxf, glb, jsonfg};
use crate::level::gdb::{column, read_model};
use crate::running::{StartError, open_existing_store};
use crate::store::gdb::{Expected, GdbChange, GdbOutcome, GdbVersion, NewGdbEntry};
use crate::store::library::LibraryOutcome;

/// The format of a file, by the end of its name, if it is a model.
pub(super) fn format_of(path: &Path) -> Option<ModelFormat> {
    let end = path.extension()?.to_string_lossy().to_ascii_lowercase();
    match end.as_str() {
        "json" | "jsonfg" | "geojson" => Some(ModelFormat::Jsonfg),
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
    let store = open_existing_store(config).await?;
    let (site, name) = (&command.site, &command.level);
    let level = store.level(site, name).await?;
    let level = level.ok_or_else(|| refused(format!("there is no level {site:?}/{name:?}")))?;
    let state = store.gdb_state(site, name).await?;
    let draft = read_model(&store, site, name, state.draft).await.map_err(unreadable)?;
    let read = match format {
        ModelFormat::Jsonfg => jsonfg::read(&bytes, level.frame, draft.library()),
        ModelFormat::Glb => glb::read(&bytes, level.frame, draft.library()),
        ModelFormat::Nav2 => {
            let package = import::read(&command.file)?;
            package.walls(level.frame, draft.library()).map(|(incoming, _)| incoming)
        }
        ModelFormat::Dxf => {
            let DrawingOptions { layers, unit_m, wall_height_m } = &command.drawing;
            let options = dxf::Options::new(layers.as_deref(), *unit_m, *wall_height_m);
            dxf::read(&bytes, level.frame, draft.library(), &options.map_err(refused)?)
        }
    };
    let Incoming { objects, prototypes, report } = read.map_err(|e| refused(e.to_string()))?;
    tell(&report)?;
    let encoded = |e: mapfold_schema::codec::EncodeError| refused(e.to_string());
    let put = objects.iter().map(|(id, object)| Ok((*id, column(object).map_err(encoded)?)));
    let put = put.collect::<Result<_, CommandError>>()?;
    let (after, change) = if command.replace {
        (objects, GdbChange::Replace(put))
    } else {
        let mut after = draft.objects().clone();
        after.extend(objects);
        (after, GdbChange::Edit { put, removed: BTreeSet::new() })
    };
    let mut library = draft.library().clone();
    let grows = !prototypes.is_empty();
    library.extend(prototypes);
    let columns = library.iter().map(|(n, p)| Ok((n.clone(), column(p).map_err(encoded)?)));
    let columns = columns.collect::<Result<BTreeMap<_, _>, CommandError>>()?;
    let model = draft.with_library(after, library).map_err(unreadable)?;
    let findings = model.findings();
    let errors = findings.iter().filter(|f| f.kind.severity() == Severity::Error).count();
    say(&format!("{} findings, {errors} of them errors", findings.len()))?;
    for finding in findings.iter().take(TOLD_MAX) {
        say(&format!("  {}", finding.kind))?;
    }
    if !command.preview {
        let mut new = NewGdbEntry {
            id: Chance::from_system().map_err(StartError::from)?.uuid(),
            author: AUTHOR.to_owned(),
            at_us: SystemClock::start().now_us(),
            comment: format!("a model as {format:?}").to_lowercase(),
            expected: Expected::Any,
        };
        let mut version = state.draft;
        if grows {
            match store.put_library(site, &new, Some(&[version.library]), &columns).await? {
                LibraryOutcome::Is(library) => version = GdbVersion { library, ..version },
                LibraryOutcome::Stale { .. } => {
                    return Err(refused("somebody edits the library now; try again"));
                }
            }
        }
        new.expected = Expected::OneOf(vec![version]);
        let outcome = store.edit_gdb(site, name, &new, &change, OBJECTS_MAX as i64).await?;
        say(&match outcome {
            GdbOutcome::Done(entry) => {
                format!("{site}/{name} has it in its draft since revision {}", entry.revision)
            }
            GdbOutcome::Same(_) => format!("{site}/{name} had all of it already"),
            GdbOutcome::Stale(_) => return Err(refused("somebody edits the model now; try again")),
            GdbOutcome::TooMany { objects } => {
                return Err(refused(format!("{objects} objects; {OBJECTS_MAX} are the most")));
            }
        })?;
    }
    store.close().await;
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
