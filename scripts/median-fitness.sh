#!/usr/bin/env bash
# Runs ten default evolutions per grid, seeds 1 to 10, and prints the median best fitness of their
# last generations. Complete runs are not repeated.
#
#   scripts/median-fitness.sh 15x15 20x20
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --quiet
for grid in "${@:-15x15}"; do
    for seed in 1 2 3 4 5 6 7 8 9 10; do
        run=runs/median-fitness/$grid-seed-$seed
        if [ ! -d "$run" ]; then
            target/release/evolver evolve --grid "$grid" --seed "$seed" --out "$run" --progress none >/dev/null
        elif [ ! -f "$run/DONE" ]; then
            target/release/evolver evolve --resume "$run" --progress none >/dev/null
        fi
        tail -n 1 "$run/generations.csv" | cut -d, -f2
    done | sort -g | awk -v grid="$grid" '{ fitness[NR] = $1 }
        END {
            printf "%s: median best fitness %.3f of %d evolutions (%.3f to %.3f)\n", grid,
                (fitness[int((NR + 1) / 2)] + fitness[int(NR / 2) + 1]) / 2, NR, fitness[1], fitness[NR]
        }'
done
