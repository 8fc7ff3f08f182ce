#!/bin/sh
# Installs Debian packages, as root or with sudo: scripts/apt-install.sh PACKAGE…
set -eu

if [ "$(id -u)" = 0 ]; then
    as_root=
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
    as_root='sudo -n'
else
    echo "apt-install: neither root nor sudo; run as root: apt-get install $*" >&2
    exit 1
fi
if ! command -v apt-get >/dev/null; then
    echo "apt-install: apt-get not found; install manually: $*" >&2
    exit 1
fi
echo "apt-install: apt-get install --no-install-recommends $*" >&2
$as_root apt-get update -qq >&2 || echo "apt-install: package lists not updated" >&2
$as_root env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "$@" >&2
