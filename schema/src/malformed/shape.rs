//! Faults of shape: what does not even become a contribution.

use serde_json::{Value, json};

use super::Fault;

const CODE: &str = "unexpected_shape";

fn set(pointer: &'static str, value: Value, name: &'static str) -> Fault {
    Fault::at(pointer, value, CODE, name)
}

fn missing(member: &'static str, object: &'static str, name: &'static str) -> Fault {
    Fault::of(vec![(member, None)], object, CODE, name)
}

pub(super) fn catalogue() -> Vec<Fault> {
    vec![
        set("", json!(42), "a number instead of a contribution"),
        set("", json!({}), "an empty object"),
        missing("/id", "", "no id"),
        missing("/pose", "", "no pose"),
        missing("/pose/covariance", "/pose", "a pose without covariance"),
        missing("/segments/0/facing", "/segments/0", "a segment seen from no side"),
        set("/colour", json!("red"), "an unknown member"),
        set("/segments/0/width_m", json!(0.1), "an unknown member of a segment"),
        set("/evidence/0/tiles/0/z", json!(1), "an unknown member of a tile"),
        set("/id", json!("one"), "an id that is no UUID"),
        set("/id", json!(7), "a number as id"),
        set("/robot", json!(null), "null as robot"),
        set("/frame", json!(""), "an empty frame"),
        set("/emulated", json!("yes"), "a word as flag"),
        set("/pose/x_m", json!("1.5"), "a number in quotes"),
        set("/pose/y_m", json!(null), "null, which is what NaN becomes in many JSON writers"),
        set("/pose/provenance", json!("gps"), "an unknown provenance"),
        set("/pose/covariance", json!([[1, 0, 0], [0, 1, 0]]), "a pose covariance of two rows"),
        set("/pose/covariance/1", json!([0, 1, 0, 0]), "a row of four entries"),
        set("/segments", json!({}), "an object instead of segments"),
        set("/segments/0", json!(null), "null as segment"),
        set("/segments/0/facing", json!("north"), "an unknown side"),
        set("/segments/0/ends/1/kind", json!("sharp"), "an unknown kind of end"),
        set("/segments/0/ends", json!([{"kind": "jump", "sd_m": 0.1}]), "one end only"),
        set("/segments/0/points", json!(-1), "a negative count"),
        set("/segments/0/points", json!(1.5), "a fractional count"),
        set("/segments/0/seen_through_m/0", json!([1.0]), "a stretch with one end"),
        set("/clusters/0/points", json!(5_000_000_000_u64), "a count of more than 32 bits"),
        set("/clusters/0/hull_m/0", json!([1.0, 2.0, 3.0]), "a point of three coordinates"),
        set("/evidence/0/sensor", json!("radar"), "an unknown class of sensor"),
        set("/evidence/0/tiles/0/x", json!(0.5), "a fractional tile"),
        set("/evidence/0/tiles/0/y", json!(3_000_000_000_u64), "a tile of more than 32 bits"),
        set("/evidence/0/tiles/0/runs/2", json!(85.0), "fractional evidence"),
    ]
}
