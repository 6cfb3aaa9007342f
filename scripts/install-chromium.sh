#!/usr/bin/env bash
# Installs Chromium if it is missing, and prints the program's path.
set -euo pipefail
here=$(dirname "$0")

browser() {
    command -v chromium || command -v chromium-browser || command -v google-chrome
}

browser || { "$here/install-apt.sh" chromium fonts-dejavu-core >&2 && browser; }
