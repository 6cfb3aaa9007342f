//! What robots found against the published GDB, and what accepting it makes of the draft.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use mapfold_map::changes::{Change, ChangeConfig, ChangeId, Stretch, What, changes};
use mapfold_map::geometry::{Level, Point, Pose};
use mapfold_schema::border::changes::change_id;
use mapfold_schema::border::gdb::object_uuid;
use mapfold_schema::digest;
use mapfold_schema::v1::{GdbObject, GdbPlacement, GdbPrism, GdbSolid, ObjectKind};
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::LevelHandle;
use super::gdb::{GdbError, GdbModel, WireObjects};
use super::open::aside;
use super::recent::Recent;
use super::snapshot::Snapshot;
use crate::store::gdb::GdbVersion;

/// Changes of a level that are kept: at a few heights, each at one revision of the map.
const KEPT_MAX: usize = 4;
/// How high a thing is that is known at one height only, metres.
const UPPER_M: f64 = 1.0;
/// How high an opening is, metres: that of a door.
const OPENING_UPPER_M: f64 = 2.1;
/// Thickness of what is known from one side only, metres.
const THIN_M: f64 = 0.05;
/// How far openings reach out of the faces of what they open, metres.
const BEYOND_M: f64 = 0.05;

/// What robots found, by the identities that it travels under.
pub type Changes = BTreeMap<String, Change>;

/// What the changes depend on: the map's revision, the model's version, and the bits of the height.
type Key = (i64, GdbVersion, u64);

/// The changes of a level that were asked for last.
#[derive(Debug)]
pub(super) struct ChangeCache(Recent<Key, Changes>);

impl Default for ChangeCache {
    fn default() -> Self {
        Self(Recent::new(KEPT_MAX))
    }
}

/// What an operator adds to a change that is accepted.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Details {
    /// What a new thing is.
    pub kind: Option<ObjectKind>,
    /// What it is called.
    pub name: String,
    /// How high a new thing or an opening is, metres.
    pub upper_m: Option<f64>,
}

/// What accepting a change makes of the draft.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Taken {
    /// Objects that are put, by identity.
    pub put: WireObjects,
    /// Objects that are removed.
    pub removed: BTreeSet<Uuid>,
}

/// Why a change cannot be accepted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotAcceptable {
    /// Only a person can say what shape it has now.
    #[error(
        "only walls and what is drawn without thickness are opened by doorways: correct the shape of this object in the draft"
    )]
    NoWall,
    /// The object is another one in the draft already.
    #[error(
        "the draft has changed this object since it was published: look at it there, and correct or dismiss"
    )]
    Redrawn,
}

impl LevelHandle {
    /// What the map of a snapshot says against a model at a height, metres.
    ///
    /// # Errors
    /// [`GdbError::TooCrowded`], or the store fails.
    pub async fn changes(
        &self,
        snapshot: &Arc<Snapshot>,
        model: &Arc<GdbModel>,
        height_m: f64,
    ) -> Result<Arc<Changes>, GdbError> {
        let key = (snapshot.folded_revision(), model.version(), height_m.to_bits());
        let kept = &self.shared.changes.0;
        if let Some(found) = kept.get(&key) {
            return Ok(found);
        }
        let (snapshot, model) = (Arc::clone(snapshot), Arc::clone(model));
        let config = ChangeConfig::standard(snapshot.resolution_m());
        let said = aside(move || {
            let map = snapshot.map();
            Ok(model.plan(height_m, |plan| changes(plan, &map, &config)))
        });
        let named = said.await???.into_iter().map(|(id, change)| (change_id(&id), change));
        let found = Arc::new(named.collect());
        kept.put(key, &found);
        Ok(found)
    }
}

/// Whether the draft says already what accepting a change would make it say.
pub fn is_in_draft(change: &Change, published: &WireObjects, draft: &WireObjects) -> bool {
    match change.id {
        ChangeId::Missing(object) => !draft.contains_key(&object_uuid(object)),
        ChangeId::Moved(object) => {
            let object = object_uuid(object);
            draft.get(&object) != published.get(&object)
        }
        ChangeId::Opened(_) => openings(change).iter().all(|(id, _)| draft.contains_key(id)),
        ChangeId::New(_) => draft.contains_key(&new_object(change)),
    }
}

/// The edit of the draft that takes a change over.
///
/// # Errors
/// [`NotAcceptable`].
pub fn accepting(
    change: &Change,
    details: &Details,
    published: &WireObjects,
    draft: &WireObjects,
) -> Result<Taken, NotAcceptable> {
    let as_published = |object: Uuid| draft.get(&object) == published.get(&object);
    let Taken { mut put, mut removed } = Taken::default();
    match (&change.what, change.id) {
        (What::Missing, ChangeId::Missing(object)) => {
            let object = object_uuid(object);
            if draft.contains_key(&object) && !as_published(object) {
                return Err(NotAcceptable::Redrawn);
            }
            removed.insert(object);
        }
        (What::Moved { motion, .. }, ChangeId::Moved(object)) => {
            let object = object_uuid(object);
            let Some(before) = published.get(&object).filter(|_| as_published(object)) else {
                return Err(NotAcceptable::Redrawn);
            };
            put.insert(object, moved(before, motion));
        }
        (What::Opened { stretches }, ChangeId::Opened(object)) => {
            let object = object_uuid(object);
            let Some(before) = published.get(&object).filter(|_| as_published(object)) else {
                return Err(NotAcceptable::Redrawn);
            };
            if before.kind != ObjectKind::Wall && stretches.iter().any(|s| s.depth > 0.0) {
                return Err(NotAcceptable::NoWall);
            }
            for (id, stretch) in openings(change) {
                put.insert(id, opening(&stretch, details));
            }
        }
        _ => {
            put.insert(new_object(change), thing(&change.hull, details));
        }
    }
    Ok(Taken { put, removed })
}

/// An identity made of a name: the same each time, so that accepting twice is accepting once.
fn derived(name: &str) -> Uuid {
    digest::identity(&Sha256::digest(name).into())
}

fn new_object(change: &Change) -> Uuid {
    derived(&change_id(&change.id))
}

/// The openings that accepting makes, each with its identity: that of the object, and its middle to the decimetre.
fn openings(change: &Change) -> Vec<(Uuid, Stretch)> {
    let What::Opened { stretches } = &change.what else { return Vec::new() };
    let named = stretches.iter().map(|stretch| {
        let middle = (stretch.from + stretch.to) * 5.0;
        let name = format!("{}@{:.0},{:.0}", change_id(&change.id), middle.x, middle.y);
        (derived(&name), *stretch)
    });
    named.collect()
}

/// The object where it stands now.
fn moved(object: &GdbObject, motion: &Pose<Level, Level>) -> GdbObject {
    let placement =
        object.placement.unwrap_or(GdbPlacement { position_m: [0.0; 3], rotation: None });
    let [x, y, z] = placement.position_m;
    let at = motion.act(&Point::new(x, y));
    let [w, i, j, k] = placement.rotation.unwrap_or([1.0, 0.0, 0.0, 0.0]);
    let (s, c) = (0.5 * motion.heading()).sin_cos();
    // The turn about the vertical after the one that the object has: (c, 0, 0, s) * (w, i, j, k).
    let rotation = [c * w - s * k, c * i - s * j, c * j + s * i, c * k + s * w];
    GdbObject {
        placement: Some(GdbPlacement { position_m: [at.x, at.y, z], rotation: Some(rotation) }),
        ..object.clone()
    }
}

/// A doorway where a wall is open.
fn opening(stretch: &Stretch, details: &Details) -> GdbObject {
    let along = (stretch.to - stretch.from).normalize();
    let out = Point::new(-along.y, along.x);
    let (near, far) = (out * BEYOND_M, out * -(stretch.depth + BEYOND_M));
    let base = [stretch.from + far, stretch.to + far, stretch.to + near, stretch.from + near];
    let upper_m = details.upper_m.unwrap_or(OPENING_UPPER_M);
    standing(ObjectKind::Doorway, &base, upper_m, details)
}

/// Something that stands where only its outline is known.
fn thing(hull: &[Point], details: &Details) -> GdbObject {
    let upper_m = details.upper_m.unwrap_or(UPPER_M);
    let kind = details.kind.unwrap_or(ObjectKind::Other);
    let twice_area: f64 = (0..hull.len()).map(|k| hull[k].perp(&hull[(k + 1) % hull.len()])).sum();
    let widest = (0..hull.len()).flat_map(|k| (0..k).map(move |l| (k, l)));
    let widest = widest.map(|(k, l)| (hull[k], hull[l], (hull[k] - hull[l]).norm()));
    let widest = widest.max_by(|a, b| a.2.total_cmp(&b.2));
    let first = hull.first().copied().unwrap_or_default();
    let (from, to, length) = widest.unwrap_or((first, first, 0.0));
    if twice_area >= 2.0 * THIN_M * length && length > 0.0 {
        return standing(kind, hull, upper_m, details);
    }
    // A face, or less: a slab about it.
    let along = if length > 0.0 { (to - from) / length } else { Point::new(1.0, 0.0) };
    let (half, out) = (along * (0.5 * THIN_M), Point::new(-along.y, along.x) * (0.5 * THIN_M));
    let base = [from - half - out, to + half - out, to + half + out, from - half + out];
    standing(kind, &base, upper_m, details)
}

fn standing(kind: ObjectKind, base: &[Point], upper_m: f64, details: &Details) -> GdbObject {
    let ring = base.iter().map(|p| [p.x, p.y]).collect();
    GdbObject {
        name: details.name.clone(),
        kind,
        solids: Some(vec![GdbSolid::Prism(GdbPrism { base_m: vec![ring], lower_m: 0.0, upper_m })]),
        prototype: None,
        placement: None,
        tolerance_m: None,
        trust: None,
        door: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_that_stands_aslant_turns_about_the_vertical() {
        let object = GdbObject {
            placement: Some(GdbPlacement {
                position_m: [1.0, 2.0, 0.5],
                rotation: Some([
                    std::f64::consts::FRAC_1_SQRT_2,
                    0.0,
                    0.0,
                    std::f64::consts::FRAC_1_SQRT_2,
                ]),
            }),
            ..standing(ObjectKind::Machine, &[], 1.0, &Details::default())
        };
        let quarter = Pose::new(10.0, 0.0, std::f64::consts::FRAC_PI_2);
        let placement = moved(&object, &quarter)
            .placement
            .unwrap_or(GdbPlacement { position_m: [0.0; 3], rotation: None });
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(placement.position_m[0], 8.0) && near(placement.position_m[1], 1.0));
        assert!(near(placement.position_m[2], 0.5));
        let half_turn = placement.rotation.unwrap_or_default();
        assert!(near(half_turn[0], 0.0) && near(half_turn[3], 1.0), "{half_turn:?}");
    }

    #[test]
    fn a_face_becomes_a_slab_and_an_outline_a_prism() {
        let base = |hull: &[Point]| match thing(hull, &Details::default()).solids.as_deref() {
            Some([GdbSolid::Prism(prism)]) => prism.base_m[0].clone(),
            other => panic!("{other:?}"),
        };
        let mut face = base(&[Point::new(0.0, 0.0), Point::new(2.0, 0.0)]);
        face.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        assert_eq!(face, [[-0.025, -0.025], [-0.025, 0.025], [2.025, -0.025], [2.025, 0.025]]);
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(base(&corners.map(Point::from)), corners);
    }
}
