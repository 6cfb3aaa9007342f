//! What the server is told before it starts: built-in values, then a TOML file, then `MAPFOLD_*`
//! variables, then the command line; the later wins. The only place that reads the environment.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use figment::Figment;
use figment::providers::{Env, Format, Serialized, Toml};
use serde::{Deserialize, Serialize};

/// Variables that are read, each with the prefix `MAPFOLD_`.
const VARIABLES: [&str; 6] =
    ["database", "listen", "data_dir", "insecure_http", "admin_token", "log"];

/// All that can be set.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// `sqlite:///path/to/file.db` or `postgres://user:password@host/name`; a file in
    /// [`Self::data_dir`] if absent.
    pub database: Option<Secret>,
    /// Where to listen.
    pub listen: SocketAddr,
    /// Where the embedded database is kept.
    pub data_dir: PathBuf,
    /// Whether to listen beyond this machine although nothing is encrypted.
    pub insecure_http: bool,
    /// Taken as the admin token on the very first start, instead of a generated one.
    pub admin_token: Option<Secret>,
    /// What to log, as `tracing_subscriber`'s `EnvFilter` writes it.
    pub log: String,
    /// What one client may take of the server.
    pub http: HttpLimits,
}

/// Limits of the HTTP side: every body, wait and number of things has its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HttpLimits {
    /// Connections at a time.
    pub connections_max: usize,
    /// Requests at a time.
    pub requests_max: usize,
    /// Live event streams at a time.
    pub streams_max: usize,
    /// Bytes of an upload as it comes over the wire.
    pub upload_compressed_bytes: usize,
    /// Bytes of an upload once it is unpacked.
    pub upload_bytes: usize,
    /// Bytes of any other body.
    pub body_bytes: usize,
    /// Wait for the first byte and for the whole of a request's head, and for the next request.
    pub head_timeout_ms: u64,
    /// Wait for the whole of a request's body.
    pub body_timeout_ms: u64,
    /// Wait for the head of an answer.
    pub answer_timeout_ms: u64,
    /// Silence after which a live stream says that it is still there.
    pub heartbeat_ms: u64,
    /// Time from the moment that `/readyz` says no until no more connections are taken: for a
    /// balancer to notice.
    pub drain_delay_ms: u64,
    /// Wait for requests in flight when the server stops.
    pub drain_timeout_ms: u64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            database: None,
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 7171)),
            data_dir: PathBuf::from("mapfold-data"),
            insecure_http: false,
            admin_token: None,
            log: "info,sqlx=warn".to_owned(),
            http: HttpLimits::default(),
        }
    }
}

impl Default for HttpLimits {
    fn default() -> Self {
        Self {
            connections_max: 4096,
            requests_max: 512,
            streams_max: 1024,
            upload_compressed_bytes: 4 << 20,
            upload_bytes: 16 << 20,
            body_bytes: 64 << 10,
            head_timeout_ms: 30_000,
            body_timeout_ms: 30_000,
            answer_timeout_ms: 60_000,
            heartbeat_ms: 15_000,
            drain_delay_ms: 0,
            drain_timeout_ms: 10_000,
        }
    }
}

impl HttpLimits {
    /// See [`Self::head_timeout_ms`].
    pub fn head_timeout(&self) -> Duration {
        Duration::from_millis(self.head_timeout_ms)
    }

    /// See [`Self::body_timeout_ms`].
    pub fn body_timeout(&self) -> Duration {
        Duration::from_millis(self.body_timeout_ms)
    }

    /// See [`Self::answer_timeout_ms`].
    pub fn answer_timeout(&self) -> Duration {
        Duration::from_millis(self.answer_timeout_ms)
    }

    /// See [`Self::heartbeat_ms`].
    pub fn heartbeat(&self) -> Duration {
        Duration::from_millis(self.heartbeat_ms)
    }

    /// See [`Self::drain_delay_ms`].
    pub fn drain_delay(&self) -> Duration {
        Duration::from_millis(self.drain_delay_ms)
    }

    /// See [`Self::drain_timeout_ms`].
    pub fn drain_timeout(&self) -> Duration {
        Duration::from_millis(self.drain_timeout_ms)
    }
}

/// A text that logs do not show.
#[derive(Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Secret(String);

impl Secret {
    /// Wraps a text.
    pub fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }

    /// The text.
    pub fn expose(&self) -> &str {
        &self.0
    }
}

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("(secret)")
    }
}

/// Why the server cannot be started as it was told.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// A value is missing, of the wrong kind or unknown.
    #[error("the settings cannot be used: {0}")]
    Figment(Box<figment::Error>),
    /// A file that was named is not there.
    #[error("there is no settings file {}", .0.display())]
    NoFile(PathBuf),
    /// Tokens and maps would travel in clear text between machines.
    #[error(
        "{listen} can be reached from other machines, and tokens and maps would travel unencrypted: \
         listen on 127.0.0.1 behind a proxy that speaks TLS, or say --insecure-http to do it all the \
         same"
    )]
    Unencrypted {
        /// The address.
        listen: SocketAddr,
    },
}

impl Config {
    /// Puts the settings together: `file` if one is named, the environment, and what `on_top` (the
    /// command line) says.
    ///
    /// # Errors
    /// What cannot be read, or makes no sense.
    pub fn load(file: Option<&Path>, on_top: impl Serialize) -> Result<Self, ConfigError> {
        let mut figment = Figment::from(Serialized::defaults(Self::default()));
        if let Some(file) = file {
            if !file.is_file() {
                return Err(ConfigError::NoFile(file.to_owned()));
            }
            figment = figment.merge(Toml::file_exact(file));
        }
        let config: Self = figment
            .merge(Env::prefixed("MAPFOLD_").only(&VARIABLES))
            .merge(Serialized::defaults(on_top))
            .extract()
            .map_err(|error| ConfigError::Figment(Box::new(error)))?;
        Ok(config)
    }

    /// Refuses to listen beyond this machine unless that was asked for in so many words.
    ///
    /// # Errors
    /// [`ConfigError::Unencrypted`].
    pub fn check_listen(&self) -> Result<(), ConfigError> {
        if self.listen.ip().is_loopback() || self.insecure_http {
            Ok(())
        } else {
            Err(ConfigError::Unencrypted { listen: self.listen })
        }
    }

    /// The file of the embedded database; `None` if another database is named.
    pub fn embedded_file(&self) -> Option<PathBuf> {
        self.database.is_none().then(|| self.data_dir.join("mapfold.db"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loaded(toml: &str, on_top: &serde_json::Value) -> Result<Config, ConfigError> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mapfold.toml");
        std::fs::write(&file, toml).unwrap();
        Config::load(Some(&file), on_top)
    }

    #[test]
    fn the_command_line_beats_the_file_and_the_file_beats_the_built_in_values() {
        let toml = "listen = \"127.0.0.1:1\"\ndata_dir = \"a\"\n[http]\nstreams_max = 3\n";
        let config = loaded(toml, &serde_json::json!({ "data_dir": "b" })).unwrap();
        assert_eq!(config.listen.port(), 1);
        assert_eq!(config.data_dir, Path::new("b"));
        assert_eq!(config.http.streams_max, 3);
        assert_eq!(config.http.body_bytes, HttpLimits::default().body_bytes);
        assert_eq!(config.embedded_file(), Some(PathBuf::from("b/mapfold.db")));
    }

    #[test]
    fn a_misspelt_setting_is_named() {
        let error = loaded("lisen = \"127.0.0.1:1\"\n", &serde_json::json!({})).unwrap_err();
        assert!(error.to_string().contains("lisen"), "{error}");
        let missing = Config::load(Some(Path::new("/nowhere/x.toml")), serde_json::json!({}));
        assert!(matches!(missing, Err(ConfigError::NoFile(_))));
    }

    #[test]
    fn other_machines_are_listened_to_only_when_asked_for() {
        let mut config = Config { listen: "0.0.0.0:80".parse().unwrap(), ..Config::default() };
        let refusal = config.check_listen().unwrap_err().to_string();
        assert!(refusal.contains("--insecure-http"), "{refusal}");
        config.insecure_http = true;
        config.check_listen().unwrap();
        config = Config { listen: "[::1]:80".parse().unwrap(), ..Config::default() };
        config.check_listen().unwrap();
    }

    #[test]
    fn secrets_are_not_shown() {
        let config = Config {
            database: Some(Secret::new("postgres://u:hunter2@h/db")),
            admin_token: Some(Secret::new("hunter2")),
            ..Config::default()
        };
        assert!(!format!("{config:?}").contains("hunter2"));
    }
}
