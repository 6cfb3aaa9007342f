//! Faults of who, when and in which frame.

use serde_json::{Value, json};

use super::Fault;

fn id(value: &str, name: &'static str) -> Fault {
    Fault::at("/id", json!(value), "not_uuid_v7", name)
}

fn robot(value: Value, name: &'static str) -> Fault {
    Fault::at("/robot", value, "bad_slug", name)
}

fn observed_at(value: &str, code: &'static str, name: &'static str) -> Fault {
    Fault::at("/observed_at", json!(value), code, name)
}

pub(super) fn catalogue() -> Vec<Fault> {
    vec![
        id("00000000-0000-0000-0000-000000000000", "the nil UUID"),
        id("9d6e2bd4-1c7f-4a53-8a49-53a1f5a9b0d7", "a random UUID, version 4"),
        id("019d1b5c-7a00-7abc-cdef-0123456789ab", "version 7, but of a foreign variant"),
        robot(json!(""), "a robot without name"),
        robot(json!("Robbie"), "a robot with a capital"),
        robot(json!("a/b"), "a path as robot"),
        robot(json!("-r1"), "a robot that starts with a hyphen"),
        robot(json!("r".repeat(65)), "a robot with a long name"),
        robot(json!("r\u{0}1"), "a robot with a NUL in its name"),
        Fault::at(
            "/frame",
            json!("00000000-0000-7000-8000-00000000beef"),
            "frame_mismatch",
            "another level's frame",
        ),
        observed_at("", "bad_instant", "no instant"),
        observed_at("yesterday", "bad_instant", "a word as instant"),
        observed_at("2026-11-22 04:00", "bad_instant", "an instant without seconds and offset"),
        observed_at("2026-02-30T04:00:00Z", "bad_instant", "the thirtieth of February"),
        observed_at("1969-12-31T23:59:59.999999Z", "out_of_range", "a clock before 1970"),
        observed_at("2200-01-01T00:00:00Z", "out_of_range", "a clock in 2200"),
        observed_at("2199-12-31T23:59:59-01:00", "out_of_range", "a clock in 2200 by its offset"),
    ]
}
