"""The exported folder builds alone: CMake, a compiler and Eigen; no LCM, no MuJoCo, no Python."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

USER = r"""
#include <stdio.h>
#include "controller/engram.h"
static unsigned char memory[2000000];
int main(void) {
  engram_controller* arm;
  const engram_error error = engram_init(&engram_panda_reach, memory, sizeof memory, NULL, &arm);
  printf("%s %s\n", engram_describe(&engram_panda_reach)->robot, engram_error_text(error));
  return error;
}
"""


def run(*command: object, cwd: Path) -> str:
    """Output of a command that must succeed."""
    done = subprocess.run(
        [str(c) for c in command], check=False, cwd=cwd, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


@pytest.fixture(scope="module")
def exported(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export") / "engram"
    subprocess.run([root / "scripts/export.sh", folder], check=True, capture_output=True, stdin=subprocess.DEVNULL)
    return folder


def test_only_the_controller_and_its_tables_are_exported(exported: Path) -> None:
    assert {path.name for path in exported.iterdir()} <= {"CMakeLists.txt", "LICENSE", "controller", "tables", "docs"}
    assert not (exported / "controller/io").exists()


def test_the_exported_folder_builds(exported: Path) -> None:
    """By CMake; the archives serve a C program."""
    build = exported / "build"
    run("cmake", "-S", exported, "-B", build, "-DCMAKE_BUILD_TYPE=Debug", cwd=exported)  # to be built, not to be fast
    run("cmake", "--build", build, "-j", "2", "--target", "engram_panda_reach", cwd=exported)
    assert "lcm" not in (build / "CMakeCache.txt").read_text(encoding="utf-8").lower()
    archives = [*build.glob("**/libengram_panda_reach.a"), *build.glob("tables/*.a"), *build.glob("**/libengram_tab.a")]
    (exported / "user.c").write_text(USER, encoding="utf-8")
    run("cc", "-std=c11", "-I.", "user.c", *archives, "-lm", "-o", build / "user", cwd=exported)
    assert run(build / "user", cwd=exported) == "panda no error\n"


def test_it_builds_without_cmake(exported: Path, tmp_path: Path) -> None:
    """By plain compiler calls."""
    tables = exported / "tables/panda_reach"
    flags = ["-Og", "-march=x86-64-v3", f"-I{exported}", f"-I{tables}", "-c"]
    sources = [
        exported / "controller/engram.cc",
        exported / "controller/engram_panda_reach.cc",
        *exported.glob("controller/tab/*.cc"),
    ]
    run("c++", "-std=c++17", "-fno-exceptions", "-fno-rtti", "-isystem", "/usr/include/eigen3", *flags, *sources, cwd=tmp_path)
    (tmp_path / "user.c").write_text(USER, encoding="utf-8")
    run("cc", "-std=c11", *flags, *tables.glob("*.c"), "user.c", cwd=tmp_path)
    blobs = tmp_path / "blobs"  # a table's .c and .S give objects of the same name
    blobs.mkdir()
    run("cc", *flags, *tables.glob("*.S"), cwd=blobs)
    run("cc", *tmp_path.glob("**/*.o"), "-lm", "-o", "user", cwd=tmp_path)
    assert run("./user", cwd=tmp_path) == "panda no error\n"


def test_a_folder_that_is_in_use_is_left_alone(root: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    done = subprocess.run([root / "scripts/export.sh", tmp_path], check=False, capture_output=True, text=True)
    assert done.returncode != 0
    assert "not empty" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
