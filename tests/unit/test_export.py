"""The controller leaves the house: the exported folder builds with a compiler and Eigen alone, by CMake and by hand."""

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


@pytest.fixture(scope="module")
def exported(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The exported folder."""
    folder = tmp_path_factory.mktemp("export") / "engram"
    subprocess.run(["scripts/export.sh", folder], cwd=root, check=True, capture_output=True)
    (folder / "user.c").write_text(USER)
    return folder


def run(*command: object, cwd: Path) -> str:
    """Output of a command that must succeed."""
    done = subprocess.run([str(c) for c in command], cwd=cwd, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


def test_nothing_of_io_is_exported(exported: Path) -> None:
    """LCM stays at home."""
    assert not (exported / "controller/io").exists()
    for file in exported.rglob("*.[hc]*"):
        if file.suffix in {".h", ".cc", ".c"}:
            assert "lcm" not in file.read_text(encoding="utf-8").lower(), file


def test_builds_with_cmake(exported: Path) -> None:
    """cmake -DENGRAM_CONTROLLER_ONLY=ON: an archive that a C program links."""
    run("cmake", "-G", "Ninja", "-B", "build", "-DENGRAM_CONTROLLER_ONLY=ON", cwd=exported)
    run("cmake", "--build", "build", "-j", "2", cwd=exported)
    archives = [exported / "build/controller/libengram_panda_reach.a", *exported.glob("build/tables/*.a"),
                exported / "build/controller/tab/libengram_tab.a"]  # fmt: skip
    run("cc", "-std=c11", "-I.", "user.c", *archives, "-lm", "-o", "user", cwd=exported)
    assert run("./user", cwd=exported) == "panda no error\n"


def test_builds_by_hand(exported: Path) -> None:
    """Two compiler calls, without CMake. -O1: it is to be built, not to be fast."""
    flags = ["-O1", "-march=x86-64-v3", "-I/usr/include/eigen3"]
    sources = [*exported.glob("controller/*.cc"), *exported.glob("controller/tab/*.cc")]
    tables = [*exported.glob("tables/panda_reach/*.c"), *exported.glob("tables/panda_reach/*.S")]
    objects = exported / "objects"
    objects.mkdir()
    run("c++", "-std=c++17", "-fno-exceptions", "-fno-rtti", *flags, f"-I{exported}", f"-I{exported}/tables/panda_reach",
        "-c", *sources, cwd=objects)  # fmt: skip
    if tables:
        run("cc", "-std=c11", *flags, f"-I{exported}", f"-I{exported}/tables/panda_reach", "-c", *tables, cwd=objects)
    run("cc", "-std=c11", "-I.", "user.c", *objects.glob("*.o"), "-lm", "-o", "by_hand", cwd=exported)
    assert run("./by_hand", cwd=exported) == "panda no error\n"
