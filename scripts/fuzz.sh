#!/bin/sh
# Coverage-guided fuzzing of the targets in tests/fuzz: scripts/fuzz.sh [SECONDS [TARGET...]]
#
# Starts from tests/fuzz-corpus and runs each target for SECONDS (default 300), one target per core
# at a time. An input on which a reader fails is saved in the corpus as found-...; commit it with
# the fix. Needs a C++ compiler because libFuzzer is written in C++, but no nightly Rust. The
# address sanitizer is not used, because no reader has unsafe code.
set -eu
cd "$(dirname "$0")/.."

if ! command -v c++ >/dev/null && ! scripts/apt-install.sh g++; then
    echo 'fuzz.sh: no C++ compiler; skipping coverage-guided fuzzing' >&2
    [ "${CI:-}" != true ]
    exit
fi

seconds=${1:-300}
[ $# = 0 ] || shift
[ $# != 0 ] || set -- $(ls tests/fuzz-corpus)

host=$(rustc -vV | sed -n 's/^host: //p')
coverage='-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1'
# The dependencies of the tests, locked to the same versions, and libFuzzer.
cp Cargo.lock fuzz/Cargo.lock
# With --target, build scripts and macros are built without these flags.
RUSTFLAGS="$coverage -Cdebug-assertions" cargo build --release \
    --manifest-path fuzz/Cargo.toml --target "$host"

# shellcheck disable=SC2016 # for the inner shell
printf '%s\n' "$@" | xargs -P "$(getconf _NPROCESSORS_ONLN)" -I {} sh -c '
    grown=fuzz/target/corpus/$1 log=fuzz/target/$1.log
    mkdir -p "$grown"
    if FUZZ_TARGET=$1 "fuzz/target/$2/release/readers" "$grown" "tests/fuzz-corpus/$1" \
        -max_total_time="$3" -timeout=20 -rss_limit_mb=1024 -max_len=65536 -verbosity=1 \
        -print_final_stats=1 -artifact_prefix="tests/fuzz-corpus/$1/found-" >"$log" 2>&1
    then echo "$1: $(sed -n "s/^stat::number_of_executed_units: *//p" "$log") inputs"
    else echo "$1 failed:" && tail -n 40 "$log" && exit 1
    fi' sh {} "$host" "$seconds"
