//! What all imports into the draft of a level's GDB do: read the draft, tell what would be wrong with it, and edit it.

use mapfold_map::gdb::Severity;
use mapfold_schema::border::gdb::OBJECTS_MAX;

use super::args::ImportCommand;
use super::import::{AUTHOR, refused};
use super::{CommandError, say};
use crate::chance::Chance;
use crate::clock::{Clock as _, SystemClock};
use crate::config::Config;
use crate::level::gdb::{GdbError, GdbModel, read_model};
use crate::running::{StartError, open_existing_store};
use crate::store::Store;
use crate::store::gdb::{Expected, GdbChange, GdbOutcome, GdbState, NewGdbEntry};
use crate::store::levels::LevelRow;

/// Findings that are told one by one.
const TOLD_MAX: usize = 10;

/// The draft that an import goes into.
pub(super) struct Draft {
    pub(super) store: Store,
    pub(super) level: LevelRow,
    pub(super) state: GdbState,
    pub(super) model: GdbModel,
}

impl Draft {
    /// The draft of the level that the command names.
    pub(super) async fn open(
        config: &Config,
        command: &ImportCommand,
    ) -> Result<Self, CommandError> {
        let store = open_existing_store(config).await?;
        let (site, name) = (&command.site, &command.level);
        let level = store.level(site, name).await?;
        let level = level.ok_or_else(|| refused(format!("there is no level {site:?}/{name:?}")))?;
        let state = store.gdb_state(site, name).await?;
        let model = read_model(&store, site, name, state.draft).await.map_err(unreadable)?;
        Ok(Self { store, level, state, model })
    }

    /// Makes the edit, as one entry of the log, and tells what became of it.
    pub(super) async fn edit(
        &self,
        command: &ImportCommand,
        new: &NewGdbEntry,
        change: &GdbChange,
    ) -> Result<(), CommandError> {
        let (site, name) = (&command.site, &command.level);
        let outcome = self.store.edit_gdb(site, name, new, change, OBJECTS_MAX as i64).await?;
        say(&match outcome {
            GdbOutcome::Done(entry) => {
                format!("{site}/{name} has it in its draft since revision {}", entry.revision)
            }
            GdbOutcome::Same(_) => format!("{site}/{name} had all of it already"),
            GdbOutcome::Stale(_) => return Err(refused("somebody edits the model now; try again")),
            GdbOutcome::TooMany { objects } => {
                return Err(refused(format!("{objects} objects; {OBJECTS_MAX} are the most")));
            }
        })
    }
}

/// An entry that the command line makes.
pub(super) fn new_entry(comment: String, expected: Expected) -> Result<NewGdbEntry, CommandError> {
    Ok(NewGdbEntry {
        id: Chance::from_system().map_err(StartError::from)?.uuid(),
        author: AUTHOR.to_owned(),
        at_us: SystemClock::start().now_us(),
        comment,
        expected,
    })
}

/// Tells what is wrong with a model.
pub(super) fn tell_findings(model: &GdbModel) -> Result<(), CommandError> {
    let findings = model.findings();
    let errors = findings.iter().filter(|f| f.kind.severity() == Severity::Error).count();
    say(&format!("{} findings, {errors} of them errors", findings.len()))?;
    findings.iter().take(TOLD_MAX).try_for_each(|finding| say(&format!("  {}", finding.kind)))
}

pub(super) fn unreadable(error: GdbError) -> CommandError {
    match error {
        GdbError::Store(error) => error.into(),
        other => refused(other.to_string()),
    }
}

pub(super) fn unwritten(error: &mapfold_schema::codec::EncodeError) -> CommandError {
    refused(error.to_string())
}
