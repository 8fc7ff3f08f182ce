#!/usr/bin/env bash
# Prints the medians and ranges of five runs of `evolver bench`, and the processor's name.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --quiet
runs=$(mktemp)
trap 'rm -f "$runs"' EXIT
for _ in 1 2 3 4 5; do
    target/release/evolver bench --json >>"$runs"
done
grep -m 1 'model name' /proc/cpuinfo || true
tr -d '{}"' <"$runs" | tr ',' '\n' | sort -t: -k1,1 -k2,2g | awk -F: '
    { value[$1] = value[$1] " " $2 }
    END {
        for (key in value) {
            split(value[key], runs, " ")
            printf "%-26s %14.4g   (%.4g to %.4g)\n", key, runs[3], runs[1], runs[5]
        }
    }' | sort
