"""The exported folder builds alone: CMake, a compiler and Eigen; no LCM, no MuJoCo, no Python."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def exported(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export") / "engram"
    subprocess.run([root / "scripts/export.sh", folder], check=True, capture_output=True, stdin=subprocess.DEVNULL)
    return folder


def test_only_the_controller_and_its_tables_are_exported(exported: Path) -> None:
    assert {path.name for path in exported.iterdir()} <= {"CMakeLists.txt", "LICENSE", "controller", "tables", "docs"}
    assert not (exported / "controller/io").exists()


def test_the_exported_folder_builds(exported: Path) -> None:
    build = exported / "build"
    for command in (["cmake", "-S", exported, "-B", build], ["cmake", "--build", build, "-j", "2"]):
        done = subprocess.run(command, check=False, capture_output=True, text=True, stdin=subprocess.DEVNULL)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert list(build.glob("**/libengram_panda_reach.a"))
    assert "lcm" not in (build / "CMakeCache.txt").read_text(encoding="utf-8").lower()


def test_a_folder_that_is_in_use_is_left_alone(root: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    done = subprocess.run([root / "scripts/export.sh", tmp_path], check=False, capture_output=True, text=True)
    assert done.returncode != 0
    assert "not empty" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
