//! From a placed model to its plan at one height.

use std::collections::BTreeMap;

use super::arrangement::{Copy, Drawn, Part, arrange_within};
use super::contours::{Bordering, rings, straightened};
use super::exact::{PlanPoint, along, side};
use super::structure::{Standing, height_on_grid};
use super::winding::Cover;
use super::{Kind, Opening, OpeningSide, Outline, Owner, Plan, Sheet, Structure, TooCrowded};

const WALLS: usize = 0;
const DOORWAYS: usize = 1;
const THINGS: usize = 2;
/// What makes a difference to a plan.
type Layers = Cover<3>;

/// Whether a place is solid. Doorways take out walls, and nothing else.
fn solid(cover: &Layers) -> bool {
    cover[THINGS] > 0 || (cover[WALLS] > 0 && cover[DOORWAYS] <= 0)
}

/// The same with all doorways walled up.
fn solid_walled_up(cover: &Layers) -> bool {
    cover[THINGS] > 0 || cover[WALLS] > 0
}

impl Structure {
    /// The plan at `height` (metres above the level's floor): the cut just above it.
    pub fn plan(&self, height: f64) -> Plan {
        plan(self.standing.iter(), height_on_grid(height))
    }

    /// The same for a model that anybody may have drawn: whose plan has more than `most` crossings or
    /// stretches is too crowded, and takes no more room than so many.
    ///
    /// # Errors
    /// [`TooCrowded`].
    pub fn plan_within(&self, height: f64, most: usize) -> Result<Plan, TooCrowded> {
        plan_within(self.standing.iter(), height_on_grid(height), most).ok_or(TooCrowded { most })
    }
}

/// The plan of some objects, which come in the order of their ids.
pub(super) fn plan<'a>(standing: impl Iterator<Item = &'a Standing>, height: i64) -> Plan {
    plan_within(standing, height, usize::MAX).unwrap_or_else(|| Plan::empty(height))
}

fn plan_within<'a>(
    standing: impl Iterator<Item = &'a Standing>,
    height: i64,
    most: usize,
) -> Option<Plan> {
    let (mut owners, mut drawn) = (Vec::new(), Vec::new());
    for object in standing {
        let layer = match object.kind {
            Kind::Corridor => continue,
            Kind::Wall => WALLS,
            Kind::Doorway => DOORWAYS,
            Kind::Machine | Kind::Furniture | Kind::Other => THINGS,
        };
        let owner = owners.len() as u32;
        let Standing { id, kind, tolerance, trust, .. } = *object;
        owners.push(Owner { id, kind, tolerance, trust });
        let [closed, sheets] = object.cut(height);
        drawn.extend(closed.into_iter().map(|ends| Drawn { ends, layer: Some(layer), owner }));
        if object.kind != Kind::Doorway {
            drawn.extend(sheets.into_iter().map(|ends| Drawn { ends, layer: None, owner }));
        }
    }
    let (parts, work) = arrange_within::<3>(drawn, most)?;
    let mut plan = Plan {
        height,
        outlines: outlines(&parts, &owners, solid),
        sheets: sheets(&parts, &owners),
        openings: openings(&parts, &owners),
        walled_up: outlines(&parts, &owners, solid_walled_up),
        owners,
        work,
    };
    plan.openings.retain(|opening| !opening.sides.is_empty());
    Some(plan)
}

/// The part as a border with what is solid on its right.
fn bordering(part: &Part<3>, solid_above: bool, copy: &Copy) -> Bordering {
    let (from, to) = if solid_above { (part.right, part.left) } else { (part.left, part.right) };
    Bordering { from, to, owner: copy.owner, drawn: copy.drawn }
}

/// Whose surface a part is, that is solid on one side. Of several, the first; `None` if it borders nothing
/// solid, or is inside of it.
fn surface(part: &Part<3>, owners: &[Owner], solid: fn(&Layers) -> bool) -> Option<Bordering> {
    let solid_above = solid(&part.above);
    if solid_above == solid(&part.below) {
        return None;
    }
    let solid_cover = if solid_above { &part.above } else { &part.below };
    let is_surface = |copy: &&Copy| {
        let kind = owners[copy.owner as usize].kind;
        // A doorway leaves its jambs: it covers the side that is free.
        copy.layer.is_some() && (copy.covers_above == solid_above) == (kind != Kind::Doorway)
    };
    // Inside a doorway a wall is no surface, though it may lie on that of something else.
    let counts =
        |copy: &&Copy| copy.layer.is_some_and(|layer| layer != WALLS || solid_cover[DOORWAYS] <= 0);
    let of = |copy: &&Copy| is_surface(copy) && counts(copy);
    let copy = part.copies.iter().filter(of).min_by_key(|copy| {
        // What a doorway only touches is not its own.
        (copy.layer == Some(DOORWAYS), copy.owner, copy.drawn)
    });
    let copy = copy.or_else(|| part.copies.iter().find(is_surface)).or(part.copies.first())?;
    Some(bordering(part, solid_above, copy))
}

fn outlines(parts: &[Part<3>], owners: &[Owner], solid: fn(&Layers) -> bool) -> Vec<Outline> {
    let border = parts.iter().filter_map(|part| surface(part, owners, solid)).collect();
    let outlines = rings(border).into_iter().map(|ring| straightened(&ring, true));
    let mut outlines: Vec<Outline> =
        outlines.filter(|edges| edges.len() > 2).map(|edges| Outline { edges }).collect();
    outlines.sort_unstable_by(|a, b| a.edges.cmp(&b.edges));
    outlines
}

/// Stretches of walls' faces within doorways: a wall on one side of them only, in a doorway on that side.
fn openings(parts: &[Part<3>], owners: &[Owner]) -> Vec<Opening> {
    let mut by_doorway: BTreeMap<u32, Vec<Bordering>> = BTreeMap::new();
    let within = doorways_of_faces(parts);
    for (part, doorway) in parts.iter().zip(within) {
        let Some(doorway) = doorway else { continue };
        let wall_above = part.above[WALLS] > 0;
        let wall_of = |copy: &&Copy| copy.layer == Some(WALLS) && copy.covers_above == wall_above;
        if let Some(copy) = part.copies.iter().filter(wall_of).min_by_key(|c| (c.owner, c.drawn)) {
            by_doorway.entry(doorway).or_default().push(bordering(part, wall_above, copy));
        }
    }
    let opening = |(doorway, faces): (u32, Vec<Bordering>)| {
        let opened = |edge: Bordering| OpeningSide {
            wall: owners[edge.owner as usize].id,
            from: edge.from,
            to: edge.to,
        };
        let joined =
            paths(&faces, true).into_iter().flat_map(|path| straightened(&path.edges, false));
        let mut sides: Vec<OpeningSide> = joined.map(opened).collect();
        sides.sort_unstable();
        Opening { doorway: owners[doorway as usize].id, sides }
    };
    by_doorway.into_iter().map(opening).collect()
}

/// For each part that is a wall's face in the open, the doorway that it lies in.
///
/// The cover tells that there is one, not which. It is found by arranging each doorway's border with the
/// faces near it; the middle of a face that lies in a doorway is inside or on the border of it.
fn doorways_of_faces(parts: &[Part<3>]) -> Vec<Option<u32>> {
    let mut borders: BTreeMap<u32, DoorwayBorder> = BTreeMap::new();
    for part in parts {
        for copy in part.copies.iter().filter(|copy| copy.layer == Some(DOORWAYS)) {
            borders.entry(copy.owner).or_default().add(part, copy);
        }
    }
    // By the left ends of their boxes; a face asks those whose boxes can hold it.
    let mut doorways: Vec<(u32, DoorwayBorder)> = borders.into_iter().collect();
    doorways.sort_by_key(|(owner, border)| (border.corners[0], *owner));
    let width = |border: &DoorwayBorder| border.corners[1].x - border.corners[0].x;
    let widest = doorways.iter().map(|(_, border)| width(border)).max().unwrap_or(0);
    let doorway = |part: &Part<3>| {
        let (above, below) = (&part.above, &part.below);
        let walled = if above[WALLS] > 0 { above } else { below };
        let is_face = (above[WALLS] > 0) != (below[WALLS] > 0);
        if !is_face || walled[DOORWAYS] <= 0 || above[THINGS] > 0 || below[THINGS] > 0 {
            return None;
        }
        let left = |border: &DoorwayBorder| border.corners[0].x;
        let start = doorways.partition_point(|(_, b)| left(b) < part.left.x - widest);
        let near = doorways[start..].iter().take_while(|(_, b)| left(b) <= part.left.x);
        near.filter(|(_, border)| border.holds(part)).map(|(owner, _)| *owner).min()
    };
    parts.iter().map(doorway).collect()
}

/// The border of one doorway in a plan.
#[derive(Default)]
struct DoorwayBorder {
    /// Left and right end of each part of it, and what crossing it upwards adds.
    parts: Vec<([PlanPoint; 2], i32)>,
    /// The smallest and the greatest coordinates.
    corners: [PlanPoint; 2],
}

impl DoorwayBorder {
    fn add(&mut self, part: &Part<3>, copy: &Copy) {
        for p in [part.left, part.right] {
            let [low, high] = if self.parts.is_empty() { [p, p] } else { self.corners };
            self.corners = [
                PlanPoint { x: low.x.min(p.x), y: low.y.min(p.y) },
                PlanPoint { x: high.x.max(p.x), y: high.y.max(p.y) },
            ];
            if p == part.left {
                self.parts.push(([part.left, part.right], if copy.covers_above { 1 } else { -1 }));
            }
        }
    }

    /// Whether the middle of a part lies inside or on the border, which it does not cross.
    fn holds(&self, part: &Part<3>) -> bool {
        let [low, high] = self.corners;
        let boxed = |p: PlanPoint| low.x <= p.x && p.x <= high.x && low.y <= p.y && p.y <= high.y;
        if !boxed(part.left) || !boxed(part.right) {
            return false;
        }
        // Twice the middle is on the grid.
        let middle = PlanPoint { x: part.left.x + part.right.x, y: part.left.y + part.right.y };
        let mut cover = 0;
        for (ends, added) in &self.parts {
            let [left, right] = ends.map(|p| PlanPoint { x: 2 * p.x, y: 2 * p.y });
            let height = side(left, right, middle);
            if height == 0 && along(middle, left, right) <= 0 {
                return true;
            }
            // As in the sweep: a vertical line, infinitesimally tilted.
            if left <= middle && middle < right && height > 0 {
                cover += added;
            }
        }
        cover > 0
    }
}

fn sheets(parts: &[Part<3>], owners: &[Owner]) -> Vec<Sheet> {
    let free = |part: &&Part<3>| !solid(&part.above) && !solid(&part.below);
    let thin = |part: &Part<3>| {
        let opened = part.above[DOORWAYS] > 0 || part.below[DOORWAYS] > 0;
        let stays = |copy: &&Copy| {
            let kind = owners[copy.owner as usize].kind;
            copy.layer.is_none() && !(opened && kind == Kind::Wall)
        };
        let copy = part.copies.iter().filter(stays).min_by_key(|c| (c.owner, c.drawn))?;
        Some(bordering(part, false, copy))
    };
    let parts: Vec<Bordering> = parts.iter().filter(free).filter_map(thin).collect();
    let joined = paths(&parts, false)
        .into_iter()
        .map(|path| Sheet { edges: straightened(&path.edges, false), ends_free: path.ends_free });
    let mut sheets: Vec<Sheet> = joined.collect();
    sheets.sort_unstable_by(|a, b| a.edges.cmp(&b.edges));
    sheets
}

/// Edges joined end to end where exactly two meet; if not `directed`, in whichever direction they ran.
fn paths(edges: &[Bordering], directed: bool) -> Vec<Sheet> {
    let mut at: BTreeMap<PlanPoint, Vec<usize>> = BTreeMap::new();
    for (index, edge) in edges.iter().enumerate() {
        at.entry(edge.from).or_default().push(index);
        at.entry(edge.to).or_default().push(index);
    }
    let mut used = vec![false; edges.len()];
    let mut paths = Vec::new();
    let ends = at.iter().filter(|(_, met)| met.len() != 2).map(|(p, _)| *p);
    // Rings have no end: whatever the ends did not lead to starts at its smallest vertex.
    for start in ends.chain(at.keys().copied()) {
        for first in at[&start].clone() {
            let (mut path, mut here, mut next) = (Vec::new(), start, Some(first));
            let fits = |index: usize, here| !directed || edges[index].from == here;
            while let Some(index) = next.filter(|index| !used[*index] && fits(*index, here)) {
                used[index] = true;
                let mut edge = edges[index];
                if edge.from != here {
                    (edge.from, edge.to) = (edge.to, edge.from);
                }
                here = edge.to;
                path.push(edge);
                let met = &at[&here];
                next = (met.len() == 2).then(|| if met[0] == index { met[1] } else { met[0] });
            }
            if !path.is_empty() {
                let ends_free = [start, here].map(|p| at[&p].len() == 1);
                paths.push(Sheet { edges: path, ends_free });
            }
        }
    }
    paths
}
