//! What the end-to-end checks are made of: real programs on real logs, and independent measures of
//! the maps that come out.
//!
//! Everything here looks at Mapfold from outside: it starts `mapfold-server` and `mapfold-robot`,
//! talks HTTP, and reads the wire types. It deliberately shares no geometry, no noise model and no
//! log reader with the code that it checks. Where a part has to be measured by itself ([`range`],
//! [`honesty`], [`growth`]), it is called as a library, and what it is measured against is still this crate's own.
//!
//! * [`carmen`]: reads laser logs and cuts them into parts, one for each robot of a fleet.
//! * [`plane`], [`floor`], [`coverage`]: the merged map as plain shapes, and how well it agrees
//!   with the readings that it was made of.
//! * [`simulation`]: worlds of walls, drives through them with odometry noise, scanners, sonars.
//! * [`growth`]: what one more contribution costs in small and in vast maps.
//! * [`honesty`]: what maps claim against how wrong they are.
//! * [`programs`], [`database`], [`server`], [`robot`], [`fleet`], [`meter`], [`api`], [`level`]: the real
//!   programs, the network between them, and what they answer.
//! * [`page`]: what the operators' page shows in a browser.
//! * [`trial`]: a log played as a fleet into a fresh server, and what came of it.
//! * [`extraction`], [`yardstick`]: how well and how fast lines are found in scans, beside the least code that
//!   finds lines.
//! * [`range`]: simulated heads, their calibration, and how well their ranges are corrected.
//! * [`change`]: how soon a map follows what has moved.
//! * [`differences`]: what is told of a floor that is not as its model, and how soon.
//! * [`buildings`]: what comes of real buildings that are taken in as models.
//! * [`plans`]: what vast models cost.
//! * [`planned`]: levels with nothing but the model of a building, and the building as it stands.
//! * [`serving`]: how long a server takes to answer about small and vast rasters.
//! * [`places`]: whether a robot that knows nothing finds its place on recorded logs.
//! * [`localization`]: how well a robot is tracked, and whether it notices that it is lost.
//! * [`structures`]: whether and how fast a place is found among landmarks.
//! * [`taught`]: what robots teach of thin walls.
//! * [`figure`]: a hallway's map as a picture.
//! * [`evaluation`], [`speed`], [`statistics`], [`report`]: `mapfold-evaluate`, which writes tables between markers
//!   into a page of text.

pub mod alignment;
pub mod api;
pub mod buildings;
pub mod carmen;
pub mod change;
pub mod coverage;
pub mod database;
pub mod differences;
pub mod error;
pub mod evaluation;
pub mod extraction;
pub mod figure;
pub mod fleet;
pub mod floor;
pub mod growth;
pub mod honesty;
pub mod level;
pub mod localization;
mod logs;
pub mod meter;
pub mod page;
pub mod places;
pub mod plane;
pub mod planned;
pub mod plans;
pub mod programs;
pub mod range;
pub mod raster;
pub mod report;
pub mod robot;
pub mod server;
pub mod serving;
pub mod simulation;
pub mod speed;
pub mod statistics;
pub mod structures;
mod surveying;
pub mod taught;
pub mod trajectory;
pub mod trial;
pub mod yardstick;

pub use error::Error;
