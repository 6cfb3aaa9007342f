#!/usr/bin/env bash
# with-postgres.sh COMMAND...: runs a command with a PostgreSQL of its own, on a free port and in a
# temporary folder, gone afterwards. The command finds it by MAPFOLD_TEST_POSTGRES, the URL of a
# database in which it may create others.
set -euo pipefail
here=$(dirname "$0")
programs=$("$here/install-postgres.sh")
folder=$(mktemp -d "${TMPDIR:-/tmp}/mapfold-postgres.XXXXXX")

# PostgreSQL refuses to run as root.
as_owner=()
if [ "$(id -u)" = 0 ]; then
    owner=postgres
    id "$owner" >/dev/null 2>&1 || owner=nobody
    chown "$owner" "$folder"
    as_owner=(runuser -u "$owner" --)
fi
control() { (cd "$folder" && "${as_owner[@]}" "$programs/pg_ctl" -s -D "$folder/data" "$@" </dev/null); }

stop() {
    control -m immediate -w stop >/dev/null 2>&1 || true
    rm -rf "$folder"
}
trap stop EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

(cd "$folder" && "${as_owner[@]}" "$programs/initdb" -D "$folder/data" -U mapfold --auth=trust \
    --encoding=UTF8 --no-locale >"$folder/initdb.log" 2>&1 </dev/null) || { cat "$folder/initdb.log" >&2; exit 1; }

started=
for _ in 1 2 3 4 5 6 7 8; do
    port=$((20000 + RANDOM % 12000))
    if control -l "$folder/data/server.log" -w -t 60 \
        -o "-h 127.0.0.1 -p $port -k $folder -c max_connections=200" start >/dev/null; then
        started=yes
        break
    fi
done
[ -n "$started" ] || { cat "$folder/data/server.log" >&2; exit 1; }

export MAPFOLD_TEST_POSTGRES="postgres://mapfold@127.0.0.1:$port/postgres"
"$@"
