//! What a robot downloads and keeps of a level's landmark table, from a real server.

use std::path::Path;

use mapfold_client::sync::{Api as ClientApi, ApiOptions, LevelAddress};
use mapfold_map::landmarks::LandmarkTable;
use mapfold_schema::border::gdb::map_landmark;
use mapfold_schema::route;
use serde_json::{Value, json};
use tokio::time::Instant;

use crate::database::Database;
use crate::level::Level;
use crate::server::Server;
use crate::{Error, report};

/// Landmarks of the levels.
const COUNTS: [usize; 3] = [1_000, 10_000, 100_000];
/// Each pillar has four corners; they stand so far apart that there is a landmark in five square metres.
const APART_M: f64 = 4.472;
/// Solids of one object.
const SOLIDS: usize = 1_000;

/// Rewrites the table `tables` of a page.
pub(super) async fn table(page: &Path) -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let mut rows = Vec::new();
    for (number, count) in COUNTS.into_iter().enumerate() {
        let level = Level::create(server.api()?, &format!("s{number}"), "l").await?;
        let put =
            level.api.put_json(&level.path(route::GDB), "\"0.0\"", &pillars(count / 4)).await?;
        let tag = put.expect(200)?.etag.unwrap_or_default();
        level.api.post_matching(&level.path(route::GDB_PUBLICATIONS), &tag).await?.expect(201)?;
        level.folded().await?;
        let api = ClientApi::new(level.api.url(), server.admin_token(), ApiOptions::STANDARD)
            .map_err(|e| Error::Client(e.to_string()))?;
        let address = LevelAddress { site: level.site.clone(), level: level.level.clone() };
        let mut cells = vec![count.to_string()];
        // The first who asks waits until the model is cut.
        let mut told = None;
        for _ in 0..2 {
            let (before, begin) = (api.traffic().bytes_down, Instant::now());
            let answer = api.landmarks(&address, 0).await;
            let answer = answer.map_err(|e| Error::Client(e.to_string()))?;
            let (bytes, ms) =
                (api.traffic().bytes_down - before, 1e3 * begin.elapsed().as_secs_f64());
            told = Some((answer, bytes));
            cells.push(format!("{ms:.0}"));
        }
        let Some((answer, bytes)) = told else { continue };
        let landmarks: Vec<_> =
            answer.landmarks.iter().filter_map(|landmark| map_landmark(landmark).ok()).collect();
        if landmarks.len() != count {
            return Err(Error::Client(format!("{} landmarks of {count}", landmarks.len())));
        }
        let begin = Instant::now();
        let table = LandmarkTable::new(landmarks);
        let ms = 1e3 * begin.elapsed().as_secs_f64();
        cells.extend([
            format!("{:.0}", bytes as f64 / 1e3),
            format!("{ms:.1}"),
            table.pair_count().to_string(),
            format!("{:.1}", table.bytes() as f64 / 1e6),
        ]);
        report::say(&cells.join(" | "));
        rows.push(cells);
    }
    let header = [
        "landmarks",
        "first answer ms",
        "next ms",
        "download kB",
        "table built ms",
        "pairs",
        "memory MB",
    ];
    report::rewrite(page, "tables", &report::table(&header, &rows))
}

/// Square pillars on a grid, none in line with another.
fn pillars(count: usize) -> Value {
    let columns = (count as f64).sqrt().ceil() as usize;
    let solid = |number: usize| {
        let (column, row) = ((number % columns) as f64, (number / columns) as f64);
        let off = |by: f64| 0.9 * (by * 0.618_034).fract();
        let (x, y) = (APART_M * column + off(row), APART_M * row + off(column));
        let side = 0.4 + 0.5 * (number as f64 * 0.754_878).fract();
        json!({"box": {"from_m": [x, y, 0.0], "to_m": [x + side, y + 1.3 * side, 2.5]}})
    };
    let numbers: Vec<usize> = (0..count).collect();
    let feature = |(id, numbers): (usize, &[usize])| {
        let solids: Vec<Value> = numbers.iter().map(|number| solid(*number)).collect();
        let id = uuid::Uuid::from_u128(1 + id as u128);
        let properties = json!({"kind": "machine", "solids": solids});
        json!({"type": "Feature", "id": id, "geometry": null, "properties": properties})
    };
    let features: Vec<Value> = numbers.chunks(SOLIDS).enumerate().map(feature).collect();
    json!({"type": "FeatureCollection", "features": features})
}
