//! Faults of the pose, the segments and the clusters.

use serde_json::{Value, json};

use super::Fault;
use crate::border::Target;

pub(super) fn catalogue(base: &Value, target: &Target) -> Vec<Fault> {
    let mut faults = pose(target);
    faults.extend(segments(base, target));
    faults.extend(clusters(base, target));
    faults
}

/// `n` copies of the first of an array's members.
fn copies(base: &Value, first: &str, n: usize) -> Value {
    Value::Array(vec![base.pointer(first).cloned().unwrap_or_default(); n])
}

fn pose(target: &Target) -> Vec<Fault> {
    let max = target.limits.coordinate_max_m;
    let at = Fault::at;
    vec![
        at("/pose/x_m", json!(max * 1.001), "out_of_range", "a pose outside the level"),
        at("/pose/y_m", json!(-1e300), "out_of_range", "a pose outside the universe"),
        at("/pose/heading_rad", json!(90), "out_of_range", "a heading in degrees"),
        at("/pose/heading_rad", json!(-1e300), "out_of_range", "a heading without meaning"),
        at("/pose/covariance/1/0", json!(0.002), "not_symmetric", "an asymmetric pose covariance"),
        at(
            "/pose/covariance",
            json!([[0.01, 0, 0], [0, -0.01, 0], [0, 0, 0.01]]),
            "not_positive_semidefinite",
            "a negative variance",
        ),
        at(
            "/pose/covariance",
            json!([[0.01, 0.02, 0], [0.02, 0.01, 0], [0, 0, 0.01]]),
            "not_positive_semidefinite",
            "a correlation above 1",
        ),
        at(
            "/pose/covariance",
            json!([[0, 0.001, 0], [0.001, 0, 0], [0, 0, 0.01]]),
            "not_positive_semidefinite",
            "a covariance without variances",
        ),
        at(
            "/pose/covariance/0/0",
            json!(1e7),
            "covariance_too_large",
            "a robot lost by kilometres",
        ),
        at("/pose/covariance/2/2", json!(50), "covariance_too_large", "a heading lost by a turn"),
        at("/pose/covariance/0/2", json!(-1e300), "covariance_too_large", "a huge covariance"),
        at("/pose/basis/revision", json!(-1), "out_of_range", "a map before there was one"),
        at("/pose/basis/way_m", json!(-0.5), "out_of_range", "a way of less than nothing"),
        at("/pose/basis/segments/0", json!("north"), "bad_id", "a wall without identity"),
        at("/pose/basis/segments", json!(vec!["x"; 1025]), "too_many", "a fix on too many walls"),
        at("/pose/basis/landmarks_m/0/1", json!(1e300), "out_of_range", "a landmark far away"),
    ]
}

fn segments(base: &Value, target: &Target) -> Vec<Fault> {
    let max = target.limits.coordinate_max_m;
    let at = Fault::at;
    let too_many = copies(base, "/segments/0", target.limits.segments_max + 1);
    let mut much = copies(base, "/segments/0", 6);
    for segment in much.as_array_mut().into_iter().flatten() {
        segment["from_m"] = json!(-400);
        segment["to_m"] = json!(400);
    }
    vec![
        at("/segments", too_many, "too_many_segments", "more segments than one look has"),
        at("/segments", much, "too_much_wall", "more metres of wall than one look sees"),
        at("/segments/0/rho_m", json!(-2), "negative", "a line at a negative distance"),
        at("/segments/0/rho_m", json!(1e300), "out_of_range", "a line outside the universe"),
        at("/segments/0/alpha_rad", json!(180), "out_of_range", "a normal in degrees"),
        at(
            "/segments/0/covariance/1/0",
            json!(0.00003),
            "not_symmetric",
            "an asymmetric line covariance",
        ),
        at(
            "/segments/0/covariance",
            json!([[0.0001, 0.0002], [0.0002, 0.0001]]),
            "not_positive_semidefinite",
            "a line's correlation above 1",
        ),
        at(
            "/segments/0/covariance/1/1",
            json!(10),
            "covariance_too_large",
            "a line in any direction",
        ),
        at("/segments/0/to_m", json!(-1), "out_of_order", "a segment without length"),
        at("/segments/0/to_m", json!(-3), "out_of_order", "a segment that ends before its start"),
        at("/segments/0/to_m", json!(-0.995), "segment_too_short", "a segment of 5 mm"),
        at("/segments/0/to_m", json!(1001), "segment_too_long", "a segment of a kilometre"),
        at("/segments/0/from_m", json!(-1e300), "out_of_range", "a segment without end"),
        at("/segments/0/ends/0/sd_m", json!(-0.01), "negative", "a negative standard deviation"),
        at("/segments/0/ends/1/sd_m", json!(1e9), "out_of_range", "an end that may be anywhere"),
        at("/segments/0/points", json!(0), "no_points", "a segment that no beam saw"),
        at(
            "/segments/0/seen_through_m",
            json!(vec![[2.0, 3.0]; 65]),
            "too_many_seen_through",
            "a wall like a comb",
        ),
        at(
            "/segments/0/seen_through_m/0",
            json!([-1.125, -2.25]),
            "out_of_order",
            "a view through a wall backwards",
        ),
        at(
            "/segments/0/seen_through_m/1",
            json!([-1.5, 2.0]),
            "out_of_order",
            "views through a wall that overlap",
        ),
        at(
            "/segments/0/seen_through_m/1/1",
            json!(1e300),
            "out_of_range",
            "a view through a wall without end",
        ),
        Fault::of(
            vec![
                ("/pose/x_m", Some(json!(max - 0.5))),
                ("/pose/heading_rad", Some(json!(0))),
                ("/clusters", Some(json!([]))),
                ("/segments/0/alpha_rad", Some(json!(0))),
            ],
            "/segments/0/from_m",
            "out_of_range",
            "a segment outside the level, seen from inside",
        ),
    ]
}

fn clusters(base: &Value, target: &Target) -> Vec<Fault> {
    let max = target.limits.coordinate_max_m;
    let at = Fault::at;
    let hull = |points: Value, code, name| at("/clusters/0/hull_m", points, code, name);
    let too_many = copies(base, "/clusters/0", target.limits.clusters_max + 1);
    let mut wide = copies(base, "/clusters/0", 6);
    for cluster in wide.as_array_mut().into_iter().flatten() {
        cluster["hull_m"] = json!([[-300, 0], [300, 0], [0, 2]]);
        cluster["centroid_m"] = json!([0, 0.5]);
    }
    let too_many_points = copies(base, "/clusters/0/hull_m/0", target.limits.hull_points_max + 1);
    vec![
        at("/clusters", too_many, "too_many_clusters", "more clusters than one look has"),
        at("/clusters", wide, "too_wide_clusters", "things wider together than one look sees"),
        hull(json!([]), "empty_hull", "a hull without points"),
        hull(too_many_points, "too_many_hull_points", "a hull of very many points"),
        hull(json!([[3.0, 1.0], [3.25, 1.5], [3.5, 1.0]]), "not_convex", "a clockwise hull"),
        hull(
            json!([[3.0, 1.0], [3.5, 1.0], [3.25, 1.1], [3.25, 1.5]]),
            "not_convex",
            "a hull with a dent",
        ),
        hull(
            json!([[4, 1], [2.4, 1.6], [3.3, 0.05], [3.3, 1.95], [2.4, 0.4]]),
            "not_convex",
            "a pentagram, which turns left everywhere",
        ),
        hull(
            json!([[3.0, 1.0], [3.0, 1.0], [3.5, 1.0], [3.25, 1.5]]),
            "not_convex",
            "a hull with a point twice",
        ),
        hull(json!([[-600, 0], [600, 0], [0, 2]]), "cluster_too_wide", "a hull of a kilometre"),
        at("/clusters/0/hull_m/1/0", json!(1e300), "out_of_range", "a point outside the universe"),
        at(
            "/clusters/0/centroid_m",
            json!([3.25, 1.6]),
            "centroid_outside_hull",
            "a centroid outside its hull",
        ),
        at("/clusters/0/centroid_m/1", json!(-1e300), "out_of_range", "a centroid outside it all"),
        at(
            "/clusters/0/covariance",
            json!([[-1e-3, 0], [0, 1e-3]]),
            "not_positive_semidefinite",
            "a centroid with a negative variance",
        ),
        Fault::of(
            vec![("/clusters/0/covariance/0/1", Some(json!(1e-4)))],
            "/clusters/0/covariance/1/0",
            "not_symmetric",
            "an asymmetric covariance",
        ),
        at("/clusters/0/covariance/0/0", json!(1e5), "covariance_too_large", "a cluster anywhere"),
        at("/clusters/0/points", json!(0), "no_points", "a cluster that no beam saw"),
        at("/clusters/0/points", json!(2), "too_few_points", "a triangle of two points"),
        Fault::of(
            vec![
                ("/pose/y_m", Some(json!(-max))),
                ("/pose/heading_rad", Some(json!(-1.0))),
                ("/segments", Some(json!([]))),
                ("/clusters/0/hull_m", Some(json!([[3.25, 1.125]]))),
            ],
            "/clusters/0/hull_m/0",
            "out_of_range",
            "a cluster outside the level, seen from inside",
        ),
    ]
}
