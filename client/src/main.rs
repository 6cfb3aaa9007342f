//! `mapfold-robot`: the robot's side on the command line, for trials and for robots without an
//! integration of their own. Here, and nowhere else in this crate, chance is real.

mod cli;

use std::process::ExitCode;

use clap::Parser as _;
use rand::SeedableRng as _;
use rand::rngs::StdRng;

fn main() -> ExitCode {
    let arguments = cli::Arguments::parse();
    tracing_subscriber::fmt()
        .with_env_filter(tracing_subscriber::EnvFilter::from_env("MAPFOLD_LOG"))
        .with_writer(std::io::stderr)
        .init();
    mapfold_client::sync::tls::install_provider();
    let runtime = match tokio::runtime::Builder::new_multi_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => return cli::failed(&error),
    };
    #[expect(clippy::disallowed_methods, reason = "this is the program: chance is real here")]
    let rng = StdRng::from_rng(&mut rand::rng());
    runtime.block_on(cli::run(arguments, rng))
}
