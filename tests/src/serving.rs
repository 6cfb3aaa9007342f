//! How long a server takes to answer about the rasters of small and of vast levels.
//!
//! Levels of equal tiles, uploaded as contributions of evidence to one real server, so that they go
//! through the log, the fold and the rows like any other. All questions are asked over one
//! connection on loopback, in turns with a file of the page that the same server hands out: the
//! ratio to that file is what can be compared between machines.

use std::collections::BTreeSet;
use std::path::Path;

use mapfold_schema::codec::JSON;
use mapfold_schema::route;
use mapfold_schema::v1::{
    Contribution, EvidencePatch, PoseEstimate, Provenance, RasterChanges, SensorClass, TilePatch,
};
use tokio::time::{Duration, Instant};
use uuid::Uuid;

use crate::api::Api;
use crate::database::Database;
use crate::level::Level;
use crate::server::Server;
use crate::statistics::quantile;
use crate::{Error, report};

/// Tiles of the levels.
const SIZES: [i32; 3] = [1_000, 10_000, 100_000];
/// Tiles along a column of the largest level, so that one picture of zoom level 0 is full.
const ROW: i32 = 316;
/// Tiles of a contribution, and of one that changes a little.
const LOOK: i32 = 1_000;
const CHANGE: i32 = 16;
/// How often each question about changed tiles is asked.
const QUESTIONS: usize = 400;
/// Most pictures of a zoom level that are asked for, and changes that are waited for.
const PICTURES: u64 = 64;
const CHANGES: u64 = 12;
/// The list of what changed may take so many times as long in the largest level as in the smallest.
const GROWTH_MAX: f64 = 1.5;
/// Zoom levels of the pyramid, the last one.
const ZOOM_MAX: u8 = 8;

/// A level of equal tiles.
struct Place {
    level: Level,
    frame: Uuid,
    token: Api,
    looks: u128,
    turn: u64,
}

impl Place {
    async fn create(api: &Api, tiles: i32) -> Result<Self, Error> {
        let level = Level::create(api.clone(), &format!("plant-{tiles}"), "floor").await?;
        let token = level.enrol("surveyor").await?;
        let frame = level.describe().await?.frame;
        let token = api.with_token(&token);
        let mut place = Self { level, frame, token, looks: 0, turn: 0 };
        let all: Vec<(i32, i32)> = (0..tiles).map(|n| (n / ROW, n % ROW)).collect();
        for look in all.chunks(LOOK as usize) {
            place.upload(look).await?;
        }
        place.level.folded().await?;
        Ok(place)
    }

    /// One look at these tiles: free space, and a wall across each that lies elsewhere each time.
    async fn upload(&mut self, tiles: &[(i32, i32)]) -> Result<(), Error> {
        self.looks += 1;
        let wall = (self.looks as i32 * 7).rem_euclid(62);
        let tile = |(x, y): &(i32, i32)| {
            let wall = (wall + x * 3 + y * 5).rem_euclid(62) + 1;
            let runs = (0..64).flat_map(|row| {
                let start = row * 64;
                [start, wall, -40, start + wall, 1, 85, start + wall + 1, 63 - wall, -40]
            });
            TilePatch { x: *x, y: *y, runs: runs.collect() }
        };
        let look = Contribution {
            id: Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0000 + self.looks),
            robot: "surveyor".to_owned(),
            frame: self.frame,
            observed_at: "2026-01-01T00:00:00Z".to_owned(),
            emulated: false,
            pose: PoseEstimate {
                x_m: 0.0,
                y_m: 0.0,
                heading_rad: 0.0,
                covariance: [[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-6]],
                provenance: Provenance::Datum,
                basis: None,
            },
            segments: Vec::new(),
            clusters: Vec::new(),
            evidence: vec![EvidencePatch {
                sensor: SensorClass::Scanner,
                tiles: tiles.iter().map(tile).collect(),
            }],
        };
        let path = self.level.path(route::CONTRIBUTIONS);
        self.token.post_json(&path, &look).await?.expect(201)?;
        Ok(())
    }

    /// Somewhere in the level, another place each time.
    fn somewhere(&mut self, tiles: i32) -> (i32, i32) {
        self.turn += 1;
        let at = (self.turn.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33) as i32 % tiles;
        (at / ROW, at % ROW)
    }
}

/// Answers of one kind: how long they took, milliseconds, and how long they were, bytes.
#[derive(Default)]
struct Asked {
    ms: Vec<f64>,
    bytes: Vec<f64>,
}

impl Asked {
    async fn ask(&mut self, api: &Api, path: &str) -> Result<(), Error> {
        let begin = Instant::now();
        let answer = api.get(path, "*/*").await?;
        self.ms.push(begin.elapsed().as_secs_f64() * 1e3);
        self.bytes.push(answer.expect(200)?.body.len() as f64);
        Ok(())
    }

    fn at(&self, share: f64) -> f64 {
        quantile(&self.ms, share)
    }

    fn told(&self) -> [String; 2] {
        [0.5, 0.95].map(|share| format!("{:.2}", self.at(share)))
    }
}

/// A file of the page: its style sheet, or the page where there is none.
async fn file_of_page(api: &Api) -> Result<String, Error> {
    let page = api.get("/", "*/*").await?.expect(200)?.text();
    let sheet = page.split('"').find(|word| word.contains(".css")).unwrap_or("/");
    Ok(format!("/{}", sheet.trim_start_matches("./").trim_start_matches('/')))
}

/// Measures, rewrites the tables `serving` of the report, and answers what is not as it must be.
///
/// # Errors
/// A program fails, or the report cannot be written.
pub async fn tables(page: &Path) -> Result<Vec<String>, Error> {
    let mut server = Server::start(Database::Sqlite).await?;
    let api = server.api()?;
    let file = file_of_page(&api).await?;
    let mut places = Vec::new();
    for tiles in SIZES {
        let begin = Instant::now();
        places.push(Place::create(&api, tiles).await?);
        let seconds = begin.elapsed().as_secs_f64();
        report::say(&format!("{tiles} tiles are in a level after {seconds:.1} s"));
    }
    let (lists, faults) = lists(&api, &file, &mut places).await?;
    let mut largest = places.pop().ok_or_else(|| Error::Program {
        program: "mapfold-evaluate".to_owned(),
        fault: "no level was made".to_owned(),
    })?;
    let pictures = pictures(&mut server, &api, &file, &mut largest).await?;
    report::rewrite(page, "serving", &format!("{lists}\n{pictures}"))?;
    Ok(faults)
}

/// The list of tiles since the last revision, of levels of all sizes in turns.
async fn lists(
    api: &Api,
    file: &str,
    places: &mut [Place],
) -> Result<(String, Vec<String>), Error> {
    let mut paths = Vec::new();
    for (place, tiles) in places.iter_mut().zip(SIZES) {
        let some: Vec<(i32, i32)> = (0..CHANGE).map(|n| (tiles / ROW / 2, n)).collect();
        place.upload(&some).await?;
        let last = place.level.folded().await?.folded_revision;
        let path = format!("{}?since={}", place.level.path(route::RASTER), last - 1);
        let changes: RasterChanges = api.get(&path, JSON).await?.decode()?;
        let listed = changes.tiles.len();
        report::say(&format!("{tiles} tiles: {listed} of them are listed as changed"));
        paths.push((path, listed));
    }
    let mut lists = [Asked::default(), Asked::default(), Asked::default()];
    let mut files = Asked::default();
    for _ in 0..QUESTIONS {
        files.ask(api, file).await?;
        for (list, (path, _)) in lists.iter_mut().zip(&paths) {
            list.ask(api, path).await?;
        }
    }
    let mut rows = Vec::new();
    for ((list, tiles), (_, listed)) in lists.iter().zip(SIZES).zip(&paths) {
        let [median, late] = list.told();
        let growth = list.at(0.5) / lists[0].at(0.5);
        rows.push(vec![
            tiles.to_string(),
            listed.to_string(),
            median,
            late,
            format!("{growth:.2}"),
            format!("{:.2}", list.at(0.5) / files.at(0.5)),
        ]);
    }
    let header = ["tiles", "listed", "median ms", "p95 ms", "of the smallest", "of the file"];
    let growth = lists[2].at(0.5) / lists[0].at(0.5);
    let fault =
        format!("the list of changed tiles takes {growth:.2} times as long in a vast level");
    let faults = if growth > GROWTH_MAX { vec![fault] } else { Vec::new() };
    Ok((report::table(&header, &rows), faults))
}

/// Whether the server has no level's pictures left to draw in the background.
async fn is_drawn(api: &Api) -> Result<bool, Error> {
    let figures = api.get("/metrics", "*/*").await?.expect(200)?.body;
    let figures = String::from_utf8_lossy(&figures);
    let left = figures.lines().find_map(|line| line.strip_prefix("mapfold_levels_to_draw "));
    Ok(left.and_then(|left| left.parse().ok()) == Some(0.0))
}

/// Starts the server again, opens the level and waits until its coarse pictures are drawn; how long that
/// takes from when the level is open, seconds.
async fn reopened(server: &mut Server, api: &Api, place: &Place) -> Result<f64, Error> {
    server.stop().await?;
    server.start_again().await?;
    // Opening the level is no part of drawing.
    place.level.folded().await?;
    let begin = Instant::now();
    while !is_drawn(api).await? {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    Ok(begin.elapsed().as_secs_f64())
}

/// Pictures of every zoom level of the largest level: from a server that has just started, again,
/// and after a tile in them has changed.
async fn pictures(
    server: &mut Server,
    api: &Api,
    file: &str,
    place: &mut Place,
) -> Result<String, Error> {
    let tiles = SIZES[2];
    // The worst that can be asked for: the coarsest picture, the moment that the level is open.
    server.stop().await?;
    server.start_again().await?;
    place.level.folded().await?;
    let mut at_once = Asked::default();
    at_once.ask(api, &picture(place, 0, (0, 0))).await?;
    let mut rows = Vec::new();
    let mut drawn_s = Vec::new();
    for z in 0..=ZOOM_MAX {
        drawn_s.push(reopened(server, api, place).await?);
        let chosen: BTreeSet<String> = (0..PICTURES)
            .map(|_| {
                let at = place.somewhere(tiles);
                picture(place, z, at)
            })
            .collect();
        let [mut cold, mut warm, mut changed, mut files] =
            std::array::from_fn(|_| Asked::default());
        for path in &chosen {
            files.ask(api, file).await?;
            cold.ask(api, path).await?;
        }
        let turns = (PICTURES as usize).div_ceil(chosen.len());
        for _ in 0..turns {
            for path in &chosen {
                files.ask(api, file).await?;
                warm.ask(api, path).await?;
            }
        }
        for _ in 0..CHANGES {
            let at = place.somewhere(tiles);
            place.upload(&[at]).await?;
            place.level.folded().await?;
            let path = picture(place, z, at);
            files.ask(api, file).await?;
            changed.ask(api, &path).await?;
        }
        let mut row = vec![z.to_string(), chosen.len().to_string()];
        row.push(format!("{:.1}", quantile(&warm.bytes, 0.5) / 1e3));
        for asked in [&cold, &warm, &changed, &files] {
            row.extend(asked.told());
        }
        row.push(format!("{:.2}", warm.at(0.5) / files.at(0.5)));
        row.push(format!("{:.2}", changed.at(0.5) / files.at(0.5)));
        report::say(&format!("pictures: {}", row.join(" ")));
        rows.push(row);
    }
    let header = [
        "zoom",
        "pictures",
        "kB",
        "first ms",
        "p95",
        "again ms",
        "p95",
        "changed ms",
        "p95",
        "file ms",
        "p95",
        "again of the file",
        "changed of the file",
    ];
    let words = format!(
        "Coarse pictures of all layers are drawn {:.1} s (median of {}) after the level is open; the coarsest, \
         asked for the moment that it is, takes {:.0} ms.\n",
        quantile(&drawn_s, 0.5),
        drawn_s.len(),
        at_once.at(0.5),
    );
    Ok(format!("{words}\n{}", report::table(&header, &rows)))
}

/// The path of the picture of a zoom level that shows a tile.
fn picture(place: &Place, z: u8, (x, y): (i32, i32)) -> String {
    let along = 1 << (ZOOM_MAX - z);
    let (row, col) = (-(y / along) - 1, x / along);
    let path = place.level.path(route::TILES);
    let path = path.replace("{z}", &z.to_string()).replace("{row}", &row.to_string());
    path.replace("{col}", &format!("{col}.png"))
}
