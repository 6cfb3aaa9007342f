//! One level of a server: its log, its map as full fetches and as patches, its exports.

use std::collections::BTreeMap;
use std::time::Duration;

use mapfold_schema::codec::JSON;
use mapfold_schema::route;
use mapfold_schema::v1::{
    Chain, Cluster, ContributionEntry, ContributionPage, ContributionRecord, IssuedToken,
    LevelDescription, NewLevel, NewRevert, NewRobot, NewSite, Patch, RasterChanges, Revert,
    Segment, SensorKind, SensorProfile, TileAddress, TileEvidence, VectorPatch,
};
use uuid::Uuid;

use crate::Error;
use crate::api::{Answer, Api};
use crate::coverage::NEAR_M;
use crate::floor::Floor;

/// How long a level may take to fold what is in its log.
const PATIENCE: Duration = Duration::from_mins(2);

/// A level, spoken to as an administrator.
#[derive(Debug, Clone)]
pub struct Level {
    /// The server.
    pub api: Api,
    /// Slug of the site.
    pub site: String,
    /// Slug of the level.
    pub level: String,
}

impl Level {
    /// A level that is there.
    pub fn new(api: Api, site: &str, level: &str) -> Self {
        Self { api, site: site.to_owned(), level: level.to_owned() }
    }

    /// Makes a site and a level in it.
    ///
    /// # Errors
    /// The server refuses.
    pub async fn create(api: Api, site: &str, level: &str) -> Result<Self, Error> {
        let new_site = NewSite { site: site.to_owned(), name: None };
        api.post_json(route::SITES, &new_site).await?.expect(201)?;
        let new_level = NewLevel {
            level: level.to_owned(),
            name: None,
            resolution_m: None,
            elevation_m: None,
            evidence_slice_s: None,
        };
        api.post_json(&route::of_site(route::LEVELS, site), &new_level).await?.expect(201)?;
        Ok(Self::new(api, site, level))
    }

    /// Enrols a robot with a scanner and answers its token.
    ///
    /// # Errors
    /// The server refuses.
    pub async fn enrol(&self, robot: &str) -> Result<String, Error> {
        let scanner = SensorProfile {
            model: "a scanner for tests".to_owned(),
            ..SensorProfile::new(SensorKind::Scanner, 50.0, 0.02, 0.005)
        };
        let new = NewRobot { robot: robot.to_owned(), name: None, sensors: vec![scanner] };
        self.api.post_json(&route::of_site(route::ROBOTS, &self.site), &new).await?.expect(201)?;
        let tokens = format!("{}/tokens", route::robot(&self.site, robot));
        let issued: IssuedToken = self.api.post(&tokens, JSON, b"{}".to_vec()).await?.decode()?;
        Ok(issued.token)
    }

    /// A path of this level.
    pub fn path(&self, template: &str) -> String {
        route::of_level(template, &self.site, &self.level)
    }

    /// What the level says of itself.
    ///
    /// # Errors
    /// No answer.
    pub async fn describe(&self) -> Result<LevelDescription, Error> {
        self.api.fetch(&self.path(route::LEVEL)).await
    }

    /// Waits until the published map has reached the end of the log.
    ///
    /// # Errors
    /// It does not in time.
    pub async fn folded(&self) -> Result<LevelDescription, Error> {
        let begin = tokio::time::Instant::now();
        while begin.elapsed() < PATIENCE {
            let level = self.describe().await?;
            if level.folded_revision == level.revision {
                return Ok(level);
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        let what = format!("{} to be folded", self.path(route::LEVEL));
        Err(Error::Late { what, seconds: PATIENCE.as_secs() })
    }

    /// The whole log, newest first.
    ///
    /// # Errors
    /// No answer.
    pub async fn log(&self) -> Result<Vec<ContributionEntry>, Error> {
        let mut entries = Vec::new();
        let mut cursor = String::new();
        loop {
            let path = format!("{}?limit=1000{cursor}", self.path(route::CONTRIBUTIONS));
            let page: ContributionPage = self.api.fetch(&path).await?;
            entries.extend(page.contributions);
            match page.next {
                Some(next) => cursor = format!("&cursor={next}"),
                None => return Ok(entries),
            }
        }
    }

    /// One contribution as it was uploaded.
    ///
    /// # Errors
    /// No answer.
    pub async fn contribution(&self, id: Uuid) -> Result<ContributionRecord, Error> {
        let path = self.path(route::CONTRIBUTION).replace("{id}", &id.to_string());
        self.api.fetch(&path).await
    }

    /// Takes contributions out of the map.
    ///
    /// # Errors
    /// No answer, or a refusal.
    pub async fn revert(&self, revert: &NewRevert) -> Result<Revert, Error> {
        self.api.post_json(&self.path(route::REVERTS), revert).await?.expect(201)?.decode()
    }

    /// Puts them back.
    ///
    /// # Errors
    /// No answer, or a refusal.
    pub async fn undo(&self, revert: Uuid) -> Result<Revert, Error> {
        let path = self.path(route::REVERT).replace("{id}", &revert.to_string());
        self.api.delete(&path).await?.expect(200)?.decode()
    }

    /// An export's bytes.
    ///
    /// # Errors
    /// No answer, or a refusal.
    pub async fn export(&self, format: &str) -> Result<Vec<u8>, Error> {
        let path = self.path(route::EXPORTS).replace("{format}", format);
        Ok(self.api.get(&path, "*/*").await?.expect(200)?.body)
    }

    /// `GET L/vector`.
    ///
    /// # Errors
    /// No answer.
    pub async fn vector(&self, since: i64, accept: &str) -> Result<VectorPatch, Error> {
        let path = format!("{}?since={since}", self.path(route::VECTOR));
        self.api.get(&path, accept).await?.decode()
    }

    /// `GET L/raster`.
    ///
    /// # Errors
    /// No answer.
    pub async fn raster(&self, since: i64, accept: &str) -> Result<RasterChanges, Error> {
        let path = format!("{}?since={since}", self.path(route::RASTER));
        self.api.get(&path, accept).await?.decode()
    }

    /// One tile of one layer: its sums, row by row from below.
    ///
    /// # Errors
    /// No answer, or not 64 x 64 numbers.
    pub async fn tile(&self, at: &TileAddress) -> Result<Vec<i32>, Error> {
        let sensor = serde_json::json!(at.sensor);
        let path = self.path(route::RASTER_TILE);
        let path = path.replace("{x}", &at.x.to_string()).replace("{y}", &at.y.to_string());
        let path = format!("{path}?sensor={}", sensor.as_str().unwrap_or_default());
        let answer = self.api.get(&path, "*/*").await?.expect(200)?;
        let sums =
            answer.body.chunks_exact(4).map(|le| i32::from_le_bytes([le[0], le[1], le[2], le[3]]));
        Ok(sums.collect())
    }

    /// `GET L/patches`: one page.
    ///
    /// # Errors
    /// No answer.
    pub async fn patch(&self, since: i64, limit: usize, accept: &str) -> Result<Patch, Error> {
        let path = format!("{}?since={since}&limit={limit}", self.path(route::PATCHES));
        self.api.get(&path, accept).await?.decode()
    }

    /// The published map, for the measures.
    ///
    /// # Errors
    /// No answer.
    pub async fn floor(&self) -> Result<(Replica, Floor), Error> {
        let resolution_m = self.folded().await?.resolution_m;
        let mut replica = Replica::default();
        replica.follow(self, 5000, mapfold_schema::codec::CBOR).await?;
        let segments: Vec<Segment> = replica.segments.values().cloned().collect();
        let clusters: Vec<Cluster> = replica.clusters.values().cloned().collect();
        let tiles: Vec<TileEvidence> = replica.tiles.values().cloned().collect();
        let floor = Floor::new(&segments, &clusters, &tiles, resolution_m, NEAR_M);
        Ok((replica, floor))
    }
}

impl Answer {
    /// This answer, if it has that status.
    ///
    /// # Errors
    /// Another status.
    pub fn expect(self, status: u16) -> Result<Self, Error> {
        if self.status == status {
            return Ok(self);
        }
        Err(Error::Answer { url: self.url.clone(), status: self.status, body: self.text() })
    }
}

/// A copy of a level's map, kept up to date by patches, as a robot by someone else would do it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Replica {
    /// The revision that it has reached.
    pub revision: i64,
    /// Segments by id.
    pub segments: BTreeMap<String, Segment>,
    /// Clusters by id.
    pub clusters: BTreeMap<String, Cluster>,
    /// Chains by id.
    pub chains: BTreeMap<String, Chain>,
    /// Tiles by layer and place.
    pub tiles: BTreeMap<TileAddress, TileEvidence>,
}

impl Replica {
    /// Applies one patch.
    pub fn apply(&mut self, patch: Patch) {
        for id in &patch.removed.segments {
            self.segments.remove(id);
        }
        for id in &patch.removed.clusters {
            self.clusters.remove(id);
        }
        for id in &patch.removed.chains {
            self.chains.remove(id);
        }
        for at in &patch.removed.tiles {
            self.tiles.remove(at);
        }
        self.segments.extend(patch.segments.into_iter().map(|s| (s.id.clone(), s)));
        self.clusters.extend(patch.clusters.into_iter().map(|c| (c.id.clone(), c)));
        self.chains.extend(patch.chains.into_iter().map(|c| (c.id.clone(), c)));
        self.tiles.extend(
            patch
                .tiles
                .into_iter()
                .map(|tile| (TileAddress { sensor: tile.sensor, x: tile.x, y: tile.y }, tile)),
        );
        self.revision = patch.revision;
    }

    /// Fetches and applies patches until there is no more; answers their number.
    ///
    /// # Errors
    /// No answer.
    pub async fn follow(
        &mut self,
        level: &Level,
        limit: usize,
        accept: &str,
    ) -> Result<u32, Error> {
        let mut pages = 0;
        loop {
            let patch = level.patch(self.revision, limit, accept).await?;
            let more = patch.more;
            self.apply(patch);
            pages += 1;
            if !more {
                return Ok(pages);
            }
        }
    }
}
