//! A map as GeoJSON in level metres, in the shape of the server's export of that name: a wall is
//! one `LineString` per solid interval, a cluster a `Polygon`, one feature a line, in the order of
//! the features' ids. A mirror's file and the server's export at the same revision are the same
//! bytes.

use std::io::{self, Write};

use mapfold_map::geometry::{Level, Line};
use mapfold_map::level::LevelMap;
use mapfold_schema::border::{wire_cluster, wire_segment};
use mapfold_schema::v1;
use serde::Serialize;

const HEAD: &str = "{\"type\":\"FeatureCollection\",\
                    \"coordinate_frame\":{\"axes\":\"x right, y up\",\"unit\":\"m\"},\
                    \"features\":[";

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
    LineString([[f64; 2]; 2]),
    Polygon([Vec<[f64; 2]>; 1]),
}

#[derive(Serialize)]
#[serde(untagged)]
enum Properties<'a> {
    Segment {
        id: &'a str,
        kind: &'static str,
        quality: u32,
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
}

/// Writes all segments and clusters of a map.
pub(super) fn write_map(map: &LevelMap, to: &mut impl Write) -> io::Result<()> {
    to.write_all(HEAD.as_bytes())?;
    let mut separator = "\n";
    for (id, segment) in &map.segments {
        let wire = wire_segment(id, segment);
        for (index, solid) in wire.solid.iter().enumerate() {
            write_feature(separator, &segment_feature(&wire, index, solid), to)?;
            separator = ",\n";
        }
    }
    for (id, cluster) in &map.clusters {
        write_feature(separator, &cluster_feature(&wire_cluster(id, cluster)), to)?;
        separator = ",\n";
    }
    to.write_all(b"\n]}\n")
}

fn write_feature(separator: &str, feature: &Feature, to: &mut impl Write) -> io::Result<()> {
    to.write_all(separator.as_bytes())?;
    serde_json::to_writer(to, feature).map_err(io::Error::from)
}

fn segment_feature<'a>(
    segment: &'a v1::Segment,
    index: usize,
    solid: &v1::SolidInterval,
) -> Feature<'a> {
    let (line, _) = Line::<Level>::normal_form(segment.rho_m, segment.alpha_rad);
    let ends = [solid.from_m, solid.to_m].map(|t| line.at(t));
    Feature {
        kind: "Feature",
        id: format!("{}#{index}", segment.id),
        geometry: Geometry::LineString(ends.map(|p| without_negative_zero([p.x, p.y]))),
        properties: Properties::Segment {
            id: &segment.id,
            kind: "segment",
            quality: segment.quality,
            rho_m: segment.rho_m,
            alpha_rad: segment.alpha_rad,
            covariance: segment.covariance,
            robots: &segment.robots,
        },
    }
}

fn cluster_feature(cluster: &v1::Cluster) -> Feature<'_> {
    Feature {
        kind: "Feature",
        id: cluster.id.clone(),
        geometry: Geometry::Polygon([ring(&cluster.hull_m)]),
        properties: Properties::Cluster {
            id: &cluster.id,
            kind: "cluster",
            quality: cluster.quality,
            robots: &cluster.robots,
        },
    }
}

/// A closed ring of at least four positions: hulls of one or two points repeat their last one.
fn ring(hull: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut ring: Vec<[f64; 2]> = hull.iter().copied().map(without_negative_zero).collect();
    if let (Some(first), Some(last)) = (ring.first().copied(), ring.last().copied()) {
        while ring.len() < 3 {
            ring.push(last);
        }
        ring.push(first);
    }
    ring
}

/// Some readers refuse negative zeros, and they make equal maps look different.
fn without_negative_zero([x, y]: [f64; 2]) -> [f64; 2] {
    [x + 0.0, y + 0.0]
}
