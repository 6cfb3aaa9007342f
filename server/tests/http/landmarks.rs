//! Landmarks over HTTP: those that robots taught, beside those of the model.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

use mapfold_schema::route;
use mapfold_schema::v1::{
    Contribution, EndKind, Facing, Landmark, LandmarkKind, LandmarkSource, LandmarkTable,
    NewRevert, ObservedEnd, ObservedSegment, PoseEstimate, Provenance, Receipt,
};
use reqwest::Method;
use reqwest::header::IF_MATCH;
use serde_json::{Value, json};

use crate::client::Answer;
use crate::server::Server;
use crate::world::{Level, id};

/// A wall in the frame of a robot that stands at (3, 2) and looks along x.
fn wall(rho_m: f64, alpha_rad: f64, [from_m, to_m]: [f64; 2], kind: EndKind) -> ObservedSegment {
    let end = ObservedEnd { kind, sd_m: 0.005 };
    ObservedSegment {
        rho_m,
        alpha_rad,
        covariance: [[2.5e-5, 0.0], [0.0, 1e-6]],
        from_m,
        to_m,
        facing: Facing::Origin,
        ends: [end.clone(), end],
        points: 80,
        seen_through_m: vec![],
    }
}

/// A room of 6 by 4 m, and a partition at y = 1 that ends freely on both sides.
fn walls() -> Vec<ObservedSegment> {
    vec![
        wall(2.0, -FRAC_PI_2, [-3.0, 3.0], EndKind::Corner),
        wall(2.0, FRAC_PI_2, [-3.0, 3.0], EndKind::Corner),
        wall(3.0, 0.0, [-2.0, 2.0], EndKind::Corner),
        wall(3.0, PI, [-2.0, 2.0], EndKind::Corner),
        wall(1.0, -FRAC_PI_2, [-1.5, 1.0], EndKind::Jump),
    ]
}

async fn contribute(floor: &Level, robot: &str, number: u64) {
    let look = Contribution {
        pose: PoseEstimate {
            x_m: 3.0,
            y_m: 2.0,
            heading_rad: 0.0,
            covariance: [[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-6]],
            provenance: Provenance::Datum,
            basis: None,
        },
        segments: walls(),
        clusters: vec![],
        evidence: vec![],
        ..floor.look(robot, number).await
    };
    let answer = floor.client.post(&floor.path(route::CONTRIBUTIONS), &look).await;
    let receipt: Receipt = answer.expect(201).data();
    floor.folded(receipt.revision).await;
}

async fn publish_room(floor: &Level) {
    let block = |number: u64, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2]| {
        let solid = json!({"box": {"from_m": [x0, y0, 0.0], "to_m": [x1, y1, 2.5]}});
        let properties = json!({"kind": "wall", "solids": [solid]});
        json!({"type": "Feature", "id": id(900 + number), "geometry": null, "properties": properties})
    };
    // A little off, as buildings are.
    let features = [
        block(1, [-0.2, -0.2], [6.2, 0.01]),
        block(2, [-0.2, 4.01], [6.2, 4.2]),
        block(3, [-0.2, 0.0], [-0.02, 4.1]),
        block(4, [6.0, 0.0], [6.2, 4.1]),
    ];
    let model = json!({"type": "FeatureCollection", "features": features});
    let send = async |method, path: &str, tag: &str, body: &Value| {
        let request = floor.client.request(method, path).header("content-type", "application/json");
        Answer::to(request.header(IF_MATCH, tag).body(body.to_string())).await
    };
    let put = send(Method::PUT, &floor.path(route::GDB), "\"0.0\"", &model).await.expect(200);
    let tag = put.header("etag").to_owned();
    send(Method::POST, &floor.path(route::GDB_PUBLICATIONS), &tag, &Value::Null).await.expect(201);
}

async fn table(floor: &Level, query: &str) -> LandmarkTable {
    let path = format!("{}{query}", floor.path(route::LANDMARKS));
    floor.client.get(&path).await.expect(200).data()
}

fn count(table: &LandmarkTable, source: LandmarkSource, kind: LandmarkKind) -> usize {
    table.landmarks.iter().filter(|l| (l.source, l.kind) == (source, kind)).count()
}

/// A robot's copy of the table, kept by asking what has changed.
#[derive(Default)]
struct Copy {
    revision: i64,
    landmarks: BTreeMap<String, Landmark>,
}

impl Copy {
    /// Follows, and is then what anybody else is told.
    async fn follow(&mut self, floor: &Level, query: &str) -> LandmarkTable {
        let changes = table(floor, &format!("?since={}{query}", self.revision)).await;
        for id in &changes.removed {
            self.landmarks.remove(id);
        }
        let new = changes.landmarks.iter().map(|landmark| (landmark.id.clone(), landmark.clone()));
        self.landmarks.extend(new);
        self.revision = changes.revision;
        let whole = table(floor, &format!("?since=0{query}")).await;
        let whole_by_id = whole.landmarks.iter().map(|l| (l.id.clone(), l.clone())).collect();
        assert_eq!((self.revision, &self.landmarks), (whole.revision, &whole_by_id), "{query}");
        changes
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_robots_taught_joins_the_table_and_leaves_it_to_the_model() {
    use LandmarkKind::{ConcaveCorner, ConvexCorner, WallEnd};
    use LandmarkSource::{Gdb, Learned};
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    floor.enrol("r2").await;
    let queries = ["", "&competence=sonar", "&near=0,0&radius_m=2", "&height_m=0.8"];
    let mut copies: Vec<Copy> = queries.iter().map(|_| Copy::default()).collect();
    let mut all = Vec::new();
    for number in 1..=5 {
        contribute(&floor, if number == 5 { "r2" } else { "r1" }, number).await;
        if number == 1 {
            continue; // Nobody asks at revision 1.
        }
        for (copy, query) in copies.iter_mut().zip(queries) {
            let changes = copy.follow(&floor, query).await;
            all.push(changes.landmarks.len());
        }
        if number == 2 {
            assert_eq!(all, [0; 4], "two looks are not enough");
        }
    }
    let [whole, sonar, near, _] = &copies[..] else { unreachable!() };
    assert_eq!((whole.landmarks.len(), sonar.landmarks.len(), near.landmarks.len()), (6, 4, 2));
    let told = table(&floor, "").await;
    assert_eq!((told.publication, count(&told, Learned, ConcaveCorner)), (0, 4));
    assert_eq!(count(&told, Learned, WallEnd), 2);
    let corner = told.landmarks.iter().find(|l| l.at_m[0].hypot(l.at_m[1]) < 0.02).unwrap();
    assert!((corner.heading_rad - PI / 4.0).abs() < 0.02, "{corner:?}");
    assert!((corner.extent - FRAC_PI_2).abs() < 0.02 && corner.objects.len() == 2, "{corner:?}");
    let variances = [0, 1, 2].map(|k| corner.covariance[k][k]);
    assert!(variances.iter().all(|v| *v > 0.0 && *v < 4e-4), "{variances:?}");
    let support = corner.support.as_ref().unwrap();
    assert_eq!((support.looks, support.robots.as_slice()), (5, &["r1".into(), "r2".into()][..]));
    let ends: Vec<f64> =
        told.landmarks.iter().filter(|l| l.kind == WallEnd).map(|l| l.at_m[0]).collect();
    assert!(ends.iter().any(|x| (x - 1.5).abs() < 0.06), "{ends:?}");
    assert!(ends.iter().any(|x| (x - 4.0).abs() < 0.06), "{ends:?}");

    // Nothing has changed: nothing is told.
    let again = table(&floor, &format!("?since={}", told.revision)).await;
    assert_eq!((again.landmarks.len(), again.removed.len()), (0, 0));
    // What was told at a revision where nobody asked is not known.
    let forgotten = floor.client.get(&format!("{}?since=1", floor.path(route::LANDMARKS))).await;
    assert_eq!(forgotten.code(410), "cursor_expired");

    // The model has the corners, up to plaster; the partition is still the robots'.
    publish_room(&floor).await;
    for (copy, query) in copies.iter_mut().zip(queries) {
        let changes = copy.follow(&floor, query).await;
        let removed = changes.removed.iter().filter(|id| id.starts_with("learned:concave:"));
        assert_eq!(removed.count(), if query.contains("near") { 1 } else { 4 }, "{query}");
    }
    let told = table(&floor, "").await;
    let counts = [(Gdb, ConcaveCorner), (Gdb, ConvexCorner), (Learned, WallEnd)];
    assert_eq!(counts.map(|(source, kind)| count(&told, source, kind)), [4, 4, 2]);
    assert_eq!(count(&told, Learned, ConcaveCorner), 0);
    assert!(told.landmarks.iter().all(|l| (l.source == Learned) == l.support.is_some()));

    // Without the looks of one robot nothing bears the ends out any more.
    let what = NewRevert {
        robot: Some("r1".to_owned()),
        reason: "a mirror stood there".to_owned(),
        ..NewRevert::default()
    };
    floor.client.post(&floor.path(route::REVERTS), &what).await.expect(201);
    let revision = floor.describe().await.revision;
    floor.folded(revision).await;
    let changes = copies[0].follow(&floor, "").await;
    assert_eq!(changes.removed.iter().filter(|id| id.starts_with("learned:end:")).count(), 2);
    let told = table(&floor, "").await;
    assert!(told.landmarks.iter().all(|l| l.source == Gdb));
}
