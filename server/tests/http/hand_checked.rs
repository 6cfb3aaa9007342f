//! Real buildings against lists of their corners, ends and doorways that were made by looking at their drawings: all of them are
//! found, and no other. The lists know the drawings and nothing of our geometry (see tests/data/README.md).

use mapfold_schema::route;
use mapfold_schema::v1::{LandmarkKind, LandmarkTable};
use reqwest::Method;
use reqwest::header::IF_MATCH;

use crate::client::Answer;
use crate::server::Server;
use crate::world::Level;

/// Kinds in the order in which they are counted.
const KINDS: [LandmarkKind; 4] = [
    LandmarkKind::ConcaveCorner,
    LandmarkKind::ConvexCorner,
    LandmarkKind::WallEnd,
    LandmarkKind::Doorway,
];

/// A building and its list.
struct Checked {
    building: &'static str,
    /// The level's name, if there are several.
    query: &'static str,
    list: &'static str,
    /// Metres of the list's unit to the right and up.
    unit_m: [f64; 2],
    /// How far a landmark may be from where the list has it, metres.
    off_max_m: f64,
    /// How far it may be turned, degrees.
    turn_max_deg: f64,
}

const OFFICE: Checked = Checked {
    building: include_str!("../../../tests/data/office.building.yaml"),
    query: "",
    list: include_str!("../../../tests/data/office.landmarks.csv"),
    unit_m: [1.0, 1.0],
    // Walls that are drawn twice are some millimetres apart and not quite parallel.
    off_max_m: 0.02,
    turn_max_deg: 2.0,
};

const HOTEL: Checked = Checked {
    building: include_str!("../../../tests/data/hotel.building.yaml"),
    query: "?building_level=L1",
    list: include_str!("../../../tests/data/hotel.landmarks.csv"),
    unit_m: [0.055_68, -0.055_68],
    // A pixel or two, and from the middles of walls to their faces.
    off_max_m: 0.15,
    turn_max_deg: 8.0,
};

#[derive(Debug)]
struct Row {
    kind: LandmarkKind,
    at_m: [f64; 2],
    heading_deg: f64,
    what: &'static str,
    /// Why it is none for robots, though it is there.
    exception: &'static str,
}

impl Checked {
    fn rows(&self) -> Vec<Row> {
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
                at_m: [number(1) * self.unit_m[0], number(2) * self.unit_m[1]],
                heading_deg: number(3),
                what: fields[4],
                exception: fields[5],
            }
        };
        self.list.lines().skip(1).map(row).collect()
    }

    async fn table(&self) -> LandmarkTable {
        let server = Server::start().await;
        let floor = Level::create(&server.admin()).await;
        let path = format!("{}{}", floor.path(route::IMPORTS), self.query);
        let import = floor.client.post_bytes(&path, "application/yaml", self.building.to_owned());
        import.await.expect(201);
        let publications = floor.path(route::GDB_PUBLICATIONS);
        let publish = floor.client.request(Method::POST, &publications).header(IF_MATCH, "\"1.0\"");
        let publish = publish.header("content-type", "application/json").body("null");
        Answer::to(publish).await.expect(201);
        floor.client.get(&floor.path(route::LANDMARKS)).await.expect(200).data()
    }

    /// Every row is found once, and nothing else; answers how many rows there are of each kind, and exceptions.
    async fn hold(&self) -> ([usize; 4], usize) {
        let mut invented = self.table().await.landmarks;
        let mut missing = Vec::new();
        for row in self.rows() {
            let fits = |landmark: &mapfold_schema::v1::Landmark| {
                let [dx, dy] = [0, 1].map(|axis| landmark.at_m[axis] - row.at_m[axis]);
                let round = if row.kind == LandmarkKind::Doorway { 180.0 } else { 360.0 };
                let turn = landmark.heading_rad.to_degrees() - row.heading_deg;
                let turn = turn.rem_euclid(round);
                landmark.kind == row.kind
                    && dx.hypot(dy) <= self.off_max_m
                    && turn.min(round - turn) <= self.turn_max_deg
            };
            match (invented.iter().position(fits), row.exception) {
                (Some(found), "") => drop(invented.remove(found)),
                (None, "") => missing.push(row),
                (Some(_), why) => panic!("{} is found, although {why}", row.what),
                (None, _) => {}
            }
        }
        assert!(missing.is_empty(), "missing: {missing:#?}; besides: {invented:#?}");
        assert!(invented.is_empty(), "not on the list: {invented:#?}");
        let count = |kind| self.rows().iter().filter(|row| row.kind == kind).count();
        let exceptions = self.rows().iter().filter(|row| !row.exception.is_empty()).count();
        (KINDS.map(count), exceptions)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_corner_of_an_office_is_found_and_none_invented() {
    assert_eq!(OFFICE.hold().await, ([21, 9, 4, 3], 2));
}

#[tokio::test(flavor = "multi_thread")]
async fn every_corner_of_a_hotel_is_found_and_none_invented() {
    assert_eq!(HOTEL.hold().await, ([52, 15, 4, 5], 0));
}
