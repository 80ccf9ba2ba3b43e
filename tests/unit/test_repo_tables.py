"""The generated tables in the tree are whole, and belong to the robots and tasks in the tree."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MANIFESTS = sorted((ROOT / "tables").glob("*/MANIFEST.json"))


def header_digest(path: Path) -> int:
    """The `digest` constant of a generated robot.h or task.h."""
    return int(re.search(r"\bdigest = (0x[0-9a-f]+)", path.read_text(encoding="utf-8")).group(1), 16)


@pytest.mark.parametrize("path", MANIFESTS, ids=lambda path: path.parent.name)
def test_the_manifest_lists_the_files_as_they_are(path: Path) -> None:
    files = json.loads(path.read_text(encoding="utf-8"))["files"]
    assert files
    for name, entry in files.items():
        content = (path.parent / name).read_bytes()
        assert len(content) == entry["bytes"], name
        assert hashlib.sha256(content).hexdigest() == entry["sha256"], name


@pytest.mark.parametrize("path", MANIFESTS, ids=lambda path: path.parent.name)
def test_tables_belong_to_the_robot_and_the_task(path: Path) -> None:
    manifest = json.loads(path.read_text(encoding="utf-8"))
    robot = path.parent.name.split("_")[0]
    assert int(manifest["robot_digest"], 16) == header_digest(ROOT / "tables" / robot / "robot.h")
    assert int(manifest["task_digest"], 16) == header_digest(path.parent / "task.h")


def test_no_generated_file_tells_when_or_where_it_was_made() -> None:
    suspicious = re.compile(rb"\b20\d\d-\d\d-\d\d\b|/home/|/root/|/tmp/")
    told = [str(path.relative_to(ROOT)) for path in (ROOT / "tables").glob("*/*")
            if path.suffix in {".h", ".c", ".S", ".json", ".xml"} and suspicious.search(path.read_bytes())]  # fmt: skip
    assert not told
