//! Sites, levels, robots: made, described, refused.

use mapfold_schema::codec::CBOR;
use mapfold_schema::route;
use mapfold_schema::v1::{
    LevelDescription, NewLevel, NewRobot, NewSite, RangeCorrection, RobotDescription, RobotState,
    RobotUpdate, SensorKind, SensorMount, SensorProfile, SiteDescription,
};
use reqwest::Method;
use reqwest::header::ACCEPT;

use crate::client::Answer;
use crate::server::Server;
use crate::world::{Level, scanner};

#[tokio::test(flavor = "multi_thread")]
async fn what_was_made_is_described_and_not_made_twice() {
    let server = Server::start().await;
    let admin = server.admin();
    let site = NewSite { site: "mit".to_owned(), name: Some("Killian Court".to_owned()) };
    let made = admin.post(route::SITES, &site).await.expect(201);
    assert_eq!(made.data::<SiteDescription>().name, "Killian Court");
    assert_eq!(admin.post(route::SITES, &site).await.code(409), "site_exists");

    let levels = route::of_site(route::LEVELS, "mit");
    let level = NewLevel {
        level: "infinite-corridor".to_owned(),
        name: None,
        resolution_m: Some(0.1),
        elevation_m: Some(3.5),
        evidence_slice_s: Some(3600),
    };
    let made = admin.post(&levels, &level).await.expect(201);
    let here = made.header("location").to_owned();
    let made: LevelDescription = made.data();
    assert_eq!(made.frame.get_version_num(), 4);
    assert_eq!((made.resolution_m, made.elevation_m, made.revision), (0.1, 3.5, 0));
    assert_eq!(made.evidence_slice_s, 3600);
    assert_eq!(admin.get(&here).await.expect(200).data::<LevelDescription>(), made);
    assert_eq!(admin.post(&levels, &level).await.code(409), "level_exists");
    let all: Vec<LevelDescription> = admin.get(&levels).await.expect(200).data();
    assert_eq!(all, [made]);
    let missing = admin.post(&route::of_site(route::LEVELS, "nowhere"), &level).await;
    assert_eq!(missing.code(404), "site_not_found");
    assert_eq!(admin.get(&route::level("mit", "attic")).await.code(404), "level_not_found");
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_are_enrolled_changed_and_told_apart_by_competence() {
    let server = Server::start().await;
    let admin = server.admin();
    Level::create(&admin).await;
    let robots = route::of_site(route::ROBOTS, "plant");
    let mut sonar = scanner();
    sonar.kind = SensorKind::Sonar;
    sonar.beam_rad = 0.4;
    sonar.emulated = true;
    let new = NewRobot {
        robot: "bat".to_owned(),
        name: Some("The bat".to_owned()),
        sensors: vec![sonar, scanner()],
    };
    let made: RobotDescription = admin.post(&robots, &new).await.expect(201).data();
    assert_eq!(made.competence, [SensorKind::Scanner, SensorKind::Sonar]);
    assert_eq!(made.sensors, new.sensors);
    assert_eq!(admin.post(&robots, &new).await.code(409), "robot_exists");

    let update = RobotUpdate {
        state: Some(RobotState::Held),
        queue_length: Some(7),
        ..RobotUpdate::default()
    };
    let patch = admin.request(Method::PATCH, &route::robot("plant", "bat"));
    let patch = patch.header("content-type", CBOR).header(ACCEPT, CBOR);
    let patch = patch.body(mapfold_schema::codec::to_cbor(&update).unwrap());
    let changed: RobotDescription = Answer::to(patch).await.expect(200).data();
    assert_eq!((changed.state, changed.queue_length), (RobotState::Held, Some(7)));
    assert_eq!(changed.name, "The bat");
    let all: Vec<RobotDescription> = admin.get(&robots).await.expect(200).data();
    assert_eq!(all.iter().map(|r| r.robot.as_str()).collect::<Vec<_>>(), ["bat", "r1"]);
    assert_eq!(admin.get(&route::robot("plant", "cat")).await.code(404), "robot_not_found");
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_fields_are_named_and_nothing_is_made() {
    let server = Server::start().await;
    let admin = server.admin();
    for (body, pointer) in [
        (r#"{"site": "Bad Slug"}"#, "/site"),
        (r#"{"site": "a", "name": ""}"#, "/name"),
        (r#"{"site": "a", "name": "\u0007"}"#, "/name"),
        (r#"{"site": "a", "owner": "me"}"#, "/owner"),
        (r#"{"site": 7}"#, "/site"),
    ] {
        let answer = admin.post_bytes(route::SITES, "application/json", body).await;
        let problem = answer.problem(422);
        assert_eq!(problem.code, "body_invalid", "{body}");
        assert_eq!(problem.errors[0].pointer, pointer, "{body}");
    }
    assert_eq!(admin.get(route::SITES).await.data::<Vec<SiteDescription>>(), []);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sensor_is_kept_whole_with_its_table_and_refused_place_by_place() {
    let server = Server::start().await;
    let admin = server.admin();
    Level::create(&admin).await;
    let distances_m: Vec<f64> = (3..=40).map(|i| 0.1 * f64::from(i)).collect();
    let incidences_rad: Vec<f64> = (0..8).map(|i| f64::from(10 * i).to_radians()).collect();
    let row = |i: usize| distances_m.iter().map(|d| 0.01 * (d + i as f64).sin()).collect();
    let correction = RangeCorrection {
        bias_m: (0..8).map(row).collect(),
        sd_m: vec![vec![0.012; distances_m.len()]; 8],
        incidence_max_rad: 65f64.to_radians(),
        distances_m: distances_m.clone(),
        incidences_rad,
    };
    let sensor = SensorProfile {
        range_min_m: Some(0.2),
        range_sd_per_m: Some(0.004),
        systematic_sd_m: Some(0.01),
        mount: Some(SensorMount { x_m: 0.1, y_m: -0.2, heading_rad: 0.3 }),
        correction: Some(correction),
        ..scanner()
    };
    let ring = SensorProfile {
        transducers: vec![SensorMount::default(); 8],
        ..SensorProfile::new(SensorKind::Sonar, 5.0, 0.03, 0.4)
    };
    let update =
        RobotUpdate { sensors: Some(vec![sensor.clone(), ring.clone()]), ..Default::default() };
    let path = route::robot("plant", "r1");
    let patch = |update: &RobotUpdate| {
        let body = serde_json::to_vec(update).unwrap();
        let patch = admin.request(Method::PATCH, &path);
        patch.header("content-type", "application/json").body(body)
    };
    let changed: RobotDescription = Answer::to(patch(&update)).await.expect(200).data();
    assert_eq!(changed.sensors, [sensor.clone(), ring]);
    let robots = route::of_site(route::ROBOTS, "plant");
    let all: Vec<RobotDescription> = admin.get(&robots).await.expect(200).data();
    assert_eq!(all[0].sensors, changed.sensors);

    let mut bad = sensor;
    bad.systematic_sd_m = Some(-0.01);
    bad.correction.as_mut().unwrap().sd_m[3].pop();
    let update = RobotUpdate { sensors: Some(vec![bad]), ..Default::default() };
    let problem = Answer::to(patch(&update)).await.problem(422);
    let pointers: Vec<_> = problem.errors.iter().map(|e| e.pointer.as_str()).collect();
    assert_eq!(pointers, ["/sensors/0/systematic_sd_m", "/sensors/0/correction/sd_m/3"]);
    let kept: RobotDescription = admin.get(&path).await.expect(200).data();
    assert_eq!(kept.sensors, changed.sensors);
}
