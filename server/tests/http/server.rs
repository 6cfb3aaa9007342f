//! A server of this process, with data of its own.

use std::net::SocketAddr;

use mapfold_server::config::{Config, Secret};
use mapfold_server::level::LevelOptions;
use mapfold_server::{Running, start_with};
use tempfile::TempDir;

use crate::client::Client;

/// The admin token of every server here.
pub(crate) const ADMIN: &str = "an-admin-token-that-tests-chose";

/// A running server; its data is gone with it.
pub(crate) struct Server {
    running: Running,
    pub(crate) folder: TempDir,
}

impl Server {
    /// A server with the built-in limits.
    pub(crate) async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    /// A server whose settings `change` has changed.
    pub(crate) async fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        Self::start_as(change, LevelOptions::default()).await
    }

    /// A server that keeps its levels in another way.
    pub(crate) async fn start_as(change: impl FnOnce(&mut Config), levels: LevelOptions) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut config = Config {
            listen: "127.0.0.1:0".parse().unwrap(),
            data_dir: folder.path().join("data"),
            admin_token: Some(Secret::new(ADMIN)),
            ..Config::default()
        };
        change(&mut config);
        Self { running: start_with(config, levels).await.unwrap(), folder }
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.running.address()
    }

    /// Somebody without a token.
    pub(crate) fn anybody(&self) -> Client {
        Client::new(self.address(), None)
    }

    /// Somebody with this token.
    pub(crate) fn with(&self, token: &str) -> Client {
        Client::new(self.address(), Some(token))
    }

    /// The administrator.
    pub(crate) fn admin(&self) -> Client {
        self.with(ADMIN)
    }

    pub(crate) async fn shutdown(self) -> TempDir {
        self.running.shutdown().await;
        self.folder
    }
}
