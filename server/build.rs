//! Tells Cargo what is part of the server besides its sources: the migrations, which
//! `sqlx::migrate!` reads at compile time, and (in release builds, which hold it) the page.

fn main() {
    println!("cargo:rerun-if-changed=../migrations");
    // Debug builds read the page at run time, and must not be built anew while there is none.
    if std::env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        println!("cargo:rerun-if-changed=../web/dist");
    }
}
