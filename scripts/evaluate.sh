#!/usr/bin/env bash
# Calibrates simulated scanners and measures their corrected ranges; finds lines in simulated scans and
# holds them against the walls; scores grids of sonars and scanners and draws a corridor; compares what the
# maps of simulated fleets claim with truth; moves shelves; removes, adds and moves
# things and asks what is told of it against the model; takes real buildings in; cuts vast models; times what a server answers about vast rasters; asks
# for places among landmarks; tracks robots and carries some away; lets lost ones find their places on logs, and others keep theirs on maps that another robot made; times the
# fold of vast floors; replays every log there is through real servers on SQLite and PostgreSQL and
# measures the maps; and rewrites the tables in BENCHMARKS.md. Logs and plans that may not be committed
# are looked for in ../shared/data; without that folder: the committed logs and simulated worlds.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/install-rust.sh
cargo build --release --workspace --bins
evaluate="${CARGO_TARGET_DIR:-target}/release/mapfold-evaluate"
"$evaluate" range --report BENCHMARKS.md
"$evaluate" extraction --report BENCHMARKS.md --data ../shared/data
"$evaluate" raster --report BENCHMARKS.md --picture docs/sonar-corridor.svg
"$evaluate" honesty --report BENCHMARKS.md
"$evaluate" change --report BENCHMARKS.md
"$evaluate" differences --report BENCHMARKS.md
"$evaluate" plans --report BENCHMARKS.md
if [ -d ../shared/data/plans ]; then "$evaluate" buildings --report BENCHMARKS.md --data ../shared/data --pictures docs/buildings; fi
"$evaluate" serving --report BENCHMARKS.md
"$evaluate" structures --report BENCHMARKS.md
"$evaluate" localization --report BENCHMARKS.md
"$evaluate" places --report BENCHMARKS.md --data ../shared/data
"$evaluate" looks --report BENCHMARKS.md --data ../shared/data
"$evaluate" alignment --report BENCHMARKS.md --data ../shared/data
if [ -d ../shared/data/logs ]; then "$evaluate" trajectories --report BENCHMARKS.md --data ../shared/data; fi
"$evaluate" growth --report BENCHMARKS.md --data ../shared/data
scripts/with-postgres.sh "$evaluate" maps --report BENCHMARKS.md --data ../shared/data "$@"
