//! The program `mapfold-server`; see `mapfold_server::cli`.

use std::process::ExitCode;

#[tokio::main]
async fn main() -> ExitCode {
    mapfold_server::cli::run(std::env::args_os()).await
}
