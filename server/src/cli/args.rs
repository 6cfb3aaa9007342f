//! What can be said on the command line.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use mapfold_schema::v1::{Bounds, Scope};
use serde::Serialize;

/// Keeps the log of what robots saw, folds it into one map per level, and shares the map.
///
/// Every setting can also be given as a variable (`MAPFOLD_LISTEN`, ...) or in a TOML file; the command
/// line goes before the variables, and these before the file. On the very first start the token in
/// `MAPFOLD_ADMIN_TOKEN` becomes the admin token; without it one is made and printed once.
#[derive(Debug, Parser)]
#[command(name = "mapfold-server", version)]
pub(super) struct Arguments {
    /// A TOML file with settings.
    #[arg(long, value_name = "FILE", env = "MAPFOLD_CONFIG", global = true)]
    pub(super) config: Option<PathBuf>,
    #[command(flatten)]
    pub(super) settings: Settings,
    #[command(subcommand)]
    pub(super) command: Option<Command>,
}

/// Settings, as `Config` names them; what is not said is left out.
#[derive(Debug, Args, Serialize)]
pub(super) struct Settings {
    /// `sqlite:///path/to/file.db` or `postgres://user:password@host/name` [default: a file in the
    /// data folder]
    #[arg(long, value_name = "URL", global = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    database: Option<String>,
    /// Where to listen [default: 127.0.0.1:7171]
    #[arg(long, value_name = "ADDR", global = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    listen: Option<SocketAddr>,
    /// Where the embedded database is kept [default: ./mapfold-data]
    #[arg(long, value_name = "DIR", global = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    data_dir: Option<PathBuf>,
    /// Listen beyond this machine although tokens and maps then travel unencrypted
    #[arg(long, global = true)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    insecure_http: bool,
    /// What to log, for instance `info` or `mapfold_server=debug`
    #[arg(long, value_name = "FILTER", global = true)]
    #[serde(skip_serializing_if = "Option::is_none")]
    log: Option<String>,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Serve; what happens if no command is given
    Serve,
    /// Make, list and revoke tokens
    #[command(subcommand)]
    Token(TokenCommand),
    /// Write a level's map as a file of another program
    Export(ExportCommand),
    /// Make a map of another program the prior of a level, below what robots saw; or take a building or a model into its draft
    Import(ImportCommand),
    /// Refold the log and compare it with what is stored; fails if anything differs
    Verify(VerifyCommand),
    /// Copy the whole embedded database, also while a server runs on it
    Backup(BackupCommand),
}

#[derive(Debug, Subcommand)]
pub(super) enum TokenCommand {
    /// Make a token and print it, once
    Create(TokenCreate),
    /// List tokens, without their secrets
    List,
    /// Revoke a token, and the sessions made from it
    Revoke {
        /// Its public id
        id: String,
    },
}

#[derive(Debug, Args)]
pub(super) struct TokenCreate {
    /// The only site that it reaches; all sites if none
    #[arg(long)]
    pub(super) site: Option<String>,
    /// The robot that it speaks for (needs --site)
    #[arg(long, requires = "site")]
    pub(super) robot: Option<String>,
    /// What it allows; may be given several times
    #[arg(long = "scope", value_enum, required = true)]
    pub(super) scopes: Vec<ScopeName>,
    /// Days until it ends; never if not given
    #[arg(long, value_parser = clap::value_parser!(i64).range(1..=36_500))]
    pub(super) days: Option<i64>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum ScopeName {
    #[value(name = "map:read")]
    MapRead,
    #[value(name = "map:contribute")]
    MapContribute,
    #[value(name = "map:edit")]
    MapEdit,
    #[value(name = "map:publish")]
    MapPublish,
    #[value(name = "admin")]
    Admin,
}

impl From<ScopeName> for Scope {
    fn from(name: ScopeName) -> Self {
        match name {
            ScopeName::MapRead => Self::MapRead,
            ScopeName::MapContribute => Self::MapContribute,
            ScopeName::MapEdit => Self::MapEdit,
            ScopeName::MapPublish => Self::MapPublish,
            ScopeName::Admin => Self::Admin,
        }
    }
}

#[derive(Debug, Args)]
pub(super) struct ExportCommand {
    /// The format
    pub(super) format: ExportFormat,
    /// Slug of the site
    #[arg(long)]
    pub(super) site: String,
    /// Slug of the level
    #[arg(long)]
    pub(super) level: String,
    /// The file to write; for nav2 the YAML, with the image beside it: `floor.pgm` for `floor.yaml`
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,
    /// Of geojson: what it shows [default: map]
    #[arg(long, value_enum)]
    pub(super) of: Option<ContentName>,
    /// Of models: which one [default: draft]
    #[arg(long, value_enum)]
    pub(super) state: Option<StateName>,
    /// Of geojson of a model: the height that it is cut at [default: 0.3]
    #[arg(long)]
    pub(super) height_m: Option<f64>,
    #[command(flatten)]
    pub(super) nav2: Nav2Options,
}

#[derive(Debug, Args)]
pub(super) struct ImportCommand {
    /// The YAML of a `map_server` map, with its image beside it; or a zip of both; or a `*.building.yaml` of Open-RMF; or a
    /// model as JSON-FG (`*.json`), a plan as GeoJSON (`*.geojson`), a drawing (`*.dxf`) or a model in
    /// three dimensions (`*.glb`)
    pub(super) file: PathBuf,
    /// Slug of the site
    #[arg(long)]
    pub(super) site: String,
    /// Slug of the level
    #[arg(long)]
    pub(super) level: String,
    /// How much the map is trusted, from 0 to 1 [default: 0.5]
    #[arg(long)]
    pub(super) trust: Option<f64>,
    /// Of a building: which of its levels [default: the only one]
    #[arg(long, value_name = "NAME")]
    pub(super) building_level: Option<String>,
    /// Of a map: its occupied cells as walls of the model, instead of the prior
    #[arg(long)]
    pub(super) into_gdb: bool,
    /// Of a building or a model: take away what is in the draft and not in the file
    #[arg(long)]
    pub(super) replace: bool,
    /// Only tell what is in it
    #[arg(long)]
    pub(super) preview: bool,
    #[command(flatten)]
    pub(super) drawing: DrawingOptions,
}

/// Of drawings only: how they are read.
#[derive(Debug, Args)]
pub(super) struct DrawingOptions {
    /// Of a drawing: which layer is what, before the standard names: `S-WALL*=wall,A-CASE*=skip`
    #[arg(long, value_name = "PATTERN=KIND,...")]
    pub(super) layers: Option<String>,
    /// Of a drawing: metres of one unit [default: what it says itself]
    #[arg(long)]
    pub(super) unit_m: Option<f64>,
    /// Of a drawing: height of walls that are drawn flat [default: 2.5]
    #[arg(long)]
    pub(super) wall_height_m: Option<f64>,
}

/// Of nav2 only: what is drawn, and how.
#[derive(Debug, Args)]
pub(super) struct Nav2Options {
    /// Of nav2: how greys stand for occupancy [default: trinary]
    #[arg(long, value_enum)]
    pub(super) mode: Option<ModeName>,
    /// Of nav2: how the image is written [default: png for mode scale, pgm for the others]
    #[arg(long, value_enum)]
    pub(super) image: Option<ImageName>,
    /// Of nav2: which evidence is drawn [default: all]
    #[arg(long, value_enum)]
    pub(super) layer: Option<LayerName>,
    /// Of nav2: only the cells that touch this rectangle, in metres
    #[arg(
        long,
        value_name = "MIN_X,MIN_Y,MAX_X,MAX_Y",
        value_parser = bbox,
        allow_hyphen_values = true
    )]
    pub(super) bbox: Option<Bounds>,
}

fn bbox(text: &str) -> Result<Bounds, String> {
    let wanted = "four numbers in metres, the minima not above the maxima";
    Bounds::parse(text).ok_or_else(|| wanted.to_owned())
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum ModeName {
    /// Occupied, free or unknown
    Trinary,
    /// As many greys as there are; transparent where nothing is known
    Scale,
    /// The grey is the occupancy in per cent; 255 where nothing is known
    Raw,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum ImageName {
    Pgm,
    Png,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum LayerName {
    /// All layers together
    All,
    /// What scanners saw
    Scanner,
    /// What sonars saw
    Sonar,
    /// What was imported
    Prior,
    /// What confirmed walls say of the cells that they pass through
    Walls,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum ExportFormat {
    /// Segments, clusters and chains in metres; or the plan of the model, with its landmarks
    Geojson,
    /// A YAML and an image, as `map_server` reads them
    Nav2,
    /// The model, with the prototypes that it uses, whole
    Jsonfg,
    /// The model as a drawing
    Dxf,
    /// The model in three dimensions, as binary glTF
    Glb,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum ContentName {
    /// What robots saw
    Map,
    /// The plan of the a-priori model, and its landmarks
    Gdb,
    /// Both
    All,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum StateName {
    /// What people work on
    Draft,
    /// What robots get
    Published,
}

#[derive(Debug, Args)]
pub(super) struct VerifyCommand {
    /// Only this site
    #[arg(long)]
    pub(super) site: Option<String>,
    /// Only this level (needs --site)
    #[arg(long, requires = "site")]
    pub(super) level: Option<String>,
}

#[derive(Debug, Args)]
pub(super) struct BackupCommand {
    /// The copy; must not exist yet
    pub(super) file: PathBuf,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_arguments_do_not_contradict_each_other() {
        Arguments::command().debug_assert();
    }
}
