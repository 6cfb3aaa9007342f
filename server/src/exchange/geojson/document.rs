//! The collection: features with their geometry, place by place, and what they are said to be.

use std::fmt;

use mapfold_schema::v1::ObjectKind;
use serde::de::{DeserializeOwned, Error, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::value::RawValue;

use super::super::few::Few;
use super::super::incoming::FileFault;

/// Corners of all features together.
const POINTS_MAX: usize = 500_000;

#[derive(Deserialize)]
#[serde(bound(deserialize = "'de: 'a"))]
pub(super) struct Collection<'a> {
    #[serde(rename = "type")]
    kind: String,
    #[serde(rename = "conformsTo")]
    conforms_to: Option<IgnoredAny>,
    coordinate_frame: Option<Frame>,
    features: Few<Wire<'a>>,
}

#[derive(Deserialize)]
struct Frame {
    unit: Option<String>,
}

#[derive(Deserialize)]
struct Wire<'a> {
    #[serde(borrow)]
    geometry: Option<Geometry<'a>>,
    #[serde(borrow)]
    properties: Option<Properties<'a>>,
}

#[derive(Deserialize)]
struct Geometry<'a> {
    #[serde(rename = "type")]
    kind: String,
    /// Read when the type is known, which may stand behind them.
    #[serde(borrow)]
    coordinates: Option<&'a RawValue>,
}

/// What is read of a feature's properties; values of other types than these say nothing.
#[derive(Default, Deserialize)]
struct Properties<'a> {
    #[serde(borrow)]
    kind: Option<&'a RawValue>,
    #[serde(borrow)]
    shape: Option<&'a RawValue>,
    #[serde(borrow)]
    name: Option<&'a RawValue>,
    #[serde(borrow)]
    objects: Option<&'a RawValue>,
    solids: Option<IgnoredAny>,
    prototype: Option<IgnoredAny>,
}

/// Two numbers; what else a position has is no part of a plan.
#[derive(Debug, Clone, Copy)]
struct Pair(Position);

impl<'de> Deserialize<'de> for Pair {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Numbers;
        impl<'de> Visitor<'de> for Numbers {
            type Value = Pair;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a position: two or three numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Pair, A::Error> {
                let x: Option<f64> = items.next_element()?;
                let y: Option<f64> = items.next_element()?;
                while items.next_element::<IgnoredAny>()?.is_some() {}
                let position = x.zip(y).map(|(x, y)| Pair([x, y]));
                position.ok_or_else(|| A::Error::invalid_length(1, &self))
            }
        }
        deserializer.deserialize_seq(Numbers)
    }
}

type Line = Vec<Pair>;
type Rings = Vec<Line>;

pub(super) type Position = [f64; 2];

/// What a feature draws.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Drawn {
    Lines(Vec<Vec<Position>>),
    /// Each with its outer ring and its holes; the first corner stands at the end again.
    Polygons(Vec<Vec<Vec<Position>>>),
    /// Nothing that a wall could be, by the word of the format.
    Other(String),
}

/// What a feature is said to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Said {
    /// Nothing that is known here.
    Nothing,
    /// An object of this kind.
    Object(ObjectKind),
    /// Of a plan: the outline of what is solid.
    Obstacle,
    /// Of a plan: the outline of free space within what is solid.
    Room,
    /// Of a plan: a surface without thickness.
    Sheet,
    /// Of a plan: where a doorway opens the face of a wall.
    Opening,
    /// Of a map: a wall that robots saw.
    Segment,
    /// Of a map: what no line explains.
    Cluster,
    /// What is worked out from other features of the file.
    Derived,
}

/// A feature.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Feature {
    /// A JSON pointer.
    pub(super) place: String,
    pub(super) drawn: Drawn,
    pub(super) said: Said,
    pub(super) name: String,
    /// The first of the objects that make it: of an opening its doorway.
    pub(super) owner: String,
}

/// A plan.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Document {
    pub(super) features: Vec<Feature>,
    /// Whether it says itself that its unit is the metre.
    pub(super) in_metres: bool,
}

impl<'a> Collection<'a> {
    /// # Errors
    /// It is no collection of features.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, FileFault> {
        let read: Self = serde_json::from_slice(bytes).map_err(|error| {
            let at = format!("line {}, column {}", error.line(), error.column());
            FileFault::at(at, error.to_string())
        })?;
        if read.kind != "FeatureCollection" {
            return Err(FileFault::at("/type", "a plan is a FeatureCollection"));
        }
        Ok(read)
    }

    /// Whether it holds solids and not what they look like from above.
    pub(super) fn is_json_fg(&self) -> bool {
        let is_solid = |feature: &Wire<'_>| {
            let said = feature.properties.as_ref();
            said.is_some_and(|said| said.solids.is_some() || said.prototype.is_some())
        };
        self.conforms_to.is_some() || self.features.0.iter().any(is_solid)
    }

    /// # Errors
    /// Where a geometry is none, or one corner too many.
    pub(super) fn checked(self) -> Result<Document, FileFault> {
        let unit = self.coordinate_frame.and_then(|frame| frame.unit);
        let mut points = 0;
        let mut features = Vec::with_capacity(self.features.0.len());
        for (index, wire) in self.features.0.into_iter().enumerate() {
            let place = format!("/features/{index}");
            let drawn = match &wire.geometry {
                None => Drawn::Other("features without geometry".to_owned()),
                Some(geometry) => geometry.drawn(&place)?,
            };
            points += drawn.points();
            if points > POINTS_MAX {
                let fault = format!("a plan has at most {POINTS_MAX} corners");
                return Err(FileFault::at(place, fault));
            }
            let said = wire.properties.unwrap_or_default();
            let owners: Option<Vec<String>> = value(said.objects);
            features.push(Feature {
                place,
                drawn,
                said: said.meaning(),
                name: value(said.name).unwrap_or_default(),
                owner: owners.and_then(|owners| owners.into_iter().next()).unwrap_or_default(),
            });
        }
        Ok(Document { features, in_metres: unit.as_deref() == Some("m") })
    }
}

/// A value if it is there and of this type.
fn value<T: DeserializeOwned>(raw: Option<&RawValue>) -> Option<T> {
    raw.and_then(|raw| serde_json::from_str(raw.get()).ok())
}

impl Properties<'_> {
    fn meaning(&self) -> Said {
        let (kind, shape): (Option<String>, Option<String>) = (value(self.kind), value(self.shape));
        match (kind.as_deref(), shape.as_deref()) {
            (Some("gdb"), Some("obstacle")) => Said::Obstacle,
            (Some("gdb"), Some("room")) => Said::Room,
            (Some("gdb"), Some("sheet")) => Said::Sheet,
            (Some("gdb"), Some("opening")) => Said::Opening,
            (Some("segment"), _) => Said::Segment,
            (Some("cluster"), _) => Said::Cluster,
            (Some("landmark" | "chain"), _) => Said::Derived,
            _ => value::<ObjectKind>(self.kind).map_or(Said::Nothing, Said::Object),
        }
    }
}

impl Geometry<'_> {
    fn drawn(&self, feature: &str) -> Result<Drawn, FileFault> {
        Ok(match self.kind.as_str() {
            "LineString" => Drawn::Lines(vec![line(self.coordinates(feature)?)]),
            "MultiLineString" => Drawn::Lines(rings(self.coordinates(feature)?)),
            "Polygon" => Drawn::Polygons(vec![rings(self.coordinates(feature)?)]),
            "MultiPolygon" => {
                let all: Vec<Rings> = self.coordinates(feature)?;
                Drawn::Polygons(all.into_iter().map(rings).collect())
            }
            "Point" | "MultiPoint" => Drawn::Other("points".to_owned()),
            "GeometryCollection" => Drawn::Other("collections of geometries".to_owned()),
            _ => {
                let fault = "a geometry is a LineString, a Polygon, several of these, or a Point";
                return Err(FileFault::at(format!("{feature}/geometry/type"), fault));
            }
        })
    }

    fn coordinates<T: DeserializeOwned>(&self, feature: &str) -> Result<T, FileFault> {
        let place = format!("{feature}/geometry/coordinates");
        let Some(raw) = self.coordinates else {
            return Err(FileFault::at(place, "they are missing"));
        };
        serde_json::from_str(raw.get())
            .map_err(|error| FileFault::at(place, format!("of a {}: {error}", self.kind)))
    }
}

fn line(line: Line) -> Vec<Position> {
    line.into_iter().map(|Pair(position)| position).collect()
}

fn rings(rings: Rings) -> Vec<Vec<Position>> {
    rings.into_iter().map(line).collect()
}

impl Drawn {
    fn points(&self) -> usize {
        match self {
            Self::Lines(lines) => lines.iter().map(Vec::len).sum(),
            Self::Polygons(polygons) => polygons.iter().flatten().map(Vec::len).sum(),
            Self::Other(_) => 0,
        }
    }

    /// All its positions.
    pub(super) fn positions(&self) -> impl Iterator<Item = Position> {
        let (lines, polygons) = match self {
            Self::Lines(lines) => (lines.as_slice(), [].as_slice()),
            Self::Polygons(polygons) => ([].as_slice(), polygons.as_slice()),
            Self::Other(_) => ([].as_slice(), [].as_slice()),
        };
        lines.iter().chain(polygons.iter().flatten()).flatten().copied()
    }
}
