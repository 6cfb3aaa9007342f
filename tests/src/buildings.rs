//! Real buildings and maps of real floors, taken into a real server as models: what of them comes in, which landmarks that
//! makes, how long it takes, and a picture of each plan with its landmarks.
//!
//! Knows what any client of the HTTP API knows.

mod archive;
mod picture;

use std::path::Path;

use mapfold_schema::v1::{FindingSeverity, GdbCollection, GdbFindings, ObjectKind};
use mapfold_schema::{geojson, route};
use serde_json::Value;
use tokio::time::Instant;

use crate::database::Database;
use crate::level::Level;
use crate::server::Server;
use crate::{Error, report};
use archive::zipped;

/// The height of a sensor, metres.
const HEIGHT_M: f64 = 0.3;
/// Kinds of landmarks, as GeoJSON names them.
const LANDMARKS: [&str; 4] = ["concave_corner", "convex_corner", "wall_end", "doorway"];

/// One building.
pub(crate) struct Building {
    /// What the table calls it.
    pub(crate) name: &'static str,
    /// Its file below the folder of plans; of a map the YAML, which names the image beside it.
    file: &'static str,
    pub(crate) media_type: &'static str,
    /// What the import is asked.
    pub(crate) query: &'static str,
    /// The file that its picture is written to, if it gets one.
    picture: Option<&'static str>,
}

const YAML: &str = "application/yaml";
const ZIP: &str = "application/zip";

pub(crate) const BUILDINGS: [Building; 12] = [
    Building {
        name: "Open-RMF office",
        file: "rmf/office.building.yaml",
        media_type: YAML,
        query: "",
        picture: Some("office.svg"),
    },
    Building {
        name: "Open-RMF hotel, L1",
        file: "rmf/hotel.building.yaml",
        media_type: YAML,
        query: "?building_level=L1",
        picture: Some("hotel.svg"),
    },
    Building {
        name: "Open-RMF hotel, L2",
        file: "rmf/hotel.building.yaml",
        media_type: YAML,
        query: "?building_level=L2",
        picture: None,
    },
    Building {
        name: "Open-RMF triple_H",
        file: "rmf/triple_H.building.yaml",
        media_type: YAML,
        query: "",
        picture: None,
    },
    Building {
        name: "Open-RMF battle_royale",
        file: "rmf/battle_royale.building.yaml",
        media_type: YAML,
        query: "",
        picture: None,
    },
    Building {
        name: "floorplan.dxf",
        file: "dxf/floorplan.dxf",
        media_type: "image/vnd.dxf",
        query: "?unit_m=0.0254",
        picture: Some("floorplan.svg"),
    },
    Building {
        name: "SimpleWall.ifc as GLB",
        file: "simple-wall.glb",
        media_type: "model/gltf-binary",
        query: "",
        picture: None,
    },
    Building {
        name: "nav2 depot",
        file: "nav2/depot.yaml",
        media_type: ZIP,
        query: "?into=gdb",
        picture: Some("depot.svg"),
    },
    Building {
        name: "nav2 warehouse",
        file: "nav2/warehouse.yaml",
        media_type: ZIP,
        query: "?into=gdb",
        picture: None,
    },
    Building {
        name: "rail ilab",
        file: "rail/ilab.yaml",
        media_type: ZIP,
        query: "?into=gdb",
        picture: None,
    },
    Building {
        name: "bwi-gdc3",
        file: "bwi-gdc3/3.yaml",
        media_type: ZIP,
        query: "?into=gdb",
        picture: None,
    },
    Building {
        name: "wean",
        file: "wean/wean.yaml",
        media_type: ZIP,
        query: "?into=gdb",
        picture: None,
    },
];

impl Building {
    /// What is uploaded of it, out of `data` (its folder `plans`) or the tests' own; `None` if there is no such file.
    pub(crate) fn read(&self, data: &Path) -> Result<Option<Vec<u8>>, Error> {
        let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(self.file);
        let file = if beside.is_file() { beside } else { data.join("plans").join(self.file) };
        if !file.is_file() {
            return Ok(None);
        }
        if self.media_type == ZIP {
            return zipped(&file).map(Some);
        }
        std::fs::read(&file).map(Some).map_err(|e| Error::file(&file, e))
    }
}

const HEADER: [&str; 12] = [
    "building",
    "walls",
    "doorways",
    "others",
    "outlines",
    "concave corners",
    "convex corners",
    "wall ends",
    "doorways",
    "errors",
    "warnings",
    "import s",
];

/// Takes in all buildings of `data` (its folder `plans`, and the tests' own), rewrites the table `buildings` of the page, and
/// draws pictures into a folder. Answers what is not as it must be.
///
/// # Errors
/// The server fails, or a file cannot be read or written.
pub async fn table(page: &Path, data: &Path, pictures: &Path) -> Result<Vec<String>, Error> {
    let server = Server::start(Database::Sqlite).await?;
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    std::fs::create_dir_all(pictures).map_err(|e| Error::file(pictures, e))?;
    for (number, building) in BUILDINGS.iter().enumerate() {
        let Some(body) = building.read(data)? else {
            faults.push(format!("{}: there is no {}", building.name, building.file));
            continue;
        };
        let level = Level::create(server.api()?, &format!("b{number}"), "l").await?;
        let path = format!("{}{}", level.path(route::IMPORTS), building.query);
        let begin = Instant::now();
        level.api.post(&path, building.media_type, body).await?.expect(201)?;
        let seconds = begin.elapsed().as_secs_f64();
        let row = row(&level, building, seconds, pictures).await?;
        report::say(&row.join(" | "));
        rows.push(row);
    }
    report::rewrite(page, "buildings", &report::table(&HEADER, &rows))?;
    Ok(faults)
}

async fn row(
    level: &Level,
    building: &Building,
    seconds: f64,
    pictures: &Path,
) -> Result<Vec<String>, Error> {
    let model: GdbCollection = level.api.fetch(&level.path(route::GDB)).await?;
    let kinds: Vec<ObjectKind> = model.features.iter().map(|f| f.properties.kind).collect();
    let of = |kind| kinds.iter().filter(|other| **other == kind).count();
    let (walls, doorways) = (of(ObjectKind::Wall), of(ObjectKind::Doorway));
    let exports = level.path(route::EXPORTS).replace("{format}", "geojson");
    let path = format!("{exports}?of=gdb&height_m={HEIGHT_M}");
    let shown: Value = level.api.get(&path, geojson::MEDIA_TYPE).await?.decode()?;
    let features = shown["features"].as_array().map(Vec::as_slice).unwrap_or_default();
    let landmarks = LANDMARKS.map(|kind| {
        let is =
            |f: &&Value| f["properties"]["kind"] == "landmark" && f["properties"]["shape"] == kind;
        features.iter().filter(is).count()
    });
    let is_outline =
        |f: &&Value| ["room", "obstacle"].iter().any(|shape| f["properties"]["shape"] == *shape);
    let outlines = features.iter().filter(is_outline).count();
    let found: GdbFindings = level.api.fetch(&level.path(route::GDB_FINDINGS)).await?;
    let errors = found.findings.iter();
    let errors = errors.filter(|f| f.severity == FindingSeverity::Error).count();
    if let Some(name) = building.picture {
        let picture = pictures.join(name);
        std::fs::write(&picture, picture::of(building.name, features))
            .map_err(|e| Error::file(&picture, e))?;
    }
    let counts = [walls, doorways, kinds.len() - walls - doorways, outlines];
    let all = counts.into_iter().chain(landmarks).chain([errors, found.findings.len() - errors]);
    let cells = all.map(|count| count.to_string());
    Ok([building.name.to_owned()]
        .into_iter()
        .chain(cells)
        .chain([format!("{seconds:.2}")])
        .collect())
}
