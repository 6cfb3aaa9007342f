//! A solid on the grid: vertices in micrometres and faces as loops of them.

use std::collections::BTreeMap;

use super::exact::{PlanPoint, nearest_quotient};

/// A placed solid. Its faces name vertices that are there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Mesh {
    /// The vertices, micrometres.
    pub(super) vertices: Vec<[i64; 3]>,
    /// The loops of each face, the outer one first.
    pub(super) faces: Vec<Vec<Vec<u32>>>,
    /// Whether every edge is walked as often one way as the other, so that the faces enclose something.
    pub(super) closed: bool,
    /// Height of the lowest vertex, micrometres.
    pub(super) lower: i64,
    /// Height of the highest vertex, micrometres.
    pub(super) upper: i64,
}

impl Mesh {
    pub(super) fn new(vertices: Vec<[i64; 3]>, faces: Vec<Vec<Vec<u32>>>) -> Self {
        let heights = || vertices.iter().map(|v| v[2]);
        let (lower, upper) = (heights().min().unwrap_or(0), heights().max().unwrap_or(0));
        let mut mesh = Self { vertices, faces, closed: false, lower, upper };
        mesh.closed = mesh.edges().values().all(|walks| walks.forward == walks.backward);
        mesh
    }

    /// A vertex seen from above.
    pub(super) fn above(&self, vertex: u32) -> PlanPoint {
        let [x, y, _] = self.vertices[vertex as usize];
        PlanPoint { x, y }
    }

    /// The directed edges of one loop.
    pub(super) fn walk(ring: &[u32]) -> impl Iterator<Item = (u32, u32)> {
        ring.iter().copied().zip(ring.iter().copied().cycle().skip(1))
    }

    /// How often each edge is walked in which direction, by its smaller and its greater vertex.
    pub(super) fn edges(&self) -> BTreeMap<(u32, u32), Walks> {
        let mut edges: BTreeMap<(u32, u32), Walks> = BTreeMap::new();
        for (index, face) in self.faces.iter().enumerate() {
            for (a, b) in face.iter().flat_map(|ring| Self::walk(ring)) {
                let walks = edges.entry((a.min(b), a.max(b))).or_default();
                if a < b {
                    walks.forward += 1;
                } else {
                    walks.backward += 1;
                }
                walks.last_face = index;
            }
        }
        edges
    }

    /// Six times the volume that the faces enclose, in cubic micrometres; negative if they are inside out.
    /// Relative to a vertex, so that it is exact where the solid stands.
    pub(super) fn volume_sixfold(&self) -> f64 {
        let Some(origin) = self.vertices.first() else { return 0.0 };
        let at = |v: u32| {
            let p = self.vertices[v as usize];
            nalgebra::Vector3::from([0, 1, 2].map(|k| (p[k] - origin[k]) as f64))
        };
        // A fan over each loop: what it adds outside of the loop, it takes away again.
        let fan = |ring: &Vec<u32>| {
            ring.windows(2)
                .skip(1)
                .map(|w| at(ring[0]).dot(&at(w[0]).cross(&at(w[1]))))
                .sum::<f64>()
        };
        self.faces.iter().flatten().filter(|ring| !ring.is_empty()).map(fan).sum()
    }

    /// Where the plane just above `height` meets the faces: directed edges with the solid on their left.
    ///
    /// A vertex at the height itself is below the plane, so a face in it is not met at all, and every
    /// other loop is crossed upwards as often as downwards. All crossings of a face lie on one line; taken in order
    /// along it, each downward one and its neighbour bound a stretch of the face. Crossings are computed from the edge
    /// alone: what is closed in space is closed in the plan, to the bit.
    pub(super) fn cut(&self, height: i64, edges: &mut Vec<[PlanPoint; 2]>) {
        if height < self.lower || height >= self.upper {
            return;
        }
        let (mut up, mut down) = (Vec::new(), Vec::new());
        for face in &self.faces {
            up.clear();
            down.clear();
            for (a, b) in face.iter().flat_map(|ring| Self::walk(ring)) {
                let (a, b) = (self.vertices[a as usize], self.vertices[b as usize]);
                match (a[2] <= height, b[2] <= height) {
                    (true, false) => up.push(crossing(a, b, height)),
                    (false, true) => down.push(crossing(b, a, height)),
                    _ => {}
                }
            }
            if up.len() > 1 {
                sort_along(&mut up, &mut down);
            }
            edges.extend(down.iter().zip(&up).map(|(d, u)| [*d, *u]).filter(|[d, u]| d != u));
        }
    }
}

/// Sorts points that lie on one line, up to rounding, by their order on it.
fn sort_along(a: &mut [PlanPoint], b: &mut [PlanPoint]) {
    let all = || a.iter().chain(b.iter());
    let extent = |of: fn(&PlanPoint) -> i64| {
        all().map(of).max().unwrap_or(0) - all().map(of).min().unwrap_or(0)
    };
    if extent(|p| p.x) >= extent(|p| p.y) {
        a.sort_unstable();
        b.sort_unstable();
    } else {
        a.sort_unstable_by_key(|p| (p.y, p.x));
        b.sort_unstable_by_key(|p| (p.y, p.x));
    }
}

/// How often an edge is walked, and by which face last.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Walks {
    pub(super) forward: u32,
    pub(super) backward: u32,
    pub(super) last_face: usize,
}

/// The point of an edge at `height`, from its end at or below it to the one above.
fn crossing(low: [i64; 3], high: [i64; 3], height: i64) -> PlanPoint {
    let (rise, whole) = (i128::from(height - low[2]), i128::from(high[2] - low[2]));
    let at = |k: usize| low[k] + nearest_quotient(i128::from(high[k] - low[k]) * rise, whole);
    PlanPoint { x: at(0), y: at(1) }
}
