//! Features of scans as GeoJSON, in metres of the level frame, for looking at.

use mapfold_map::geometry::{Level, Point, Pose, Robot, UncertainLine};
use mapfold_map::vector::{EndKind, Facing, ObservedCluster, ObservedSegment};
use serde_json::{Value, json};

use crate::perception::Features;

/// A scan's features, placed.
#[derive(Debug, Clone, Copy)]
pub struct PlacedFeatures<'a> {
    /// Number of the reading in its log.
    pub scan: u32,
    /// Seconds by the log's clock.
    pub time_s: f64,
    /// Where the robot was.
    pub level_from_robot: Pose<Level, Robot>,
    /// What it saw, in its own frame.
    pub features: &'a Features,
}

/// A `FeatureCollection` of all of them: a point with a heading for each pose, a `LineString` for
/// each segment, a `Polygon` for each cluster. Covariances are the sensor's alone.
pub fn feature_collection<'a>(placed: impl IntoIterator<Item = PlacedFeatures<'a>>) -> Value {
    let features: Vec<Value> = placed.into_iter().flat_map(|p| features_of(&p)).collect();
    json!({ "type": "FeatureCollection", "features": features })
}

fn features_of(placed: &PlacedFeatures<'_>) -> Vec<Value> {
    let pose = &placed.level_from_robot;
    let mut all = vec![feature(
        &json!({ "type": "Point", "coordinates": [pose.x, pose.y] }),
        json!({ "kind": "pose", "heading_rad": pose.heading() }),
        placed,
    )];
    all.extend(placed.features.segments.iter().map(|s| segment(s, placed)));
    all.extend(placed.features.clusters.iter().map(|c| cluster(c, placed)));
    all
}

fn feature(geometry: &Value, mut properties: Value, placed: &PlacedFeatures<'_>) -> Value {
    properties["scan"] = placed.scan.into();
    properties["time_s"] = placed.time_s.into();
    json!({ "type": "Feature", "geometry": geometry, "properties": properties })
}

fn segment(segment: &ObservedSegment, placed: &PlacedFeatures<'_>) -> Value {
    let pose = &placed.level_from_robot;
    let line = &segment.line.line;
    let ends = [segment.from, segment.to].map(|t| coordinates(&pose.act(&line.at(t))));
    let moved = pose.act_on_line(line);
    let covariance = segment.line.covariance.transformed(&moved.j_line_line);
    let (level, _) = UncertainLine::<Level>::normal_form(moved.rho, moved.alpha, covariance);
    feature(
        &json!({ "type": "LineString", "coordinates": ends }),
        json!({
            "kind": "segment",
            "rho_m": level.line.rho(),
            "alpha_rad": level.line.alpha(),
            "covariance": level.covariance.rows(),
            "points": segment.points,
            "seen_through_m": segment.seen_through.iter().map(|i| [i.from_m(), i.to_m()]).collect::<Vec<_>>(),
            "facing": match segment.facing {
                Facing::Origin => "origin",
                Facing::Away => "away",
            },
            "ends": segment.ends.map(|e| match e.kind {
                EndKind::Corner => "corner",
                EndKind::Jump => "jump",
                EndKind::Occluded => "occluded",
            }),
            "ends_sd_m": segment.ends.map(|e| e.sd),
        }),
        placed,
    )
}

fn cluster(cluster: &ObservedCluster, placed: &PlacedFeatures<'_>) -> Value {
    let hull: Vec<[f64; 2]> =
        cluster.hull.iter().map(|p| coordinates(&placed.level_from_robot.act(p))).collect();
    let geometry = match hull.as_slice() {
        [point] => json!({ "type": "Point", "coordinates": point }),
        [a, b] => json!({ "type": "LineString", "coordinates": [a, b] }),
        ring => {
            let closed: Vec<[f64; 2]> = ring.iter().chain(ring.first()).copied().collect();
            json!({ "type": "Polygon", "coordinates": [closed] })
        }
    };
    feature(&geometry, json!({ "kind": "cluster", "points": cluster.points }), placed)
}

fn coordinates(p: &Point) -> [f64; 2] {
    // Tenths of a millimetre are enough to look at.
    [p.x, p.y].map(|v| (v * 1e4).round() / 1e4)
}
