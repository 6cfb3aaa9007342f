#!/usr/bin/env bash
# Installs PostgreSQL's server programs if they are missing, and prints the folder they are in.
set -euo pipefail
here=$(dirname "$0")

programs() {
    local folder
    for folder in $(ls -d /usr/lib/postgresql/*/bin 2>/dev/null | sort -rV) $(dirname "$(command -v postgres || echo /none/postgres)"); do
        if [ -x "$folder/initdb" ] && [ -x "$folder/pg_ctl" ] && [ -x "$folder/postgres" ]; then
            echo "$folder"
            return 0
        fi
    done
    return 1
}

programs || { "$here/install-apt.sh" postgresql >&2 && programs; }
