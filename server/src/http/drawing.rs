//! Draws the coarse pictures of a level in the background as soon as it is open.
//!
//! The first picture of a vast level is made of all its tiles, which takes a second: nobody who looks
//! at it should have to wait for that. Once for each level in the life of the server; from then on
//! pictures cost what has changed in them.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::Semaphore;
use uuid::Uuid;

use super::state::App;
use crate::exchange::layers::{Layer, LayerId};
use crate::level::{LevelHandle, Snapshot};

/// Which levels' pictures have been begun.
#[derive(Debug)]
pub(super) struct Drawing {
    /// By frame.
    begun: Mutex<BTreeSet<Uuid>>,
    /// One level at a time: there are answers to be made as well.
    turn: Arc<Semaphore>,
}

impl Default for Drawing {
    fn default() -> Self {
        Self { begun: Mutex::default(), turn: Arc::new(Semaphore::new(1)) }
    }
}

impl Drawing {
    /// Begins with the pictures of a level, if nobody has yet. They are drawn from what it publishes
    /// meanwhile, until the server closes.
    pub(super) fn begin(&self, app: &App, level: &LevelHandle) {
        let mut begun = self.begun.lock().unwrap_or_else(PoisonError::into_inner);
        if !begun.insert(level.frame()) {
            return;
        }
        drop(begun);
        metrics::gauge!("mapfold_levels_to_draw").increment(1.0);
        let (turn, app, level) = (Arc::clone(&self.turn), app.clone(), level.clone());
        tokio::spawn(async move {
            let turn = turn.acquire_owned().await;
            let drawn = tokio::task::spawn_blocking(move || draw(&app, &level)).await;
            drop(turn);
            if let Err(error) = drawn {
                tracing::error!(%error, "the pictures of a level were not drawn");
            }
            metrics::gauge!("mapfold_levels_to_draw").decrement(1.0);
        });
    }
}

fn draw(app: &App, level: &LevelHandle) {
    let started = app.parts.clock.elapsed();
    let newest = || -> Option<Arc<Snapshot>> { (!app.is_closing()).then(|| level.snapshot()) };
    let layers = [Layer::All].into_iter().chain(LayerId::ALL.map(Layer::Only));
    let mut drawn = 0;
    for layer in layers {
        match app.pictures.draw_ahead(level.frame(), layer, newest) {
            Ok(count) => drawn += count,
            Err(error) => tracing::error!(%error, "a picture was not drawn"),
        }
    }
    let took = app.parts.clock.elapsed().saturating_sub(started);
    metrics::histogram!("mapfold_draw_duration_seconds").record(took.as_secs_f64());
    tracing::info!(site = level.site(), level = level.level(), drawn, ?took, "pictures drawn");
}
