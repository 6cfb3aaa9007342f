#!/usr/bin/env bash
# The demonstration: a server on an embedded SQLite file, and real logs played into it as a fleet.
#
# LISTEN (127.0.0.1:7171) and DATA_DIR (mapfold-data) may be set; remove the folder to begin anew.
set -euo pipefail
cd "$(dirname "$0")/.."
listen=${LISTEN:-127.0.0.1:7171}
data_dir=${DATA_DIR:-mapfold-data}
server="http://$listen"

scripts/install-rust.sh
scripts/page.sh
cargo build --release --workspace --bins
programs=${CARGO_TARGET_DIR:-target}/release

# The token outlives a restart with the data that it opens.
mkdir -p "$data_dir"
token_file=$data_dir/admin-token
if [ ! -s "$token_file" ]; then
    (umask 077 && head -c 24 /dev/urandom | od -An -tx1 | tr -d ' \n' >"$token_file")
fi
token=$(cat "$token_file")

jobs_started=()
stop_all() {
    trap - EXIT INT TERM
    for job in "${jobs_started[@]}"; do kill "$job" 2>/dev/null || true; done
    wait 2>/dev/null || true
}
trap stop_all EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# What an earlier server said of being ready must not be taken for this one's.
rm -f "$data_dir/server.log"
MAPFOLD_ADMIN_TOKEN=$token "$programs/mapfold-server" serve \
    --listen "$listen" --data-dir "$data_dir" >"$data_dir/server.log" 2>&1 </dev/null &
server_job=$!
jobs_started+=("$server_job")

# The server itself tells when it is ready: somebody else may hold the port.
for _ in $(seq 300); do
    grep -q ' listening' "$data_dir/server.log" 2>/dev/null && break
    kill -0 "$server_job" 2>/dev/null || { cat "$data_dir/server.log" >&2; exit 1; }
    sleep 0.1
done
kill -0 "$server_job" 2>/dev/null || { cat "$data_dir/server.log" >&2; exit 1; }

cat <<EOF

  Mapfold is at     $server/
  Open it signed in $server/#token=$token&site=mit&level=infinite-corridor
  Admin token       $token   (also in $token_file)

  Three robots map the corridors of MIT, 32 times as fast as they did: two with a laser scanner,
  one with sonar only (emulated from its part of the laser log). On a second level a real ring
  of eight sonars maps one corridor. Ctrl-C stops everything.

EOF

# The log's first reading is at 0; it lasts 7674 s.
replay() {
    local name=$1
    shift
    "$programs/mapfold-robot" replay "$@" --outbox "$data_dir/robots/$name" --server "$server" --token "$token" --site mit --create \
        --robot "$name" --poses log >"$data_dir/$name.log" 2>&1 </dev/null &
    jobs_started+=("$!")
    robots+=("$name:$!")
}
robots=()
replay anna tests/data/killian.log.gz --level infinite-corridor --to 2558 --speed 32
replay bruno tests/data/killian.log.gz --level infinite-corridor --from 2558 --to 5116 --speed 32
replay clara tests/data/killian.log.gz --level infinite-corridor --from 5116 --speed 32 \
    --competence sonar --emulate-sonar
replay ring tests/data/corridor-ring8.log.gz --level ring8-corridor --speed 2

for robot in "${robots[@]}"; do
    if wait "${robot#*:}"; then
        echo "  ${robot%%:*} has played its log to the end"
    else
        echo "  ${robot%%:*} stopped early; its last words:" >&2
        tail -n 3 "$data_dir/${robot%%:*}.log" >&2
    fi
done
echo "  The server goes on until Ctrl-C."
wait "$server_job"
