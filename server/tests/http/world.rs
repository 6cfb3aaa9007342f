//! A small world to ask about: sites, levels, robots, and what the robots saw.

use std::time::Duration;

use mapfold_schema::border::{DEFAULT_LIMITS, Target};
use mapfold_schema::v1::{
    Contribution, IssuedToken, LevelDescription, NewLevel, NewRobot, NewSite, NewToken, Receipt,
    SensorKind, SensorProfile,
};
use mapfold_schema::{malformed, route};
use uuid::Uuid;

use crate::client::Client;

/// How long the fold may take to reach what was acknowledged.
const PATIENCE: Duration = Duration::from_secs(20);

/// A level with robots, and somebody who asks about it.
#[derive(Clone)]
pub(crate) struct Level {
    pub(crate) client: Client,
    pub(crate) site: String,
    pub(crate) name: String,
}

/// A scanner.
pub(crate) fn scanner() -> SensorProfile {
    SensorProfile {
        model: "of tests".to_owned(),
        ..SensorProfile::new(SensorKind::Scanner, 20.0, 0.02, 0.01)
    }
}

/// The `number`th contribution id.
pub(crate) fn id(number: u64) -> Uuid {
    Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0000 + u128::from(number))
}

impl Level {
    /// Makes `plant`/`floor` with the robot `r1`.
    pub(crate) async fn create(client: &Client) -> Self {
        Self::create_at(client, "plant", "floor").await
    }

    /// Makes a site, a level and the robot `r1`.
    pub(crate) async fn create_at(client: &Client, site: &str, level: &str) -> Self {
        let new = NewSite { site: site.to_owned(), name: None };
        client.post(route::SITES, &new).await.expect(201);
        let new = NewLevel {
            level: level.to_owned(),
            name: None,
            resolution_m: None,
            elevation_m: None,
            evidence_slice_s: None,
        };
        client.post(&route::of_site(route::LEVELS, site), &new).await.expect(201);
        let made = Self { client: client.clone(), site: site.to_owned(), name: level.to_owned() };
        made.enrol("r1").await;
        made
    }

    /// Enrols a robot.
    pub(crate) async fn enrol(&self, robot: &str) {
        let new = NewRobot { robot: robot.to_owned(), name: None, sensors: vec![scanner()] };
        self.client.post(&route::of_site(route::ROBOTS, &self.site), &new).await.expect(201);
    }

    /// A token for a robot.
    pub(crate) async fn token(&self, robot: &str) -> String {
        let path = format!("{}/tokens", route::robot(&self.site, robot));
        let issued = self.client.post(&path, &NewToken { scopes: None }).await.expect(201);
        issued.data::<IssuedToken>().token
    }

    /// The path of something of the level.
    pub(crate) fn path(&self, template: &str) -> String {
        route::of_level(template, &self.site, &self.name)
    }

    pub(crate) async fn describe(&self) -> LevelDescription {
        self.client.get(&self.path(route::LEVEL)).await.expect(200).data()
    }

    /// The `number`th look of a robot: the same wall and cells, from a little further on.
    pub(crate) async fn look(&self, robot: &str, number: u64) -> Contribution {
        let level = self.describe().await;
        let target =
            Target { frame: level.frame, resolution_m: level.resolution_m, limits: DEFAULT_LIMITS };
        let mut look = malformed::valid(id(number), robot, &target);
        look.pose.x_m += number as f64 * 0.01;
        look
    }

    /// Uploads a look and waits until it is in the map.
    pub(crate) async fn contribute(&self, robot: &str, number: u64) -> Receipt {
        let look = self.look(robot, number).await;
        let answer = self.client.post(&self.path(route::CONTRIBUTIONS), &look).await;
        let receipt: Receipt = answer.expect(201).data();
        self.folded(receipt.revision).await;
        receipt
    }

    /// Waits until the map has reached a revision.
    pub(crate) async fn folded(&self, revision: i64) {
        let begin = tokio::time::Instant::now();
        while self.describe().await.folded_revision < revision {
            assert!(begin.elapsed() < PATIENCE, "revision {revision} is not folded");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }
}
