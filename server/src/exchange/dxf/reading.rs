//! What stands in a drawing, as objects: ours as we wrote it, walls out of their lines, blocks as instances.

use std::collections::{BTreeMap, BTreeSet};

use mapfold_schema::v1::{GdbPrototype, ModelFormat, ObjectKind};
use uuid::Uuid;

use super::super::affine::Affine;
use super::super::incoming::{FileFault, Found, Incoming, object};
use super::document::{Block, Drawing, Entity, Insert, Shape, unescaped};
use super::groups::{fault_at, short, text};
use super::layers::{Content, LayerTable};
use super::objects::{Laid, Objects};
use super::placing::Piece;
use super::prototypes::{height_m, placing, solids};
use super::tagged;

/// Blocks within blocks.
const DEPTH_MAX: usize = 16;
/// Points once all blocks are laid out.
const LAID_MAX: usize = 500_000;

/// How a drawing is read.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// What is on which layer.
    pub layers: LayerTable,
    /// Metres of one unit of the drawing; what it says itself if absent.
    pub unit_m: Option<f64>,
    /// Height of walls that are drawn flat, metres.
    pub wall_height_m: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { layers: LayerTable::default(), unit_m: None, wall_height_m: 2.5 }
    }
}

impl Options {
    /// What a request says: patterns of layers, metres of a unit, metres of a wall's height.
    ///
    /// # Errors
    /// What of it cannot be, in words.
    pub fn new(
        layers: Option<&str>,
        unit_m: Option<f64>,
        wall_height_m: Option<f64>,
    ) -> Result<Self, String> {
        let layers = LayerTable::parse(layers.unwrap_or_default()).map_err(|part| {
            format!("{part:?} is not PATTERN=KIND, of a kind of object or `skip`.")
        })?;
        let wall_height_m = wall_height_m.unwrap_or(Self::default().wall_height_m);
        if unit_m.is_some_and(|unit| !(1e-9..=1e4).contains(&unit)) {
            return Err("A unit is a length in metres.".to_owned());
        }
        if !(0.1..=100.0).contains(&wall_height_m) {
            return Err("A wall is 0.1 to 100 m high.".to_owned());
        }
        Ok(Self { layers, unit_m, wall_height_m })
    }
}

/// Reads a drawing. Prototypes get names of their own where `library` has others of theirs.
///
/// # Errors
/// What is wrong with it, and in which line.
pub fn read(
    bytes: &[u8],
    frame: Uuid,
    library: &BTreeMap<String, GdbPrototype>,
    options: &Options,
) -> Result<Incoming, FileFault> {
    let mut found = Found::new(ModelFormat::Dxf, frame, bytes)?;
    let text = text(bytes)?;
    let drawing = Drawing::read(&text)?;
    let unit_m = options.unit_m.or_else(|| unit_m(drawing.units?)).ok_or_else(|| {
        let said = drawing.units.map_or("nothing".to_owned(), |units| units.to_string());
        fault_at(1, format!("the drawing does not tell its unit ($INSUNITS says {said}): name one"))
    })?;
    found.scale_m = unit_m;
    let mut laying = Laying {
        drawing: &drawing,
        options,
        unit_m,
        contents: BTreeMap::new(),
        structural: BTreeMap::new(),
        laid: Vec::new(),
        budget: LAID_MAX,
        made: BTreeMap::new(),
        found: &mut found,
    };
    laying.lay(&drawing.entities, &Affine::scaled(unit_m), None, 0)?;
    let laid = std::mem::take(&mut laying.laid);
    Objects { found: &mut found, wall_height_m: options.wall_height_m }.make(laid)?;
    let incoming = found.settled(library)?;
    Ok(doubting(incoming))
}

/// Says so if a building is of no building's size.
fn doubting(mut incoming: Incoming) -> Incoming {
    if let Some(bounds) = incoming.report.bounds {
        let width = (bounds.max_x_m - bounds.min_x_m).max(bounds.max_y_m - bounds.min_y_m);
        if !(2.0..=2000.0).contains(&width) {
            let words =
                format!("all of it is {width:.3} m wide: is the unit of the drawing right?");
            incoming.report.warnings.push(words);
        }
    }
    incoming
}

/// Metres of a unit of `$INSUNITS`.
fn unit_m(units: i64) -> Option<f64> {
    Some(match units {
        1 => 0.0254,
        2 => 0.3048,
        3 => 1609.344,
        4 => 0.001,
        5 => 0.01,
        6 => 1.0,
        7 => 1000.0,
        8 => 0.0254e-6,
        9 => 0.0254e-3,
        10 => 0.9144,
        14 => 0.1,
        _ => return None,
    })
}

/// Lays out entities, and the blocks that walls and doors are drawn in.
struct Laying<'a, 'f> {
    drawing: &'a Drawing<'a>,
    options: &'a Options,
    unit_m: f64,
    contents: BTreeMap<&'a str, Content>,
    structural: BTreeMap<&'a str, bool>,
    laid: Vec<Laid<'a>>,
    budget: usize,
    /// Prototypes by block and stretch, with their names; empty for a block that draws nothing.
    made: BTreeMap<(&'a str, String), Option<String>>,
    found: &'f mut Found,
}

impl<'a> Laying<'a, '_> {
    fn on(&mut self, layer: &'a str) -> Content {
        let layers = &self.options.layers;
        *self.contents.entry(layer).or_insert_with(|| layers.content_of(layer))
    }

    fn spend(&mut self, line: usize, points: usize) -> Result<(), FileFault> {
        self.budget = self.budget.checked_sub(points).ok_or_else(|| {
            let fault = format!("with all blocks laid out there are more than {LAID_MAX} points");
            fault_at(line, fault)
        })?;
        Ok(())
    }

    fn lay(
        &mut self,
        entities: &'a [Entity<'a>],
        place: &Affine,
        within: Option<&'a str>,
        depth: usize,
    ) -> Result<(), FileFault> {
        for entity in entities {
            self.spend(entity.line, entity.size())?;
            // What is on layer 0 of a block is on the layer that the block stands on.
            let layer = if entity.layer == "0" { within.unwrap_or("0") } else { entity.layer };
            if let Shape::Insert(insert) = &entity.shape {
                self.insert(entity, insert, layer, place, depth)?;
                continue;
            }
            let content = self.on(layer);
            let Some(kind) = tagged::kind(&entity.tags).or_else(|| content.kind()) else {
                let what = format!("{} on layer {:?}", entity.shape.name(), short(layer));
                self.found.leave_out(what, content.why_not());
                continue;
            };
            if let Some(piece) = Piece::of(entity, place) {
                let (line, tags) = (entity.line, &entity.tags);
                self.laid.push(Laid { line, kind, piece, tags, copy: self.laid.len() });
            } else {
                let what = format!("{} on layer {:?}", entity.shape.name(), short(layer));
                self.found.leave_out(what, "entities of this kind are not read");
            }
        }
        Ok(())
    }

    fn insert(
        &mut self,
        entity: &'a Entity<'a>,
        insert: &Insert<'a>,
        layer: &'a str,
        place: &Affine,
        depth: usize,
    ) -> Result<(), FileFault> {
        let drawing = self.drawing;
        let Some(block) = drawing.blocks.get(insert.block) else {
            let fault = format!("there is no block {:?}", short(insert.block));
            return Err(fault_at(entity.line, fault));
        };
        if depth >= DEPTH_MAX {
            let fault = format!("blocks within blocks, more than {DEPTH_MAX} deep");
            return Err(fault_at(entity.line, fault));
        }
        let content = self.on(layer);
        let kind = tagged::kind(&entity.tags).or_else(|| content.kind());
        if kind.is_none() && content == Content::Skipped {
            let what = format!("block {:?} on layer {:?}", short(insert.block), short(layer));
            self.found.leave_out(what, content.why_not());
            return Ok(());
        }
        let is_drawn = matches!(kind, Some(ObjectKind::Wall | ObjectKind::Doorway))
            && !entity.tags.contains_key(tagged::ID);
        let is_laid_out = is_drawn || self.is_structural(insert.block, &mut BTreeSet::new());
        let kind = kind.or_else(|| self.content_of(block));
        for column in 0..insert.columns[0] {
            for row in 0..insert.columns[1] {
                self.spend(entity.line, 1)?;
                let own = Affine::of_insert(insert, block.base, entity.normal, [column, row]);
                let own = place.after(&own);
                if is_laid_out && !entity.tags.contains_key(tagged::ID) {
                    self.lay(&block.entities, &own, Some(layer), depth + 1)?;
                } else if let Some(kind) = kind {
                    self.instance(entity, insert, kind, &own, [column, row])?;
                } else {
                    let what =
                        format!("block {:?} on layer {:?}", short(insert.block), short(layer));
                    let why =
                        "neither its layer nor what it draws is in the table: name it in `layers`";
                    self.found.leave_out(what, why);
                }
            }
        }
        Ok(())
    }

    /// What the first entity of a block is that stands on a known layer.
    fn content_of(&mut self, block: &'a Block<'a>) -> Option<ObjectKind> {
        block.entities.iter().find_map(|entity| self.on(entity.layer).kind())
    }

    /// Whether walls or doors are drawn in a block, or in one within it.
    fn is_structural(&mut self, name: &'a str, above: &mut BTreeSet<&'a str>) -> bool {
        if let Some(known) = self.structural.get(name) {
            return *known;
        }
        let drawing = self.drawing;
        let Some(block) = drawing.blocks.get(name) else { return false };
        // A block within itself is found when it is laid out.
        if above.len() > DEPTH_MAX || !above.insert(name) {
            return above.len() > DEPTH_MAX || above.contains(name);
        }
        let is = block.entities.iter().any(|entity| match &entity.shape {
            Shape::Insert(insert) => self.is_structural(insert.block, above),
            _ => matches!(
                self.on(entity.layer),
                Content::Kind(ObjectKind::Wall | ObjectKind::Doorway)
            ),
        });
        above.remove(name);
        self.structural.insert(name, is);
        is
    }

    fn instance(
        &mut self,
        entity: &'a Entity<'a>,
        insert: &Insert<'a>,
        kind: ObjectKind,
        place: &Affine,
        cell: [usize; 2],
    ) -> Result<(), FileFault> {
        let name = short(insert.block);
        let Some(placed) = placing(place, self.unit_m, entity.tags.contains_key(tagged::ID)) else {
            self.found.leave_out(
                format!("block {name:?}"),
                "it is sheared, or stands on edge and is stretched",
            );
            return Ok(());
        };
        let key = (insert.block, placed.words.clone());
        let prototype = if let Some(made) = self.made.get(&key) {
            made.clone()
        } else {
            let made = self.prototype(entity, insert, kind, &placed.stretch, &placed.words)?;
            self.made.insert(key, made.clone());
            made
        };
        let Some(prototype) = prototype else {
            self.found.leave_out(format!("block {name:?}"), "it covers nothing");
            return Ok(());
        };
        let mut instance = object(kind, "");
        instance.prototype = Some(prototype);
        instance.placement = Some(placed.placement);
        tagged::complete(&mut instance, &entity.tags);
        let place = format!("line {}, copy {cell:?} {}", entity.line, self.found.objects.len());
        self.found.put(&place, tagged::id(&entity.tags), instance)
    }

    /// Makes a block a prototype and tells its name; `None` if it draws nothing.
    fn prototype(
        &mut self,
        entity: &Entity<'_>,
        insert: &Insert<'a>,
        kind: ObjectKind,
        stretch: &Affine,
        words: &str,
    ) -> Result<Option<String>, FileFault> {
        let drawing = self.drawing;
        let Some(block) = drawing.blocks.get(insert.block) else { return Ok(None) };
        let from_base = Affine {
            offset: stretch.vector(&-mapfold_map::gdb::Point3::from(block.base)),
            ..*stretch
        };
        let solids = if block.tags.contains_key(tagged::PROTOTYPE) {
            for entity in &block.entities {
                self.spend(entity.line, entity.size())?;
            }
            tagged::solids(&block.entities, &from_base)
        } else {
            let mut pieces = Vec::new();
            self.pieces(&block.entities, &from_base, 0, &mut pieces)?;
            solids(&pieces, height_m(kind, self.options.wall_height_m))
        };
        if solids.is_empty() && !block.tags.contains_key(tagged::PROTOTYPE) {
            return Ok(None);
        }
        // A drawing within a drawing puts its name before that of the block.
        let plain = insert.block.rsplit(['$', '|']).next().unwrap_or_default();
        let said = block.tags.get(tagged::PROTOTYPE).cloned();
        let mut name = said.unwrap_or_else(|| unescaped(plain)) + words;
        if self.found.prototypes.contains_key(&name) {
            name = format!("{}{words}", unescaped(insert.block));
        }
        let kind = match block.tags.get(tagged::PROTOTYPE) {
            Some(_) => tagged::kind(&block.tags),
            None => Some(kind),
        };
        let place = format!("line {}, block {:?}", entity.line, short(insert.block));
        self.found.put_prototype(&place, &name, GdbPrototype { kind, solids })?;
        Ok(Some(name))
    }

    /// All that a block draws, blocks within it included, on whatever layer.
    fn pieces(
        &mut self,
        entities: &'a [Entity<'a>],
        place: &Affine,
        depth: usize,
        pieces: &mut Vec<Piece>,
    ) -> Result<(), FileFault> {
        let drawing = self.drawing;
        for entity in entities {
            self.spend(entity.line, entity.size())?;
            let Shape::Insert(insert) = &entity.shape else {
                pieces.extend(Piece::of(entity, place));
                continue;
            };
            if depth >= DEPTH_MAX {
                let fault = format!("blocks within blocks, more than {DEPTH_MAX} deep");
                return Err(fault_at(entity.line, fault));
            }
            let Some(block) = drawing.blocks.get(insert.block) else {
                let fault = format!("there is no block {:?}", short(insert.block));
                return Err(fault_at(entity.line, fault));
            };
            for column in 0..insert.columns[0] {
                for row in 0..insert.columns[1] {
                    self.spend(entity.line, 1)?;
                    let own = Affine::of_insert(insert, block.base, entity.normal, [column, row]);
                    self.pieces(&block.entities, &place.after(&own), depth + 1, pieces)?;
                }
            }
        }
        Ok(())
    }
}

impl Shape<'_> {
    /// What it is called in drawings.
    fn name(&self) -> &str {
        match self {
            Self::Line(_) => "LINE",
            Self::Path { .. } => "POLYLINE",
            Self::Circle { .. } => "CIRCLE",
            Self::Arc { .. } => "ARC",
            Self::Face(_) => "3DFACE",
            Self::Insert(_) => "INSERT",
            Self::Other(name) => name,
        }
    }
}
