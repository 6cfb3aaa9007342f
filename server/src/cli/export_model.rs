//! `export` of a level's a-priori model: the draft or what is published, as a file of another program.

use std::process::ExitCode;

use mapfold_schema::geojson;

use super::args::{ContentName, ExportCommand, ExportFormat, StateName};
use super::export::to_file;
use super::import::refused;
use super::import_draft::unreadable;
use super::{CommandError, say};
use crate::exchange::outgoing::Outgoing;
use crate::exchange::{dxf, glb, jsonfg};
use crate::level::gdb::{GdbModel, HEIGHT_M, read_model};
use crate::level::{LevelHandle, Snapshot};
use crate::store::Store;
use crate::store::gdb::GdbVersion;

/// Writes the model of a level; `snapshot` is what robots saw there.
pub(super) async fn write(
    store: &Store,
    level: &LevelHandle,
    snapshot: &Snapshot,
    command: &ExportCommand,
) -> Result<ExitCode, CommandError> {
    if !command.nav2.is_empty() {
        return Err(refused("--mode, --image, --layer and --bbox are of nav2 only"));
    }
    let (site, name) = (&command.site, &command.level);
    let state = store.gdb_state(site, name).await?;
    let published = state.published.map(|published| published.version);
    let version = match command.state.unwrap_or(StateName::Draft) {
        StateName::Draft => state.draft,
        StateName::Published => published.unwrap_or(GdbVersion { draft: 0, library: 0 }),
    };
    let model = read_model(store, site, name, version).await.map_err(unreadable)?;
    let outgoing = outgoing(&model, level);
    match command.format {
        ExportFormat::Jsonfg => to_file(&command.out, |file| jsonfg::write(outgoing, file))?,
        ExportFormat::Glb => to_file(&command.out, |file| glb::write(outgoing, file))?,
        ExportFormat::Dxf => to_file(&command.out, |file| dxf::write(outgoing, file))?,
        ExportFormat::Geojson | ExportFormat::Nav2 => {
            let height_m = command.height_m.unwrap_or(HEIGHT_M);
            let landmarks = model.landmarks(height_m).map_err(unreadable)?;
            let map = (command.of == Some(ContentName::All)).then(|| snapshot.map());
            let write = |plan: &_| {
                to_file(&command.out, |file| {
                    geojson::write(map.as_deref(), Some((plan, &landmarks)), file)
                })
            };
            model.plan(height_m, write).map_err(unreadable)??;
        }
    }
    let (path, objects) = (command.out.display(), model.objects().len());
    say(&format!("{path} holds draft {}: {objects} objects", version.draft))?;
    Ok(ExitCode::SUCCESS)
}

fn outgoing<'a>(model: &'a GdbModel, level: &LevelHandle) -> Outgoing<'a> {
    let version = model.version();
    Outgoing {
        frame: level.frame(),
        version: [version.draft, version.library],
        objects: model.objects(),
        library: model.library(),
        model: model.model(),
    }
}
