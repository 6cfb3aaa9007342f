//! For tests of this module: an [`App`] that stands on an empty database in a temporary folder.

use std::sync::Arc;

use tempfile::TempDir;
use tokio::sync::watch;
use uuid::Uuid;

use super::state::{App, Parts};
use crate::chance::Chance;
use crate::clock::ManualClock;
use crate::config::HttpLimits;
use crate::level::{LevelHandle, LevelOptions, Levels};
use crate::store::levels::NewLevelRow;
use crate::store::{Store, sqlite_url};

/// The app, with one level `plant`/`floor`, and what it stands on.
pub(super) struct Fixture {
    pub(super) app: App,
    pub(super) level: LevelHandle,
    pub(super) closing: watch::Sender<bool>,
    _folder: TempDir,
}

impl Fixture {
    pub(super) async fn new(limits: HttpLimits) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::connect(&sqlite_url(&folder.path().join("x.db"))).await.unwrap();
        store.migrate().await.unwrap();
        store.create_site("plant", "plant", 0).await.unwrap();
        let row = NewLevelRow {
            level: "floor",
            name: "floor",
            frame: Uuid::from_u128(1),
            resolution_m: 0.05,
            elevation_m: 0.0,
            slice_s: 86_400,
            created_at_us: 0,
        };
        store.create_level("plant", &row).await.unwrap();
        let clock = Arc::new(ManualClock::at(0));
        let levels = Levels::new(store.clone(), clock.clone(), LevelOptions::default());
        let level = levels.open("plant", "floor").await.unwrap().unwrap();
        let (closing, is_closing) = watch::channel(false);
        let chance = Chance::from_system().unwrap();
        let app = App::new(Parts { store, levels, clock, chance, limits, closing: is_closing });
        Self { app, level, closing, _folder: folder }
    }
}
