#!/bin/sh
# Runs a firmware program under QEMU and prints what it logs: scripts/run-firmware.sh ELF
# Cargo's runner in firmware-example.
set -eu

elf=$(realpath "$1")
cd "$(dirname "$0")/.."
# What an outer cargo for the target has set is not for the host.
unset CARGO_BUILD_TARGET RUSTC RUSTC_BOOTSTRAP
exec cargo run --quiet --package tests --bin run-firmware -- "$elf"
