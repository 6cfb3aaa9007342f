//! Refolds a level's log from empty and compares it with what is stored.
//!
//! Twice, by two ways: one entry at a time in the order of the log, which also gives the date of
//! each thing's last change, and page by page in reverse order, without what is reverted, as if it
//! had never been there. Both must come to the same map because the fold is a function of the set.

mod acts;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use mapfold_map::level::Level;
use mapfold_schema::digest::content_digest;
use sha2::{Digest, Sha256};

use crate::level::folding::Folding;
use crate::level::gdb;
use crate::level::prior::Imported;
use crate::level::recall::{self, Act, Entry, Logged, Reading};
use crate::level::rows;
use crate::store::acts::{ActRow, Force};
use crate::store::levels::LevelRow;
use crate::store::log::LogRow;
use crate::store::map_rows::{FeatureRow, MapRows, StoredMap};
use crate::store::{Store, StoreError, payload, tile_cells};
use acts::Acts;

/// Rows of the log that are read and folded at once.
const PAGE: u32 = 256;

/// What a check of one level found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// Slug of the site.
    pub site: String,
    /// Slug of the level.
    pub level: String,
    /// Newest revision of the log: the one to which the counts and the digest belong.
    pub revision: i64,
    /// Revision up to which the stored map is folded: the one at which it was compared.
    pub folded_revision: i64,
    /// Contributions read.
    pub contributions: i64,
    /// Those of them that are reverted.
    pub reverted: usize,
    /// Acts read.
    pub acts: usize,
    /// Imports read.
    pub imports: usize,
    /// Entries about the GDB read.
    pub gdb_entries: usize,
    /// Segments of the refolded map.
    pub segments: usize,
    /// Clusters of the refolded map.
    pub clusters: usize,
    /// Chains of the refolded map.
    pub chains: usize,
    /// Tiles of the refolded map.
    pub tiles: usize,
    /// SHA-256 of the refolded map in canonical form, lower-case hexadecimal: equal maps have
    /// equal digests, on every engine and replica.
    pub map_digest: String,
    /// What is wrong, a sentence each; empty if nothing is. At most
    /// [`FAULTS_MAX`](Self::FAULTS_MAX).
    pub faults: Vec<String>,
}

impl Report {
    /// Faults that are listed.
    pub const FAULTS_MAX: usize = 100;

    /// Whether nothing is wrong.
    pub fn is_sound(&self) -> bool {
        self.faults.is_empty()
    }
}

/// Checks one level and, on SQLite, the file; `None` if there is no such level. It may be in use
/// meanwhile.
///
/// # Errors
/// The store cannot be read at all. What can be read and is wrong is in the report.
pub async fn verify(store: &Store, site: &str, level: &str) -> Result<Option<Report>, StoreError> {
    let Some(row) = store.level(site, level).await? else { return Ok(None) };
    let Some(stored) = store.stored_map(site, level).await? else { return Ok(None) };
    // What comes in meanwhile is not looked at.
    let until = row.revision.max(stored.folded_revision);
    let acts = store.acts_between(site, level, 0, until).await?;
    let stored_frames = store.frames_at(site, level, stored.folded_revision).await?;
    let frames = store.frames_at(site, level, until).await?;
    let readings = Readings {
        of_stored: Reading::new(&row, stored_frames),
        of_end: Reading::new(&row, frames),
    };
    let mut check = Check::new(&row, stored, &acts, readings);
    for fault in store.check_file().await? {
        check.fault(format!("database file: {fault}"));
    }
    let mut after = 0;
    loop {
        let mut stretch = store.stretch_after(site, level, after, PAGE).await?;
        stretch.contributions.retain(|row| row.revision <= until);
        stretch.act = stretch.act.filter(|act| act.revision <= until);
        stretch.import = stretch.import.filter(|import| *import <= until);
        stretch.gdb = stretch.gdb.filter(|entry| *entry <= until);
        let Some(end) = stretch.end() else { break };
        after = end;
        check = check.aside(move |check| check.fold(&stretch.contributions)).await?;
        if let Some(act) = stretch.act {
            check = match recall::gather(store, &row, &act).await {
                Ok(act) => check.aside(move |check| check.step_act(act)).await?,
                Err(error @ StoreError::Corrupt { .. }) => {
                    check.pass_over(act.revision, &error.to_string());
                    check
                }
                Err(error) => return Err(error),
            };
        }
        if let Some(import) = stretch.import {
            check = match recall::imported(store, &row, import).await {
                Ok(imported) => check.aside(move |check| check.step_import(imported)).await?,
                Err(error @ StoreError::Corrupt { .. }) => {
                    check.pass_over(import, &error.to_string());
                    check
                }
                Err(error) => return Err(error),
            };
        }
        if let Some(entry) = stretch.gdb {
            check = match gdb::check_entry(store, site, level, entry).await {
                Ok(()) => check.aside(move |check| check.step_gdb(entry)).await?,
                Err(error @ StoreError::Corrupt { .. }) => {
                    check.pass_over(entry, &error.to_string());
                    check
                }
                Err(error) => return Err(error),
            };
        }
    }
    check = check.catch_up(store, &row).await?;
    let later = store.acts_between(site, level, until, i64::MAX).await?;
    Ok(Some(check.report(&row, &later)))
}

/// How rows are read as they are in force.
struct Readings {
    /// At the revision of the stored map.
    of_stored: Reading,
    /// At the end.
    of_end: Reading,
}

struct Check {
    readings: Readings,
    stored: StoredMap,
    stepwise: Folding,
    reversed: Level,
    acts: Acts,
    imports: usize,
    gdb_entries: usize,
    /// Revisions of rows that say of themselves what the acts do not.
    astray: Vec<i64>,
    read: i64,
    /// Revision of the last row that was read.
    last: i64,
    faults: Vec<String>,
}

impl Check {
    fn new(row: &LevelRow, stored: StoredMap, acts: &[ActRow], readings: Readings) -> Self {
        let mut faults = Vec::new();
        let acts = Acts::new(acts, stored.folded_revision, |fault| faults.push(fault));
        faults.truncate(Report::FAULTS_MAX);
        let mut check = Self {
            readings,
            stored,
            stepwise: Folding::empty(&recall::config(row)),
            reversed: Level::new(recall::config(row)),
            acts,
            imports: 0,
            gdb_entries: 0,
            astray: Vec::new(),
            read: 0,
            last: 0,
            faults,
        };
        if check.stored.folded_revision == 0 {
            check.compare_stored();
        }
        check
    }

    fn fault(&mut self, fault: String) {
        if self.faults.len() < Report::FAULTS_MAX {
            self.faults.push(fault);
        }
    }

    /// Folds a page of the log both ways.
    fn fold(&mut self, page: &[LogRow]) {
        let mut logged: Vec<Logged> = Vec::with_capacity(page.len());
        for row in page {
            self.read += 1;
            match self.recall(row, row.revision <= self.stored.folded_revision) {
                Ok(contribution) => logged.push(contribution),
                // Revisions of rows that cannot be read are passed over below, as if held.
                Err(fault) => self.fault(format!("revision {}: {fault}", row.revision)),
            }
            if !self.acts.allow(row.revision, row.state) {
                self.astray.push(row.revision);
            }
            self.follow(row.revision);
        }
        // The stored map may end within the page: the ways must meet there.
        let (until, rest): (Vec<Logged>, Vec<Logged>) =
            logged.into_iter().partition(|l| l.revision <= self.stored.folded_revision);
        for (piece, is_stored) in [(until, true), (rest, false)] {
            if piece.is_empty() {
                continue;
            }
            let force = if is_stored { &self.acts.stored } else { &self.acts.end };
            let in_force = piece.iter().rev().filter(|l| force.has(l.revision, l.held));
            self.reversed.fold(in_force.map(|logged| &*logged.contribution));
            for logged in piece {
                self.step(&Entry::Contribution(logged));
            }
            self.compare_here();
        }
    }

    /// Notes that the log goes on with `revision`.
    fn follow(&mut self, revision: i64) {
        if revision != self.last + 1 {
            let (from, to) = (self.last + 1, revision - 1);
            self.fault(format!("the log has no revision {from} (and on to {to})"));
        }
        self.last = revision;
    }

    fn step(&mut self, entry: &Entry) {
        self.stepwise.pass_over_until(entry.revision());
        if let Err(stray) = self.stepwise.step(entry) {
            self.fault(stray.to_string());
            self.stepwise.pass_over_until(entry.revision() + 1);
        }
    }

    /// Folds an act the way of the log; the other way knows already what is out.
    fn step_act(&mut self, act: Act) {
        self.follow(act.revision);
        self.step(&Entry::Act(Box::new(act)));
        self.compare_here();
    }

    /// Nor are entries about the GDB: that their objects can be read has been looked at.
    fn step_gdb(&mut self, revision: i64) {
        self.gdb_entries += 1;
        self.follow(revision);
        self.step(&Entry::Gdb(revision));
        self.compare_here();
    }

    /// Imports are no part of the fold: only that they can be read is looked at.
    fn step_import(&mut self, imported: Imported) {
        self.imports += 1;
        self.follow(imported.revision);
        self.step(&Entry::Import(Box::new(imported)));
        self.compare_here();
    }

    fn pass_over(&mut self, revision: i64, why: &str) {
        self.follow(revision);
        self.fault(format!("revision {revision}: {why}"));
        self.stepwise.pass_over_until(revision + 1);
        self.compare_here();
    }

    /// Brings the second way from what was out at the stored map's revision to what is out at the
    /// end.
    async fn catch_up(mut self, store: &Store, row: &LevelRow) -> Result<Self, StoreError> {
        let folded_revision = self.stored.folded_revision;
        let Acts { stored, end, .. } = &self.acts;
        // What was held may be in at another place: it leaves and comes anew.
        let change = |before: &Force, after: &Force| -> Vec<i64> {
            let was_held = |revision: &i64| {
                stored.aligned.contains(revision) || end.aligned.contains(revision)
            };
            let moved = after.out.difference(&before.out).filter(|revision| !was_held(revision));
            let aligned = before.aligned.difference(&before.out);
            moved.chain(aligned).filter(|r| **r <= folded_revision).copied().collect()
        };
        let (leaving, coming) = (change(stored, end), change(end, stored));
        for (revisions, is_leaving) in [(leaving, true), (coming, false)] {
            for piece in revisions.chunks(PAGE as usize) {
                let rows = store.log_rows(&row.site, &row.level, piece).await?;
                self = self
                    .aside(move |check| {
                        // What cannot be read was a fault when it was read first.
                        let logged: Vec<Logged> = rows
                            .iter()
                            .filter_map(|row| check.recall(row, is_leaving).ok())
                            .collect();
                        let contributions = logged.iter().map(|logged| &*logged.contribution);
                        if is_leaving {
                            check.reversed.unfold(contributions);
                        } else {
                            check.reversed.fold(contributions);
                        }
                    })
                    .await?;
            }
        }
        Ok(self)
    }

    /// Runs heavy work on a thread that may block.
    async fn aside(
        mut self,
        work: impl FnOnce(&mut Self) + Send + 'static,
    ) -> Result<Self, StoreError> {
        let after = self.last;
        let run = tokio::task::spawn_blocking(move || {
            work(&mut self);
            self
        });
        run.await.map_err(|panic| StoreError::Corrupt {
            table: "contributions",
            key: format!("revisions after {after}"),
            detail: format!("the fold panicked: {panic}"),
        })
    }

    /// A row as it is folded at the revision of the stored map, or at the end.
    fn recall(&self, row: &LogRow, is_stored: bool) -> Result<Logged, String> {
        let uploaded = payload::join(&row.payload.features, &row.payload.evidence)
            .map_err(|e| e.to_string())?;
        let digest = content_digest(&uploaded).map_err(|e| e.to_string())?;
        if digest != row.digest {
            return Err(format!("its digest is {digest}, not {}", row.digest));
        }
        let Readings { of_stored, of_end } = &self.readings;
        recall::whole(row, if is_stored { of_stored } else { of_end }).map_err(|e| e.to_string())
    }

    fn compare_here(&mut self) {
        if self.stepwise.revision() == self.stored.folded_revision {
            self.compare_ways();
            self.compare_stored();
        }
    }

    fn compare_ways(&mut self) {
        if self.stepwise.level().map() != self.reversed.map() {
            let revision = self.stepwise.revision();
            self.fault(format!(
                "revision {revision}: the fold depends on the order, or a revert left traces"
            ));
        }
    }

    fn compare_stored(&mut self) {
        let (rows, revision) = (std::mem::take(&mut self.stored.rows), self.stepwise.revision());
        let refolded = match rows::changed(self.stepwise.history(), -1, revision) {
            Ok(refolded) => refolded,
            Err(error) => return self.fault(error.to_string()),
        };
        let features = |rows: &[FeatureRow]| -> Dated {
            rows.iter()
                .map(|row| (row.feature.clone(), (row.revision, row.content.clone())))
                .collect()
        };
        let tiles = |rows: &MapRows| -> Dated {
            rows.tiles
                .iter()
                .map(|row| (format!("{:?}", row.key), (row.revision, row.is_gone.then(Vec::new))))
                .collect()
        };
        let slices = |rows: &MapRows| -> Dated {
            rows.slices
                .iter()
                .map(|row| (format!("{:?}", row.at), (row.revision, row.content.clone())))
                .collect()
        };
        self.compare("segment", &features(&rows.segments), &features(&refolded.segments));
        self.compare("cluster", &features(&rows.clusters), &features(&refolded.clusters));
        self.compare("chain", &features(&rows.chains), &features(&refolded.chains));
        self.compare("tile", &tiles(&rows), &tiles(&refolded));
        self.compare("evidence", &slices(&rows), &slices(&refolded));
    }

    fn compare(&mut self, kind: &str, stored: &Dated, refolded: &Dated) {
        for (key, (revision, content)) in stored {
            match refolded.get(key) {
                None => self.fault(format!("{kind} {key} is stored but not in the log's fold")),
                Some((_, other)) if other != content => {
                    self.fault(format!("{kind} {key} is stored with other content"));
                }
                Some((other, _)) if other != revision => self.fault(format!(
                    "{kind} {key} is stored as of revision {revision}, but changed at {other}"
                )),
                Some(_) => {}
            }
        }
        for key in refolded.keys().filter(|key| !stored.contains_key(*key)) {
            self.fault(format!("{kind} {key} is not stored"));
        }
    }

    fn report(mut self, row: &LevelRow, later: &[ActRow]) -> Report {
        self.compare_ways();
        for revision in std::mem::take(&mut self.astray) {
            // An act that came while the log was read may have changed the row's word.
            if !later.iter().any(|act| act.moved.binary_search(&revision).is_ok()) {
                let is = if self.acts.end.out.contains(&revision) { "is" } else { "is not" };
                self.fault(format!("revision {revision} {is} reverted, but says otherwise"));
            }
        }
        let revision = self.last;
        if revision < row.revision {
            self.fault(format!("the log ends at revision {revision}, not {}", row.revision));
        }
        if revision < self.stored.folded_revision {
            self.fault(format!(
                "the stored map is of revision {}, which the log has not reached",
                self.stored.folded_revision
            ));
        }
        let map_digest = match map_digest(&self.stepwise) {
            Ok(digest) => digest,
            Err(error) => {
                self.fault(error.to_string());
                String::new()
            }
        };
        let map = self.stepwise.level().map();
        Report {
            site: row.site.clone(),
            level: row.level.clone(),
            revision,
            folded_revision: self.stored.folded_revision,
            contributions: self.read,
            reverted: self.acts.end.out.len(),
            acts: self.acts.count,
            imports: self.imports,
            gdb_entries: self.gdb_entries,
            segments: map.segments.len(),
            clusters: map.clusters.len(),
            chains: map.chains.len(),
            tiles: map.tiles.len(),
            map_digest,
            faults: self.faults,
        }
    }
}

/// Rows by key: revision and content.
type Dated = BTreeMap<String, (i64, Option<Vec<u8>>)>;

/// The digest of what a map holds, without dates: kind, key and content of each thing in order,
/// each with its length before it.
fn map_digest(folding: &Folding) -> Result<String, StoreError> {
    let rows = rows::changed(folding.history(), -1, folding.revision())?;
    let mut digest = Sha256::new();
    let mut add = |kind: &str, key: &str, content: &[u8]| {
        for part in [kind.as_bytes(), key.as_bytes(), content] {
            digest.update((part.len() as u64).to_le_bytes());
            digest.update(part);
        }
    };
    let kinds = [("segment", &rows.segments), ("cluster", &rows.clusters), ("chain", &rows.chains)];
    for (kind, rows) in kinds {
        for row in rows {
            if let Some(content) = &row.content {
                add(kind, &row.feature, content);
            }
        }
    }
    for (key, tile) in &folding.level().map().tiles {
        let cells = tile_cells::bytes(tile);
        add("tile", &format!("{:?}/{}/{}", key.class, key.tile.x, key.tile.y), &cells);
    }
    let mut hex = String::new();
    for byte in digest.finalize() {
        let _ = write!(hex, "{byte:02x}"); // writing to a String cannot fail
    }
    Ok(hex)
}
