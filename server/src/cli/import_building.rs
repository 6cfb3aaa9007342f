//! `import` of a building of Open-RMF: into the draft of a level's GDB, or what it would change.

use std::collections::BTreeSet;
use std::process::ExitCode;

use mapfold_map::gdb::Severity;
use mapfold_schema::border::gdb::OBJECTS_MAX;
use mapfold_schema::v1::BuildingReport;

use super::args::ImportCommand;
use super::import::{AUTHOR, bytes_of, refused};
use super::{CommandError, say};
use crate::chance::Chance;
use crate::clock::{Clock as _, SystemClock};
use crate::config::Config;
use crate::exchange::building::{BUILDING_BYTES_MAX, Document};
use crate::level::gdb::{GdbError, column, read_model};
use crate::running::{StartError, open_existing_store};
use crate::store::gdb::{Expected, GdbChange, GdbOutcome, NewGdbEntry};

/// Findings that are told one by one.
pub(super) const TOLD_MAX: usize = 10;

pub(super) async fn run(
    config: &Config,
    command: &ImportCommand,
) -> Result<ExitCode, CommandError> {
    if command.trust.is_some() {
        return Err(refused("--trust is of map_server's maps only"));
    }
    let document = Document::read(&bytes_of(&command.file, BUILDING_BYTES_MAX)?);
    let document = document.map_err(|error| refused(error.to_string()))?;
    let store = open_existing_store(config).await?;
    let (site, name) = (&command.site, &command.level);
    let level = store.level(site, name).await?;
    let level = level.ok_or_else(|| refused(format!("there is no level {site:?}/{name:?}")))?;
    let state = store.gdb_state(site, name).await?;
    let draft = read_model(&store, site, name, state.draft).await.map_err(unreadable)?;
    let prototypes: BTreeSet<&str> = draft.library().keys().map(String::as_str).collect();
    let imported = document.import(command.building_level.as_deref(), level.frame, &prototypes);
    let imported = imported.map_err(|error| refused(error.to_string()))?;
    tell(&imported.report)?;
    let encode = |object| column(object).map_err(|error| refused(error.to_string()));
    let put = imported.objects.iter().map(|(id, object)| Ok((*id, encode(object)?)));
    let put = put.collect::<Result<_, CommandError>>()?;
    let (after, change) = if command.replace {
        (imported.objects, GdbChange::Replace(put))
    } else {
        let mut after = draft.objects().clone();
        after.extend(imported.objects);
        (after, GdbChange::Edit { put, removed: BTreeSet::new() })
    };
    let model = draft.with_objects(after).map_err(unreadable)?;
    let findings = model.findings();
    let errors = findings.iter().filter(|f| f.kind.severity() == Severity::Error).count();
    say(&format!("{} findings, {errors} of them errors", findings.len()))?;
    for finding in findings.iter().take(TOLD_MAX) {
        say(&format!("  {}", finding.kind))?;
    }
    if !command.preview {
        let BuildingReport { building, building_level, .. } = &imported.report;
        let new = NewGdbEntry {
            id: Chance::from_system().map_err(StartError::from)?.uuid(),
            author: AUTHOR.to_owned(),
            at_us: SystemClock::start().now_us(),
            comment: format!("{building_level} of {building}").chars().take(120).collect(),
            expected: Expected::OneOf(vec![state.draft]),
        };
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

pub(super) fn unreadable(error: GdbError) -> CommandError {
    match error {
        GdbError::Store(error) => error.into(),
        other => refused(other.to_string()),
    }
}

fn tell(report: &BuildingReport) -> Result<(), CommandError> {
    say(&format!(
        "{} of {}: {} walls, {} doorways, {} floors, {} instances; {:.5} m a unit",
        report.building_level,
        report.building,
        report.walls,
        report.doorways,
        report.floors,
        report.instances,
        report.scale_m
    ))?;
    report.warnings.iter().try_for_each(|warning| say(&format!("  {warning}")))
}
