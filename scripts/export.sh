#!/usr/bin/env bash
# Exports the controller: a folder that builds by itself with CMake, a C and C++ compiler and Eigen.
#
#   scripts/export.sh <folder>
#   cmake -S <folder> -B <folder>/build && cmake --build <folder>/build     # libengram_panda_reach.a and its tables
set -euo pipefail
[ $# = 1 ] || { echo "usage: scripts/export.sh <folder>" >&2; exit 2; }
target=$(realpath -m "$1")
cd "$(dirname "$0")/.."
. scripts/common.sh
if [ -e "$target" ] && [ -n "$(ls -A "$target")" ]; then fail "$target is there already and is not empty" "name another folder"; fi
mkdir -p "$target"
git ls-files -z CMakeLists.txt LICENSE controller tables docs/example ':!controller/io' |
  while IFS= read -r -d '' file; do [ ! -f "$file" ] || install -D -m 644 "$file" "$target/$file"; done
say export "$target ($(du -sh "$target" | cut -f 1))"
