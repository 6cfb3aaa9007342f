//! Malformed contributions over HTTP: each is refused by name and changes nothing.

#![expect(clippy::expect_used, reason = "tests may stop at the first surprise")]

use mapfold_schema::border::{DEFAULT_LIMITS, Target};
use mapfold_schema::codec::{CBOR, JSON, to_cbor};
use mapfold_schema::malformed::{catalogue, valid};
use mapfold_schema::problem::{PROBLEM_JSON, Problem};
use mapfold_schema::route;
use mapfold_schema::v1::{Receipt, UploadAnswer};
use mapfold_tests::Error;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::server::Server;
use serde::ser::{Serialize, SerializeMap as _, Serializer};
use serde_json::{Value, json};
use uuid::Uuid;

/// Kinds of malformed contributions that there must be at least.
const KINDS_MIN: usize = 40;

/// A JSON value as the same thing is written in CBOR, where UUIDs are bytes and fractional numbers
/// are floats however whole they are.
struct AsCbor<'a> {
    value: &'a Value,
    fractional: bool,
}

impl Serialize for AsCbor<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let fractional = self.fractional;
        match self.value {
            Value::String(text) => match Uuid::parse_str(text) {
                Ok(uuid) => serializer.serialize_bytes(uuid.as_bytes()),
                Err(_) => serializer.serialize_str(text),
            },
            Value::Number(number) if fractional => match number.as_f64() {
                Some(number) => serializer.serialize_f64(number),
                None => number.serialize(serializer),
            },
            Value::Array(items) => {
                serializer.collect_seq(items.iter().map(|value| Self { value, fractional }))
            }
            Value::Object(fields) => {
                let mut map = serializer.serialize_map(Some(fields.len()))?;
                for (key, value) in fields {
                    let fractional =
                        key.ends_with("_m") || key.ends_with("_rad") || key == "covariance";
                    map.serialize_entry(key, &Self { value, fractional })?;
                }
                map.end()
            }
            other => other.serialize(serializer),
        }
    }
}

async fn every_kind_is_refused(database: Database) -> Result<(), Error> {
    let server = Server::start(database).await?;
    let admin = Level::create(server.api()?, "plant", "floor").await?;
    let robot = Level { api: admin.api.with_token(&admin.enrol("r2").await?), ..admin.clone() };
    let description = admin.describe().await?;
    let target = Target {
        frame: description.frame,
        resolution_m: description.resolution_m,
        limits: DEFAULT_LIMITS,
    };
    let id = |number: u128| Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0000 + number);
    let path = robot.path(route::CONTRIBUTIONS);

    // Something is in the map already, so that "nothing changes" is more than "nothing is there".
    let first = robot.api.post_json(&path, &valid(id(0), "r2", &target)).await?;
    let first: Receipt = first.expect(201)?.decode()?;
    admin.folded().await?;
    let before = (admin.describe().await?, admin.log().await?, admin.export("geojson").await?);

    let kinds = catalogue(id(1), "r2", &target);
    assert!(kinds.len() >= KINDS_MIN, "only {} kinds", kinds.len());
    let forms = kinds.iter().flat_map(|kind| [(kind, JSON), (kind, CBOR)]);
    for (kind, media_type) in forms {
        let body = if media_type == CBOR {
            to_cbor(&AsCbor { value: &kind.body, fractional: false })
                .expect("JSON can be written as CBOR")
        } else {
            kind.body.to_string().into_bytes()
        };
        // With the robot's own token, a faulty name would be refused as another robot's.
        let answer = admin.api.post(&path, media_type, body).await?;
        let name = format!("{} ({media_type})", kind.name);
        assert_eq!(answer.status, 422, "{name}: {}", answer.text());
        assert!(answer.content_type.starts_with(PROBLEM_JSON), "{name}: {}", answer.content_type);
        let problem: Problem = answer.decode_any()?;
        assert_eq!(problem.code, "contribution_invalid", "{name}");
        // A whole number where CBOR must have a float is refused for that already.
        let names_it =
            |code: &str| code == kind.code || (media_type == CBOR && code == "unexpected_shape");
        assert!(
            problem.errors.iter().any(|e| names_it(&e.code) && e.pointer == kind.pointer),
            "{name}: no {} at {} among {:?}",
            kind.code,
            kind.pointer,
            problem.errors
        );
        assert!(!problem.retryable, "{name}");
    }
    let after = (admin.describe().await?, admin.log().await?, admin.export("geojson").await?);
    assert!(before == after, "a refused contribution has changed something");

    // In an array, the neighbours of a malformed one are taken, and answered in order.
    let faulty = kinds.iter().find(|kind| kind.code == "not_positive_semidefinite");
    let faulty = faulty.expect("a fault that shows only after the body was read");
    let neighbour = |number: u128| json!(valid(id(number), "r2", &target));
    let array = Value::Array(vec![neighbour(2), faulty.body.clone(), neighbour(3)]);
    let answers: Vec<UploadAnswer> = robot.api.post_json(&path, &array).await?.decode()?;
    let taken: Vec<Option<i64>> = answers
        .iter()
        .map(|answer| match answer {
            UploadAnswer::Receipt(receipt) => Some(receipt.revision),
            UploadAnswer::Problem(_) => None,
        })
        .collect();
    assert_eq!(taken, [Some(first.revision + 1), None, Some(first.revision + 2)]);
    Ok(())
}

#[tokio::test]
async fn every_kind_of_malformed_contribution_is_refused_by_name_on_sqlite() -> Result<(), Error> {
    every_kind_is_refused(Database::Sqlite).await
}

#[tokio::test]
async fn every_kind_of_malformed_contribution_is_refused_by_name_on_postgres() -> Result<(), Error>
{
    every_kind_is_refused(Database::new_postgres().await?).await
}
