"""The C program of the documents: compiled as C11, linked without the C++ library, it steers the Panda to its target."""

import subprocess
from pathlib import Path


def test_it_arrives(root: Path, build: Path) -> None:
    """Exit code 0 means: within 1 cm after 3 s."""
    done = subprocess.run(
        [build / "bin/panda_in_process", root / "tables/panda_reach/scene.xml"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(done.stdout.splitlines()) == 12
    assert "plan, converged" in done.stdout.splitlines()[-1]


def test_it_asks_for_the_scene(build: Path) -> None:
    """Without an argument it names what it needs."""
    done = subprocess.run([build / "bin/panda_in_process"], capture_output=True, text=True, timeout=10)
    assert done.returncode == 2
    assert "scene.xml" in done.stderr


def test_it_needs_no_cpp_library(build: Path) -> None:
    """A C program that links the controller does not drag libstdc++ in."""
    needed = subprocess.run(["ldd", build / "bin/panda_in_process"], capture_output=True, text=True, check=True).stdout
    direct = subprocess.run(["readelf", "-d", build / "bin/panda_in_process"], capture_output=True, text=True, check=True).stdout
    assert "libmujoco" in needed
    assert "libstdc++" not in direct
