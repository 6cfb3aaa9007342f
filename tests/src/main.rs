//! `mapfold-evaluate`: measures what needs more data or time than the tests have, and rewrites the
//! tables in a page of text.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use mapfold_tests::{
    alignment, buildings, change, differences, evaluation, extraction, figure, growth, honesty,
    localization, places, plans, range, raster, serving, speed, structures, trajectory,
};

/// Measures Mapfold and rewrites the tables of a report between their markers.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Plays logs as fleets into real servers on SQLite and PostgreSQL and measures the maps
    Maps {
        /// The page with the markers `maps`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// A folder with further logs, in `logs/`; simulated worlds are played where there is none
        #[arg(long, value_name = "DIR")]
        data: Option<PathBuf>,
        /// Only logs whose name contains this; the report is then left as it is
        #[arg(long, value_name = "TEXT")]
        only: Option<String>,
    },
    /// Calibrates simulated infrared heads and measures how well their ranges are corrected
    Range {
        /// The page with the markers `range`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
    },
    /// Sends simulated fleets that localize on the map that they write, and compares what it claims
    /// with how wrong it is
    Honesty {
        /// The page with the markers `honesty`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
    },
    /// Times the fold of vast simulated floors and of logs, and taking contributions out again
    Growth {
        /// The page with the markers `growth`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// A folder with further logs, in `logs/`
        #[arg(long, value_name = "DIR")]
        data: Option<PathBuf>,
    },
    /// Moves a shelf in a simulated hall and measures how soon the map believes it
    Change {
        /// The page with the markers `change`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
    },
    /// Removes, adds and moves things on simulated floors, and measures what is told against the model
    Differences {
        /// The page with the markers `differences`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
    },
    /// Takes real buildings into a server, and counts what comes of them
    Buildings {
        /// The page with the markers `buildings`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// The folder with the real data, in `plans/`
        #[arg(long, value_name = "DIR")]
        data: PathBuf,
        /// The folder that pictures are written to
        #[arg(long, value_name = "DIR")]
        pictures: PathBuf,
    },
    /// Cuts models of up to 20 000 walls, and times what is made of them
    Plans {
        /// The page with the markers `plans`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
    },
    /// Uploads levels of up to 100 000 tiles and times what a server answers about their rasters
    Serving {
        /// The page with the markers `serving`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
    },
    /// Asks for a robot's place among up to 100 000 landmarks
    Structures {
        /// The page with the markers `structures`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
    },
    /// Repeats the paper's experiment: tracks simulated robots on 15 m with nine stops, and carries some of them away
    Localization {
        /// The page with the markers `localization`, `kidnapped` and `selection`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// The seed of each row's first run; the page has those from 0 on
        #[arg(long, value_name = "N", default_value_t = 0)]
        first_seed: u64,
    },
    /// Lets robots that know nothing find their places on logs that are not in their maps
    Places {
        /// The page with the markers `places`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// A folder with further logs, in `logs/`
        #[arg(long, value_name = "DIR")]
        data: Option<PathBuf>,
    },
    /// Asks single looks for their places, on logs that are not in the maps and on plans of real buildings
    Looks {
        /// The page with the markers `looks` and `on-plans`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// The folder with the real data, in `logs/` and `plans/`
        #[arg(long, value_name = "DIR")]
        data: PathBuf,
    },
    /// Aligns maps that robots made in frames of their own, out of logs that are cut in two
    Alignment {
        /// The page with the markers `alignment`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// A folder with further logs, in `logs/`
        #[arg(long, value_name = "DIR")]
        data: Option<PathBuf>,
    },
    /// Plays logs with poses that the robot finds itself, on maps that another one made, and compares them with the published ones
    Trajectories {
        /// The page with the markers `trajectories`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// The folder with the logs, in `logs/`
        #[arg(long, value_name = "DIR")]
        data: PathBuf,
        /// Only logs whose name contains this; the report is then left as it is
        #[arg(long, value_name = "TEXT")]
        only: Option<String>,
    },
    /// Draws a hallway's vector map from a few scans of the committed log
    Figure {
        /// The SVG to write
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
    /// Finds lines in simulated scans of which every wall is known, beside a bare loop
    Extraction {
        /// The page with the markers `extraction`, `lines`, `seeds` and `labelled`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// A folder with a map whose lines people drew, `plans/aria/columbia.map`
        #[arg(long, value_name = "DIR")]
        data: Option<PathBuf>,
    },
    /// Makes grids of simulated and recorded sonars and scanners, and holds them against what is there
    Raster {
        /// The page with the markers `sonar-grid`, `rules`, `scanner-grid`, `layers` and `recorded`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// The SVG of a real corridor to write
        #[arg(long, value_name = "FILE")]
        picture: PathBuf,
    },
    /// Gathers the figures that Criterion has left in the target folder
    Benches {
        /// The page with the markers `benches`
        #[arg(long, value_name = "FILE")]
        report: PathBuf,
        /// Where Criterion leaves its figures
        #[arg(long, value_name = "DIR", default_value = "target/criterion")]
        criterion: PathBuf,
    },
}

#[tokio::main]
async fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::Maps { report, data, only } => {
            evaluation::maps(&report, data.as_deref(), only.as_deref()).await
        }
        Command::Range { report } => range::evaluate(&report, &range::FULL),
        Command::Honesty { report } => honesty::table(&report),
        Command::Growth { report, data } => growth::tables(&report, data.as_deref()),
        Command::Extraction { report, data } => extraction::extraction(&report, data.as_deref()),
        Command::Change { report } => change::table(&report),
        Command::Differences { report } => differences::table(&report),
        Command::Buildings { report, data, pictures } => {
            buildings::table(&report, &data, &pictures).await
        }
        Command::Plans { report } => plans::table(&report),
        Command::Serving { report } => serving::tables(&report).await,
        Command::Structures { report } => structures::table(&report).await,
        Command::Localization { report, first_seed } => localization::tables(&report, first_seed),
        Command::Places { report, data } => places::table(&report, data.as_deref()),
        Command::Looks { report, data } => places::single_looks(&report, &data).await,
        Command::Alignment { report, data } => alignment::table(&report, data.as_deref()),
        Command::Trajectories { report, data, only } => {
            trajectory::table(&report, &data, only.as_deref()).await
        }
        Command::Figure { out } => figure::write(&out).await.map(|()| Vec::new()),
        Command::Raster { report, picture } => raster::raster(&report, &picture),
        Command::Benches { report, criterion } => speed::benches(&report, &criterion),
    };
    match done {
        Ok(faults) if faults.is_empty() => ExitCode::SUCCESS,
        Ok(faults) => {
            complain(&faults.join("\n"));
            ExitCode::FAILURE
        }
        Err(error) => {
            complain(&error.to_string());
            ExitCode::FAILURE
        }
    }
}

fn complain(words: &str) {
    use std::io::Write as _;
    // Where nobody listens, the exit status still tells.
    let _ = writeln!(std::io::stderr(), "mapfold-evaluate: {words}");
}
