#!/bin/sh
# Runs cargo for a Cortex-M4 or, with --target, for a different processor, e.g. in firmware-example:
#
#     ../scripts/thumb-cargo.sh build --release [--target thumbv7em-none-eabi]
#     scripts/thumb-cargo.sh --compiler [--target …]       prints the compiler and builds nothing
#
# The target's core library (std for targets with an operating system) comes from the first of these
# sources that works:
#
#   1. the active Rust toolchain, if it has the library;
#   2. rustup, which installs it (skipped with RUSTUP_TARGET_ADD=0);
#   3. the system's Rust, which builds it from source. With PROVIDE_TOOLS=1, the Debian packages
#      needed for this are installed.
#
# Prints the compiler to stderr, because sizes and instruction counts depend on it. If no source
# works, prints what to install and exits with code 69.
set -eu

target=thumbv7em-none-eabihf
previous=
for argument in "$@"; do
    case $previous in --target) target=$argument ;; esac
    case $argument in --target=*) target=${argument#--target=} ;; esac
    previous=$argument
done
export CARGO_BUILD_TARGET="$target"

here=$(dirname "$0")
version_min=1.95

case $target in
    *-none-*) library=core ;;
    *) library=std ;;
esac

say() { echo "thumb-cargo: $*" >&2; }

has_target() {
    command -v rustc >/dev/null && command -v cargo >/dev/null &&
        ls "$(rustc --print sysroot)/lib/rustlib/$target/lib/"libcore-*.rlib >/dev/null 2>&1
}

add_target() {
    [ "${RUSTUP_TARGET_ADD:-1}" = 1 ] && command -v rustup >/dev/null || return 1
    say "rustup target add $target"
    timeout 120 rustup target add "$target" >&2 && has_target
}

# Checks whether the system's Rust exists, is new enough, and can build core for a different target.
has_system_rust() {
    [ -x /usr/bin/cargo ] && [ -x /usr/bin/rustc ] && command -v ld.lld >/dev/null || return 1
    [ -f "$(system rustc --print sysroot)/lib/rustlib/src/rust/library/core/Cargo.toml" ] || return 1
    version=$(system rustc --version | cut -d ' ' -f 2)
    [ "$(printf '%s\n' "$version_min" "$version" | sort -V | head -n 1)" = "$version_min" ]
}

# Runs a program of the system's Rust, without the variables set by rustup or a calling cargo.
system() {
    program=$1
    shift
    env -u RUSTUP_TOOLCHAIN -u RUSTC_WRAPPER -u RUSTDOC -u CARGO -u LD_LIBRARY_PATH \
        RUSTC_BOOTSTRAP=1 RUSTC=/usr/bin/rustc "/usr/bin/$program" "$@"
}

system_packages='rustc-web cargo-web rust-web-src lld'

provide_system_rust() {
    [ "${PROVIDE_TOOLS:-}" = 1 ] || return 1
    # shellcheck disable=SC2086 # a list of names
    "$here/apt-install.sh" $system_packages && has_system_rust
}

named() { say "compiler: $1, target $target"; }

if has_target || add_target; then
    named "$(rustc --version)"
    [ "${1:-}" = --compiler ] || exec cargo "$@"
elif has_system_rust || provide_system_rust; then
    named "$(system rustc --version), $library built from its source"
    [ "${1:-}" = --compiler ] || system cargo -Z build-std="$library" \
        --config "target.$target.linker='ld.lld'" \
        --config "target.$target.rustflags=['-Clinker-flavor=ld.lld']" \
        "$@"
else
    say "no $library library for $target. Either of these commands installs it:"
    say "    rustup target add $target"
    say "    apt-get install --no-install-recommends $system_packages   (Rust $version_min or newer)"
    exit 69
fi
