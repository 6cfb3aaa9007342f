//! A model for the tests of formats: every form of solid, every field of an object, instances that stand upright and tilted.

use std::collections::BTreeMap;

use mapfold_map::gdb::{Model, Plan, PrototypeName, Structure};
use mapfold_schema::border::gdb::{map_object, map_prototype, object_id};
use mapfold_schema::v1::{GdbObject, GdbPrototype};
use serde_json::json;
use uuid::Uuid;

use super::incoming::Incoming;
use super::outgoing::Outgoing;

pub(super) const FRAME: Uuid = Uuid::from_u128(7);

/// A model as it travels and as the map has it.
pub(super) struct Sample {
    pub(super) objects: BTreeMap<Uuid, GdbObject>,
    pub(super) library: BTreeMap<String, GdbPrototype>,
    pub(super) model: Model,
}

pub(super) fn mapped(
    objects: &BTreeMap<Uuid, GdbObject>,
    library: &BTreeMap<String, GdbPrototype>,
) -> Model {
    Model {
        prototypes: library
            .iter()
            .map(|(name, p)| (PrototypeName::from(name.as_str()), map_prototype(p).unwrap()))
            .collect(),
        objects: objects.iter().map(|(id, o)| (object_id(*id), map_object(o).unwrap())).collect(),
    }
}

impl Sample {
    pub(super) fn new() -> Self {
        let tetrahedron = json!({"polyhedron": {
            "vertices_m": [[0.1, 0.2, 0.0], [1.1, 0.2, 0.0], [0.1, 1.2, 0.0], [0.3, 0.4, 1.0]],
            "faces": [[[0, 2, 1]], [[0, 1, 3]], [[1, 2, 3]], [[2, 0, 3]]],
        }});
        let ring = json!([
            [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]],
            [[1.0, 1.0], [1.0, 2.0], [2.0, 2.0]]
        ]);
        let (c, s) = (0.6_f64.cos(), 0.6_f64.sin());
        let objects = [
            json!({"kind": "wall", "name": "Süd 🚪", "tolerance_m": 0.01, "trust": 0.9,
                "solids": [{"box": {"from_m": [0.0, 0.0, 0.0], "to_m": [6.0, 0.2, 2.5]}}]}),
            json!({"kind": "doorway", "door": {"type": "hinged", "opens_rad": 1.5},
                "placement": {"position_m": [2.0, 0.1, 0.0], "rotation": [c, 0.0, 0.0, s]},
                "solids": [{"box": {"from_m": [-0.5, -0.5, 0.0], "to_m": [0.5, 0.5, 2.1]}}]}),
            json!({"kind": "wall", "name": "court",
                "placement": {"position_m": [10.0, 5.0, 0.5], "rotation": [c, 0.0, 0.0, s]},
                "solids": [{"prism": {"base_m": ring, "lower_m": -0.1, "upper_m": 2.0}}]}),
            json!({"kind": "machine", "name": "x".repeat(120), "solids": [
                {"cylinder": {"centre_m": [3.0, 2.0], "radius_m": 0.4, "lower_m": 0.0, "upper_m": 1.3,
                    "chord_error_m": 0.002}},
                tetrahedron]}),
            json!({"kind": "other", "placement": {"position_m": [-5.0, 2.0, 1.0], "rotation": [c, s, 0.0, 0.0]},
                "solids": [{"prism": {"base_m": ring, "lower_m": 0.0, "upper_m": 0.4}}]}),
            json!({"kind": "furniture", "prototype": "table 1.6 \"m\"", "name": "a",
                "placement": {"position_m": [1.0, 2.0, 0.4], "rotation": [c, s, 0.0, 0.0]}}),
            json!({"kind": "furniture", "prototype": "table 1.6 \"m\"",
                "placement": {"position_m": [1.0, 2.0, 0.0], "rotation": [c, 0.0, 0.0, -s]}}),
            json!({"kind": "machine", "prototype": "TABLE 1.6 'm'",
                "placement": {"position_m": [-3.0, 2.0, 2.0], "rotation": [0.0, 1.0, 0.0, 0.0]}}),
        ];
        let table = |width: f64| {
            let top = json!({"box": {"from_m": [0.0, 0.0, 0.7], "to_m": [width, 0.8, 0.75]}});
            let leg = json!({"cylinder": {"centre_m": [0.1, 0.1], "radius_m": 0.05, "lower_m": 0.0, "upper_m": 0.7}});
            json!({"kind": "furniture", "solids": [top, leg, tetrahedron]})
        };
        let library = [("table 1.6 \"m\"", 1.6), ("TABLE 1.6 'm'", 1.2), ("unused", 1.0)];
        let read = |value| serde_json::from_value(value).unwrap();
        let library = library
            .map(|(name, width)| (name.to_owned(), serde_json::from_value(table(width)).unwrap()));
        let objects = objects.into_iter().zip(1_u128..);
        let objects = objects.map(|(value, n)| (Uuid::from_u128(n << 64 | 1 << 63), read(value)));
        let (objects, library) = (objects.collect(), BTreeMap::from(library));
        let model = mapped(&objects, &library);
        Self { objects, library, model }
    }

    pub(super) fn outgoing(&self) -> Outgoing<'_> {
        Outgoing {
            frame: FRAME,
            version: [3, 4],
            objects: &self.objects,
            library: &self.library,
            model: &self.model,
        }
    }
}

/// The plans of a model at heights that meet all of the sample.
pub(super) fn plans(model: &Model) -> Vec<Plan> {
    let structure = Structure::of(model);
    [0.05, 0.3, 0.72, 1.1, 1.9, 2.3].map(|height| structure.plan(height)).into()
}

/// What came in, as the map has it.
pub(super) fn model_of(incoming: &Incoming) -> Model {
    mapped(&incoming.objects, &incoming.prototypes)
}

/// What is said of objects besides where and what they are.
pub(super) fn words(objects: &BTreeMap<Uuid, GdbObject>) -> Vec<String> {
    let word = |(id, o): (&Uuid, &GdbObject)| {
        format!(
            "{id} {} {:?} {:?} {:?} {:?} {:?}",
            o.name, o.kind, o.prototype, o.tolerance_m, o.trust, o.door
        )
    };
    objects.iter().map(word).collect()
}

/// Changes a file: bytes replaced, taken out and put in, digits for others, and all after a place cut off (once in
/// a while, or little would be left to read).
pub(super) fn changed(bytes: &mut Vec<u8>, edits: &[(proptest::sample::Index, u8, u8)]) {
    for (at, byte, what) in edits {
        if bytes.is_empty() {
            return;
        }
        let at = at.index(bytes.len());
        match what {
            0 => bytes[at] = *byte,
            1 => bytes[at] = byte % 10 + b'0',
            2 => drop(bytes.remove(at)),
            3 => bytes.insert(at, byte % 10 + b'0'),
            _ if *byte < 64 => bytes.truncate(at),
            _ => bytes[at] ^= 1 << (byte % 8),
        }
    }
}
