#!/usr/bin/env bash
# Makes this checkout ready to run: Debian packages, Python environment, build. Safe to run again: what is done is skipped.
#
#   scripts/setup.sh [packages] [python] [build] [scene] [network]     no argument: all of these, in this order
#   scripts/setup.sh torch                                             the optional extra: PyTorch, reference of `make bench`
#
# PYTHON=/path/to/python3.11 chooses the interpreter. JOBS=n sets the number of parallel compilations. TARGETS="a b" builds these only.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh

packages=(
  cmake ninja-build ccache g++ pkg-config  # build
  libeigen3-dev                            # the controller's only library
  liblcm-dev liblcm-bin                    # messages, logs
  libmujoco-dev libosmesa6-dev ffmpeg      # plant, off-screen video
  coinor-libipopt-dev libsundials-dev      # offline solver, reference integration
  libgtest-dev iproute2                    # tests, loopback multicast
)

# Runs a command as root, by sudo if need be.
as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"
  elif command -v sudo > /dev/null; then sudo "$@"
  else return 127
  fi
}

installed() { [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2> /dev/null)" = installed ]; }

find_python() {
  local candidate candidates=(python3.11 python3 python3.12)
  [ -z "${PYTHON:-}" ] || candidates=("$PYTHON")
  for candidate in "${candidates[@]}"; do
    if "$candidate" -c 'import sys; raise SystemExit(not (3, 11) <= sys.version_info < (3, 13))' 2> /dev/null; then
      "$candidate" -c 'import sys; print(sys.executable)'
      return
    fi
  done
  fail "no Python 3.11 or 3.12 in: ${candidates[*]}" "install it (apt-get install python3), or name one: PYTHON=/path/to/python3.11 make ..."
}

setup_packages() {
  command -v dpkg-query > /dev/null || fail "this is not Debian or Ubuntu" "install by hand: ${packages[*]}"
  # Without any Python 3.11 yet, Debian's own is one of the packages.
  local python
  python=$(find_python 2> /dev/null) || { packages+=(python3); python=/usr/bin/python3; }
  if [[ $python == /usr/bin/* ]]; then packages+=(python3-venv python3-dev); fi
  apt_install packages "${packages[@]}"
}

# PyPI's wheel takes gigabytes, Debian's package 0.5; it belongs to /usr/bin/python3, which engram.pytorch runs.
setup_torch() {
  command -v dpkg-query > /dev/null || fail "this is not Debian or Ubuntu" "none: what needs PyTorch is left out"
  apt_install torch python3-torch
}

# apt_install <step> <package>...: installs what is missing.
apt_install() {
  local step=$1 missing=() package
  shift
  for package in "$@"; do installed "$package" || missing+=("$package"); done
  if [ ${#missing[@]} = 0 ]; then
    say "$step" "$([ $# = 1 ] && echo "$1 is" || echo "all $# are") installed"
    return
  fi
  say "$step" "installing ${missing[*]}"
  local log=build/logs/apt.log
  mkdir -p build/logs
  if [ "$(id -u)" != 0 ] && ! command -v sudo > /dev/null; then
    fail "Debian packages are missing and this user is neither root nor has sudo" "as root: apt-get install ${missing[*]}"
  fi
  if ! apt-cache show "${missing[@]}" > /dev/null 2>&1; then
    say "$step" "fetching the package lists"
    as_root apt-get update > "$log" 2>&1 || fail "apt-get update failed, see $log" "check the network, then run again"
  fi
  as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${missing[@]}" >> "$log" 2>&1 < /dev/null ||
    { as_root apt-get update >> "$log" 2>&1 &&
      as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "${missing[@]}" >> "$log" 2>&1 < /dev/null; } ||
    fail "apt-get install failed, see $log" "as root: apt-get update && apt-get install ${missing[*]}"
}

# The environment as far as a build needs it.
setup_venv() {
  local python log=build/logs/pip.log
  python=$(find_python)
  venv_stamp=$(content_hash requirements.txt requirements-peers.txt <("$python" -VV; echo "$PWD"))
  [ "$(cat .venv/venv.stamp 2> /dev/null)" != "$venv_stamp" ] || return 0
  mkdir -p build/logs
  say python "creating .venv from pinned versions (1 to 3 minutes)"
  "$python" -m venv --clear .venv > "$log" 2>&1 || fail "could not create .venv, see $log" "apt-get install python3-venv"
  pip_install --only-binary :all: "$(grep nanobind requirements.txt)"
  echo "$venv_stamp" > .venv/venv.stamp
}

setup_python() {
  local stamp
  setup_venv
  if [ "$(cat .venv/stamp 2> /dev/null)" = "$venv_stamp" ]; then
    say python "environment .venv is up to date"
  else
    pip_install --only-binary :all: -r requirements.txt -r requirements-peers.txt
    echo "$venv_stamp" > .venv/stamp
  fi
  stamp=$(content_hash requirements-cluster.txt)
  if [ "$(cat .venv/cluster.stamp 2> /dev/null)" != "$stamp" ]; then
    say python "installing the optional extra: clusters"
    pip_install --only-binary :all: -r requirements-cluster.txt
    echo "$stamp" > .venv/cluster.stamp
  fi
  stamp=$(content_hash pyproject.toml)
  if [ "$(cat .venv/engram.stamp 2> /dev/null)" != "$stamp" ]; then
    say python "installing the package engram (editable)"
    pip_install --no-build-isolation -e .
    echo "$stamp" > .venv/engram.stamp
  fi
}

pip_install() {
  .venv/bin/python -m pip install --no-input --disable-pip-version-check --no-compile --no-deps "$@" >> build/logs/pip.log 2>&1 < /dev/null ||
    fail "pip install failed, see build/logs/pip.log" "check the network, then run again"
}

setup_build() {
  configure build Release
  say build "building into build/ (minutes the first time, seconds after that)"
  # shellcheck disable=SC2086: a list of targets
  compile build ${TARGETS:-all}
}

# What the build does not need of the environment is installed meanwhile.
setup_python_and_build() {
  setup_venv
  setup_python &
  local python=$!
  trap wait EXIT  # whatever stops the build, no pip is left behind
  setup_build
  wait "$python" || exit 1  # it has said why
}

# The unit and fuzz tests under AddressSanitizer and UndefinedBehaviorSanitizer.
setup_sanitized() {
  configure build/asan Debug -DENGRAM_SANITIZE=ON
  compile build/asan sanitized_tests
}

# The renderer's scenes: meshes of the robot and the world around it, from models/ into build/.
setup_scene() {
  local stamp
  stamp=$(find models codegen/engram/robots codegen/engram/tasks -type f ! -name '*.pyc' | sort | xargs sha256sum | content_hash)
  if [ "$(cat build/scene/stamp 2> /dev/null)" = "$stamp" ]; then
    say scene "meshes are up to date"
  else
    say scene "writing meshes and scene of the Panda"
    .venv/bin/engram task panda reach --meshes > build/logs/scene.log 2>&1 < /dev/null || fail "no scene, see build/logs/scene.log" "read it"
    echo "$stamp" > build/scene/stamp
  fi
}

# LCM speaks UDP multicast; a machine without any network has no route for it, so the loopback interface gets one.
setup_network() {
  if ip route get "$lcm_group" > /dev/null 2>&1; then
    say network "multicast has a route"
  elif as_root ip link set lo up 2> /dev/null && as_root ip route add "$lcm_group/32" dev lo 2> /dev/null; then
    say network "added a multicast route on the loopback interface"
  else
    say network "no multicast route and no right to add one; LCM needs it. As root:"
    echo "           ip link set lo up; ip route add $lcm_group/32 dev lo"
  fi
}

[ $# -gt 0 ] || set -- packages python_and_build scene network
for step in "$@"; do
  case $step in
    packages | python | build | python_and_build | sanitized | scene | network | torch) "setup_$step" ;;
    *) fail "unknown step $step" "steps: packages python build sanitized scene network torch" ;;
  esac
done
