//! Robots that do not know where they are: what they send is held, aligned, and had back.

use std::collections::BTreeMap;
use std::time::Duration;

use mapfold_map::geometry::{Covariance, Line, Point, Pose, UncertainLine, UncertainPose};
use mapfold_map::level::{Contribution, ContributionId, Provenance};
use mapfold_map::raster::{Cell, EvidencePatch, SensorClass, TILE_CELLS, TileIndex, TilePatch};
use mapfold_map::vector::{EndKind, Facing, ObservedEnd, ObservedSegment};
use mapfold_schema::border::wire_contribution;
use mapfold_schema::route;
use mapfold_schema::v1::{
    self, Alignment, AlignmentDoubt, Alignments, ContributionEntry, ContributionPage,
    ContributionState, NewAlignment, NewRevert, Receipt, Revert, RobotDescription, RobotState,
    RobotUpdate, UploadAnswer,
};
use mapfold_server::maintenance::verify;
use mapfold_server::store::{Store, sqlite_url};
use reqwest::Method;
use serde_json::json;
use uuid::Uuid;

use crate::client::{Answer, Client};
use crate::server::Server;
use crate::world::{Level, id};

/// A robot's own frame.
fn frame(number: u128) -> Uuid {
    Uuid::from_u128(0x5000_0000_0000_4000_8000_0000_0000_0000 + number)
}

/// The `number`th look of a robot in a frame of its own.
async fn lost_look(floor: &Level, robot: &str, number: u64, own: Uuid) -> v1::Contribution {
    let mut look = floor.look(robot, number).await;
    look.frame = own;
    look.pose.provenance = v1::Provenance::OwnMap;
    look
}

fn alignment_of(floor: &Level, own: Uuid) -> String {
    floor.path(route::ALIGNMENT).replace("{frame}", &own.to_string())
}

async fn delete(client: &Client, path: &str) -> Answer {
    Answer::to(client.request(Method::DELETE, path)).await
}

async fn geojson(floor: &Level) -> Vec<u8> {
    let path = floor.path(route::EXPORTS).replace("{format}", "geojson");
    floor.client.get(&path).await.expect(200).body
}

async fn entry(floor: &Level, number: u64) -> ContributionEntry {
    let page: ContributionPage =
        floor.client.get(&floor.path(route::CONTRIBUTIONS)).await.expect(200).data();
    page.contributions.into_iter().find(|entry| entry.id == id(number)).unwrap()
}

fn pose() -> v1::UncertainPose {
    v1::UncertainPose {
        x_m: 4.0,
        y_m: -3.0,
        heading_rad: 1.25,
        covariance: [[1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [0.0, 0.0, 1e-5]],
    }
}

fn at(pose: v1::UncertainPose) -> NewAlignment {
    NewAlignment { pose: Some(pose), comment: "saw it there".to_owned() }
}

/// Tells what becomes of a lost robot's looks; answers the map with them in and when they are out again.
pub(crate) async fn story(server: &Server, floor: &Level) -> [Vec<u8>; 2] {
    let (admin, contributions) = (server.admin(), floor.path(route::CONTRIBUTIONS));
    floor.enrol("lost").await;
    let before = floor.describe().await;
    let alone = geojson(floor).await;
    let looks = [
        lost_look(floor, "lost", 101, frame(1)).await,
        lost_look(floor, "lost", 102, frame(1)).await,
    ];
    let answers: Vec<UploadAnswer> = admin.post(&contributions, &looks).await.expect(201).data();
    let receipt = |answer: &UploadAnswer| match answer {
        UploadAnswer::Receipt(receipt) => receipt.clone(),
        UploadAnswer::Problem(problem) => panic!("{problem:?}"),
    };
    let receipts: Vec<Receipt> = answers.iter().map(receipt).collect();
    assert!(receipts.iter().all(|receipt| receipt.state == ContributionState::Held));
    floor.folded(before.revision + 2).await;
    assert_eq!(floor.describe().await.counts.in_force, before.counts.in_force);
    assert_eq!(geojson(floor).await, alone, "what is held is not in the map");
    let robot: RobotDescription =
        admin.get(&route::robot("plant", "lost")).await.expect(200).data();
    assert_eq!((robot.contributions, robot.last_pose), (2, None), "nobody knows where it is");
    let held = entry(floor, 101).await;
    assert_eq!((held.state, held.frame), (ContributionState::Held, Some(frame(1))));

    let told: Alignments = admin.get(&floor.path(route::ALIGNMENTS)).await.expect(200).data();
    let [unaligned] = told.unaligned.as_slice() else { panic!("{told:?}") };
    assert_eq!((unaligned.frame, unaligned.contributions), (frame(1), 2));
    assert_eq!(unaligned.robots, ["lost"]);
    assert!(!unaligned.is_certain && unaligned.doubts.contains(&AlignmentDoubt::LittleOverlap));
    let path = alignment_of(floor, frame(1));
    let refused = admin.post(&path, &NewAlignment::default()).await;
    assert_eq!(refused.code(409), "alignment_uncertain");

    // An operator knows where it is.
    let made: Alignment = admin.post(&path, &at(pose())).await.expect(201).data();
    assert_eq!((made.contributions, made.withdrawn), (2, None));
    assert_eq!((made.pose.clone(), made.comment.as_str()), (pose(), "saw it there"));
    floor.folded(made.revision).await;
    assert_eq!(floor.describe().await.counts.in_force, before.counts.in_force + 2);
    let state = entry(floor, 101).await.state;
    assert_eq!(state, ContributionState::Folded);
    let aligned = geojson(floor).await;
    assert_ne!(aligned, alone);
    assert_eq!(admin.post(&path, &at(pose())).await.code(409), "frame_aligned");
    // Sent again it gets the receipt that it had.
    let again: Receipt = admin.post(&contributions, &looks[0]).await.expect(201).data();
    assert_eq!(again, receipts[0]);

    // A later look in the same frame follows.
    let late = lost_look(floor, "lost", 103, frame(1)).await;
    admin.post(&contributions, &late).await.expect(201);
    let patience = tokio::time::Instant::now();
    while entry(floor, 103).await.state == ContributionState::Held {
        assert!(patience.elapsed() < Duration::from_secs(20), "it does not follow");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    let told: Alignments = admin.get(&floor.path(route::ALIGNMENTS)).await.expect(200).data();
    assert!(told.unaligned.is_empty());
    assert_eq!(told.alignments[0].author, "rule");
    assert_eq!((told.alignments[0].contributions, &told.alignments[0].pose), (1, &pose()));
    floor.folded(told.alignments[0].revision).await;
    let all = geojson(floor).await;

    // What a revert has taken out would be put back elsewhere.
    let revert = NewRevert { contributions: Some(vec![id(101)]), ..NewRevert::default() };
    let revert = NewRevert { reason: "drift".to_owned(), ..revert };
    let reverts = floor.path(route::REVERTS);
    let revert: Revert = admin.post(&reverts, &revert).await.expect(201).data();
    floor.folded(revert.revision).await;
    assert_ne!(geojson(floor).await, all);
    assert_eq!(delete(&admin, &path).await.code(409), "frame_reverted");
    let undone: Revert =
        delete(&admin, &format!("{reverts}/{}", revert.id)).await.expect(200).data();
    floor.folded(undone.undone.unwrap().revision).await;
    assert!(geojson(floor).await == all, "a revert of what was aligned is exact");

    let withdrawn: Vec<Alignment> = delete(&admin, &path).await.expect(200).data();
    assert_eq!(withdrawn.len(), 2);
    floor.folded(withdrawn[0].withdrawn.unwrap()).await;
    let back = geojson(floor).await;
    assert!(back == alone, "the map is as if they never were");
    assert_eq!(entry(floor, 103).await.state, ContributionState::Held);
    assert_eq!(delete(&admin, &path).await.code(409), "frame_not_aligned");

    // Elsewhere, from what is held.
    let elsewhere = v1::UncertainPose { x_m: -6.0, heading_rad: -2.0, ..pose() };
    let made: Alignment = admin.post(&path, &at(elsewhere)).await.expect(201).data();
    assert_eq!(made.contributions, 3);
    floor.folded(made.revision).await;
    assert_ne!(geojson(floor).await, all);
    [all, geojson(floor).await]
}

#[tokio::test(flavor = "multi_thread")]
async fn a_lost_robots_map_is_held_aligned_and_had_back() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    for number in 1..=3 {
        floor.contribute("r1", number).await;
    }
    let [_, last] = story(&server, &floor).await;
    // What is stored is what the log says, also to a server that begins with it.
    let folder = server.shutdown().await;
    let data = folder.path().join("data");
    let store = Store::connect(&sqlite_url(&data.join("mapfold.db"))).await.unwrap();
    let report = verify(&store, "plant", "floor").await.unwrap().unwrap();
    assert!(report.is_sound(), "{:?}", report.faults);
    store.close().await;
    let server = Server::start_with(|config| config.data_dir = data).await;
    let floor = Level { client: server.admin(), ..floor };
    assert!(geojson(&floor).await == last, "another map after a restart");
}

#[tokio::test(flavor = "multi_thread")]
async fn what_makes_no_sense_is_refused() {
    let server = Server::start().await;
    let (admin, floor) = (server.admin(), Level::create(&server.admin()).await);
    let contributions = floor.path(route::CONTRIBUTIONS);
    let mut look = lost_look(&floor, "r1", 1, frame(1)).await;
    look.frame = floor.describe().await.frame;
    let problem = admin.post(&contributions, &look).await.problem(422);
    assert_eq!(problem.errors[0].code, "frame_mismatch", "the level's frame is not its own");
    look.frame = frame(1);
    look.pose.provenance = v1::Provenance::Odometry;
    let problem = admin.post(&contributions, &look).await.problem(422);
    assert_eq!(problem.errors[0].code, "frame_mismatch");
    look.pose.provenance = v1::Provenance::OwnMap;
    admin.post(&contributions, &look).await.expect(201);
    let path = alignment_of(&floor, frame(1));
    for (body, pointer) in [
        (
            json!({"pose": {"x_m": 1e9, "y_m": 0.0, "heading_rad": 0.0, "covariance": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]}}),
            "/pose/x_m",
        ),
        (
            json!({"pose": {"x_m": 0.0, "y_m": 0.0, "heading_rad": 9.0, "covariance": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]}}),
            "/pose/heading_rad",
        ),
        (
            json!({"pose": {"x_m": 0.0, "y_m": 0.0, "heading_rad": 0.0, "covariance": [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}}),
            "/pose/covariance",
        ),
    ] {
        let problem = admin.post(&path, &body).await.problem(422);
        assert_eq!(problem.errors[0].pointer, pointer);
    }
    let nobody = alignment_of(&floor, frame(2));
    assert_eq!(admin.post(&nobody, &at(pose())).await.code(409), "nothing_held");
    assert_eq!(floor.describe().await.revision, 1, "nothing of it is in the log");
}

/// A corridor with niches, unlike itself when turned, counter-clockwise.
fn corridor() -> Vec<Point> {
    [
        (0.0, 0.0),
        (3.0, 0.0),
        (3.0, -1.2),
        (4.5, -1.2),
        (4.5, 0.0),
        (8.0, 0.0),
        (8.0, -0.8),
        (8.8, -0.8),
        (8.8, 0.0),
        (12.0, 0.0),
        (12.0, -2.0),
        (14.5, -2.0),
        (14.5, 0.0),
        (20.0, 0.0),
        (20.0, 3.0),
        (17.0, 3.0),
        (17.0, 4.7),
        (15.2, 4.7),
        (15.2, 3.0),
        (9.0, 3.0),
        (9.0, 5.5),
        (6.0, 5.5),
        (6.0, 3.0),
        (2.0, 3.0),
        (2.0, 3.9),
        (1.2, 3.9),
        (1.2, 3.0),
        (0.0, 3.0),
    ]
    .map(|(x, y)| Point::new(x, y))
    .to_vec()
}

fn is_inside(outline: &[Point], p: &Point) -> bool {
    let edges = outline.iter().zip(outline.iter().cycle().skip(1));
    let crossings = edges.filter(|(a, b)| {
        (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)
    });
    crossings.count() % 2 == 1
}

/// One look at all of the corridor, in a frame in which its origin is at `pose`.
fn corridor_look(
    pose: &Pose<mapfold_map::geometry::Level, mapfold_map::geometry::Level>,
) -> Contribution {
    const RESOLUTION: f64 = 0.05;
    let outline = corridor();
    let back = pose.inverse();
    let near =
        [(-0.07, 0.0), (0.07, 0.0), (0.0, -0.07), (0.0, 0.07)].map(|(x, y)| Point::new(x, y));
    let mut tiles: BTreeMap<TileIndex, Box<[i16; TILE_CELLS]>> = BTreeMap::new();
    for (x, y) in (-4..=684)
        .flat_map(|x| (-72..=190).map(move |y| (f64::from(x) * 0.03, f64::from(y) * 0.03)))
    {
        let cell = Cell::holding(&pose.act(&Point::new(x, y)), RESOLUTION);
        let centre = back.act(&cell.centre(RESOLUTION));
        let value = if is_inside(&outline, &centre) {
            -40
        } else if near.iter().any(|off| is_inside(&outline, &(centre + off))) {
            85
        } else {
            continue;
        };
        let (tile, offset) = cell.tile();
        tiles.entry(tile).or_insert_with(|| Box::new([0; TILE_CELLS]))[offset] = value;
    }
    let wall = |(a, b): (&Point, &Point)| {
        let way = (b - a).normalize();
        let right = Point::new(way.y, -way.x);
        let (line, is_flipped) = Line::normal_form(right.dot(a), right.y.atan2(right.x));
        let ends = [line.along(a), line.along(b)];
        ObservedSegment {
            line: UncertainLine { line, covariance: Covariance::from_variances([1e-4, 1e-5]) },
            from: ends[0].min(ends[1]),
            to: ends[0].max(ends[1]),
            facing: if is_flipped { Facing::Away } else { Facing::Origin },
            ends: [ObservedEnd { kind: EndKind::Corner, sd: 0.01 }; 2],
            points: 40,
            seen_through: vec![],
        }
    };
    let tiles = tiles.into_iter().map(|(tile, cells)| (tile, TilePatch::from_cells(&cells)));
    Contribution {
        id: ContributionId([0; 16]),
        robot: "r1".into(),
        observed_at_us: 0,
        level_from_robot: UncertainPose {
            pose: Pose::new(pose.x, pose.y, pose.heading()),
            covariance: Covariance::from_variances([1e-4, 1e-4, 1e-6]),
        },
        provenance: Provenance::SharedMap,
        segments: outline.iter().zip(outline.iter().cycle().skip(1)).map(wall).collect(),
        clusters: vec![],
        evidence: vec![EvidencePatch { class: SensorClass::Scanner, tiles: tiles.collect() }],
    }
}

/// The same look, of a robot, as its `number`th.
fn named(look: &Contribution, number: u64, robot: &str) -> Contribution {
    Contribution {
        id: ContributionId(id(number).into_bytes()),
        robot: robot.into(),
        observed_at_us: 1_700_000_000_000_000 + number as i64,
        ..look.clone()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_map_that_fits_in_one_place_only_is_aligned_by_rule() {
    let server = Server::start().await;
    let (admin, floor) = (server.admin(), Level::create(&server.admin()).await);
    floor.enrol("lost").await;
    floor.enrol("bad").await;
    let held = RobotUpdate { state: Some(RobotState::Held), ..RobotUpdate::default() };
    let patch = admin.request(Method::PATCH, &route::robot("plant", "bad"));
    let patch = patch.header("content-type", "application/json");
    let held = serde_json::to_string(&held).unwrap();
    Answer::to(patch.body(held)).await.expect(200);
    let contributions = floor.path(route::CONTRIBUTIONS);
    let level_frame = floor.describe().await.frame;
    let away = Pose::new(31.0, -12.0, 2.2);
    let drawn = corridor_look(&Pose::identity());
    for number in 1..=3 {
        let look = wire_contribution(&named(&drawn, number, "r1"), level_frame, false, None);
        admin.post(&contributions, &look).await.expect(201);
    }
    floor.folded(3).await;
    let drawn = corridor_look(&away);
    for (robot, own, first) in [("bad", frame(2), 200), ("lost", frame(1), 100)] {
        let looks: Vec<v1::Contribution> = (first..first + 16)
            .map(|number| {
                let mut look = wire_contribution(&named(&drawn, number, robot), own, false, None);
                look.pose.provenance = v1::Provenance::OwnMap;
                look
            })
            .collect();
        admin.post(&contributions, &looks).await.expect(201);
    }
    let patience = tokio::time::Instant::now();
    let told = loop {
        let told: Alignments = admin.get(&floor.path(route::ALIGNMENTS)).await.expect(200).data();
        if !told.alignments.is_empty() {
            break told;
        }
        assert!(patience.elapsed() < Duration::from_mins(2), "{told:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    let [alignment] = told.alignments.as_slice() else { panic!("{told:?}") };
    assert_eq!((alignment.frame, alignment.author.as_str()), (frame(1), "rule"));
    assert_eq!(alignment.contributions, 16);
    let truth = away.inverse();
    let off = (alignment.pose.x_m - truth.x).hypot(alignment.pose.y_m - truth.y);
    assert!(off < 0.1, "{off} {alignment:?}");
    // What a robot sends that is held as such waits for an operator, however well it fits.
    let [waiting] = told.unaligned.as_slice() else { panic!("{told:?}") };
    assert!(waiting.frame == frame(2) && waiting.is_certain, "{waiting:?}");
    let path = alignment_of(&floor, frame(2));
    let made: Alignment = admin.post(&path, &NewAlignment::default()).await.expect(201).data();
    assert_eq!(made.contributions, 16);
    floor.folded(made.revision).await;
    assert_eq!(floor.describe().await.counts.in_force, 35);
}
