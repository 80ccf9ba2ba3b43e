"""Allocations of timed queries: count_heap.cc in front of the C library's allocator, switched on by the binding's clock."""

from __future__ import annotations

import os
import sys
from pathlib import Path

PLANTED = 2  # calls of a `new` and a `delete`, which every count must see first


def restart_counting(library: Path) -> None:
    """This process once more, with `library` in front; programs that are started from then on go without it."""
    if os.environ.get("LD_PRELOAD") != str(library):
        os.execve(sys.executable, sys.orig_argv, {**os.environ, "LD_PRELOAD": str(library)})
    del os.environ["LD_PRELOAD"]


class Count:
    """Calls of the allocators within the binding's timed calls since this was made; None if a planted one is not seen."""

    def __init__(self) -> None:
        from engram.engine import engine

        before, self.so_far = engine.allocations(), engine.allocations
        self.begin = self.so_far(planted=True)
        self.sees = before is not None and self.begin == before + PLANTED

    @property
    def calls(self) -> int | None:
        return self.so_far() - self.begin if self.sees else None
