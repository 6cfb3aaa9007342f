//! Triangles as solids: those that stand beside a mesh as long as its numbers are the same, else its triangles.

use std::collections::BTreeMap;

use mapfold_schema::border::gdb::VERTICES_MAX;
use mapfold_schema::v1::{GdbPolyhedron, GdbSolid, ObjectKind};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::super::incoming::FileFault;
use super::accessors::Numbers;
use super::document::Mesh;

/// What we write beside a mesh.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct MeshExtras {
    /// The prototype that it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) prototype: Option<String>,
    /// What its instances are usually.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) kind: Option<ObjectKind>,
    /// What it was made of.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) solids: Option<Vec<GdbSolid>>,
    /// Digest of its numbers when it was made of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) digest: Option<String>,
}

/// A mesh as solids.
#[derive(Debug, Clone)]
pub(super) struct Content {
    pub(super) solids: Vec<GdbSolid>,
    /// Primitives that are no triangles.
    pub(super) skipped: usize,
    /// Whether the solids are those that were written beside it.
    pub(super) is_untouched: bool,
}

/// Digest of a mesh: of the positions and indices of each primitive.
pub(super) fn digest(primitives: &[(Vec<[f32; 3]>, Vec<u32>)]) -> String {
    let mut digest = Sha256::new();
    for (positions, indices) in primitives {
        digest.update((positions.len() as u64).to_le_bytes());
        for number in positions.iter().flatten() {
            digest.update(number.to_le_bytes());
        }
        digest.update((indices.len() as u64).to_le_bytes());
        for index in indices {
            digest.update(index.to_le_bytes());
        }
    }
    digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().concat()
}

/// The solids of a mesh. `budget` is what of vertices may still be read.
pub(super) fn solids(
    mesh: &Mesh,
    index: usize,
    extras: MeshExtras,
    numbers: Numbers<'_>,
    budget: &mut usize,
) -> Result<Content, FileFault> {
    let (mut primitives, mut skipped) = (Vec::new(), 0);
    for (number, primitive) in mesh.primitives.0.iter().enumerate() {
        let place = || format!("/meshes/{index}/primitives/{number}");
        let Some(accessor) = primitive.attributes.position else {
            skipped += 1;
            continue;
        };
        let count = numbers.count(accessor)?;
        let listed = primitive.indices.map(|indices| numbers.count(indices)).transpose()?;
        let spent = budget.checked_sub(count.max(listed.unwrap_or(count)));
        *budget = spent.ok_or_else(|| {
            FileFault::at(place(), format!("more than {VERTICES_MAX} vertices are not taken"))
        })?;
        let positions = numbers.positions(accessor)?;
        let indices = match primitive.indices {
            Some(indices) => numbers.indices(indices)?,
            None => (0..positions.len() as u32).collect(),
        };
        if let Some(wrong) = indices.iter().find(|index| **index as usize >= positions.len()) {
            let fault = format!("index {wrong} is none of {} vertices", positions.len());
            return Err(FileFault::at(place(), fault));
        }
        let triangles = match primitive.mode.unwrap_or(4) {
            4 => indices,
            5 => strip(&indices),
            6 => fan(&indices),
            _ => {
                skipped += 1;
                continue;
            }
        };
        primitives.push((positions, triangles));
    }
    let is_untouched = extras.digest.is_some_and(|written| written == digest(&primitives));
    if is_untouched && let Some(solids) = extras.solids {
        return Ok(Content { solids, skipped, is_untouched });
    }
    let solids = primitives.iter().map(|(positions, triangles)| polyhedron(positions, triangles));
    let solids = solids.filter(|solid| !solid.faces.is_empty()).map(GdbSolid::Polyhedron);
    Ok(Content { solids: solids.collect(), skipped, is_untouched: false })
}

/// Every second triangle of a strip is turned.
fn strip(indices: &[u32]) -> Vec<u32> {
    let turned =
        |(k, w): (usize, &[u32])| if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] };
    indices.windows(3).enumerate().flat_map(turned).collect()
}

fn fan(indices: &[u32]) -> Vec<u32> {
    let Some((hub, rim)) = indices.split_first() else { return Vec::new() };
    rim.windows(2).flat_map(|w| [*hub, w[0], w[1]]).collect()
}

/// Triangles with the vertices that they share: programs repeat a vertex for each face that it is a corner of.
fn polyhedron(positions: &[[f32; 3]], triangles: &[u32]) -> GdbPolyhedron {
    let mut known: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    let mut polyhedron = GdbPolyhedron::default();
    let GdbPolyhedron { vertices_m, faces } = &mut polyhedron;
    let numbers: Vec<u32> = positions
        .iter()
        .map(|position| {
            // Both zeros are one.
            let position = position.map(|number| number + 0.0);
            *known.entry(position.map(f32::to_bits)).or_insert_with(|| {
                vertices_m.push(position.map(f64::from));
                vertices_m.len() as u32 - 1
            })
        })
        .collect();
    for corners in triangles.chunks_exact(3) {
        let ring: Vec<u32> = corners.iter().map(|k| numbers[*k as usize]).collect();
        let has_area = ring[0] != ring[1] && ring[1] != ring[2] && ring[2] != ring[0];
        if has_area {
            faces.push(vec![ring]);
        }
    }
    polyhedron
}
