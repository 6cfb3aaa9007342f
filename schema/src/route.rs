//! Every path of the HTTP API, once: templates for the server, builders for the client.

/// `GET, POST`: sites.
pub const SITES: &str = "/api/v1/sites";
/// `GET, POST`: levels of a site.
pub const LEVELS: &str = "/api/v1/sites/{site}/levels";
/// `GET`: one level.
pub const LEVEL: &str = "/api/v1/sites/{site}/levels/{level}";
/// `GET, POST`: robots of a site.
pub const ROBOTS: &str = "/api/v1/sites/{site}/robots";
/// `GET, PATCH`: one robot.
pub const ROBOT: &str = "/api/v1/sites/{site}/robots/{robot}";
/// `POST`: a token for a robot.
pub const ROBOT_TOKENS: &str = "/api/v1/sites/{site}/robots/{robot}/tokens";
/// `GET, POST`: the log, and uploads into it.
pub const CONTRIBUTIONS: &str = "/api/v1/sites/{site}/levels/{level}/contributions";
/// `GET`: one contribution.
pub const CONTRIBUTION: &str = "/api/v1/sites/{site}/levels/{level}/contributions/{id}";
/// `GET, POST`: reverts.
pub const REVERTS: &str = "/api/v1/sites/{site}/levels/{level}/reverts";
/// `GET, DELETE`: one revert; deleting it puts back what it took out.
pub const REVERT: &str = "/api/v1/sites/{site}/levels/{level}/reverts/{id}";
/// `GET`: segments, clusters and chains.
pub const VECTOR: &str = "/api/v1/sites/{site}/levels/{level}/vector";
/// `GET`: changed tiles.
pub const RASTER: &str = "/api/v1/sites/{site}/levels/{level}/raster";
/// `GET`: one tile's evidence.
pub const RASTER_TILE: &str = "/api/v1/sites/{site}/levels/{level}/raster/{x}/{y}";
/// `GET`: the evidence of many tiles.
pub const RASTER_BATCH: &str = "/api/v1/sites/{site}/levels/{level}/raster/batch";
/// `GET`: picture pyramid, `{col}` with the suffix `.png`.
pub const TILES: &str = "/api/v1/sites/{site}/levels/{level}/tiles/{z}/{row}/{col}";
/// `GET`: all that changed, in pages.
pub const PATCHES: &str = "/api/v1/sites/{site}/levels/{level}/patches";
/// `GET`: live events.
pub const EVENTS: &str = "/api/v1/sites/{site}/levels/{level}/events";
/// `GET, POST, DELETE`: maps of other programs as the level's prior.
pub const IMPORTS: &str = "/api/v1/sites/{site}/levels/{level}/imports";
/// `GET, PUT, PATCH`: the a-priori model (GDB), as a draft or as published.
pub const GDB: &str = "/api/v1/sites/{site}/levels/{level}/gdb";
/// `POST`: publish the draft of the GDB.
pub const GDB_PUBLICATIONS: &str = "/api/v1/sites/{site}/levels/{level}/gdb/publications";
/// `GET`: who changed the GDB, and when.
pub const GDB_ENTRIES: &str = "/api/v1/sites/{site}/levels/{level}/gdb/entries";
/// `GET`: what is wrong with the GDB.
pub const GDB_FINDINGS: &str = "/api/v1/sites/{site}/levels/{level}/gdb/findings";
/// `GET`: the GDB cut at a height.
pub const GDB_PLAN: &str = "/api/v1/sites/{site}/levels/{level}/gdb/plan";
/// `POST`: make what is published the prior of the raster.
pub const GDB_PRIOR: &str = "/api/v1/sites/{site}/levels/{level}/gdb/prior";
/// `GET`: the GDB in three dimensions, as binary glTF.
pub const GDB_GLB: &str = "/api/v1/sites/{site}/levels/{level}/gdb.glb";
/// `GET`: the landmarks that robots find themselves by.
pub const LANDMARKS: &str = "/api/v1/sites/{site}/levels/{level}/landmarks";
/// `GET`: what robots found against the GDB.
pub const CHANGES: &str = "/api/v1/sites/{site}/levels/{level}/changes";
/// `POST`: what is made of one of them.
pub const CHANGE: &str = "/api/v1/sites/{site}/levels/{level}/changes/{id}";
/// `GET`: robots' own frames, and where they lie on the level.
pub const ALIGNMENTS: &str = "/api/v1/sites/{site}/levels/{level}/alignments";
/// `POST, DELETE`: accept where one of them lies, or withdraw that.
pub const ALIGNMENT: &str = "/api/v1/sites/{site}/levels/{level}/alignments/{frame}";
/// `GET, PUT`: the library of a site.
pub const PROTOTYPES: &str = "/api/v1/sites/{site}/prototypes";
/// `GET`: exports.
pub const EXPORTS: &str = "/api/v1/sites/{site}/levels/{level}/exports/{format}";
/// `POST`, `GET`, `DELETE`: the page's session.
pub const SESSION: &str = "/api/v1/session";

/// The path of a level.
pub fn level(site: &str, level: &str) -> String {
    LEVEL.replace("{site}", site).replace("{level}", level)
}

/// The path of a robot.
pub fn robot(site: &str, robot: &str) -> String {
    ROBOT.replace("{site}", site).replace("{robot}", robot)
}

/// A template with the site and level filled in.
pub fn of_level(template: &str, site: &str, level: &str) -> String {
    template.replace("{site}", site).replace("{level}", level)
}

/// A template with the site filled in.
pub fn of_site(template: &str, site: &str) -> String {
    template.replace("{site}", site)
}
