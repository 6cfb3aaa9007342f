//! Randomness, as a parameter like the clock: a test can then be repeated. Tokens, frames of
//! levels and ids of requests are drawn from it.

use std::sync::{Arc, Mutex, PoisonError};

use rand::rngs::{StdRng, SysError, SysRng};
use rand::{CryptoRng, Rng, SeedableRng};
use uuid::Uuid;

/// A generator that all parts of one server share.
#[derive(Clone)]
pub struct Chance(Arc<Mutex<dyn CryptoRng + Send>>);

impl std::fmt::Debug for Chance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Chance")
    }
}

impl Chance {
    /// Draws from `rng`, which must be fit for secrets.
    pub fn new(rng: impl CryptoRng + Send + 'static) -> Self {
        Self(Arc::new(Mutex::new(rng)))
    }

    /// A generator seeded by the system.
    ///
    /// # Errors
    /// The system has no randomness to give.
    pub fn from_system() -> Result<Self, SysError> {
        StdRng::try_from_rng(&mut SysRng).map(Self::new)
    }

    /// Draws with `draw`, alone.
    pub fn with<T>(&self, draw: impl FnOnce(&mut dyn Rng) -> T) -> T {
        // A generator is valid in any state, so a panic elsewhere does not spoil it.
        let mut rng = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        draw(&mut *rng)
    }

    /// A random UUID.
    pub fn uuid(&self) -> Uuid {
        let mut bytes = [0; 16];
        self.with(|rng| rng.fill_bytes(&mut bytes));
        uuid::Builder::from_random_bytes(bytes).into_uuid()
    }
}
