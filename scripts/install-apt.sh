#!/usr/bin/env bash
# install-apt.sh PACKAGE...: installs packages of the distribution, as root or through sudo.
set -euo pipefail
as_root=()
[ "$(id -u)" = 0 ] || as_root=(sudo -n)
if ! command -v apt-get >/dev/null; then
    echo "install-apt.sh: no apt-get here; install these by hand: $*" >&2
    exit 1
fi
export DEBIAN_FRONTEND=noninteractive
apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300)
"${apt[@]}" update </dev/null
"${apt[@]}" install -y --no-install-recommends "$@" </dev/null
