//! A level with the published model of a building, the building as it stands, and robots that look about in it.
//!
//! The building is the model's plan as the server tells it, each corner off by some deviation.

use std::collections::BTreeMap;

use mapfold_client::sync::{Api as ClientApi, ApiOptions, LevelAddress, Mirror, MirrorConfig};
use mapfold_map::raster::Cell;
use mapfold_schema::codec::JSON;
use mapfold_schema::route;
use mapfold_schema::v1::{GdbPlan, PlanCorner};

use crate::Error;
use crate::level::Level;
use crate::plane::{Piece, Point};
use crate::simulation::{Noise, World};

/// Robots stand no nearer to anything, metres.
pub const CLEARANCE_M: f64 = 0.4;

/// Walls are looked for all around within this, metres.
const WITHIN_M: f64 = 15.0;
/// So often a place is looked for.
const TRIES: u32 = 20_000;

/// A level that nobody has driven on.
#[derive(Debug)]
pub struct Planned {
    /// The level.
    pub level: Level,
    /// The building as it stands.
    pub world: World,
    /// A robot's mirror of the level.
    pub mirror: Mirror,
    _folder: tempfile::TempDir,
}

impl Planned {
    /// Takes a file into a level as its model, publishes it and makes it the prior. The corners of the building stand off by
    /// `off_m` (standard deviation).
    ///
    /// # Errors
    /// The server refuses, or a file cannot be written.
    pub async fn build(
        level: Level,
        (query, media_type, file): (&str, &str, Vec<u8>),
        token: &str,
        (off_m, noise): (f64, &mut Noise),
    ) -> Result<Self, Error> {
        let imports = format!("{}{query}", level.path(route::IMPORTS));
        level.api.post(&imports, media_type, file).await?.expect(201)?;
        let draft = level.api.get(&level.path(route::GDB), JSON).await?.expect(200)?;
        let tag = draft.etag.unwrap_or_default();
        level.api.post_matching(&level.path(route::GDB_PUBLICATIONS), &tag).await?.expect(201)?;
        level.api.post(&level.path(route::GDB_PRIOR), JSON, b"null".to_vec()).await?.expect(201)?;
        level.folded().await?;
        let plan: GdbPlan =
            level.api.fetch(&format!("{}?state=published", level.path(route::GDB_PLAN))).await?;
        let folder = tempfile::tempdir().map_err(|e| Error::file(std::path::Path::new("."), e))?;
        let address = LevelAddress { site: level.site.clone(), level: level.level.clone() };
        let fault = |e: &dyn std::fmt::Display| Error::Client(e.to_string());
        let mut mirror =
            Mirror::open(folder.path(), &address, MirrorConfig::STANDARD).map_err(|e| fault(&e))?;
        let api = ClientApi::new(level.api.url(), token, ApiOptions::STANDARD);
        mirror.refresh(&api.map_err(|e| fault(&e))?).await.map_err(|e| fault(&e))?;
        Ok(Self { level, world: standing(&plan, off_m, noise), mirror, _folder: folder })
    }

    /// A place within walls where a robot can stand; `None` if there is hardly any.
    pub fn place(&self, noise: &mut Noise) -> Option<Point> {
        let ends = self.world.walls.iter().flat_map(|wall| [wall.a, wall.b]);
        let far = (f64::INFINITY, f64::NEG_INFINITY);
        let (x, y) = ends.fold((far, far), |(x, y), p| {
            ((x.0.min(p.x), x.1.max(p.x)), (y.0.min(p.y), y.1.max(p.y)))
        });
        (0..TRIES).find_map(|_| {
            let at =
                Point::new(x.0 + noise.share() * (x.1 - x.0), y.0 + noise.share() * (y.1 - y.0));
            let near = self.near(at, WITHIN_M);
            (near.is_clear(at) && near.encloses(at) && !self.is_solid(at)).then_some(at)
        })
    }

    /// Whether the prior says that a place is inside of something.
    fn is_solid(&self, at: Point) -> bool {
        let Some(resolution) = self.mirror.resolution_m() else { return false };
        let [column, row] = [at.x, at.y].map(|v| (v / resolution).floor() as i32);
        let (index, offset) = Cell { column, row }.tile();
        let tile = self.mirror.map().prior.get(&index);
        tile.and_then(|tile| tile.cells().get(offset)).is_some_and(|value| *value > 0)
    }

    /// What of the building is within some metres of a place.
    pub fn near(&self, at: Point, metres: f64) -> World {
        let is_near = |wall: &&Piece| wall.distance(at) < metres;
        let walls = self.world.walls.iter().filter(is_near).copied().collect();
        World { walls, ..self.world.clone() }
    }
}

impl World {
    /// Whether a robot can stand there.
    pub fn is_clear(&self, at: Point) -> bool {
        self.walls.iter().all(|wall| wall.distance(at) > CLEARANCE_M)
    }

    /// Whether there are walls all around a place.
    fn encloses(&self, at: Point) -> bool {
        let angles = (0..36).map(|i| f64::from(i) * 10f64.to_radians());
        angles.filter(|angle| self.cast(at, *angle, WITHIN_M).is_some()).count() >= 32
    }

    /// A way of straight legs of 1.5 to 5 m past the walls, at least so long; shorter if there is no way on.
    pub fn way(&self, from: Point, length_m: f64, noise: &mut Noise) -> Vec<Point> {
        let mut way = vec![from];
        let (mut driven, mut last_heading) = (0.0, None);
        while driven < length_m {
            let Some(at) = way.last().copied() else { break };
            let next = (0..200).find_map(|number| {
                let leg = 1.5 + 3.5 * noise.share();
                let heading = noise.share() * std::f64::consts::TAU;
                // Back where it came from only if nothing else is left.
                let is_back = last_heading.is_some_and(|last: f64| (heading - last).cos() < -0.5);
                let to = at.towards(heading, leg);
                (!(is_back && number < 150) && self.is_passable(at, to))
                    .then_some((to, heading, leg))
            });
            let Some((to, heading, leg)) = next else { break };
            way.push(to);
            driven += leg;
            last_heading = Some(heading);
        }
        way
    }

    fn is_passable(&self, from: Point, to: Point) -> bool {
        let leg = Piece { a: from, b: to };
        self.walls.iter().all(|wall| {
            leg.crossing(wall).is_none()
                && [wall.a, wall.b].iter().all(|end| leg.distance(*end) > CLEARANCE_M)
                && [leg.a, leg.b].iter().all(|end| wall.distance(*end) > CLEARANCE_M)
        })
    }
}

/// The walls of a plan, each corner off by a deviation.
fn standing(plan: &GdbPlan, off_m: f64, noise: &mut Noise) -> World {
    let mut corners: BTreeMap<[u64; 2], Point> = BTreeMap::new();
    let mut stands = |corner: &PlanCorner| {
        let [x, y] = corner.at_m;
        *corners
            .entry(corner.at_m.map(f64::to_bits))
            .or_insert_with(|| Point::new(x + noise.normal(off_m), y + noise.normal(off_m)))
    };
    let mut walls = Vec::new();
    for (paths, is_closed) in [(&plan.outlines, true), (&plan.sheets, false)] {
        for path in paths {
            let path: Vec<Point> = path.iter().map(&mut stands).collect();
            let back = path.first().copied().filter(|_| is_closed);
            let ends = path.iter().skip(1).copied().chain(back);
            walls.extend(path.iter().zip(ends).map(|(a, b)| Piece { a: *a, b }));
        }
    }
    World { name: "a building", walls, way: Vec::new() }
}
