//! The same requests on both engines: the same answers, and the same exports byte for byte.

use mapfold_schema::route;
use mapfold_schema::v1::{ContributionPage, RobotDescription};
use mapfold_server::config::Secret;
use sqlx::{AnyConnection, AssertSqlSafe, Connection, Executor};

use crate::alignments;
use crate::server::Server;
use crate::world::Level;

/// Tells a small story and answers what can be seen of it.
async fn story(server: &Server) -> (Vec<u8>, Vec<u8>, Vec<i64>, [Vec<u8>; 2]) {
    let floor = Level::create(&server.admin()).await;
    floor.enrol("r2").await;
    let robot = server.with(&floor.token("r1").await);
    for number in [1, 3, 2] {
        let look = floor.look("r1", number).await;
        robot.post(&floor.path(route::CONTRIBUTIONS), &look).await.expect(201);
    }
    floor.contribute("r2", 4).await;
    let same = floor.look("r1", 3).await;
    robot.post(&floor.path(route::CONTRIBUTIONS), &same).await.expect(201);
    let mut other = same;
    other.pose.x_m += 0.5;
    let conflict = robot.post(&floor.path(route::CONTRIBUTIONS), &other).await;
    assert_eq!(conflict.code(409), "contribution_conflict");
    let seen: RobotDescription = robot.get(&route::robot("plant", "r1")).await.expect(200).data();
    assert_eq!(seen.contributions, 3);
    assert!(seen.last_pose.is_some());
    server.anybody().get("/readyz").await.expect(200);
    let aligned = alignments::story(server, &floor).await;
    let log: ContributionPage =
        robot.get(&floor.path(route::CONTRIBUTIONS)).await.expect(200).data();
    let export = |format| floor.path(route::EXPORTS).replace("{format}", format);
    (
        robot.get(&export("geojson")).await.expect(200).body,
        robot.get(&export("nav2")).await.expect(200).body,
        log.contributions.iter().map(|entry| entry.revision).collect(),
        aligned,
    )
}

async fn administer(server: &str, statement: String) {
    sqlx::any::install_default_drivers();
    let mut connection = AnyConnection::connect(server).await.unwrap();
    // The name is ours, and no parameter can stand there.
    connection.execute(AssertSqlSafe(statement)).await.unwrap();
    connection.close().await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn postgres_and_sqlite_tell_the_same_story() {
    let postgres = std::env::var("MAPFOLD_TEST_POSTGRES").expect(
        "MAPFOLD_TEST_POSTGRES must hold the URL of a PostgreSQL database in which this test may \
         create others; `make test` starts one and sets it",
    );
    let name = format!("mapfold_http_{}", std::process::id());
    administer(&postgres, format!("create database {name}")).await;
    let url = format!("{}/{name}", postgres.rsplit_once('/').unwrap().0);
    let server = Server::start_with(|config| config.database = Some(Secret::new(url))).await;
    let on_postgres = story(&server).await;
    server.shutdown().await;
    administer(&postgres, format!("drop database {name} with (force)")).await;

    let server = Server::start().await;
    let on_sqlite = story(&server).await;
    assert!(on_postgres == on_sqlite, "the engines differ");
    assert_eq!(on_sqlite.2, [8, 6, 5, 4, 3, 2, 1]);
}
