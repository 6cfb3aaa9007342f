//! The model placed: every object's solids on the grid, ready to be cut.

use super::exact::{PlanPoint, REACH, micrometres};
use super::mesh::Mesh;
use super::shell::is_sound;
use super::{Kind, Model, Object, ObjectId, Placement, Point3, Solid};

/// An object with its solids where they stand.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Standing {
    pub(super) id: ObjectId,
    pub(super) kind: Kind,
    pub(super) tolerance: f64,
    pub(super) trust: f64,
    /// The sound solids, and which of the object's they are.
    pub(super) solids: Vec<(usize, Mesh)>,
}

/// A model with everything placed. Solids with an error, which [`super::findings()`] names, are left out of
/// it: what a draft has right can be looked at while the rest is mended.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// In the order of their ids.
    pub(super) standing: Vec<Standing>,
}

impl Structure {
    /// Places a model.
    pub fn of(model: &Model) -> Self {
        let standing = model.objects.iter().map(|(id, object)| {
            let solids = model.solids(object).unwrap_or_default();
            Standing::of(*id, object, solids)
        });
        Self { standing: standing.collect() }
    }

    /// The smallest and the greatest coordinates of all that stands, metres; `None` if nothing does.
    pub fn extent(&self) -> Option<[Point3; 2]> {
        let all: Vec<_> = self.standing.iter().filter_map(Standing::bounds).collect();
        let lower = |k: usize| all.iter().map(|[from, _]| from[k]).min();
        let upper = |k: usize| all.iter().map(|[_, to]| to[k]).max();
        let metres = |value: Option<i64>| Some(value? as f64 / super::MICROMETRES);
        let from = Point3::new(metres(lower(0))?, metres(lower(1))?, metres(lower(2))?);
        let to = Point3::new(metres(upper(0))?, metres(upper(1))?, metres(upper(2))?);
        Some([from, to])
    }

    /// Heights between which something stands, metres; `None` if nothing does.
    pub fn heights(&self) -> Option<[f64; 2]> {
        let meshes = || self.standing.iter().flat_map(|s| &s.solids).map(|(_, mesh)| mesh);
        let lower = meshes().map(|mesh| mesh.lower).min()?;
        let upper = meshes().map(|mesh| mesh.upper).max()?;
        Some([lower, upper].map(|z| z as f64 / super::MICROMETRES))
    }
}

impl Standing {
    fn of(id: ObjectId, object: &Object, solids: &[Solid]) -> Self {
        let placed = |(index, solid): (usize, &Solid)| {
            let sound = is_sound(solid);
            let mesh = sound.then(|| solid.mesh(&object.placement)).flatten()?;
            Some((index, mesh))
        };
        let within = |value: f64, most: f64, otherwise: f64| {
            if value.is_finite() { value.clamp(0.0, most) } else { otherwise }
        };
        Self {
            id,
            kind: object.kind,
            tolerance: within(object.tolerance, REACH as f64, Object::TOLERANCE),
            trust: within(object.trust, 1.0, 0.0),
            solids: solids.iter().enumerate().filter_map(placed).collect(),
        }
    }

    /// The smallest and the greatest coordinates of all solids, micrometres; `None` if there are none.
    pub(super) fn bounds(&self) -> Option<[[i64; 3]; 2]> {
        let vertices = || self.solids.iter().flat_map(|(_, mesh)| &mesh.vertices);
        vertices().next()?;
        let lower = [0, 1, 2].map(|k| vertices().map(|v| v[k]).min().unwrap_or(0));
        let upper = [0, 1, 2].map(|k| vertices().map(|v| v[k]).max().unwrap_or(0));
        Some([lower, upper])
    }

    /// The edges of the object just above `height` (micrometres): of closed solids, which cover what is on
    /// their left, and of sheets.
    pub(super) fn cut(&self, height: i64) -> [Vec<[PlanPoint; 2]>; 2] {
        let (mut closed, mut sheets) = (Vec::new(), Vec::new());
        for (_, mesh) in &self.solids {
            mesh.cut(height, if mesh.closed { &mut closed } else { &mut sheets });
        }
        [closed, sheets]
    }
}

/// A height in micrometres; heights out of reach meet nothing, like those just within.
pub(super) fn height_on_grid(height: f64) -> i64 {
    micrometres(height).unwrap_or(if height > 0.0 { REACH } else { -REACH })
}

/// Faults of a solid do not depend on where it stands.
pub(super) fn in_place(solid: &Solid) -> Option<Mesh> {
    solid.mesh(&Placement::identity())
}
