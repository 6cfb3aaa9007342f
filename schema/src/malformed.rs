//! A catalogue of malformed contributions, for tests of servers and robots: each is a valid one
//! with one fault, together with the code and the JSON pointer by which it must be refused.
//!
//! Behind the feature `malformed`; no program needs it.

mod evidence;
mod identity;
mod look;
mod shape;

use serde_json::{Value, json};
use uuid::Uuid;

use crate::border::Target;
use crate::v1;

/// A contribution that must be refused.
#[derive(Debug, Clone, PartialEq)]
pub struct Malformed {
    /// What is wrong with it, in words.
    pub name: &'static str,
    /// The body, as JSON.
    pub body: Value,
    /// The code of the violation that it must be refused with.
    pub code: &'static str,
    /// The JSON pointer of that violation.
    pub pointer: &'static str,
}

/// A valid contribution by `robot` that has some of everything.
pub fn valid(id: Uuid, robot: &str, target: &Target) -> v1::Contribution {
    let end = |kind| v1::ObservedEnd { kind, sd_m: 0.01 };
    let tile = |x, y| v1::TilePatch { x, y, runs: vec![0, 10, 85, 64, 3, -40] };
    v1::Contribution {
        id,
        robot: robot.to_owned(),
        frame: target.frame,
        observed_at: "2026-11-22T04:00:00.123456Z".to_owned(),
        emulated: false,
        pose: v1::PoseEstimate {
            x_m: 1.5,
            y_m: -2.25,
            heading_rad: 0.5,
            covariance: [[0.01, 0.001, 0.0], [0.001, 0.02, 0.0], [0.0, 0.0, 0.001]],
            provenance: v1::Provenance::SharedMap,
            basis: Some(v1::FixBasis {
                revision: 7,
                way_m: 12.5,
                segments: vec!["019d0000-0000-7000-8000-000000000000-3".to_owned()],
                landmarks_m: vec![[2.5, -1.0]],
            }),
        },
        segments: vec![v1::ObservedSegment {
            rho_m: 2.0,
            alpha_rad: 0.25,
            covariance: [[0.0001, 0.00002], [0.00002, 0.0001]],
            from_m: -1.0,
            to_m: 1.5,
            facing: v1::Facing::Origin,
            ends: [end(v1::EndKind::Corner), end(v1::EndKind::Occluded)],
            points: 40,
            seen_through_m: vec![[-2.25, -1.125], [1.5, 2.375]],
        }],
        clusters: vec![v1::ObservedCluster {
            hull_m: vec![[3.0, 1.0], [3.5, 1.0], [3.25, 1.5]],
            centroid_m: [3.25, 1.125],
            covariance: [[0.0004, 0.0], [0.0, 0.0004]],
            points: 7,
        }],
        evidence: vec![v1::EvidencePatch {
            sensor: v1::SensorClass::Scanner,
            tiles: vec![tile(-1, 0), tile(0, -1), tile(0, 0)],
        }],
    }
}

/// Every kind of malformed contribution, made from [`valid`]. All bear the same `id`, which must
/// not be that of a contribution the server already has.
pub fn catalogue(id: Uuid, robot: &str, target: &Target) -> Vec<Malformed> {
    let base = json!(valid(id, robot, target));
    [
        shape::catalogue(),
        identity::catalogue(),
        look::catalogue(&base, target),
        evidence::catalogue(&base, target),
    ]
    .into_iter()
    .flatten()
    .map(|fault| Malformed {
        name: fault.name,
        body: fault.edits.into_iter().fold(base.clone(), edited),
        code: fault.code,
        pointer: fault.pointer,
    })
    .collect()
}

/// One fault: how the valid contribution is changed, and what must be said about it.
struct Fault {
    name: &'static str,
    edits: Vec<Edit>,
    code: &'static str,
    pointer: &'static str,
}

/// A place and what to put there; `None` takes the member away.
type Edit = (&'static str, Option<Value>);

impl Fault {
    /// The fault of `value` at `pointer`, named there.
    fn at(pointer: &'static str, value: Value, code: &'static str, name: &'static str) -> Self {
        Self { name, edits: vec![(pointer, Some(value))], code, pointer }
    }

    /// The fault that several edits make, named at `pointer`.
    fn of(edits: Vec<Edit>, pointer: &'static str, code: &'static str, name: &'static str) -> Self {
        Self { name, edits, code, pointer }
    }
}

/// `body` after an edit. The tests of the catalogue notice an edit whose place does not exist.
fn edited(mut body: Value, (pointer, value): Edit) -> Value {
    let Some((parent, last)) = pointer.rsplit_once('/') else {
        return value.unwrap_or_default();
    };
    match (body.pointer_mut(parent), value) {
        (Some(Value::Object(members)), Some(value)) => {
            members.insert(last.to_owned(), value);
        }
        (Some(Value::Object(members)), None) => {
            members.remove(last);
        }
        (Some(parent), Some(value)) => {
            if let Some(slot) = last.parse::<usize>().ok().and_then(|i| parent.get_mut(i)) {
                *slot = value;
            }
        }
        _ => {}
    }
    body
}
