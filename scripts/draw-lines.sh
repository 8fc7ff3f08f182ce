#!/bin/sh
# Draws random lines of comments, messages and documents, for a review of their English:
#
#     scripts/draw-lines.sh [SEED [NUMBER]]      default: seed 1, 300 lines
#
# The same seed draws the same lines if the revision is the same.
set -eu
cd "$(dirname "$0")/.."

seed=${1:-1} number=${2:-300}
{
    # Comments, and strings of at least four words.
    git ls-files '*.rs' | xargs grep -nE '^ *//|"[^"]*[a-z]+ [a-z]+ [a-z]+ [a-z]+[^"]*"' /dev/null
    git ls-files '*.md' | grep -v '^docs/results/' | xargs grep -nE '[a-z]+ [a-z]+ [a-z]+' /dev/null
} | sort | awk -v seed="$seed" 'BEGIN { srand(seed) } { print rand() "\t" $0 }' | sort -n | cut -f 2- | head -n "$number"
