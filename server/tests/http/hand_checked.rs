//! A real building against a list of its corners, ends and doorways that was made by looking at its drawing: all of them are
//! found, and no other. The list knows the drawing's vertices and nothing of our geometry (see tests/data/README.md).

use mapfold_schema::route;
use mapfold_schema::v1::{LandmarkKind, LandmarkTable};
use reqwest::Method;
use reqwest::header::IF_MATCH;

use crate::client::Answer;
use crate::server::Server;
use crate::world::Level;

const BUILDING: &str = include_str!("../../../tests/data/office.building.yaml");
const LIST: &str = include_str!("../../../tests/data/office.landmarks.csv");
/// How far a landmark may be from where the list has it, metres: walls that are drawn twice are some millimetres apart, and
/// so are their ends.
const OFF_MAX_M: f64 = 0.02;
/// How far it may be turned, degrees: such walls are not quite parallel.
const TURN_MAX_DEG: f64 = 2.0;

#[derive(Debug)]
struct Row<'a> {
    kind: LandmarkKind,
    at_m: [f64; 2],
    heading_deg: f64,
    vertices: &'a str,
    /// Why it is none for robots, though it is there.
    exception: &'a str,
}

fn rows() -> Vec<Row<'static>> {
    let row = |line: &'static str| {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |field: usize| fields[field].parse::<f64>().unwrap();
        Row {
            kind: match fields[0] {
                "concave_corner" => LandmarkKind::ConcaveCorner,
                "convex_corner" => LandmarkKind::ConvexCorner,
                "wall_end" => LandmarkKind::WallEnd,
                "doorway" => LandmarkKind::Doorway,
                other => panic!("{other} is no kind"),
            },
            at_m: [number(1), number(2)],
            heading_deg: number(3),
            vertices: fields[4],
            exception: fields[5],
        }
    };
    LIST.lines().skip(1).map(row).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_corner_of_an_office_is_found_and_none_invented() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::IMPORTS);
    floor.client.post_bytes(&path, "application/yaml", BUILDING.to_owned()).await.expect(201);
    let publications = floor.path(route::GDB_PUBLICATIONS);
    let publish = floor.client.request(Method::POST, &publications).header(IF_MATCH, "\"1.0\"");
    Answer::to(publish.header("content-type", "application/json").body("null")).await.expect(201);
    let table: LandmarkTable =
        floor.client.get(&floor.path(route::LANDMARKS)).await.expect(200).data();

    let mut invented = table.landmarks;
    let mut missing = Vec::new();
    for row in rows() {
        let found = invented.iter().position(|landmark| {
            let [dx, dy] = [0, 1].map(|axis| landmark.at_m[axis] - row.at_m[axis]);
            let turn = (landmark.heading_rad.to_degrees() - row.heading_deg).rem_euclid(360.0);
            let turn = turn.min(360.0 - turn);
            landmark.kind == row.kind && dx.hypot(dy) <= OFF_MAX_M && turn <= TURN_MAX_DEG
        });
        match (found, row.exception) {
            (Some(found), "") => drop(invented.remove(found)),
            (None, "") => missing.push(row),
            (Some(_), why) => panic!("{} is found, although {why}", row.vertices),
            (None, _) => {}
        }
    }
    assert!(missing.is_empty(), "missing: {missing:#?}");
    assert!(invented.is_empty(), "not on the list: {invented:#?}");
    // The list itself: what a person counts on the drawing.
    let count = |kind| rows().iter().filter(|row| row.kind == kind).count();
    let kinds = [
        LandmarkKind::ConcaveCorner,
        LandmarkKind::ConvexCorner,
        LandmarkKind::WallEnd,
        LandmarkKind::Doorway,
    ];
    assert_eq!(kinds.map(count), [21, 9, 4, 3]);
    assert_eq!(rows().iter().filter(|row| !row.exception.is_empty()).count(), 2);
}
