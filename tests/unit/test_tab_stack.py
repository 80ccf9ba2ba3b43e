"""The evaluators' stack: the frames of all functions of a kind together stay below what docs/tables.md states."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROW = re.compile(r"^\| .*? \| `Tab(\w+)` \|.*\| (\d+) \|$", re.MULTILINE)
STATED = {kind.lower(): int(limit) for kind, limit in ROW.findall((ROOT / "docs/tables.md").read_text(encoding="utf-8"))}


def test_every_evaluator_states_its_stack() -> None:
    headers = {path.stem.removeprefix("tab_") for path in (ROOT / "controller/tab").glob("tab_*.h")}
    assert set(STATED) == headers - {"eval", "lanes", "random", "tt_core"}


@pytest.mark.parametrize("kind", STATED)
def test_frames_stay_below_what_is_stated(kind: str, tmp_path: Path) -> None:
    source = ROOT / "controller/tab" / f"tab_{kind}.cc"
    flags = "-std=c++17 -O2 -DNDEBUG -fno-exceptions -fno-rtti -fno-math-errno -march=x86-64-v3 -fstack-usage".split()
    subprocess.run(["c++", *flags, f"-I{ROOT}", "-c", source, "-o", tmp_path / "kind.o"], check=True)
    lines = (tmp_path / "kind.su").read_text().splitlines()
    frames = [line.split("\t") for line in lines]
    assert frames and all(bound in ("static", "dynamic,bounded") for _, _, bound in frames)  # no variable-length arrays
    used = sum(int(size) for _, size, _ in frames)
    assert used <= STATED[kind] < 4 * used + 1000, f"{used} bytes"  # a bound that says something
