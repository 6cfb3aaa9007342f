#!/usr/bin/env bash
# Builds the operators' page into web/dist, installing its packages if they are missing or stale.
set -euo pipefail
cd "$(dirname "$0")/../web"

major=$(node --version 2>/dev/null | sed -n 's/^v\([0-9]*\).*/\1/p')
if [ "${major:-0}" -lt 20 ]; then
    echo "The page needs Node 20 or newer (found: ${major:-none}); install it, then run this again." >&2
    exit 1
fi
# npm writes this file last: it is older than the lock file when packages have changed since.
if [ ! -e node_modules/.package-lock.json ] || [ package-lock.json -nt node_modules/.package-lock.json ]; then
    npm ci --no-audit --no-fund </dev/null
fi
# A page that is built anew would have the server compiled anew, for the same bytes.
if [ ! -e dist/index.html ] ||
    [ -n "$(find . -path ./node_modules -prune -o -path ./dist -prune -o -type f -newer dist/index.html -print -quit)" ]; then
    npm run --silent build </dev/null
fi
