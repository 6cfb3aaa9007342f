//! Features as objects.

use std::collections::BTreeMap;

use mapfold_map::geometry::{Point, convex_hull};
use mapfold_schema::v1::{
    GdbPolyhedron, GdbPrism, GdbPrototype, GdbSolid, ModelFormat, ObjectKind,
};
use uuid::Uuid;

use super::super::dxf::{corners, heights, prism, upright_box};
use super::super::incoming::{FileFault, Found, Incoming, object};
use super::super::jsonfg;
use super::super::paired::{WallConfig, WallLine, walls};
use super::document::{Collection, Document, Drawn, Feature, Position, Said};
use super::globe::{EXTENT_MAX_M, Globe};
use super::nesting::around;

/// How a plan is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Metres of one unit; what the plan says itself if absent, or else it is longitude and latitude.
    pub unit_m: Option<f64>,
    /// Height of walls, metres.
    pub wall_height_m: f64,
}

/// Reads a plan; of JSON-FG a model.
///
/// # Errors
/// What is wrong with it, and in which feature.
pub fn read(
    bytes: &[u8],
    frame: Uuid,
    library: &BTreeMap<String, GdbPrototype>,
    options: &Options,
) -> Result<Incoming, FileFault> {
    let mut found = Found::new(ModelFormat::Geojson, frame, bytes)?;
    let collection = Collection::read(bytes)?;
    if collection.is_json_fg() {
        return jsonfg::read(bytes, frame, library);
    }
    let document = collection.checked()?;
    let metres = metres(&document, options, &mut found)?;
    let mut plan = Plan { found: &mut found, wall_height_m: options.wall_height_m, metres };
    let mut outlines = Outlines::default();
    let mut lines: Vec<WallLine> = Vec::new();
    for (index, feature) in document.features.iter().enumerate() {
        plan.take(feature, index, &mut outlines, &mut lines)?;
    }
    plan.outlines(&outlines)?;
    plan.openings(&outlines.openings)?;
    plan.lines(&lines)?;
    found.settled(library)
}

/// Where a position is in the level, metres.
enum Metres {
    Unit(f64),
    Globe(Globe),
}

impl Metres {
    fn point(&self, position: Position) -> Point {
        let [x, y] = match self {
            Self::Unit(unit) => position.map(|number| number * unit),
            Self::Globe(globe) => globe.metres(position),
        };
        Point::new(x, y)
    }
}

fn metres(document: &Document, options: &Options, found: &mut Found) -> Result<Metres, FileFault> {
    let said = options.unit_m.or(document.in_metres.then_some(1.0));
    if let Some(unit) = said {
        found.scale_m = unit;
        return Ok(Metres::Unit(unit));
    }
    let mut positions = document.features.iter().flat_map(|f| f.drawn.positions()).peekable();
    if positions.peek().is_none() {
        return Ok(Metres::Unit(1.0));
    }
    let globe = Globe::about(positions).ok_or_else(|| {
        let fault = format!(
            "GeoJSON is in degrees of longitude and latitude, and these are none of one building (at most {EXTENT_MAX_M} m): if they \
             are lengths, say how many metres a unit has (`unit_m`)"
        );
        FileFault::at("/features", fault)
    })?;
    let [longitude, latitude] = globe.origin;
    found.warnings.push(format!(
        "it is in degrees: the level's origin is at longitude {longitude:.7}, latitude {latitude:.7}, x is to the east and y to the north"
    ));
    Ok(Metres::Globe(globe))
}

/// What is put together of several features.
#[derive(Default)]
struct Outlines {
    /// Outlines of what is solid, and the places that they are from.
    solid: Vec<(String, Vec<Point>)>,
    rooms: Vec<Vec<Point>>,
    /// By doorway: corners of what it opens, and the place of its first side.
    openings: BTreeMap<String, (String, Vec<Point>)>,
}

struct Plan<'f> {
    found: &'f mut Found,
    wall_height_m: f64,
    metres: Metres,
}

impl Plan<'_> {
    fn take(
        &mut self,
        feature: &Feature,
        index: usize,
        outlines: &mut Outlines,
        lines: &mut Vec<WallLine>,
    ) -> Result<(), FileFault> {
        let place = &feature.place;
        match (&feature.drawn, feature.said) {
            (_, Said::Derived) => {
                self.found.leave_out("landmarks and chains", "they are worked out from walls");
            }
            (Drawn::Other(what), _) => {
                self.found.leave_out(what.clone(), "nothing of a wall is drawn by them");
            }
            (Drawn::Polygons(polygons), Said::Obstacle | Said::Room) => {
                for ring in polygons.iter().filter_map(|rings| rings.first()) {
                    let ring = self.ring(ring);
                    match feature.said {
                        Said::Room => outlines.rooms.push(ring),
                        _ => outlines.solid.push((place.clone(), ring)),
                    }
                }
            }
            (Drawn::Polygons(polygons), Said::Object(kind)) => {
                self.solids(feature, kind, polygons)?;
            }
            (Drawn::Polygons(polygons), Said::Cluster) => {
                self.solids(feature, ObjectKind::Other, polygons)?;
            }
            (Drawn::Polygons(polygons), _) => {
                // What is not said to be solid may be a room.
                let rings: Vec<Vec<Position>> = polygons.iter().flatten().cloned().collect();
                self.wall_lines(&rings, index, lines);
            }
            (Drawn::Lines(drawn), Said::Sheet) => self.sheets(feature, drawn)?,
            (Drawn::Lines(drawn), Said::Opening) => {
                let corners = drawn.iter().flatten().map(|p| self.metres.point(*p));
                let entry = outlines.openings.entry(feature.owner.clone());
                entry.or_insert_with(|| (place.clone(), Vec::new())).1.extend(corners);
            }
            (
                Drawn::Lines(drawn),
                Said::Object(ObjectKind::Wall) | Said::Nothing | Said::Segment,
            ) => {
                self.wall_lines(drawn, index, lines);
            }
            (Drawn::Lines(_), _) => {
                self.found
                    .leave_out("open lines of other things than walls", "they enclose nothing");
            }
        }
        Ok(())
    }

    /// A ring in metres, without its first corner once more.
    fn ring(&self, ring: &[Position]) -> Vec<Point> {
        let points: Vec<Point> = ring.iter().map(|p| self.metres.point(*p)).collect();
        corners(&points).into_iter().map(Point::from).collect()
    }

    fn wall_lines(&self, drawn: &[Vec<Position>], feature: usize, lines: &mut Vec<WallLine>) {
        for line in drawn {
            let points: Vec<Point> = line.iter().map(|p| self.metres.point(*p)).collect();
            let pairs = points.windows(2).map(|ends| [ends[0], ends[1]]);
            lines.extend(pairs.map(|ends| WallLine { ends, heights: None, line: feature }));
        }
    }

    /// Polygons of an object, drawn up together.
    fn solids(
        &mut self,
        feature: &Feature,
        kind: ObjectKind,
        polygons: &[Vec<Vec<Position>>],
    ) -> Result<(), FileFault> {
        let [lower_m, upper_m] = heights(kind, self.wall_height_m);
        let mut solids = Vec::new();
        for rings in polygons {
            let rings: Vec<Vec<Point>> = rings.iter().map(|ring| self.ring(ring)).collect();
            let drawn_up = rings.iter().filter_map(|ring| match prism(ring, [lower_m, upper_m])? {
                GdbSolid::Prism(prism) => prism.base_m.into_iter().next(),
                _ => None,
            });
            let base_m: Vec<Vec<[f64; 2]>> = drawn_up.collect();
            if !base_m.is_empty() {
                solids.push(GdbSolid::Prism(GdbPrism { base_m, lower_m, upper_m }));
            }
        }
        if solids.is_empty() {
            self.found.leave_out("polygons", "they enclose nothing");
            return Ok(());
        }
        let mut made = object(kind, &feature.name);
        made.solids = Some(solids);
        self.found.put(&feature.place, None, made)
    }

    /// Surfaces without thickness, upright.
    fn sheets(&mut self, feature: &Feature, drawn: &[Vec<Position>]) -> Result<(), FileFault> {
        let [lower, upper] = heights(ObjectKind::Wall, self.wall_height_m);
        let mut solids = Vec::new();
        for line in drawn {
            let points: Vec<Point> = line.iter().map(|p| self.metres.point(*p)).collect();
            let vertices = points.iter().flat_map(|p| [[p.x, p.y, lower], [p.x, p.y, upper]]);
            let vertices_m: Vec<[f64; 3]> = vertices.collect();
            let faces = (1..points.len() as u32).map(|k| {
                let (low, next) = (2 * (k - 1), 2 * k);
                vec![vec![low, next, next + 1, low + 1]]
            });
            let faces: Vec<Vec<Vec<u32>>> = faces.collect();
            if !faces.is_empty() {
                solids.push(GdbSolid::Polyhedron(GdbPolyhedron { vertices_m, faces }));
            }
        }
        if solids.is_empty() {
            return Ok(());
        }
        let mut made = object(ObjectKind::Wall, &feature.name);
        made.solids = Some(solids);
        self.found.put(&feature.place, None, made)
    }

    /// What is solid, with its rooms as holes.
    fn outlines(&mut self, outlines: &Outlines) -> Result<(), FileFault> {
        if outlines.solid.is_empty() {
            return Ok(());
        }
        let solid: Vec<Vec<Point>> = outlines.solid.iter().map(|(_, ring)| ring.clone()).collect();
        let mut holes: Vec<Vec<Vec<[f64; 2]>>> = vec![Vec::new(); solid.len()];
        for (room, around) in outlines.rooms.iter().zip(around(&outlines.rooms, &solid)?) {
            match around {
                Some(index) => holes[index].push(corners(room)),
                None => self.found.leave_out("rooms", "no outline of walls is round them"),
            }
        }
        let [lower_m, upper_m] = heights(ObjectKind::Wall, self.wall_height_m);
        for ((place, ring), holes) in outlines.solid.iter().zip(holes) {
            let mut base_m = vec![corners(ring)];
            if base_m[0].len() < 3 {
                self.found.leave_out("outlines", "they enclose nothing");
                continue;
            }
            base_m.extend(holes.into_iter().filter(|hole| hole.len() > 2));
            let mut made = object(ObjectKind::Wall, "");
            made.solids = Some(vec![GdbSolid::Prism(GdbPrism { base_m, lower_m, upper_m })]);
            self.found.put(place, None, made)?;
        }
        let words = format!(
            "outlines of a plan do not tell what they are of: they come in as walls, {upper_m} m high"
        );
        self.found.warnings.push(words);
        Ok(())
    }

    /// Doorways between the faces that they open, and the walls over them.
    fn openings(
        &mut self,
        openings: &BTreeMap<String, (String, Vec<Point>)>,
    ) -> Result<(), FileFault> {
        for (place, corners) in openings.values() {
            let hull = convex_hull(corners);
            for (kind, what) in
                [(ObjectKind::Wall, ", the wall over it"), (ObjectKind::Doorway, "")]
            {
                let Some(solid) = prism(&hull, heights(kind, self.wall_height_m)) else {
                    if kind == ObjectKind::Doorway {
                        let why = "they open one face, or a wall without thickness";
                        self.found.leave_out("doorways", why);
                    }
                    continue;
                };
                let mut made = object(kind, "");
                made.solids = Some(vec![solid]);
                self.found.put(&format!("{place}{what}"), None, made)?;
            }
        }
        Ok(())
    }

    /// Lines of walls: two alongside each other are the faces of one.
    fn lines(&mut self, lines: &[WallLine]) -> Result<(), FileFault> {
        let drawn = walls(lines, &WallConfig::STANDARD);
        drawn.tell(self.found);
        let heights = heights(ObjectKind::Wall, self.wall_height_m);
        for (index, wall) in drawn.found.iter().enumerate() {
            let made = upright_box(ObjectKind::Wall, wall.ends, wall.thickness, heights);
            self.found.put(&format!("/features/{}, wall {index}", wall.line), None, made)?;
        }
        Ok(())
    }
}
