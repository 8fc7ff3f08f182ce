#!/bin/sh
# Mutation tests of controller, slots and link: scripts/mutants.sh [SHARDS]. Takes about an hour and
# needs cargo-mutants (cargo install cargo-mutants --locked).
#
# Results are in target/mutants. A repeated call resumes after the last complete shard; after a
# change to sources or tests, remove that directory first.
set -eu
cd "$(dirname "$0")/.."

shards=${1:-16}
outcomes=target/mutants/outcomes
# Shared by all shards, so that dependencies are compiled only once.
CARGO_TARGET_DIR=$PWD/target/mutants/build
export CARGO_TARGET_DIR

shard=0
while [ "$shard" -lt "$shards" ]; do
    this=$outcomes/$shard-of-$shards
    if [ ! -e "$this/complete" ]; then
        mkdir -p "$this"
        status=0
        cargo mutants --package minimal-surprise-controller --package minimal-surprise-slots \
            --package minimal-surprise-link --shard "$shard/$shards" --sharding round-robin \
            --output "$this" || status=$?
        # Exit codes: 2 if mutants survived, 3 if tests timed out; a mutant whose tests time out
        # counts as caught.
        case $status in
            0 | 2 | 3) touch "$this/complete" ;;
            *) exit "$status" ;;
        esac
    fi
    shard=$((shard + 1))
done

printf '%-9s %10s %11s %10s %5s\n' '' controller robot-slots robot-link all
for outcome in caught timeout unviable missed; do
    of() { cat "$outcomes"/*-of-"$shards"/mutants.out/$outcome.txt | grep -c "^$1"; }
    printf '%-9s %10s %11s %10s %5s\n' $outcome \
        "$(of controller/)" "$(of robot-slots/)" "$(of robot-link/)" "$(of '')"
done
cat "$outcomes"/*-of-"$shards"/mutants.out/missed.txt
