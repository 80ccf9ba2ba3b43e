#!/usr/bin/env bash
# Rebuilds tables/ from models/: robots, tasks, data (solved tasks, kept in build/data and resumed from there), memory.
# The same models and sources give the same bytes; `git status tables` tells.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
engram=.venv/bin/engram
robots=()
for description in models/*/robot.toml; do robots+=("$(basename "$(dirname "$description")")"); done
"$engram" robot "${robots[@]}"
for description in models/*/*/task.toml; do
  task=$(basename "$(dirname "$description")") robot=$(basename "$(dirname "$(dirname "$description")")")
  "$engram" task "$robot" "$task"
  scripts/setup.sh build
  if [ "$robot/$task" = talos/step ]; then
    "$engram" data talos step
    "$engram" fit talos step
    scripts/setup.sh build
    continue
  fi
  if [ "$robot/$task" = talos/pole ]; then
    TARGETS=engram-pole scripts/setup.sh build
    "$engram" pole
    scripts/setup.sh build
    continue
  fi
  grep -q '^kind = "reach"' "$description" || continue  # another motion has no memory to fit
  "$engram" data "$robot" "$task"
  "$engram" fit "$robot" "$task"
  scripts/setup.sh build
done
if [ -z "$(git status --porcelain tables)" ]; then
  say tables "the same bytes as in the tree"
else
  say tables "these differ from what is committed:"
  git status --short tables
fi
