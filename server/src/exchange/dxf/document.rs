//! Header, blocks and entities of a drawing, as far as a building needs them.

use std::collections::BTreeMap;

use super::super::incoming::FileFault;
use super::APPLICATION;
use super::groups::{Group, Groups, fault_at, short};

/// Entities of a drawing, those of blocks included.
const ENTITIES_MAX: usize = 1_000_000;

pub(super) type Position = [f64; 3];

/// A drawing.
#[derive(Debug, Default)]
pub(super) struct Drawing<'a> {
    /// `$INSUNITS`.
    pub(super) units: Option<i64>,
    pub(super) blocks: BTreeMap<&'a str, Block<'a>>,
    pub(super) entities: Vec<Entity<'a>>,
}

/// What is drawn once and stands in many places.
#[derive(Debug, Default)]
pub(super) struct Block<'a> {
    pub(super) base: Position,
    pub(super) tags: Tags,
    pub(super) entities: Vec<Entity<'a>>,
}

/// What we said of an entity when we wrote it.
pub(super) type Tags = BTreeMap<String, String>;

/// Something drawn.
#[derive(Debug)]
pub(super) struct Entity<'a> {
    pub(super) line: usize,
    pub(super) layer: &'a str,
    /// Normal of the plane that its coordinates are in.
    pub(super) normal: Position,
    /// How far it is drawn up.
    pub(super) thickness: f64,
    pub(super) tags: Tags,
    pub(super) shape: Shape<'a>,
}

/// What is drawn. Angles are degrees, as in the file.
#[derive(Debug)]
pub(super) enum Shape<'a> {
    Line([Position; 2]),
    /// Corners, each with the bulge of the edge after it.
    Path {
        corners: Vec<(Position, f64)>,
        is_closed: bool,
        /// Whether the corners are in the coordinates of the drawing, whatever the normal.
        is_in_space: bool,
    },
    Circle {
        centre: Position,
        radius: f64,
    },
    Arc {
        centre: Position,
        radius: f64,
        angles: [f64; 2],
    },
    Face([Position; 4]),
    Insert(Insert<'a>),
    /// Something else.
    Other(&'a str),
}

/// A block placed, perhaps in rows and columns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Insert<'a> {
    pub(super) block: &'a str,
    pub(super) at: Position,
    pub(super) scale: Position,
    pub(super) turn: f64,
    pub(super) columns: [usize; 2],
    pub(super) spacing: [f64; 2],
}

/// The groups of one entity.
struct Record<'a> {
    line: usize,
    kind: &'a str,
    groups: Vec<Group<'a>>,
}

impl<'a> Drawing<'a> {
    pub(super) fn read(text: &'a str) -> Result<Self, FileFault> {
        let mut reading = Reading { groups: Groups::of(text), entities: 0 };
        let mut drawing = Self::default();
        loop {
            let record = reading.record()?;
            match record.kind {
                "EOF" => return Ok(drawing),
                "SECTION" => {
                    let name = record.groups.iter().find(|group| group.code == 2);
                    match name.map(|group| group.value) {
                        Some("HEADER") => drawing.units = units(&record)?,
                        Some("BLOCKS") => drawing.blocks = reading.blocks()?,
                        Some("ENTITIES") => drawing.entities = reading.entities("ENDSEC")?,
                        Some(_) => {}
                        None => return Err(fault_at(record.line, "a section has a name")),
                    }
                }
                _ => {}
            }
        }
    }
}

/// `$INSUNITS` of the header.
fn units(header: &Record<'_>) -> Result<Option<i64>, FileFault> {
    let mut groups = header.groups.iter();
    let named = groups.by_ref().find(|group| group.code == 9 && group.value == "$INSUNITS");
    match (named, groups.next()) {
        (Some(_), Some(value)) => value.integer().map(Some),
        _ => Ok(None),
    }
}

struct Reading<'a> {
    groups: Groups<'a>,
    entities: usize,
}

impl<'a> Reading<'a> {
    /// The next record: from a group of code 0 to before the next one.
    fn record(&mut self) -> Result<Record<'a>, FileFault> {
        let Some(head) = self.groups.read()? else {
            let fault = "the drawing breaks off: it has no end (`EOF`)";
            return Err(fault_at(self.groups.line(), fault));
        };
        if head.code != 0 {
            let fault = format!("a record begins with the code 0, not {}", head.code);
            return Err(fault_at(head.line - 1, fault));
        }
        let mut record = Record { line: head.line, kind: head.value, groups: Vec::new() };
        while let Some(group) = self.groups.read()? {
            if group.code == 0 {
                self.groups.put_back(group);
                break;
            }
            record.groups.push(group);
        }
        Ok(record)
    }

    fn blocks(&mut self) -> Result<BTreeMap<&'a str, Block<'a>>, FileFault> {
        let mut blocks = BTreeMap::new();
        loop {
            let record = self.record()?;
            match record.kind {
                "ENDSEC" => return Ok(blocks),
                "BLOCK" => {
                    let name = record.text(2);
                    let name = name.ok_or_else(|| fault_at(record.line, "a block has a name"))?;
                    let base = record.position(10)?.unwrap_or_default();
                    let tags = record.tags();
                    let entities = self.entities("ENDBLK")?;
                    blocks.insert(name, Block { base, tags, entities });
                }
                "EOF" => return Err(fault_at(record.line, "the section of blocks has no end")),
                _ => {}
            }
        }
    }

    fn entities(&mut self, end: &str) -> Result<Vec<Entity<'a>>, FileFault> {
        let mut entities = Vec::new();
        loop {
            let record = self.record()?;
            if record.kind == end {
                return Ok(entities);
            }
            if matches!(record.kind, "EOF" | "ENDSEC" | "SECTION") {
                return Err(fault_at(record.line, format!("{end} is missing before this")));
            }
            self.entities += 1;
            if self.entities > ENTITIES_MAX {
                let fault = format!("more than {ENTITIES_MAX} entities are not taken");
                return Err(fault_at(record.line, fault));
            }
            let shape = match record.kind {
                "POLYLINE" => self.polyline(&record)?,
                "VERTEX" | "SEQEND" | "ATTRIB" | "ATTDEF" => continue,
                _ => record.shape()?,
            };
            // On paper, or not to be seen.
            let is_hidden = record.integer(67)?.unwrap_or(0) == 1 || record.integer(60)? == Some(1);
            if !is_hidden {
                entities.push(record.entity(shape)?);
            }
        }
    }

    /// A polyline of the old form: its vertices are records of their own.
    fn polyline(&mut self, head: &Record<'a>) -> Result<Shape<'a>, FileFault> {
        let flags = head.integer(70)?.unwrap_or(0);
        let elevation = head.number(30)?.unwrap_or(0.0);
        let mut corners = Vec::new();
        loop {
            let Some(next) = self.groups.read()? else {
                return Err(fault_at(head.line, "this polyline has no end (`SEQEND`)"));
            };
            let is_mine = matches!(next.value, "VERTEX" | "SEQEND");
            self.groups.put_back(next);
            if !is_mine {
                return Err(fault_at(head.line, "this polyline has no end (`SEQEND`)"));
            }
            let record = self.record()?;
            if record.kind == "SEQEND" {
                break;
            }
            self.entities += 1;
            if self.entities > ENTITIES_MAX {
                let fault = format!("more than {ENTITIES_MAX} entities are not taken");
                return Err(fault_at(record.line, fault));
            }
            let Some(mut at) = record.position(10)? else {
                return Err(fault_at(record.line, "a vertex has coordinates"));
            };
            // Control points of curves are no corners.
            if record.integer(70)?.unwrap_or(0) & 16 != 0 {
                continue;
            }
            if flags & 8 == 0 {
                at[2] = elevation;
            }
            corners.push((at, record.number(42)?.unwrap_or(0.0)));
        }
        // Meshes.
        if flags & (16 | 64) != 0 {
            return Ok(Shape::Other("POLYLINE (mesh)"));
        }
        Ok(Shape::Path { corners, is_closed: flags & 1 != 0, is_in_space: flags & 8 != 0 })
    }
}

impl<'a> Record<'a> {
    fn group(&self, code: i32) -> Option<&Group<'a>> {
        self.groups.iter().find(|group| group.code == code)
    }

    fn text(&self, code: i32) -> Option<&'a str> {
        self.group(code).map(|group| group.value)
    }

    fn number(&self, code: i32) -> Result<Option<f64>, FileFault> {
        self.group(code).map(Group::number).transpose()
    }

    fn integer(&self, code: i32) -> Result<Option<i64>, FileFault> {
        self.group(code).map(Group::integer).transpose()
    }

    /// The point whose x has this code; `None` without x or y.
    fn position(&self, code: i32) -> Result<Option<Position>, FileFault> {
        let (x, y) = (self.number(code)?, self.number(code + 10)?);
        let z = self.number(code + 20)?.unwrap_or(0.0);
        Ok(x.zip(y).map(|(x, y)| [x, y, z]))
    }

    fn needed<T>(&self, value: Option<T>, what: &str) -> Result<T, FileFault> {
        let kind = short(self.kind);
        value.ok_or_else(|| fault_at(self.line, format!("this {kind} has no {what}")))
    }

    fn entity(&self, shape: Shape<'a>) -> Result<Entity<'a>, FileFault> {
        let normal = self.position(210)?.unwrap_or([0.0, 0.0, 1.0]);
        if normal.iter().map(|part| part * part).sum::<f64>() < 1e-12 {
            return Err(fault_at(self.line, "the normal of this entity has no direction"));
        }
        Ok(Entity {
            line: self.line,
            layer: self.text(8).unwrap_or("0"),
            normal,
            thickness: self.number(39)?.unwrap_or(0.0),
            tags: self.tags(),
            shape,
        })
    }

    fn shape(&self) -> Result<Shape<'a>, FileFault> {
        Ok(match self.kind {
            "LINE" => {
                let from = self.needed(self.position(10)?, "start")?;
                Shape::Line([from, self.needed(self.position(11)?, "end")?])
            }
            "LWPOLYLINE" => self.light_polyline()?,
            "CIRCLE" | "ARC" => {
                let centre = self.needed(self.position(10)?, "centre")?;
                let radius = self.needed(self.number(40)?, "radius")?;
                if radius <= 0.0 {
                    return Err(fault_at(self.line, "a radius is more than 0"));
                }
                if self.kind == "CIRCLE" {
                    Shape::Circle { centre, radius }
                } else {
                    let from = self.needed(self.number(50)?, "start angle")?;
                    let to = self.needed(self.number(51)?, "end angle")?;
                    Shape::Arc { centre, radius, angles: [from, to] }
                }
            }
            "3DFACE" => {
                let mut corners = [[0.0; 3]; 4];
                for (k, corner) in corners.iter_mut().enumerate().take(3) {
                    *corner = self.needed(self.position(10 + k as i32)?, "corner")?;
                }
                corners[3] = self.position(13)?.unwrap_or(corners[2]);
                Shape::Face(corners)
            }
            "INSERT" => Shape::Insert(self.insert()?),
            other => Shape::Other(other),
        })
    }

    fn light_polyline(&self) -> Result<Shape<'a>, FileFault> {
        let elevation = self.number(38)?.unwrap_or(0.0);
        let is_closed = self.integer(70)?.unwrap_or(0) & 1 != 0;
        let mut corners: Vec<(Position, f64)> = Vec::new();
        let mut x = None;
        for group in &self.groups {
            match group.code {
                10 => x = Some(group.number()?),
                20 => {
                    let x = x.take().ok_or_else(|| group.fault("a y without an x before it"))?;
                    corners.push(([x, group.number()?, elevation], 0.0));
                }
                42 => {
                    if let Some((_, bulge)) = corners.last_mut() {
                        *bulge = group.number()?;
                    }
                }
                _ => {}
            }
        }
        Ok(Shape::Path { corners, is_closed, is_in_space: false })
    }

    fn insert(&self) -> Result<Insert<'a>, FileFault> {
        let number =
            |code, otherwise| Ok::<f64, FileFault>(self.number(code)?.unwrap_or(otherwise));
        let count = |code: i32| match self.group(code) {
            None => Ok(1),
            Some(group) => {
                let count = usize::try_from(group.integer()?).ok();
                let count = count.filter(|count| *count <= ENTITIES_MAX);
                count.map(|c| c.max(1)).ok_or_else(|| group.fault("this is no number of copies"))
            }
        };
        Ok(Insert {
            block: self.needed(self.text(2), "block")?,
            at: self.needed(self.position(10)?, "place")?,
            scale: [number(41, 1.0)?, number(42, 1.0)?, number(43, 1.0)?],
            turn: number(50, 0.0)?,
            columns: [count(70)?, count(71)?],
            spacing: [number(44, 0.0)?, number(45, 0.0)?],
        })
    }

    /// Our own extended data: `key=value`; pieces of one key follow each other.
    fn tags(&self) -> Tags {
        let mut tags = Tags::new();
        let mut is_ours = false;
        for group in &self.groups {
            match group.code {
                1001 => is_ours = group.value == APPLICATION,
                1000 if is_ours => {
                    if let Some((key, value)) = group.value.split_once('=') {
                        tags.entry(key.trim().to_owned()).or_default().push_str(&unescaped(value));
                    }
                }
                _ => {}
            }
        }
        tags
    }
}

/// `\U+00FC` as the letter that it stands for; two in a row may be one letter of UTF-16.
pub(super) fn unescaped(text: &str) -> String {
    let (mut plain, mut units) = (String::new(), Vec::new());
    let mut rest = text;
    while let Some(letter) = rest.chars().next() {
        let digits = rest.strip_prefix("\\U+").and_then(|rest| rest.get(..4));
        if let Some(unit) = digits.and_then(|digits| u16::from_str_radix(digits, 16).ok()) {
            units.push(unit);
            rest = &rest[7..];
            continue;
        }
        plain.push_str(&String::from_utf16_lossy(&units));
        units.clear();
        plain.push(letter);
        rest = &rest[letter.len_utf8()..];
    }
    plain + &String::from_utf16_lossy(&units)
}
