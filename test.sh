#!/bin/sh
# Runs all tests: ./test.sh, or ./test.sh --all to include the long tests.
#
# Installs missing tools (a C linker, the thumbv7em targets, QEMU, Chromium, GNU parallel, rustfmt
# and clippy; for --all also Slurm) and prints what it installs. Needs Rust and, if a tool is
# missing, Debian's apt-get as root or with sudo.
set -eu
cd "$(dirname "$0")"

case "$*" in
    '') ;;
    --all) export TEST_ALL=1 ;;
    *) echo 'usage: ./test.sh [--all]' >&2 && exit 2 ;;
esac

# CI as set by the caller, before it is overwritten below: if true, no step may be skipped.
strict=${CI:-}
# If a tool is missing, its tests fail instead of being skipped.
export CI=true

started=$(date +%s)
say() { echo "== $* ($(($(date +%s) - started)) s)"; }

if ! command -v cargo >/dev/null; then
    PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
fi
if ! command -v cargo >/dev/null; then
    echo 'test.sh: cargo not found; install Rust 1.95 or newer, e.g. with rustup' >&2
    exit 69
fi

# Prints the version of a Rust component; installs the component first if it is missing.
component() {
    name=$1 command=$2 package=$3
    cargo "$command" --version 2>/dev/null && return
    if command -v rustup >/dev/null; then
        timeout 120 rustup component add "$name" || true
    elif [ "$(command -v cargo)" = /usr/bin/cargo ]; then
        scripts/apt-install.sh "$package" || true
    fi
    cargo "$command" --version 2>/dev/null && return
    echo "test.sh: $name is missing; its checks are skipped" >&2
    [ "$strict" != true ] || exit 69
    return 1
}

say 'tools'
command -v cc >/dev/null || scripts/apt-install.sh gcc libc6-dev
command -v qemu-system-arm >/dev/null || scripts/apt-install.sh qemu-system-arm
command -v parallel >/dev/null || scripts/apt-install.sh parallel
command -v chromium >/dev/null || scripts/apt-install.sh chromium
without_slurm=
if [ -n "${TEST_ALL:-}" ]; then
    if [ "$(id -u)" = 0 ] && getent hosts "$(hostname -s)" >/dev/null && { { command -v slurmctld && command -v slurmd && command -v sbatch &&
        command -v munged; } >/dev/null ||
        scripts/apt-install.sh slurmctld slurmd slurm-client munge; }; then
        slurmctld -V
    else
        echo 'test.sh: Slurm tests are skipped: they need root, Slurm and the host name in /etc/hosts' >&2
        [ "$strict" != true ] || exit 69
        without_slurm='--skip real_slurm'
    fi
fi
qemu-system-arm --version | head -n 1
export PROVIDE_TOOLS=1
targets='thumbv7em-none-eabihf thumbv7em-none-eabi'
core_from_source=0
for target in $targets; do
    scripts/thumb-cargo.sh --compiler --target "$target"
    if RUSTUP_TARGET_ADD=0 scripts/thumb-cargo.sh --compiler --target "$target" 2>&1 |
        grep -q 'from its source'; then
        core_from_source=1
        # rustup has just failed; without a network, each attempt waits for a time-out.
        export RUSTUP_TARGET_ADD=0
    fi
done
cargo --version
promised=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
case $(rustc --version) in
    "rustc $promised".*) ;;
    *) echo "test.sh: Rust $promised is promised, but $(rustc --version) is tested" ;;
esac
rustfmt=1 clippy=1
component rustfmt fmt rustfmt-web || rustfmt=0
component clippy clippy rust-web-clippy || clippy=0

if [ $rustfmt = 1 ]; then
    say 'format'
    cargo fmt --all --check
    cargo fmt --manifest-path firmware-example/Cargo.toml --all --check
fi

if [ $clippy = 1 ]; then
    say 'lints'
    cargo clippy --locked --workspace --all-targets --all-features -- -D warnings
    if [ $core_from_source = 1 ]; then
        echo 'test.sh: clippy has no core library for the target; checking only the portable firmware'
        cargo clippy --locked --manifest-path firmware-example/Cargo.toml --lib -- -D warnings
    else
        (cd firmware-example &&
            ../scripts/thumb-cargo.sh clippy --locked -- -D warnings &&
            ../scripts/thumb-cargo.sh clippy --locked --package probe -- -D warnings &&
            ../scripts/thumb-cargo.sh clippy --locked --package robot-stm32f4 -- -D warnings)
    fi
fi

say 'docs'
RUSTDOCFLAGS='-D warnings' cargo doc --locked --workspace --all-features --no-deps

say 'the controller for the Cortex-M4'
for target in $targets; do
    for features in '' neighbours,defmt; do
        example=
        [ -z "$features" ] || example='--example embed'
        # shellcheck disable=SC2086 # an option and its value
        scripts/thumb-cargo.sh build --locked --release --package minimal-surprise-controller \
            --lib $example --features "$features" --target "$target"
    done
done

say 'slots and link for the Cortex-M4'
for features in '' minimal-surprise-slots/defmt,minimal-surprise-link/defmt; do
    scripts/thumb-cargo.sh build --locked --release --package minimal-surprise-slots \
        --package minimal-surprise-link --features "$features" --target thumbv7em-none-eabihf
done

say "the robot's firmware for both boards"
(cd firmware-example &&
    ../scripts/thumb-cargo.sh build --locked --release --bin robot &&
    ../scripts/thumb-cargo.sh build --locked --release --package robot-stm32f4)

say 'the engine for processors that are not x86-64'
scripts/thumb-cargo.sh check --locked --package minimal-surprise-sim \
    --target aarch64-unknown-linux-gnu

say 'the libraries for a browser'
scripts/thumb-cargo.sh check --locked --no-default-features --package minimal-surprise-evolution \
    --package minimal-surprise-replay --target wasm32-unknown-unknown

say 'packages'
cargo package --locked --workspace --exclude tests --exclude robot-support --allow-dirty --no-verify

say 'tests'
# Many tests run the release program. It is built beside the tests, because the last crates of both
# builds leave a core idle; a test that needs it waits for this build, and reports its errors.
cargo build --quiet --locked --release --package minimal-surprise-evolver --bin evolver &
# Many tests wait for other programs, so more of them can run than there are cores.
RUST_TEST_THREADS=${RUST_TEST_THREADS:-$((2 * $(getconf _NPROCESSORS_ONLN)))}
export RUST_TEST_THREADS
# shellcheck disable=SC2086 # an option and its value
cargo test --locked --workspace --all-features --no-fail-fast -- --show-output $without_slurm
if [ -n "${TEST_ALL:-}" ]; then
    say 'every power cut after every power cut'
    cargo test --locked --release --package minimal-surprise-slots --test power_cuts -- --show-output
    say 'coverage-guided fuzzing of every reader of untrusted input' && scripts/fuzz.sh
fi

if [ -n "${TEST_ALL:-}" ]; then
    say 'dependencies'
    cargo deny --version 2>/dev/null || cargo install --locked cargo-deny
    for manifest in Cargo.toml firmware-example/Cargo.toml; do
        cargo deny --manifest-path $manifest --config deny.toml check licenses bans sources
    done
    if cargo deny fetch db; then
        # scripts/fuzz.sh locks fuzz/ to the dependencies of the root workspace and to libFuzzer.
        for manifest in Cargo.toml firmware-example/Cargo.toml fuzz/Cargo.toml; do
            cargo deny --manifest-path $manifest --config deny.toml check advisories
        done
    else
        echo 'test.sh: the advisory database cannot be reached; advisories are not checked'
    fi
fi

say 'all tests passed'
