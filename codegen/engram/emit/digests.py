"""Digests of the robot and the task a table belongs to, from their generated headers."""

from __future__ import annotations

import re
from pathlib import Path

from engram.inputs import InputError, read_text
from engram.paths import relative


def header_digest(path: Path) -> int:
    """The `digest` constant of a robot.h or task.h."""
    found = re.search(r"uint64_t digest = 0x([0-9a-f]{1,16});", read_text(path, "run 'make tables'"))
    if not found:
        raise InputError(f"{relative(path)}: has no digest; run 'make tables'")
    return int(found.group(1), 16)
