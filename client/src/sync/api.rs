//! The server's HTTP API from the robot's side: one function per endpoint.
//!
//! Nothing is retried here; [`ApiError`] says what may be. Paths come from
//! [`mapfold_schema::route`], types from [`mapfold_schema::v1`]. Answers are read as CBOR, packed
//! as zstd or gzip, and never longer than [`ApiOptions::answer_bytes_max`] once unpacked.

mod answer;
mod error;
mod exchange;
mod traffic;
mod upload;

use std::sync::Arc;
use std::time::Duration;

use mapfold_schema::slug::is_slug;
use mapfold_schema::{route, v1};
use reqwest::{Client, Method};

pub use error::ApiError;
pub use traffic::Traffic;
pub(super) use upload::UploadBatch;

use traffic::TrafficCounters;

use super::tls;

/// How long to wait, and how much to take.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ApiOptions {
    /// Wait for a connection.
    pub connect_timeout: Duration,
    /// Wait for the next bytes of an answer.
    pub idle_timeout: Duration,
    /// Wait for a whole request and its answer.
    pub request_timeout: Duration,
    /// Longest answer that is read, bytes, packed or unpacked.
    pub answer_bytes_max: usize,
}

impl ApiOptions {
    /// 5 s for a connection, 30 s of silence, 2 minutes for all of it, answers of up to 256 MiB.
    pub const STANDARD: Self = Self {
        connect_timeout: Duration::from_secs(5),
        idle_timeout: Duration::from_secs(30),
        request_timeout: Duration::from_mins(2),
        answer_bytes_max: 256 << 20,
    };
}

/// Which level: the slugs of its site and of itself.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct LevelAddress {
    /// The site's slug.
    pub site: String,
    /// The level's slug.
    pub level: String,
}

impl std::fmt::Display for LevelAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.site, self.level)
    }
}

/// One server, spoken to with one token. Clones share connections and counters.
#[derive(Clone)]
pub struct Api {
    http: Client,
    base_url: Arc<str>,
    token: Arc<str>,
    options: ApiOptions,
    traffic: Arc<TrafficCounters>,
}

/// Without the token: it must not get into logs.
impl std::fmt::Debug for Api {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Api").field("base_url", &self.base_url).finish_non_exhaustive()
    }
}

impl Api {
    /// The API at `base_url` (`http://..` or `https://..`, without `/api/v1`), as the holder of
    /// `token`. Proxies of the environment are not used, and redirections are not followed: a
    /// token goes to the server that it is for and nowhere else. For `https` the system's root
    /// certificates are trusted (or those of `SSL_CERT_FILE`, for a plant with its own).
    ///
    /// # Errors
    /// A URL that is none; no [`tls::install_provider`] before; for `https`, no root certificates.
    pub fn new(base_url: &str, token: &str, options: ApiOptions) -> Result<Self, ApiError> {
        let base_url = base_url.trim_end_matches('/');
        let bad_url = |why: String| ApiError::BadUrl { url: base_url.to_owned(), why };
        let url = reqwest::Url::parse(base_url).map_err(|e| bad_url(e.to_string()))?;
        if !matches!(url.scheme(), "http" | "https") || !url.has_host() {
            return Err(bad_url("it must begin with http:// or https:// and name a host".into()));
        }
        if !tls::has_provider() {
            return Err(ApiError::NoTlsProvider);
        }
        let mut builder = Client::builder()
            .user_agent(concat!("mapfold-robot/", env!("CARGO_PKG_VERSION")))
            .connect_timeout(options.connect_timeout)
            .read_timeout(options.idle_timeout)
            .timeout(options.request_timeout)
            .redirect(reqwest::redirect::Policy::none())
            // Unpacked by `answer`, which counts the packed bytes and bounds the others.
            .no_gzip()
            .no_zstd()
            .no_proxy();
        if url.scheme() == "http" {
            // No root certificates are needed, and a bare robot may have none to load.
            builder = builder.tls_certs_only([]);
        }
        let http = builder.build().map_err(|source| ApiError::NoHttpClient { source })?;
        Ok(Self {
            http,
            base_url: base_url.into(),
            token: token.into(),
            options,
            traffic: Arc::default(),
        })
    }

    /// The same server, with another token.
    #[must_use]
    pub fn with_token(&self, token: &str) -> Self {
        Self { token: token.into(), ..self.clone() }
    }

    /// What went over the wire so far, for this and all its clones.
    pub fn traffic(&self) -> Traffic {
        self.traffic.so_far()
    }

    /// All sites that the token reaches.
    ///
    /// # Errors
    /// See [`ApiError`].
    pub async fn sites(&self) -> Result<Vec<v1::SiteDescription>, ApiError> {
        self.get(route::SITES).await
    }

    /// Makes a site.
    ///
    /// # Errors
    /// See [`ApiError`]; 409 `site_exists` if there is one of that name.
    pub async fn create_site(&self, new: &v1::NewSite) -> Result<v1::SiteDescription, ApiError> {
        self.send_value(Method::POST, route::SITES, new).await
    }

    /// The levels of a site.
    ///
    /// # Errors
    /// See [`ApiError`].
    pub async fn levels(&self, site: &str) -> Result<Vec<v1::LevelDescription>, ApiError> {
        self.get(&route::of_site(route::LEVELS, slug(site)?)).await
    }

    /// Makes a level.
    ///
    /// # Errors
    /// See [`ApiError`]; 409 `level_exists` if there is one of that name.
    pub async fn create_level(
        &self,
        site: &str,
        new: &v1::NewLevel,
    ) -> Result<v1::LevelDescription, ApiError> {
        self.send_value(Method::POST, &route::of_site(route::LEVELS, slug(site)?), new).await
    }

    /// A level: its frame, grid, revisions.
    ///
    /// # Errors
    /// See [`ApiError`].
    pub async fn level(&self, level: &LevelAddress) -> Result<v1::LevelDescription, ApiError> {
        self.get(&of_level(route::LEVEL, level)?).await
    }

    /// The robots of a site.
    ///
    /// # Errors
    /// See [`ApiError`].
    pub async fn robots(&self, site: &str) -> Result<Vec<v1::RobotDescription>, ApiError> {
        self.get(&route::of_site(route::ROBOTS, slug(site)?)).await
    }

    /// Enrols a robot.
    ///
    /// # Errors
    /// See [`ApiError`]; 409 `robot_exists` if there is one of that name.
    pub async fn create_robot(
        &self,
        site: &str,
        new: &v1::NewRobot,
    ) -> Result<v1::RobotDescription, ApiError> {
        self.send_value(Method::POST, &route::of_site(route::ROBOTS, slug(site)?), new).await
    }

    /// A robot.
    ///
    /// # Errors
    /// See [`ApiError`].
    pub async fn robot(&self, site: &str, robot: &str) -> Result<v1::RobotDescription, ApiError> {
        self.get(&route::robot(slug(site)?, slug(robot)?)).await
    }

    /// Changes a robot, or reports its revision and queue length.
    ///
    /// # Errors
    /// See [`ApiError`].
    pub async fn update_robot(
        &self,
        site: &str,
        robot: &str,
        update: &v1::RobotUpdate,
    ) -> Result<v1::RobotDescription, ApiError> {
        self.send_value(Method::PATCH, &route::robot(slug(site)?, slug(robot)?), update).await
    }

    /// Makes a token for a robot. The answer is the only place where its secret is ever shown.
    ///
    /// # Errors
    /// See [`ApiError`].
    pub async fn issue_robot_token(
        &self,
        site: &str,
        robot: &str,
        new: &v1::NewToken,
    ) -> Result<v1::IssuedToken, ApiError> {
        let path = route::of_site(route::ROBOT_TOKENS, slug(site)?);
        self.send_value(Method::POST, &path.replace("{robot}", slug(robot)?), new).await
    }

    /// Uploads up to 64 contributions; the answers are in their order. A receipt among them bears
    /// the id and the content digest of what was sent, or it is no receipt.
    ///
    /// # Errors
    /// See [`ApiError`]; [`ApiError::Encode`] if CBOR cannot hold one of them.
    pub async fn contribute(
        &self,
        level: &LevelAddress,
        contributions: &[v1::Contribution],
    ) -> Result<Vec<v1::UploadAnswer>, ApiError> {
        self.upload(level, &UploadBatch::of(contributions)?).await
    }

    /// All that changed after revision `since`, as the next page of about `limit` things.
    ///
    /// # Errors
    /// See [`ApiError`]; 410 `cursor_expired` if the server does not know revision `since`.
    pub async fn patches(
        &self,
        level: &LevelAddress,
        since: i64,
        limit: u32,
    ) -> Result<v1::Patch, ApiError> {
        let path = of_level(route::PATCHES, level)?;
        self.get(&format!("{path}?since={since}&limit={limit}")).await
    }

    /// Landmarks that changed after revision `since`, at the height that the server takes for a sensor's.
    ///
    /// # Errors
    /// See [`ApiError`]; 410 `cursor_expired` if the server does not know any more what was told at `since`; 409
    /// `plan_too_crowded` if the published model cannot be cut.
    pub async fn landmarks(
        &self,
        level: &LevelAddress,
        since: i64,
    ) -> Result<v1::LandmarkTable, ApiError> {
        self.get(&format!("{}?since={since}", of_level(route::LANDMARKS, level)?)).await
    }

    /// The plan of the published model at the same height.
    ///
    /// # Errors
    /// See [`ApiError`]; 409 `plan_too_crowded`.
    pub async fn published_plan(&self, level: &LevelAddress) -> Result<v1::GdbPlan, ApiError> {
        self.get(&format!("{}?state=published", of_level(route::GDB_PLAN, level)?)).await
    }

    /// Segments, clusters and chains that changed after revision `since`.
    ///
    /// # Errors
    /// See [`ApiError`].
    pub async fn vector(
        &self,
        level: &LevelAddress,
        since: i64,
    ) -> Result<v1::VectorPatch, ApiError> {
        self.get(&format!("{}?since={since}", of_level(route::VECTOR, level)?)).await
    }

    /// Which tiles changed after revision `since`.
    ///
    /// # Errors
    /// See [`ApiError`].
    pub async fn raster(
        &self,
        level: &LevelAddress,
        since: i64,
    ) -> Result<v1::RasterChanges, ApiError> {
        self.get(&format!("{}?since={since}", of_level(route::RASTER, level)?)).await
    }
}

/// `name` if it may stand in a path.
fn slug(name: &str) -> Result<&str, ApiError> {
    if is_slug(name) { Ok(name) } else { Err(ApiError::BadName { name: name.to_owned() }) }
}

fn of_level(template: &str, level: &LevelAddress) -> Result<String, ApiError> {
    Ok(route::of_level(template, slug(&level.site)?, slug(&level.level)?))
}

#[cfg(test)]
mod tests;
