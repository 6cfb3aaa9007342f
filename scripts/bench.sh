#!/usr/bin/env bash
# Runs the speed benchmarks and rewrites their figures in BENCHMARKS.md.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/install-rust.sh
cargo bench -p mapfold-map -p mapfold-client -p mapfold-tests --bench '*' -- --noplot
cargo run --release -q -p mapfold-tests --bin mapfold-evaluate -- benches --report BENCHMARKS.md
