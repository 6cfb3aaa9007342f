//! Maps from coordinates within a file to those of the level.

use mapfold_map::gdb::Point3;

/// `p -> columns * p + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Affine {
    pub(super) columns: [Point3; 3],
    pub(super) offset: Point3,
}

impl Affine {
    pub(super) fn scaled(by: f64) -> Self {
        let columns = [Point3::x() * by, Point3::y() * by, Point3::z() * by];
        Self { columns, offset: Point3::zeros() }
    }

    pub(super) fn vector(&self, v: &Point3) -> Point3 {
        self.columns[0] * v.x + self.columns[1] * v.y + self.columns[2] * v.z
    }

    pub(super) fn point(&self, p: &Point3) -> Point3 {
        self.vector(p) + self.offset
    }

    /// First `other`, then this.
    pub(super) fn after(&self, other: &Self) -> Self {
        Self { columns: other.columns.map(|c| self.vector(&c)), offset: self.point(&other.offset) }
    }

    /// The quaternion of a rotation, `[w, x, y, z]`: by the largest of its parts, which is exact enough to
    /// divide by.
    pub(super) fn quaternion(&self) -> [f64; 4] {
        let [x, y, z] = self.columns;
        let trace = x.x + y.y + z.z;
        let parts = if trace >= x.x.max(y.y).max(z.z) {
            [1.0 + trace, y.z - z.y, z.x - x.z, x.y - y.x]
        } else if x.x >= y.y.max(z.z) {
            [y.z - z.y, 1.0 + x.x - y.y - z.z, x.y + y.x, z.x + x.z]
        } else if y.y >= z.z {
            [z.x - x.z, x.y + y.x, 1.0 + y.y - x.x - z.z, y.z + z.y]
        } else {
            [x.y - y.x, z.x + x.z, y.z + z.y, 1.0 + z.z - x.x - y.y]
        };
        let length = parts.iter().map(|part| part * part).sum::<f64>().sqrt();
        parts.map(|part| part / length)
    }
}
