#!/usr/bin/env bash
# Sees to it that the toolchain of rust-toolchain.toml and cargo-nextest are there.
set -euo pipefail
cd "$(dirname "$0")/.."
if ! command -v cargo >/dev/null; then
    echo "Rust is missing: install rustup, then run this again." >&2
    exit 1
fi
cargo --version >/dev/null 2>&1 || rustup toolchain install --profile minimal -c clippy -c rustfmt
if [ "${1:-}" = nextest ] && ! cargo nextest --version >/dev/null 2>&1; then
    cargo install --locked cargo-nextest
fi
