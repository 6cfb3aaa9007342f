#!/usr/bin/env bash
# Every check there is, cheap ones first. Nothing is skipped: what a check needs is installed.
set -euo pipefail
cd "$(dirname "$0")/.."
exec </dev/null

begin=$SECONDS
step() {
    local name=$1 from=$SECONDS
    shift
    printf '\n== %s\n' "$name"
    "$@"
    printf '== %s: %d s (%d s in all)\n' "$name" $((SECONDS - from)) $((SECONDS - begin))
}

rust_tests() {
    # Real programs are started, killed and driven: build them first, the tests find them.
    cargo build --workspace --bins
    MAPFOLD_TEST_CHROMIUM=$chromium scripts/with-postgres.sh cargo nextest run --workspace --all-features
}

step "install what is missing" scripts/install-rust.sh nextest
chromium=$(scripts/install-chromium.sh | tail -n 1)
scripts/install-postgres.sh >/dev/null

step "format" cargo fmt --all --check
step "page" scripts/page.sh
step "page checks" npm --prefix web run --silent check
step "page tests" npm --prefix web test --silent
step "lints" cargo clippy --workspace --all-targets --all-features -- -D warnings
step "documentation" env RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --document-private-items
step "doctests" cargo test --workspace --doc --all-features
step "tests on SQLite and PostgreSQL, browser" rust_tests
