"""Arrows between rooms go down only, as the table of docs/architecture.md says."""

from __future__ import annotations

import re
from pathlib import Path

INCLUDE = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)
LCM_INCLUDE = re.compile(r'^\s*#\s*include\s+[<"](lcm/|engram_msg)', re.MULTILINE)


def read_arrows(root: Path) -> dict[str, set[str]]:
    """Room of the controller -> rooms that it may include, from the table in the document, closed under going down."""
    arrows: dict[str, set[str]] = {}
    for line in (root / "docs/architecture.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if len(cells) == 3 and (room := re.match(r"`controller/(\w+)(/|\.h)`", cells[0])):
            arrows[room.group(1)] = set(re.findall(r"\w+", cells[2]))
    for room in list(arrows):
        reach, frontier = set(), {room}
        while frontier:
            reach |= frontier
            frontier = {below for above in frontier for below in arrows.get(above, set())} - reach
        arrows[room] = reach & arrows.keys()
    return arrows


def includes(path: Path) -> list[str]:
    """Quoted headers that a source file includes."""
    return INCLUDE.findall(path.read_text(encoding="utf-8"))


def sources(root: Path, tracked: list[Path], room: str) -> list[Path]:
    return [path for path in tracked if str(path).startswith(room) and path.suffix in {".h", ".cc", ".c"}]


def test_the_table_of_rooms_is_read(root: Path) -> None:
    arrows = read_arrows(root)
    assert {"rbd", "ocp", "fddp", "ik", "tab", "memory", "loop", "io"} <= arrows.keys()
    assert "rbd" in arrows["loop"]
    assert "loop" not in arrows["fddp"]


def test_includes_in_the_controller_go_down_only(root: Path, tracked: list[Path]) -> None:
    arrows, wrong = read_arrows(root), []
    for room, allowed in arrows.items():
        for path in sources(root, tracked, f"controller/{room}/"):
            for header in includes(root / path):
                below = re.match(r"controller/(\w+)/", header)
                if below and below.group(1) not in allowed:
                    wrong.append(f"{path} includes {header}")
                if header == "controller/engram.h" and room not in ("loop", "io"):
                    wrong.append(f"{path} includes {header}: statuses and options end at the loop")
    assert not wrong


def test_io_knows_the_controller_by_its_door_and_loop_only(root: Path, tracked: list[Path]) -> None:
    own = re.compile(r"controller/(engram\.h|io/.*|loop/.*)")
    wrong = [f"{path}: {header}" for path in sources(root, tracked, "controller/io/") for header in includes(root / path)
             if header.startswith("controller/") and not own.fullmatch(header)]  # fmt: skip
    assert not wrong


def test_only_io_knows_lcm(root: Path, tracked: list[Path]) -> None:
    wrong = [str(path) for path in sources(root, tracked, "controller/") if path.parts[1] != "io"
             and LCM_INCLUDE.search((root / path).read_text(encoding="utf-8"))]  # fmt: skip
    assert not wrong


def test_the_harness_shares_messages_only(root: Path, tracked: list[Path]) -> None:
    wrong = [f"{path}: {header}" for path in sources(root, tracked, "sim_harness/")
             for header in includes(root / path) if header.startswith("controller/")]  # fmt: skip
    assert not wrong
