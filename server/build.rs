//! Tells Cargo that the migrations are part of the server: `sqlx::migrate!` reads them at compile
//! time, and a new one would otherwise go unnoticed.

#![expect(clippy::print_stdout, reason = "this is how a build script speaks to Cargo")]

fn main() {
    println!("cargo:rerun-if-changed=../migrations");
}
