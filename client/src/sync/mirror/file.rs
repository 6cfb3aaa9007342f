//! A mirror as one file, replaced as a whole.
//!
//! ```text
//! "MFMIRROR"          8 bytes
//! version             u32, little-endian, 4
//! checksum            32 bytes, SHA-256 of all that follows
//! payload             CBOR of the level, its frame, its revision and the map as a patch from
//!                     nothing, zstd
//! ```
//!
//! The payload may hold landmarks and the plan of the model besides; files of earlier programs do not.
//!
//! A file of version 1 knows no chains, one of version 2 no existence, one of version 3 no prior: of
//! these only the level and its frame are taken over, and the map is fetched anew.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use mapfold_map::level::{LevelMap, apply, diff};
use mapfold_schema::border::{map_patch, wire_patch};
use mapfold_schema::codec;
use mapfold_schema::v1;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::landmarks::{KnownLandmarks, Told};
use super::{Ground, KnownMap, MirrorError};
use crate::sync::LevelAddress;
use crate::sync::durable::{self, DiskError, at};

const FILE: &str = "level.mirror";
const MAGIC: &[u8; 8] = b"MFMIRROR";
const VERSION: u32 = 4;
const ZSTD_LEVEL: i32 = 3;

/// What a file holds.
#[derive(Debug, PartialEq)]
pub(super) struct Saved {
    pub(super) level: LevelAddress,
    pub(super) ground: Ground,
    pub(super) known: KnownMap,
    pub(super) landmarks: Arc<KnownLandmarks>,
}

/// The payload; all but the map is the same in every version.
#[derive(Serialize, Deserialize)]
struct Content<M> {
    site: String,
    level: String,
    frame: Uuid,
    resolution_m: f64,
    map: M,
    #[serde(default)]
    landmarks: Option<Told>,
}

impl<M> Content<M> {
    fn saved(self, known: KnownMap) -> Result<Saved, String> {
        let landmarks = KnownLandmarks::of_told(self.landmarks.unwrap_or_default());
        Ok(Saved {
            level: LevelAddress { site: self.site, level: self.level },
            ground: Ground { frame: self.frame, resolution_m: self.resolution_m },
            known,
            landmarks: Arc::new(landmarks.map_err(|violations| format!("{violations:?}"))?),
        })
    }
}

/// Why a file cannot be used.
#[derive(Debug)]
pub(super) enum Unusable {
    Damaged(String),
    Disk(DiskError),
}

/// The mirror in `folder`; `None` if there is none.
pub(super) fn read(folder: &Path) -> Result<Option<Saved>, Unusable> {
    let path = path(folder);
    match fs::read(&path) {
        Ok(bytes) => decode(&bytes).map(Some).map_err(Unusable::Damaged),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Unusable::Disk(at(&path)(error))),
    }
}

/// Puts a mirror in the place of the one in `folder`.
pub(super) fn write(folder: &Path, saved: &Saved) -> Result<(), MirrorError> {
    let path = path(folder);
    let bytes = encode(saved)?.map_err(at(&path))?;
    Ok(durable::replace(&path, &bytes)?)
}

/// Takes a damaged file out of the way.
pub(super) fn set_aside(folder: &Path) -> Result<(), DiskError> {
    let path = path(folder);
    durable::rename(&path, &path.with_extension("mirror.damaged"))
}

fn path(folder: &Path) -> PathBuf {
    folder.join(FILE)
}

fn encode(saved: &Saved) -> Result<io::Result<Vec<u8>>, codec::EncodeError> {
    let Saved { level, ground, known, landmarks } = saved;
    let patch = diff(&LevelMap::default(), &known.map);
    let content = Content {
        site: level.site.clone(),
        level: level.level.clone(),
        frame: ground.frame,
        resolution_m: ground.resolution_m,
        map: wire_patch(&patch, 0, known.revision, false),
        landmarks: Some(landmarks.told().clone()),
    };
    let cbor = codec::to_cbor(&content)?;
    Ok(zstd::bulk::compress(&cbor, ZSTD_LEVEL).map(|payload| {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(Sha256::digest(&payload));
        bytes.extend_from_slice(&payload);
        bytes
    }))
}

fn decode(bytes: &[u8]) -> Result<Saved, String> {
    let rest = bytes.strip_prefix(MAGIC).ok_or("it is not the file of a mirror")?;
    let (version, rest) = rest.split_first_chunk().ok_or("it is cut short")?;
    let version = u32::from_le_bytes(*version);
    if !(1..=VERSION).contains(&version) {
        return Err(format!("it is of format version {version}, and this program knows {VERSION}"));
    }
    let (checksum, payload) = rest.split_first_chunk::<32>().ok_or("it is cut short")?;
    if Sha256::digest(payload) != *checksum {
        return Err("its checksum does not fit".to_owned());
    }
    let cbor = zstd::stream::decode_all(payload).map_err(|e| e.to_string())?;
    if version < VERSION {
        let content: Content<IgnoredAny> = codec::from_cbor(&cbor).map_err(|e| e.to_string())?;
        return content.saved(KnownMap::default());
    }
    let content: Content<v1::Patch> = codec::from_cbor(&cbor).map_err(|e| e.to_string())?;
    let patch = map_patch(&content.map).map_err(|violations| format!("{violations:?}"))?;
    let mut known = KnownMap { revision: content.map.revision, ..KnownMap::default() };
    apply(&patch, &mut known.map);
    content.saved(known)
}
