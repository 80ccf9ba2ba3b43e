"""The same bits on every machine: libraries that pick instructions or threads by machine are pinned before they are loaded."""

from __future__ import annotations

import os
import sys

# One thread: the order of a sum does not depend on the number of cores. Instruction sets up to AVX2, the least that the product
# asks for: a wider vector sums in another order.
PINNED = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "PYTHONHASHSEED": "0",
}


def pinned() -> bool:
    """Was this process started with the pinned environment?"""
    return all(os.environ.get(key) == value for key, value in PINNED.items())


def restart_pinned() -> None:
    """Replace this process by itself under the pinned environment, unless it already runs there. Keeps arguments and output."""
    if not pinned():
        sys.stdout.flush()
        sys.stderr.flush()
        os.execve(sys.executable, sys.orig_argv, {**os.environ, **PINNED})
