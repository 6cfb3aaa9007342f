//! A model as a drawing in metres: what is drawn up as outlines with a height, free faces as faces, prototypes as blocks.
//!
//! In the words of release 12, which everything reads. Solids stand where they stand in the level: an object's own
//! placement is not kept, but that of instances is.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, Write};

use mapfold_map::gdb::{Kind, Placement, Point3, Shape, Solid};
use mapfold_map::geometry::Point;
use mapfold_schema::v1::GdbObject;
use uuid::Uuid;

use super::super::affine::Affine;
use super::super::outgoing::Outgoing;
use super::layers::layer_of;
use super::{APPLICATION, tagged};

/// Letters of one string of extended data.
const STRING_MAX: usize = 200;

/// Writes a model. Instances of prototypes that nobody has are left out.
///
/// # Errors
/// What `to` cannot take.
pub fn write(model: Outgoing<'_>, to: &mut impl Write) -> io::Result<()> {
    let mut out = Writer { to };
    out.header()?;
    let names = block_names(&model);
    out.section("BLOCKS")?;
    for (prototype, block) in &names {
        let wire = model.library.get(*prototype);
        let kind = wire.and_then(|wire| wire.kind);
        let mut tags = vec![(tagged::PROTOTYPE, (*prototype).to_owned())];
        tags.extend(kind.map(|kind| (tagged::KIND, word(&kind))));
        out.texts(&[(0, "BLOCK"), (8, "0"), (2, block), (70, "0")])?;
        out.position(10, &Point3::zeros())?;
        out.text(3, block)?;
        out.tags(&tags)?;
        if let Some(mapped) = model.model.prototypes.get(*prototype) {
            out.solids("0", &mapped.solids, &Placement::identity(), &[])?;
        }
        out.texts(&[(0, "ENDBLK"), (8, "0")])?;
    }
    out.text(0, "ENDSEC")?;
    out.section("ENTITIES")?;
    for (id, wire, object) in model.pairs() {
        let layer = layer_of(wire.kind);
        let tags = tags_of(id, wire);
        match &object.shape {
            Shape::Own(solids) => out.solids(layer, solids, &object.placement, &tags)?,
            Shape::Instance(prototype) => {
                if let Some(block) = names.get(&**prototype) {
                    out.insert(layer, block, &object.placement, &tags)?;
                }
            }
        }
    }
    out.texts(&[(0, "ENDSEC"), (0, "EOF")])
}

/// What is said beside each entity of an object.
fn tags_of(id: Uuid, object: &GdbObject) -> Vec<(&'static str, String)> {
    let mut tags = vec![(tagged::ID, id.to_string()), (tagged::KIND, word(&object.kind))];
    if !object.name.is_empty() {
        tags.push((tagged::NAME, object.name.clone()));
    }
    tags.extend(object.tolerance_m.map(|value| (tagged::TOLERANCE, value.to_string())));
    tags.extend(object.trust.map(|value| (tagged::TRUST, value.to_string())));
    if let Some(door) = &object.door {
        tags.push((tagged::DOOR, word(&door.kind)));
        tags.extend(door.opens_rad.map(|value| (tagged::OPENS, value.to_string())));
    }
    tags
}

/// The word that a kind travels as.
fn word(kind: &impl serde::Serialize) -> String {
    let value = serde_json::to_value(kind).unwrap_or_default();
    value.as_str().unwrap_or_default().to_owned()
}

/// Names of blocks that every program takes, one for each prototype that has instances.
fn block_names<'a>(model: &Outgoing<'a>) -> BTreeMap<&'a str, String> {
    let mut names: BTreeMap<&str, String> = BTreeMap::new();
    let mut taken = std::collections::BTreeSet::new();
    for prototype in model.used().into_keys() {
        let plain = |c: char| if c.is_ascii_alphanumeric() || "-_".contains(c) { c } else { '_' };
        let name: String = prototype.chars().take(60).map(plain).collect();
        let mut own = name.clone();
        let mut number = 2;
        // Names of blocks do not tell capitals from small letters.
        while !taken.insert(own.to_ascii_uppercase()) {
            own = format!("{name}-{number}");
            number += 1;
        }
        names.insert(prototype, own);
    }
    names
}

struct Writer<'w, W: Write> {
    to: &'w mut W,
}

type Tag = (&'static str, String);

impl<W: Write> Writer<'_, W> {
    fn text(&mut self, code: i32, value: &str) -> io::Result<()> {
        write!(self.to, "{code:>3}\r\n{value}\r\n")
    }

    fn texts(&mut self, groups: &[(i32, &str)]) -> io::Result<()> {
        groups.iter().try_for_each(|(code, value)| self.text(*code, value))
    }

    fn number(&mut self, code: i32, value: f64) -> io::Result<()> {
        // No negative zeros, and always a point: that tells numbers from counts.
        let digits = (value + 0.0).to_string();
        let point = if digits.contains('.') { "" } else { ".0" };
        self.text(code, &format!("{digits}{point}"))
    }

    fn position(&mut self, code: i32, p: &Point3) -> io::Result<()> {
        self.number(code, p.x)?;
        self.number(code + 10, p.y)?;
        self.number(code + 20, p.z)
    }

    fn section(&mut self, name: &str) -> io::Result<()> {
        self.texts(&[(0, "SECTION"), (2, name)])
    }

    fn header(&mut self) -> io::Result<()> {
        self.section("HEADER")?;
        self.texts(&[(9, "$ACADVER"), (1, "AC1009"), (9, "$INSUNITS"), (70, "6"), (0, "ENDSEC")])?;
        self.section("TABLES")?;
        self.texts(&[(0, "TABLE"), (2, "LAYER"), (70, "6")])?;
        for (kind, colour) in Kind::ALL.into_iter().zip(["7", "3", "8", "5", "30", "9"]) {
            let layer = [(0, "LAYER"), (2, layer_of(kind.into())), (70, "0"), (62, colour)];
            self.texts(&layer)?;
            self.text(6, "CONTINUOUS")?;
        }
        self.texts(&[(0, "ENDTAB"), (0, "TABLE"), (2, "APPID"), (70, "1")])?;
        self.texts(&[(0, "APPID"), (2, APPLICATION), (70, "0"), (0, "ENDTAB"), (0, "ENDSEC")])
    }

    /// Extended data: after all other groups of an entity.
    fn tags(&mut self, tags: &[Tag]) -> io::Result<()> {
        if tags.is_empty() {
            return Ok(());
        }
        self.text(1001, APPLICATION)?;
        for (key, value) in tags {
            let escaped: Vec<String> = value.chars().map(escaped).collect();
            let mut piece = String::new();
            for letter in escaped {
                if piece.len() + letter.len() > STRING_MAX {
                    self.text(1000, &format!("{key}={piece}"))?;
                    piece.clear();
                }
                piece.push_str(&letter);
            }
            self.text(1000, &format!("{key}={piece}"))?;
        }
        Ok(())
    }

    fn solids(
        &mut self,
        layer: &str,
        solids: &[Solid],
        placement: &Placement,
        tags: &[Tag],
    ) -> io::Result<()> {
        for (index, solid) in solids.iter().enumerate() {
            let mut tags = tags.to_vec();
            tags.push((tagged::SOLID, index.to_string()));
            match solid {
                Solid::Cylinder(c) if placement.is_upright() => {
                    tags.push((tagged::CHORD, c.chord_error.to_string()));
                    let centre = placement.point(&Point3::new(c.centre.x, c.centre.y, c.lower));
                    self.texts(&[(0, "CIRCLE"), (8, layer)])?;
                    self.number(39, c.upper - c.lower)?;
                    self.position(10, &centre)?;
                    self.number(40, c.radius)?;
                    self.tags(&tags)?;
                }
                Solid::Prism { base, lower, upper } if placement.is_upright() => {
                    for ring in std::iter::once(&base.outer).chain(&base.holes) {
                        self.ring(layer, ring, [*lower, *upper], placement, &tags)?;
                    }
                }
                Solid::Box { from, to } if placement.is_upright() => {
                    let corners = [[from.x, from.y], [to.x, from.y], [to.x, to.y], [from.x, to.y]];
                    let ring = corners.map(Point::from);
                    self.ring(layer, &ring, [from.z, to.z], placement, &tags)?;
                }
                _ => self.faces(layer, solid, placement, &tags)?,
            }
        }
        Ok(())
    }

    /// A closed outline that is drawn up.
    fn ring(
        &mut self,
        layer: &str,
        ring: &[Point],
        [lower, upper]: [f64; 2],
        placement: &Placement,
        tags: &[Tag],
    ) -> io::Result<()> {
        let placed: Vec<Point3> =
            ring.iter().map(|p| placement.point(&Point3::new(p.x, p.y, lower))).collect();
        self.texts(&[(0, "POLYLINE"), (8, layer), (66, "1")])?;
        self.number(39, upper - lower)?;
        self.position(10, &Point3::new(0.0, 0.0, lower + placement.position.z))?;
        self.text(70, "1")?;
        self.tags(tags)?;
        self.vertices(layer, &placed)
    }

    fn vertices(&mut self, layer: &str, placed: &[Point3]) -> io::Result<()> {
        for p in placed {
            self.texts(&[(0, "VERTEX"), (8, layer)])?;
            self.position(10, p)?;
        }
        self.texts(&[(0, "SEQEND"), (8, layer)])
    }

    /// A solid by its faces: those of three or four corners as faces, others by their outlines.
    fn faces(
        &mut self,
        layer: &str,
        solid: &Solid,
        placement: &Placement,
        tags: &[Tag],
    ) -> io::Result<()> {
        let polyhedron = solid.polyhedron();
        let placed: Vec<Point3> = polyhedron.vertices.iter().map(|p| placement.point(p)).collect();
        for (index, face) in polyhedron.faces.iter().enumerate() {
            let mut tags = tags.to_vec();
            tags.push((tagged::FACE, index.to_string()));
            let is_small = face.holes.is_empty() && matches!(face.outer.len(), 3 | 4);
            for ring in face.loops() {
                let corners: Vec<Point3> =
                    ring.iter().filter_map(|v| placed.get(*v as usize)).copied().collect();
                if is_small && let Some(last) = corners.last() {
                    self.texts(&[(0, "3DFACE"), (8, layer)])?;
                    for k in 0..4 {
                        self.position(10 + k as i32, corners.get(k).unwrap_or(last))?;
                    }
                    self.tags(&tags)?;
                } else {
                    self.texts(&[(0, "POLYLINE"), (8, layer), (66, "1")])?;
                    self.position(10, &Point3::zeros())?;
                    self.text(70, "9")?;
                    self.tags(&tags)?;
                    self.vertices(layer, &corners)?;
                }
            }
        }
        Ok(())
    }

    fn insert(
        &mut self,
        layer: &str,
        block: &str,
        placement: &Placement,
        tags: &[Tag],
    ) -> io::Result<()> {
        let turned = |axis: Point3| placement.rotation * axis;
        let up = if placement.is_upright() { Point3::z() } else { turned(Point3::z()) };
        let axes = Affine::of_normal([up.x, up.y, up.z]).columns;
        let in_axes = |p: &Point3| Point3::from(axes.map(|axis| axis.dot(p)));
        let ahead = in_axes(&turned(Point3::x()));
        self.texts(&[(0, "INSERT"), (8, layer), (2, block)])?;
        self.position(10, &in_axes(&placement.position))?;
        self.number(50, ahead.y.atan2(ahead.x).to_degrees())?;
        if !placement.is_upright() {
            self.position(210, &up)?;
        }
        self.tags(tags)
    }
}

/// A letter as every program reads it.
fn escaped(letter: char) -> String {
    let mut units = [0; 2];
    let mut escaped = String::new();
    match letter {
        ' '..='~' => escaped.push(letter),
        _ => {
            for unit in letter.encode_utf16(&mut units) {
                let _ = write!(escaped, "\\U+{unit:04X}"); // writing to a String cannot fail
            }
        }
    }
    escaped
}
