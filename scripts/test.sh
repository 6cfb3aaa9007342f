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

# Real programs are started, killed and driven by the tests, which find them beside themselves.
# Programs and tests are built in one go: apart, they would differ in features and be built twice.
build() { cargo build --workspace --all-features --bins --tests; }

step "install what is missing" scripts/install-rust.sh nextest
CHROMIUM=$(scripts/install-chromium.sh | tail -n 1)
export CHROMIUM
scripts/install-postgres.sh >/dev/null

step "format" cargo fmt --all --check
step "page" scripts/page.sh
step "page checks" npm --prefix web run --silent check
step "page tests" npm --prefix web test --silent
step "page in a browser" npm --prefix web run --silent test:browser
step "lints" cargo clippy --workspace --all-targets --all-features -- -D warnings
step "documentation" env RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --document-private-items
step "build" build
step "doctests" cargo test --workspace --all-features --doc
step "tests on SQLite and PostgreSQL" \
    scripts/with-postgres.sh cargo nextest run --workspace --all-features
