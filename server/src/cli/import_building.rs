//! `import` of a building of Open-RMF: into the draft of a level's GDB, or what it would change.

use std::collections::BTreeSet;
use std::process::ExitCode;

use mapfold_schema::v1::BuildingReport;

use super::args::ImportCommand;
use super::import::{bytes_of, refused};
use super::import_draft::{Draft, new_entry, tell_findings, unreadable, unwritten};
use super::{CommandError, say};
use crate::config::Config;
use crate::exchange::building::{BUILDING_BYTES_MAX, Document};
use crate::store::gdb::Expected;

pub(super) async fn run(
    config: &Config,
    command: &ImportCommand,
) -> Result<ExitCode, CommandError> {
    if command.trust.is_some() {
        return Err(refused("--trust is of map_server's maps only"));
    }
    let document = Document::read(&bytes_of(&command.file, BUILDING_BYTES_MAX)?);
    let document = document.map_err(|error| refused(error.to_string()))?;
    let draft = Draft::open(config, command).await?;
    let library = draft.model.library();
    let prototypes: BTreeSet<&str> = library.keys().map(String::as_str).collect();
    let level = command.building_level.as_deref();
    let imported = document.import(level, draft.level.frame, &prototypes);
    let imported = imported.map_err(|error| refused(error.to_string()))?;
    tell(&imported.report)?;
    let taken = draft.model.taking(imported.objects, command.replace);
    let (after, change) = taken.map_err(|error| unwritten(&error))?;
    tell_findings(&draft.model.with_objects(after).map_err(unreadable)?)?;
    if !command.preview {
        let BuildingReport { building, building_level, .. } = &imported.report;
        let comment = format!("{building_level} of {building}").chars().take(120).collect();
        let new = new_entry(comment, Expected::OneOf(vec![draft.state.draft]))?;
        draft.edit(command, &new, &change).await?;
    }
    draft.store.close().await;
    Ok(ExitCode::SUCCESS)
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
