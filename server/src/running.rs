//! A server from its start to its end.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use rand::rngs::SysError;
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::auth::{self, Token};
use crate::chance::Chance;
use crate::clock::{SharedClock, SystemClock};
use crate::config::{Config, ConfigError};
use crate::http::{self, App, Parts};
use crate::level::{LevelOptions, Levels};
use crate::store::{Store, StoreError, sqlite_url};

/// How often figures are put into their buckets.
const UPKEEP: Duration = Duration::from_secs(5);

/// Why a server did not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// Settings that cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A folder or an address that cannot be used.
    #[error("{what}: {cause}")]
    System {
        /// What was tried.
        what: String,
        /// What the system says.
        cause: std::io::Error,
    },
    /// No randomness.
    #[error("the system gives no random numbers: {0}")]
    Chance(#[from] SysError),
    /// A chosen admin token that anybody could guess.
    #[error("MAPFOLD_ADMIN_TOKEN must be 16 to 256 visible ASCII characters")]
    WeakAdminToken,
    /// Nothing was ever kept there.
    #[error("there is no database {0}: is --data-dir (or --database) right?")]
    NoDatabase(String),
    /// The database.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// A server that runs.
pub struct Running {
    address: SocketAddr,
    admin_token: Option<Token>,
    app: App,
    closing: watch::Sender<bool>,
    serving: JoinHandle<()>,
    upkeep: JoinHandle<()>,
    levels: Levels,
    store: Store,
}

/// Opens the database of `config` (making the folder of an embedded one) and brings its tables up
/// to date.
///
/// # Errors
/// What cannot be made, opened or trusted.
pub async fn open_store(config: &Config) -> Result<Store, StartError> {
    let url = match (&config.database, config.embedded_file()) {
        (Some(url), _) => url.expose().to_owned(),
        (None, file) => {
            make_private_folder(&config.data_dir)?;
            sqlite_url(&file.unwrap_or_default())
        }
    };
    let store = Store::connect(&url).await?;
    store.migrate().await?;
    Ok(store)
}

/// Opens the store of a server that has run: what looks at a store must not make one.
///
/// # Errors
/// There is none, or it cannot be opened.
pub(crate) async fn open_existing_store(config: &Config) -> Result<Store, StartError> {
    if let Some(file) = config.embedded_file()
        && !file.exists()
    {
        return Err(StartError::NoDatabase(file.display().to_string()));
    }
    open_store(config).await
}

/// Starts a server. Port 0 takes a free one; [`Running::address`] tells which.
///
/// # Errors
/// Why it cannot start.
pub async fn start(config: Config) -> Result<Running, StartError> {
    start_with(config, LevelOptions::default()).await
}

/// Starts a server that keeps its levels in memory in another way, which no installation should
/// need: for tests.
///
/// # Errors
/// Why it cannot start.
pub async fn start_with(config: Config, options: LevelOptions) -> Result<Running, StartError> {
    config.check_listen()?;
    let clock: SharedClock = Arc::new(SystemClock::start());
    let chance = Chance::from_system()?;
    let chosen = match &config.admin_token {
        Some(text) => Some(Token::parse(text.expose()).ok_or(StartError::WeakAdminToken)?),
        None => None,
    };
    let store = open_store(&config).await?;
    // Only a server that can be reached makes tokens: a refused start must not use up the first.
    let listening = format!("cannot listen on {}", config.listen);
    let listener = TcpListener::bind(config.listen).await.map_err(system(&listening))?;
    let address = listener.local_addr().map_err(system(&listening))?;
    let admin_token = auth::admit_first_admin(&store, &chance, chosen, clock.now_us()).await?;

    let levels = Levels::new(store.clone(), Arc::clone(&clock), options);
    let (closing, is_closing) = watch::channel(false);
    let app = App::new(Parts {
        store: store.clone(),
        levels: levels.clone(),
        clock,
        chance,
        limits: config.http,
        closing: is_closing.clone(),
    });
    let router = http::router(&app);
    let serving = tokio::spawn(http::serve(listener, router, config.http, is_closing));
    let upkeep = tokio::spawn(upkeep(app.clone()));
    tracing::info!(%address, "listening");
    Ok(Running { address, admin_token, app, closing, serving, upkeep, levels, store })
}

impl Running {
    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The admin token, if this was the very first start and nobody had chosen one: to be shown
    /// once.
    pub fn admin_token(&self) -> Option<&Token> {
        self.admin_token.as_ref()
    }

    /// Makes `/metrics` tell of the whole process: for the program that has only this server.
    pub fn record_process(&self) {
        self.app.record_process();
    }

    /// Resolves if the database's disk fails; the program should then stop with a failure.
    pub async fn disk_failed(&self) -> String {
        self.levels.disk_failed().await
    }

    /// Stops: no new connections, live streams end, requests in flight are finished, levels are
    /// written and closed.
    pub async fn shutdown(self) {
        self.closing.send_replace(true);
        if let Err(error) = self.serving.await {
            tracing::error!(%error, "the accept loop failed");
        }
        self.upkeep.abort();
        self.levels.shutdown().await;
        self.store.close().await;
    }
}

async fn upkeep(app: App) {
    let mut beat = tokio::time::interval(UPKEEP);
    loop {
        beat.tick().await;
        app.upkeep();
    }
}

fn system(what: &str) -> impl FnOnce(std::io::Error) -> StartError {
    move |cause| StartError::System { what: what.to_owned(), cause }
}

/// Maps and digests of secrets are nobody else's business.
fn make_private_folder(path: &Path) -> Result<(), StartError> {
    let mut builder = std::fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(path).map_err(system(&format!("cannot make the folder {}", path.display())))
}
