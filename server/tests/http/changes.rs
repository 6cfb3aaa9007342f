//! What robots found against the published model, over HTTP: told, accepted and dismissed.

use mapfold_schema::route;
use mapfold_schema::v1::{
    Contribution, EvidencePatch, GdbCollection, GdbEntryKind, GdbEntryPage, ModelChange,
    ModelChangeAnswered, ModelChangeKind, ModelChangeState, ModelChanges, ObservedCluster,
    PoseEstimate, Provenance, Scope, SensorClass, TilePatch,
};
use reqwest::Method;
use reqwest::header::{ACCEPT, IF_MATCH};
use serde_json::{Value, json};
use uuid::Uuid;

use crate::access::token;
use crate::client::Answer;
use crate::server::Server;
use crate::world::Level;

const MACHINE: u128 = 5;
const PARTITION: u128 = 6;

fn id(number: u128) -> Uuid {
    Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0000 + number)
}

fn feature(number: u128, kind: &str, from: [f64; 2], to: [f64; 2]) -> Value {
    let solid = json!({"box": {"from_m": [from[0], from[1], 0.0], "to_m": [to[0], to[1], 2.5]}});
    let properties = json!({"kind": kind, "name": format!("{kind} {number}"), "solids": [solid]});
    json!({"type": "Feature", "id": id(number), "geometry": null, "properties": properties})
}

/// A room of 6 by 4 m with a machine and a partition in it, published.
async fn room(floor: &Level) {
    let features = [
        feature(1, "wall", [-0.2, -0.2], [6.2, 0.0]),
        feature(2, "wall", [-0.2, 4.0], [6.2, 4.2]),
        feature(3, "wall", [-0.2, 0.0], [0.0, 4.0]),
        feature(4, "wall", [6.0, 0.0], [6.2, 4.0]),
        feature(MACHINE, "machine", [1.0, 0.5], [1.6, 0.9]),
        feature(PARTITION, "wall", [0.4, 2.0], [2.4, 2.1]),
    ];
    let model = json!({"type": "FeatureCollection", "features": features});
    send(floor, Method::PUT, &floor.path(route::GDB), "\"0.0\"", &model).await.expect(200);
    publish(floor, "\"1.0\"").await;
}

async fn publish(floor: &Level, tag: &str) {
    let path = floor.path(route::GDB_PUBLICATIONS);
    send(floor, Method::POST, &path, tag, &Value::Null).await.expect(201);
}

async fn send(floor: &Level, method: Method, path: &str, tag: &str, body: &Value) -> Answer {
    let request = floor.client.request(method, path).header("content-type", "application/json");
    Answer::to(request.header(IF_MATCH, tag).body(body.to_string())).await
}

/// Half of the room (a tile: 3.2 m each way) as one look sees it: the machine is gone, the partition ends at 1.2 m,
/// and a thing of 60 cm stands at (2.4, 2.4).
fn look(base: Contribution) -> Contribution {
    let mut runs = Vec::new();
    for row in 0..64 {
        let pieces = match row {
            // The partition: from 0.4 m to 1.2 m of what should go on to 2.4 m.
            40 | 41 => vec![(0, 8, -40), (8, 16, 85), (24, 40, -40)],
            // The thing.
            48..60 => vec![(0, 48, -40), (48, 12, 85), (60, 4, -40)],
            _ => vec![(0, 64, -40)],
        };
        for (column, length, value) in pieces {
            runs.extend([row * 64 + column, length, value]);
        }
    }
    let tiles = vec![TilePatch { x: 0, y: 0, runs }];
    let variances = [[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-6]];
    Contribution {
        pose: PoseEstimate {
            x_m: 0.0,
            y_m: 0.0,
            heading_rad: 0.0,
            covariance: variances,
            provenance: Provenance::Datum,
            basis: None,
        },
        segments: vec![],
        clusters: vec![ObservedCluster {
            hull_m: vec![[2.4, 2.4], [3.0, 2.4], [3.0, 3.0], [2.4, 3.0]],
            centroid_m: [2.7, 2.7],
            covariance: [[1e-4, 0.0], [0.0, 1e-4]],
            points: 20,
        }],
        evidence: vec![EvidencePatch { sensor: SensorClass::Scanner, tiles }],
        ..base
    }
}

async fn contribute(floor: &Level, number: u64) {
    let look = look(floor.look("r1", number).await);
    let answer = floor.client.post(&floor.path(route::CONTRIBUTIONS), &look).await;
    let receipt: mapfold_schema::v1::Receipt = answer.expect(201).data();
    floor.folded(receipt.revision).await;
}

async fn changes(floor: &Level) -> ModelChanges {
    floor.client.get(&floor.path(route::CHANGES)).await.expect(200).data()
}

async fn change(floor: &Level, kind: ModelChangeKind) -> ModelChange {
    let all = changes(floor).await.changes;
    let found = all.iter().find(|change| change.kind == kind);
    found.unwrap_or_else(|| panic!("no {kind:?} in {all:?}")).clone()
}

async fn answer(floor: &Level, id: &str, body: &Value) -> Answer {
    let path = floor.path(route::CHANGE).replace("{id}", id);
    floor.client.post(&path, body).await
}

#[tokio::test(flavor = "multi_thread")]
async fn what_robots_found_is_told_and_accepted_into_the_draft() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let nothing = changes(&floor).await;
    assert_eq!((nothing.publication, nothing.changes.len()), (0, 0), "nothing is published");
    room(&floor).await;
    contribute(&floor, 1).await;
    assert_eq!(changes(&floor).await.changes, [], "one look is no evidence");
    contribute(&floor, 2).await;
    contribute(&floor, 3).await;

    let told = changes(&floor).await;
    assert_eq!((told.publication, told.height_m, told.changes.len()), (2, 0.3, 3));
    let missing = change(&floor, ModelChangeKind::Missing).await;
    assert_eq!((missing.object, missing.name.as_str()), (Some(id(MACHINE)), "machine 5"));
    assert_eq!(missing.state, ModelChangeState::Open);
    assert!((missing.through_m - 2.0).abs() < 0.01, "{missing:?}");
    let opened = change(&floor, ModelChangeKind::Opened).await;
    assert_eq!(opened.object, Some(id(PARTITION)));
    assert!((opened.stretches[0].depth_m - 0.1).abs() < 1e-9, "{opened:?}");
    let new = change(&floor, ModelChangeKind::New).await;
    assert_eq!(
        (new.looks, new.robots.as_slice(), new.clusters.len()),
        (3, &["r1".to_owned()][..], 1)
    );

    // Who only reads may not answer, and what is not there cannot be answered.
    let reader = token(&server, Some("plant"), None, &[Scope::MapRead]).await;
    let as_reader = Level { client: server.with(&reader), ..floor.clone() };
    let accept = json!({"answer": "accept"});
    assert_eq!(answer(&as_reader, &missing.id, &accept).await.code(403), "insufficient_scope");
    assert_eq!(answer(&floor, "missing:nothing", &accept).await.code(404), "change_not_found");
    let body = json!({"answer": "accept", "upper_m": -1.0});
    assert_eq!(answer(&floor, &new.id, &body).await.code(422), "body_invalid");

    let done: ModelChangeAnswered = answer(&floor, &missing.id, &accept).await.expect(200).data();
    let entry = done.entry.unwrap();
    assert_eq!((entry.kind, entry.removed, entry.put), (GdbEntryKind::Edit, 1, 0));
    assert_eq!(done.change.state, ModelChangeState::Accepted);
    // Once more changes nothing.
    let again: ModelChangeAnswered = answer(&floor, &missing.id, &accept).await.expect(200).data();
    assert_eq!((again.entry, again.change.state), (None, ModelChangeState::Accepted));
    answer(&floor, &opened.id, &json!({"answer": "accept"})).await.expect(200);
    let as_shelf =
        json!({"answer": "accept", "kind": "furniture", "name": "shelf", "upper_m": 1.8});
    answer(&floor, &new.id, &as_shelf).await.expect(200);
    let states: Vec<ModelChangeState> =
        changes(&floor).await.changes.iter().map(|change| change.state).collect();
    assert_eq!(states, [ModelChangeState::Accepted; 3]);

    let path = floor.path(route::GDB);
    let draft = floor.client.get_with(&path, ACCEPT, "application/json").await.expect(200);
    let draft: GdbCollection = draft.data();
    assert!(draft.features.iter().all(|feature| feature.id != id(MACHINE)));
    let names: Vec<&str> = draft.features.iter().map(|f| f.properties.name.as_str()).collect();
    assert_eq!((draft.features.len(), names.contains(&"shelf")), (7, true), "{names:?}");
    let log: GdbEntryPage =
        floor.client.get(&floor.path(route::GDB_ENTRIES)).await.expect(200).data();
    assert!(log.entries[0].comment.starts_with("accepted: new:cluster:"), "{:?}", log.entries[0]);

    // What is published with them has nothing left to tell.
    let tag = format!("\"{}.0\"", draft.revision.unwrap());
    publish(&floor, &tag).await;
    assert_eq!(changes(&floor).await.changes, []);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_dismissed_stays_so_until_it_is_taken_back() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    room(&floor).await;
    for number in 1..=3 {
        contribute(&floor, number).await;
    }
    let missing = change(&floor, ModelChangeKind::Missing).await;
    let body = json!({"answer": "dismiss", "comment": "at the repair shop"});
    let done: ModelChangeAnswered = answer(&floor, &missing.id, &body).await.expect(200).data();
    assert_eq!((done.entry, done.change.state), (None, ModelChangeState::Dismissed));
    contribute(&floor, 4).await;
    let told = change(&floor, ModelChangeKind::Missing).await;
    assert_eq!(told.state, ModelChangeState::Dismissed);
    assert_eq!(told.dismissal.unwrap().comment, "at the repair shop");
    answer(&floor, &missing.id, &json!({"answer": "reopen"})).await.expect(200);
    let told = change(&floor, ModelChangeKind::Missing).await;
    assert_eq!((told.state, told.dismissal), (ModelChangeState::Open, None));

    // Somebody has drawn the machine elsewhere in the draft: what was found is no longer said of that.
    let moved = feature(MACHINE, "machine", [4.0, 0.5], [4.6, 0.9]);
    let edit = json!({"put": [moved]});
    send(&floor, Method::PATCH, &floor.path(route::GDB), "\"1.0\"", &edit).await.expect(200);
    let accept = json!({"answer": "accept"});
    assert_eq!(answer(&floor, &missing.id, &accept).await.code(409), "change_not_acceptable");
}
