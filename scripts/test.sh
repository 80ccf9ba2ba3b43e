#!/usr/bin/env bash
# Builds everything, the sanitized tests included, and runs the whole ladder (scripts/test.py). Arguments go to scripts/test.py.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
case " $* " in
  *" sanitize "* | "  " | *" --raise-floor "*)
    configure build/asan Debug -DENGRAM_SANITIZE=ON
    say build "compiling the unit and fuzz tests under ASan and UBSan into build/asan/"
    compile build/asan sanitized_tests
    ;;
esac
exec .venv/bin/python scripts/test.py "$@"
