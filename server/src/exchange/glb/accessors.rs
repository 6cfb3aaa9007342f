//! Numbers in the binary part, bounds checked before anything is laid out.

use super::super::incoming::FileFault;
use super::document::{Accessor, Gltf};

const BYTE: u32 = 5121;
const SHORT: u32 = 5123;
pub(super) const INT: u32 = 5125;
pub(super) const FLOAT: u32 = 5126;

/// Reads numbers of one file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Numbers<'a> {
    pub(super) gltf: &'a Gltf,
    pub(super) binary: &'a [u8],
}

impl<'a> Numbers<'a> {
    /// Positions of vertices, as bits of single floats.
    pub(super) fn positions(self, index: usize) -> Result<Vec<[f32; 3]>, FileFault> {
        let place = place(index);
        let accessor = self.accessor(index)?;
        if accessor.component_type != FLOAT || accessor.kind != "VEC3" {
            return Err(FileFault::at(place, "positions are three floats each"));
        }
        let mut positions = Vec::with_capacity(accessor.count);
        for element in self.elements(index, 12)? {
            let number = |k: usize| {
                let bytes = element.get(4 * k..4 * k + 4)?.try_into().ok()?;
                Some(f32::from_le_bytes(bytes)).filter(|number| number.is_finite())
            };
            let position = [number(0), number(1), number(2)];
            let [Some(x), Some(y), Some(z)] = position else {
                let fault = format!("position {} is no number", positions.len());
                return Err(FileFault::at(place, fault));
            };
            positions.push([x, y, z]);
        }
        Ok(positions)
    }

    /// Indices of vertices.
    pub(super) fn indices(self, index: usize) -> Result<Vec<u32>, FileFault> {
        let accessor = self.accessor(index)?;
        let width = match accessor.component_type {
            BYTE => 1,
            SHORT => 2,
            INT => 4,
            _ => {
                return Err(FileFault::at(
                    place(index),
                    "indices are whole numbers without a sign",
                ));
            }
        };
        if accessor.kind != "SCALAR" {
            return Err(FileFault::at(place(index), "indices are single numbers"));
        }
        let number =
            |element: &[u8]| element.iter().rev().fold(0, |n, byte| n << 8 | u32::from(*byte));
        Ok(self.elements(index, width)?.map(number).collect())
    }

    /// How many elements an accessor has: known to be there.
    pub(super) fn count(self, index: usize) -> Result<usize, FileFault> {
        self.accessor(index).map(|accessor| accessor.count)
    }

    fn accessor(self, index: usize) -> Result<&'a Accessor, FileFault> {
        let accessor = self.gltf.accessors.0.get(index);
        accessor.ok_or_else(|| FileFault::at(place(index), "there is no such accessor"))
    }

    fn elements(
        self,
        index: usize,
        width: usize,
    ) -> Result<impl Iterator<Item = &'a [u8]>, FileFault> {
        let accessor = self.accessor(index)?;
        let fault = |fault: &str| FileFault::at(place(index), fault);
        if accessor.sparse.is_some() {
            return Err(fault("sparse accessors are not read"));
        }
        let view = accessor.buffer_view.and_then(|view| self.gltf.buffer_views.0.get(view));
        let view = view.ok_or_else(|| fault("it has no view of a buffer"))?;
        if view.buffer != 0 {
            return Err(fault("only the binary part of the file itself is read"));
        }
        let stride = view.byte_stride.unwrap_or(width);
        if stride < width || stride > 252 {
            return Err(fault("its elements overlap, or lie too far apart"));
        }
        let end = view.byte_offset.checked_add(view.byte_length);
        let bytes = end.and_then(|end| self.binary.get(view.byte_offset..end));
        let bytes = bytes.and_then(|bytes| bytes.get(accessor.byte_offset..));
        let bytes = bytes.ok_or_else(|| fault("it begins or ends beyond the binary part"))?;
        let needed = match accessor.count.checked_sub(1) {
            None => Some(0),
            Some(before) => before.checked_mul(stride).and_then(|n| n.checked_add(width)),
        };
        if needed.is_none_or(|needed| needed > bytes.len()) {
            return Err(fault("it has more elements than the binary part"));
        }
        Ok((0..accessor.count).map(move |k| &bytes[k * stride..k * stride + width]))
    }
}

fn place(index: usize) -> String {
    format!("/accessors/{index}")
}
