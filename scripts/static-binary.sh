#!/bin/sh
# Builds an `evolver` without system libraries, linked statically with musl:
#
#     scripts/static-binary.sh [x86_64|aarch64]      default: this machine's processor
#
# Prints the path of the program. Needs rustup; uses the linker shipped with Rust.
set -eu
cd "$(dirname "$0")/.."

processor=${1:-$(uname -m)}
case $processor in
    x86_64 | aarch64) ;;
    *) echo "usage: scripts/static-binary.sh [x86_64|aarch64]" >&2 && exit 2 ;;
esac
target=$processor-unknown-linux-musl

rustup target list --installed | grep -qx "$target" || rustup target add "$target" >&2
flags='-C linker=rust-lld -C link-self-contained=yes -C target-feature=+crt-static'
env "CARGO_TARGET_$(echo "$target" | tr 'a-z-' 'A-Z_')_RUSTFLAGS=$flags" \
    cargo build --release --locked --package minimal-surprise-evolver --target "$target" >&2
echo "target/$target/release/evolver"
