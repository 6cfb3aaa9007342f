//! GeoJSON in level metres: a wall is one `LineString` per solid interval, a cluster a `Polygon`, a
//! chain the one or the other.
//!
//! RFC 7946 knows only longitude and latitude; that these coordinates are metres stands in the
//! foreign member `coordinate_frame`. One feature a line, in the order of the features' ids, so
//! that two exports can be compared by their bytes and by `diff`.

mod model;

use std::io::{self, Write};

use mapfold_map::gdb::{Plan, PlannedLandmark};
use mapfold_map::geometry::Line;
use mapfold_map::level::LevelMap;
use serde::Serialize;
use uuid::Uuid;

use crate::border::{wire_chain, wire_cluster, wire_segment};
use crate::v1;

/// Media type of GeoJSON.
pub const MEDIA_TYPE: &str = "application/geo+json";

const HEAD: &str = "{\"type\":\"FeatureCollection\",\
                    \"coordinate_frame\":{\"axes\":\"x right, y up\",\"unit\":\"m\"},";

#[derive(Serialize)]
struct Feature<'a> {
    #[serde(rename = "type")]
    kind: &'static str,
    id: String,
    geometry: Geometry,
    properties: Properties<'a>,
}

#[derive(Serialize)]
#[serde(tag = "type", content = "coordinates")]
enum Geometry {
    Point([f64; 2]),
    LineString(Vec<[f64; 2]>),
    Polygon([Vec<[f64; 2]>; 1]),
}

#[derive(Serialize)]
#[serde(untagged)]
enum Properties<'a> {
    Segment {
        id: &'a str,
        kind: &'static str,
        quality: u32,
        existence_nat: f64,
        rho_m: f64,
        alpha_rad: f64,
        covariance: [[f64; 2]; 2],
        robots: &'a [String],
    },
    Cluster {
        id: &'a str,
        kind: &'static str,
        quality: u32,
        robots: &'a [String],
    },
    Chain {
        id: &'a str,
        kind: &'static str,
        shape: v1::ChainKind,
        quality: u32,
        segments: &'a [String],
        robots: &'a [String],
    },
    Plan {
        id: &'a str,
        kind: &'static str,
        shape: model::PlanShape,
        height_m: f64,
        objects: &'a [Uuid],
    },
    Landmark {
        id: &'a str,
        kind: &'static str,
        shape: v1::LandmarkKind,
        heading_rad: f64,
        covariance: [[f64; 3]; 3],
        extent: f64,
        objects: &'a [String],
    },
}

/// Writes all segments, clusters and chains of a map.
///
/// # Errors
/// What `to` cannot take.
pub fn write_map(map: &LevelMap, to: &mut impl Write) -> io::Result<()> {
    write(Some(map), None, to)
}

/// Writes a map, or the plan of a model with its landmarks, or both.
///
/// # Errors
/// What `to` cannot take.
pub fn write(
    map: Option<&LevelMap>,
    model: Option<(&Plan, &[PlannedLandmark])>,
    to: &mut impl Write,
) -> io::Result<()> {
    let mut features = Features::begin(to, "")?;
    for (id, segment) in map.iter().flat_map(|map| &map.segments) {
        features.segment(&wire_segment(id, segment))?;
    }
    for (id, cluster) in map.iter().flat_map(|map| &map.clusters) {
        features.cluster(&wire_cluster(id, cluster))?;
    }
    for (id, chain) in map.iter().flat_map(|map| &map.chains) {
        features.chain(&wire_chain(id, chain))?;
    }
    if let Some((plan, landmarks)) = model {
        features.model(plan, landmarks)?;
    }
    features.end()
}

/// Writes what changed after a revision; what is no more stands in the foreign member `removed`.
///
/// # Errors
/// What `to` cannot take.
pub fn write_patch(patch: &v1::VectorPatch, to: &mut impl Write) -> io::Result<()> {
    let removed = serde_json::to_string(&patch.removed)?;
    let (since, revision) = (patch.since, patch.revision);
    let members = format!("\"since\":{since},\"revision\":{revision},\"removed\":{removed},");
    let mut features = Features::begin(to, &members)?;
    for segment in &patch.segments {
        features.segment(segment)?;
    }
    for cluster in &patch.clusters {
        features.cluster(cluster)?;
    }
    for chain in &patch.chains {
        features.chain(chain)?;
    }
    features.end()
}

/// Writes the features of a collection one after the other.
struct Features<'w, W: Write> {
    to: &'w mut W,
    separator: &'static str,
}

impl<'w, W: Write> Features<'w, W> {
    fn begin(to: &'w mut W, members: &str) -> io::Result<Self> {
        write!(to, "{HEAD}{members}\"features\":[")?;
        Ok(Self { to, separator: "\n" })
    }

    fn segment(&mut self, segment: &v1::Segment) -> io::Result<()> {
        let (line, _) =
            Line::<mapfold_map::geometry::Level>::normal_form(segment.rho_m, segment.alpha_rad);
        for (index, interval) in segment.solid.iter().enumerate() {
            let ends = [interval.from_m, interval.to_m].map(|t| line.at(t));
            self.feature(
                format!("{}#{index}", segment.id),
                Geometry::LineString(ends.iter().map(|p| coordinates([p.x, p.y])).collect()),
                Properties::Segment {
                    id: &segment.id,
                    kind: "segment",
                    quality: segment.quality,
                    existence_nat: interval.existence_nat,
                    rho_m: segment.rho_m,
                    alpha_rad: segment.alpha_rad,
                    covariance: segment.covariance,
                    robots: &segment.robots,
                },
            )?;
        }
        Ok(())
    }

    fn cluster(&mut self, cluster: &v1::Cluster) -> io::Result<()> {
        self.feature(
            cluster.id.clone(),
            Geometry::Polygon([ring(&cluster.hull_m)]),
            Properties::Cluster {
                id: &cluster.id,
                kind: "cluster",
                quality: cluster.quality,
                robots: &cluster.robots,
            },
        )
    }

    fn chain(&mut self, chain: &v1::Chain) -> io::Result<()> {
        let mut vertices: Vec<[f64; 2]> =
            chain.vertices_m.iter().copied().map(coordinates).collect();
        let shape = if chain.closed {
            // RFC 7946 wants outer rings counter-clockwise; obstacles run the other way.
            if chain.kind == v1::ChainKind::Obstacle {
                vertices.reverse();
            }
            Geometry::Polygon([ring(&vertices)])
        } else {
            Geometry::LineString(vertices)
        };
        self.feature(
            chain.id.clone(),
            shape,
            Properties::Chain {
                id: &chain.id,
                kind: "chain",
                shape: chain.kind,
                quality: chain.quality,
                segments: &chain.segments,
                robots: &chain.robots,
            },
        )
    }

    fn feature(&mut self, id: String, shape: Geometry, properties: Properties) -> io::Result<()> {
        self.to.write_all(self.separator.as_bytes())?;
        self.separator = ",\n";
        let feature = Feature { kind: "Feature", id, geometry: shape, properties };
        serde_json::to_writer(&mut *self.to, &feature).map_err(io::Error::from)
    }

    fn end(self) -> io::Result<()> {
        self.to.write_all(b"\n]}\n")
    }
}

/// A closed ring of at least four positions: hulls of one or two points repeat their last one.
fn ring(hull: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut ring: Vec<[f64; 2]> = hull.iter().copied().map(coordinates).collect();
    if let (Some(first), Some(last)) = (ring.first().copied(), ring.last().copied()) {
        while ring.len() < 3 {
            ring.push(last);
        }
        ring.push(first);
    }
    ring
}

/// The same point without negative zeros, which some readers refuse and which make equal maps
/// look different.
fn coordinates([x, y]: [f64; 2]) -> [f64; 2] {
    [x + 0.0, y + 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment() -> v1::Segment {
        v1::Segment {
            id: "0190a000-0000-7000-8000-000000000001-3".to_owned(),
            rho_m: 2.0,
            alpha_rad: 0.0,
            covariance: [[1e-4, 0.0], [0.0, 1e-6]],
            covariance_independent: [[1e-4, 0.0], [0.0, 1e-6]],
            covariance_dependent: [[0.0; 2]; 2],
            facing: v1::Facing::Origin,
            solid: [(-1.0, 0.5), (1.5, 3.0)]
                .map(|(from_m, to_m)| v1::SolidInterval {
                    from_m,
                    to_m,
                    ends: [v1::EndKind::Jump; 2],
                    existence_nat: from_m,
                })
                .to_vec(),
            quality: 4,
            robots: vec!["a".to_owned()],
            first_seen: "2026-01-01T00:00:00Z".to_owned(),
            last_seen: "2026-01-01T00:00:00Z".to_owned(),
        }
    }

    fn written(patch: &v1::VectorPatch) -> serde_json::Value {
        let mut bytes = Vec::new();
        write_patch(patch, &mut bytes).unwrap();
        serde_json::from_slice(&bytes).unwrap()
    }

    #[test]
    fn a_wall_with_a_doorway_becomes_two_line_strings_of_one_segment() {
        let patch = v1::VectorPatch {
            since: 1,
            revision: 9,
            segments: vec![segment()],
            clusters: Vec::new(),
            chains: Vec::new(),
            removed: v1::Removed::default(),
        };
        let json = written(&patch);
        let features = json["features"].as_array().unwrap();
        assert_eq!(features.len(), 2);
        let id = "0190a000-0000-7000-8000-000000000001-3";
        for (n, feature) in features.iter().enumerate() {
            assert_eq!(feature["id"], format!("{id}#{n}"));
            assert_eq!(feature["properties"]["id"], id);
            assert_eq!(feature["properties"]["kind"], "segment");
            assert_eq!(feature["properties"]["quality"], 4);
            assert_eq!(feature["properties"]["existence_nat"], [-1.0, 1.5][n]);
        }
        let expected = serde_json::json!([[2.0, -1.0], [2.0, 0.5]]);
        assert_eq!(features[0]["geometry"]["coordinates"], expected);
        assert_eq!((&json["since"], &json["revision"]), (&1.into(), &9.into()));
    }

    #[test]
    fn a_chain_becomes_a_line_string_or_a_counter_clockwise_polygon() {
        let square = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];
        let chain = |piece: u8, kind, vertices_m: &[[f64; 2]]| v1::Chain {
            id: format!("0190a000-0000-7000-8000-000000000001-3.{piece}"),
            kind,
            closed: kind != v1::ChainKind::Polyline,
            vertices_m: vertices_m.to_vec(),
            covariances: vec![[[1e-4, 0.0], [0.0, 1e-4]]; vertices_m.len()],
            segments: Vec::new(),
            quality: 2,
            robots: vec!["a".to_owned()],
            first_seen: "2026-01-01T00:00:00Z".to_owned(),
            last_seen: "2026-01-01T00:00:00Z".to_owned(),
        };
        let json = written(&v1::VectorPatch {
            since: 0,
            revision: 9,
            segments: Vec::new(),
            clusters: Vec::new(),
            chains: vec![
                chain(0, v1::ChainKind::Obstacle, &square),
                chain(1, v1::ChainKind::Polyline, &square[..3]),
            ],
            removed: v1::Removed::default(),
        });
        let [obstacle, line] = &json["features"].as_array().unwrap()[..] else { panic!() };
        assert_eq!(obstacle["geometry"]["type"], "Polygon");
        let [a, b, c, d] = square;
        assert_eq!(obstacle["geometry"]["coordinates"], serde_json::json!([[d, c, b, a, d]]));
        assert_eq!(obstacle["properties"]["kind"], "chain");
        assert_eq!(obstacle["properties"]["shape"], "obstacle");
        assert_eq!(line["geometry"]["type"], "LineString");
        assert_eq!(line["geometry"]["coordinates"], serde_json::json!([a, b, c]));
        assert_eq!(line["id"], "0190a000-0000-7000-8000-000000000001-3.1");
    }

    #[test]
    fn a_hull_of_any_size_becomes_a_closed_ring_of_at_least_four_positions() {
        let (a, b, c) = ([0.0, 0.0], [1.0, 0.0], [0.0, 1.0]);
        assert_eq!(ring(&[a]), [a, a, a, a]);
        assert_eq!(ring(&[a, b]), [a, b, b, a]);
        assert_eq!(ring(&[a, b, c]), [a, b, c, a]);
    }

    #[test]
    fn an_empty_map_is_an_empty_collection() {
        let mut bytes = Vec::new();
        write_map(&LevelMap::default(), &mut bytes).unwrap();
        let json: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
        assert_eq!(json["type"], "FeatureCollection");
        assert_eq!(json["features"], serde_json::json!([]));
    }
}
