//! The plan of a model at a height, and its landmarks, as features: outlines as polygons, sheets and openings as lines.

use std::collections::BTreeSet;
use std::io::{self, Write};

use mapfold_map::gdb::{Edge, Plan, PlannedLandmark};
use uuid::Uuid;

use super::{Features, Geometry, Properties, coordinates, ring};
use crate::border::gdb::{object_uuid, wire_gdb_landmark};

/// What a plan shows.
#[derive(serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum PlanShape {
    /// The outline of something that stands in a room, or of the building.
    Obstacle,
    /// The outline of free space within walls.
    Room,
    /// A surface without thickness.
    Sheet,
    /// Where a doorway opens the face of a wall.
    Opening,
}

impl<W: Write> Features<'_, W> {
    /// What a sensor at one height would see, and the landmarks there.
    pub(super) fn model(&mut self, plan: &Plan, landmarks: &[PlannedLandmark]) -> io::Result<()> {
        for (index, outline) in plan.outlines().iter().enumerate() {
            let edges: Vec<Edge<'_>> = plan.edges_of(outline).collect();
            let mut vertices: Vec<[f64; 2]> = edges.iter().map(start).collect();
            let is_room = outline.area() > 0.0;
            if !is_room {
                // RFC 7946 wants outer rings counter-clockwise; plans have free space on the left.
                vertices.reverse();
            }
            let shape = if is_room { PlanShape::Room } else { PlanShape::Obstacle };
            let geometry = Geometry::Polygon([ring(&vertices)]);
            self.plan_feature(&format!("outline-{index}"), geometry, shape, plan, &owners(&edges))?;
        }
        for (index, sheet) in plan.sheets().iter().enumerate() {
            let edges: Vec<Edge<'_>> = plan.edges_of_sheet(sheet).collect();
            let last = edges.last().map(|edge| place(edge.to));
            let vertices = edges.iter().map(start).chain(last).map(coordinates).collect();
            let geometry = Geometry::LineString(vertices);
            let owners = owners(&edges);
            self.plan_feature(
                &format!("sheet-{index}"),
                geometry,
                PlanShape::Sheet,
                plan,
                &owners,
            )?;
        }
        for opening in plan.openings() {
            let doorway = object_uuid(opening.doorway);
            for (index, side) in opening.sides.iter().enumerate() {
                let ends = [side.from, side.to].map(|p| coordinates(place(p)));
                let geometry = Geometry::LineString(ends.to_vec());
                let objects = [doorway, object_uuid(side.wall)];
                let id = format!("{doorway}#{index}");
                self.plan_feature(&id, geometry, PlanShape::Opening, plan, &objects)?;
            }
        }
        for landmark in landmarks {
            let wire = wire_gdb_landmark(landmark);
            self.feature(
                wire.id.clone(),
                Geometry::Point(coordinates(wire.at_m)),
                Properties::Landmark {
                    id: &wire.id,
                    kind: "landmark",
                    shape: wire.kind,
                    heading_rad: wire.heading_rad,
                    covariance: wire.covariance,
                    extent: wire.extent,
                    objects: &wire.objects,
                },
            )?;
        }
        Ok(())
    }

    fn plan_feature(
        &mut self,
        id: &str,
        geometry: Geometry,
        shape: PlanShape,
        plan: &Plan,
        objects: &[Uuid],
    ) -> io::Result<()> {
        let properties =
            Properties::Plan { id, kind: "gdb", shape, height_m: plan.height(), objects };
        self.feature(id.to_owned(), geometry, properties)
    }
}

/// Whose surfaces they are.
fn owners(edges: &[Edge<'_>]) -> Vec<Uuid> {
    let owners: BTreeSet<Uuid> = edges.iter().map(|edge| object_uuid(edge.owner.id)).collect();
    owners.into_iter().collect()
}

fn start(edge: &Edge<'_>) -> [f64; 2] {
    place(edge.from)
}

fn place(at: mapfold_map::gdb::PlanPoint) -> [f64; 2] {
    let p = at.metres();
    [p.x, p.y]
}
