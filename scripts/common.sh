# Shared by the scripts of this folder; sourced with the repository root as working directory.

lcm_group=239.255.76.67  # LCM's default multicast group
jobs=${JOBS:-$(nproc)}

# The same source gives the same cache entry in every checkout.
export CCACHE_BASEDIR=$PWD CCACHE_NOHASHDIR=1 CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:-pch_defines,time_macros}

# say <step> <text>: one plain line of progress.
say() { printf '%-10s %s\n' "$1:" "$2"; }

# fail <what> <mend>: names the thing and the mend, then stops.
fail() {
  printf 'error: %s\n  mend: %s\n' "$1" "$2" >&2
  exit 1
}

# content_hash [file]...: one digest of the contents, of standard input without a file.
content_hash() { cat "$@" | sha256sum | cut -d ' ' -f 1; }

# configure <dir> <build type> [cmake option]...: runs CMake unless this configuration is there already.
configure() {
  local dir=$1 type=$2 stamp
  shift 2
  stamp=$(printf '%s\n' "$PWD" "$type" "$@" | sha256sum | cut -d ' ' -f 1)
  if [ -f "$dir/build.ninja" ] && [ "$(cat "$dir/stamp" 2> /dev/null)" = "$stamp" ]; then return; fi
  mkdir -p build/logs
  local log=build/logs/cmake-${dir//\//-}.log
  say build "configuring $dir/ ($type${*:+, $*})"
  cmake -G Ninja -S . -B "$dir" -DCMAKE_BUILD_TYPE="$type" -DPython_EXECUTABLE="$PWD/.venv/bin/python" "$@" > "$log" 2>&1 < /dev/null ||
    { tail -n 20 "$log" >&2; fail "CMake failed, see $log" "read the lines above; scripts/setup.sh packages installs what a build needs"; }
  echo "$stamp" > "$dir/stamp"
}

# compile <dir> [target]...: builds; the full output goes to a log, the failing part of it to the terminal.
compile() {
  local dir=$1
  shift
  local log=build/logs/ninja-${dir//\//-}.log
  mkdir -p build/logs
  if [ -t 1 ]; then
    ninja -C "$dir" -j "$jobs" "$@" < /dev/null || fail "the build of $dir/ stopped" "read the first error above"
  else
    ninja -C "$dir" -j "$jobs" "$@" > "$log" 2>&1 < /dev/null ||
      { grep -E -A 12 'FAILED|error' "$log" | head -n 60 >&2; fail "the build of $dir/ stopped, see $log" "read the first error above"; }
  fi
}
