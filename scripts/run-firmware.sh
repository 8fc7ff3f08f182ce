#!/bin/sh
# Runs a firmware program in QEMU and prints its log: scripts/run-firmware.sh ELF
# This is Cargo's runner in firmware-example.
set -eu

elf=$(realpath "$1")
cd "$(dirname "$0")/.."
# A calling cargo may have set these variables for the target; they must not affect builds for the
# host.
unset CARGO_BUILD_TARGET RUSTC RUSTC_BOOTSTRAP
exec cargo run --quiet --package tests --bin run-firmware -- "$elf"
