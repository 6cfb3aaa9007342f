//! Solids seen from above, with the heights that they take up: the model in two and a half dimensions.

use super::arrangement::{Drawn, arrange};
use super::contours::{Bordering, rings, straightened};
use super::mesh::Mesh;
use super::{MICROMETRES, ObjectId, Outline, Structure};

/// The shadow of one solid on the floor, and the heights between which it stands.
///
/// Of a solid that is not upright it is all that any height of it covers. A sheet that stands upright has no outline.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    /// Whose solid it is.
    pub object: ObjectId,
    /// Which of the object's solids.
    pub solid: usize,
    /// Height of its lowest point, metres.
    pub lower: f64,
    /// Height of its highest point, metres.
    pub upper: f64,
    /// Its shadow's outlines, with free space on the left of each: the outer one clockwise, holes counter-clockwise.
    pub outlines: Vec<Outline>,
}

/// The footprints of all sound solids, by object and by solid.
pub fn footprints(structure: &Structure) -> Vec<Footprint> {
    let of_each = structure.standing.iter().flat_map(|object| {
        object.solids.iter().map(|(solid, mesh)| Footprint {
            object: object.id,
            solid: *solid,
            lower: mesh.lower as f64 / MICROMETRES,
            upper: mesh.upper as f64 / MICROMETRES,
            outlines: shadow(mesh),
        })
    });
    of_each.collect()
}

/// The union of the faces' shadows. Each face is a layer's worth of cover, turned the right way up as a whole, so
/// that holes stay holes.
fn shadow(mesh: &Mesh) -> Vec<Outline> {
    let mut drawn = Vec::new();
    for face in &mesh.faces {
        let edges = || face.iter().flat_map(|ring| Mesh::walk(ring));
        let origin = mesh.above(face[0][0]);
        let twice_area: i128 =
            edges().map(|(a, b)| super::exact::side(origin, mesh.above(a), mesh.above(b))).sum();
        if twice_area == 0 {
            continue;
        }
        drawn.extend(edges().map(|(a, b)| {
            let ends = [mesh.above(a), mesh.above(b)];
            let ends = if twice_area > 0 { ends } else { [ends[1], ends[0]] };
            Drawn { ends, layer: Some(0), owner: 0 }
        }));
    }
    let (parts, _) = arrange::<1>(drawn);
    let border = parts.iter().filter_map(|part| {
        let above = part.above[0] > 0;
        if above == (part.below[0] > 0) {
            return None;
        }
        let (from, to) = if above { (part.right, part.left) } else { (part.left, part.right) };
        Some(Bordering { from, to, owner: 0, drawn: part.copies.first()?.drawn })
    });
    let outlines = rings(border.collect()).into_iter().map(|ring| straightened(&ring, true));
    outlines.filter(|edges| edges.len() > 2).map(|edges| Outline { edges }).collect()
}
