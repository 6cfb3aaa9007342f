//! `verify`: is what is stored what the log makes?

use std::process::ExitCode;

use super::args::VerifyCommand;
use super::{CommandError, say};
use crate::config::Config;
use crate::maintenance::{self, Report};
use crate::running::open_existing_store;
use crate::store::Store;

pub(super) async fn run(
    config: &Config,
    command: &VerifyCommand,
) -> Result<ExitCode, CommandError> {
    let store = open_existing_store(config).await?;
    let mut sound = true;
    for (site, level) in asked_for(&store, command).await? {
        match maintenance::verify(&store, &site, &level).await? {
            Some(report) => {
                tell(&report)?;
                sound &= report.is_sound();
            }
            None => {
                return Err(CommandError::Refused(format!("there is no level {site:?}/{level:?}")));
            }
        }
    }
    store.close().await;
    Ok(if sound { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

async fn asked_for(
    store: &Store,
    command: &VerifyCommand,
) -> Result<Vec<(String, String)>, CommandError> {
    if let (Some(site), Some(level)) = (&command.site, &command.level) {
        return Ok(vec![(site.clone(), level.clone())]);
    }
    let mut found = Vec::new();
    for site in store.sites().await? {
        if command.site.as_ref().is_none_or(|only| *only == site.site) {
            found.extend(site.levels.iter().map(|level| (site.site.clone(), level.clone())));
        }
    }
    match &command.site {
        Some(site) if found.is_empty() => {
            Err(CommandError::Refused(format!("there is no site {site:?} with a level")))
        }
        _ => Ok(found),
    }
}

fn tell(report: &Report) -> Result<(), CommandError> {
    let verdict = if report.is_sound() { "sound" } else { "NOT SOUND" };
    say(&format!(
        "{}/{}: {verdict}; revision {}, folded up to {}; {} contributions, {}{}{}{} segments, {} clusters, \
         {} chains, {} tiles; map {}",
        report.site,
        report.level,
        report.revision,
        report.folded_revision,
        report.contributions,
        if report.acts == 0 {
            String::new()
        } else {
            format!("{} of them reverted, {} acts, ", report.reverted, report.acts)
        },
        if report.imports == 0 { String::new() } else { format!("{} imports, ", report.imports) },
        if report.gdb_entries == 0 {
            String::new()
        } else {
            format!("{} entries about the GDB, ", report.gdb_entries)
        },
        report.segments,
        report.clusters,
        report.chains,
        report.tiles,
        report.map_digest,
    ))?;
    report.faults.iter().try_for_each(|fault| say(&format!("  {fault}")))
}
