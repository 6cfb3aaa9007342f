//! The founding paper's Figure 3 told again: a hallway's vector map from a few scanning positions.
//!
//! Two stretches of the committed log are played by two real robots into a real server, and what the
//! server answers is drawn. The same log and programs give the same bytes.

mod plate;

use std::path::Path;

use crate::carmen::Log;
use crate::database::Database;
use crate::level::{Level, Replica};
use crate::plane::Point;
use crate::robot::{Robot, Target};
use crate::server::Server;
use crate::{Error, logs};

/// One robot's way through the hallway: a stretch of the log.
#[derive(Debug, Clone)]
pub struct Way {
    /// The robot.
    pub robot: &'static str,
    /// Number of the first scan in the log.
    pub first: usize,
    /// Number of the scan after the last.
    pub end: usize,
}

/// Which stretches of a log are drawn, and how the picture is turned.
#[derive(Debug, Clone)]
pub struct Hallway {
    /// Who goes where.
    pub ways: [Way; 2],
    /// The picture is turned clockwise by this, radians, so that the hallway lies across the page.
    pub turned: f64,
    /// So much is shown around the stops, metres.
    pub around_m: f64,
    /// Where the log was recorded, for the caption.
    pub place: &'static str,
}

/// The hallway of `docs/hallway.svg`: where two corridors of Killian Court meet, at a pillar. One
/// robot passes straight on, another one comes round the corner.
pub const HALLWAY: Hallway = Hallway {
    ways: [
        Way { robot: "anna", first: 1297, end: 1325 },
        Way { robot: "bruno", first: 2387, end: 2412 },
    ],
    turned: 1.03,
    around_m: 3.6,
    place: "MIT, Killian Court",
};

/// What was drawn.
#[derive(Debug, Clone)]
pub struct Figure {
    /// The picture.
    pub svg: String,
    /// Number of scanning positions.
    pub stops: usize,
    /// The map.
    pub map: Replica,
}

/// Plays the hallway's stops into a fresh server and draws its answer.
///
/// # Errors
/// A program fails, or the log has not so many scans.
pub async fn draw(log: &Path, hallway: &Hallway) -> Result<Figure, Error> {
    let whole = Log::read(log)?;
    if hallway.ways.iter().any(|way| way.end > whole.scans.len()) {
        let fault = format!("there are only {} scans", whole.scans.len());
        return Err(Error::Log { path: log.to_owned(), line: 0, fault });
    }
    let folder = tempfile::tempdir().map_err(|e| Error::file("a temporary folder", e))?;
    let mut server = Server::start(Database::Sqlite).await?;
    let target = Target {
        url: server.url(),
        token: server.admin_token().to_owned(),
        site: "figure".to_owned(),
        level: "hallway".to_owned(),
    };
    let mut stops: Vec<Vec<(Point, f64)>> = Vec::new();
    for way in &hallway.ways {
        let part = folder.path().join(format!("{}.log.gz", way.robot));
        whole.write_part(way.first, way.end, &part)?;
        let scans = whole.scans[way.first..way.end].iter();
        stops.push(scans.map(|scan| (scan.origin, scan.heading)).collect());
        Robot::new(way.robot, &part).start(&target, folder.path())?.finish().await?;
    }
    let (map, _) = Level::new(server.api()?, &target.site, &target.level).floor().await?;
    server.stop().await?;
    let svg = plate::plate(&map, &stops, hallway);
    Ok(Figure { svg, stops: stops.iter().map(Vec::len).sum(), map })
}

/// Draws [`HALLWAY`] of the committed log into a file.
///
/// # Errors
/// As [`draw`]; the file cannot be written.
pub async fn write(out: &Path) -> Result<(), Error> {
    let log = logs::killian();
    let figure = draw(&log, &HALLWAY).await?;
    std::fs::write(out, figure.svg).map_err(|e| Error::file(out, e))
}
