"""The tree itself: sizes, left-over marks, the two front doors."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

LARGEST_FILE = 4_000_000  # bytes: sources, tables and golden text only
LARGEST_TABLES = {"panda_reach": 2_000_000, "talos_step": 1_050_000, "talos_pole": 620_000}  # bytes of each memory's folder
LARGEST_REST = 200_000  # bytes of all other tables: constants of robots and tasks
LONGEST_SOURCE = 520  # lines: a file is read in one sitting; 500 and a little slack
MARKS = re.compile(r"\b(" + "|".join(["TO" + "DO", "FIX" + "ME", "XX" + "X", "HA" + "CK", "NotImplemented" + "Error"]) + r")\b")
TEXT = {".h", ".cc", ".c", ".py", ".md", ".toml", ".txt", ".sh", ".cmake", ".lcm", ".html"}
HAND_WRITTEN = ("controller", "codegen", "sim_harness", "tests", "bench", "scripts")


def text(path: Path) -> str:
    return path.read_text(encoding="utf-8")


def is_source(path: Path) -> bool:
    return path.parts[0] in HAND_WRITTEN and path.suffix in {".h", ".cc", ".c", ".py"}


def test_no_file_is_large(root: Path, tracked: list[Path]) -> None:
    large = {str(path): size for path in tracked if (size := (root / path).stat().st_size) > LARGEST_FILE}
    assert not large


def test_tables_stay_within_their_budget(root: Path, tracked: list[Path]) -> None:
    sizes = dict.fromkeys([*LARGEST_TABLES, "rest"], 0)
    for path in tracked:
        if path.parts[0] == "tables":
            sizes[path.parts[1] if path.parts[1] in LARGEST_TABLES else "rest"] += (root / path).stat().st_size
    assert not {name: size for name, size in sizes.items() if size > (LARGEST_TABLES | {"rest": LARGEST_REST})[name]}


def test_no_left_over_marks(root: Path, tracked: list[Path]) -> None:
    found = [f"{path}:{number}: {line.strip()}"
             for path in tracked if path.suffix in TEXT
             for number, line in enumerate(text(root / path).splitlines(), 1)
             if MARKS.search(line)]  # fmt: skip
    assert not found


def test_source_files_are_short(root: Path, tracked: list[Path]) -> None:
    lines = {str(path): len(text(root / path).splitlines()) for path in tracked if is_source(path)}
    assert {path: n for path, n in lines.items() if n > LONGEST_SOURCE} == {}


def test_text_files_end_with_one_newline_and_have_no_trailing_space(root: Path, tracked: list[Path]) -> None:
    bad = []
    for path in tracked:
        if path.suffix in TEXT:
            body = text(root / path)
            if body and (not body.endswith("\n") or body.endswith("\n\n") or re.search(r"[ \t]+$", body, re.M)):
                bad.append(str(path))
    assert not bad


def test_scripts_are_executable(root: Path) -> None:
    scripts = [root / ".ci/run", *(path for path in (root / "scripts").glob("*.sh") if path.name != "common.sh")]
    assert all(os.access(path, os.X_OK) for path in scripts)


def test_readme_names_both_front_doors(root: Path) -> None:
    readme = text(root / "README.md")
    assert "make demo" in readme
    assert "make test" in readme


def test_every_requirement_is_pinned(root: Path) -> None:
    for name in ("requirements.txt", "requirements-peers.txt"):
        for line in text(root / name).splitlines():
            assert line.startswith("#") or re.fullmatch(r"[\w.-]+==[\w.]+", line), f"{name}: {line}"


def test_links_of_the_documents_lead_somewhere(root: Path, tracked: list[Path]) -> None:
    broken = []
    for path in tracked:
        if path.suffix == ".md":
            for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text(root / path)):
                if "://" not in target and not (root / path.parent / target).exists():
                    broken.append(f"{path}: {target}")
    assert not broken


def test_python_passes_the_linter(root: Path) -> None:
    ruff = subprocess.run([sys.executable, "-m", "ruff", "check", "--no-cache", "--quiet", "."], cwd=root, check=False,
                          capture_output=True, text=True)  # fmt: skip
    assert ruff.returncode == 0, ruff.stdout + ruff.stderr


def test_python_is_formatted(root: Path) -> None:
    ruff = subprocess.run([sys.executable, "-m", "ruff", "format", "--no-cache", "--diff", "."], cwd=root, check=False,
                          capture_output=True, text=True)  # fmt: skip
    assert ruff.returncode == 0, ruff.stdout + "\nmend: .venv/bin/ruff format ."
