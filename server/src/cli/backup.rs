//! `backup`: a copy of the embedded database.

use std::process::ExitCode;

use super::args::BackupCommand;
use super::{CommandError, say};
use crate::config::Config;
use crate::maintenance;
use crate::running::open_existing_store;

pub(super) async fn run(
    config: &Config,
    command: &BackupCommand,
) -> Result<ExitCode, CommandError> {
    let store = open_existing_store(config).await?;
    maintenance::backup(&store, &command.file).await?;
    store.close().await;
    say(&format!("{} is a copy of the database", command.file.display()))?;
    Ok(ExitCode::SUCCESS)
}
