#!/usr/bin/env bash
# Draws docs/hallway.svg: stops of a committed log, played by real robots into a real server, whose
# answer is drawn.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/install-rust.sh
cargo build --release --workspace --bins
"${CARGO_TARGET_DIR:-target}/release/mapfold-evaluate" figure --out docs/hallway.svg
