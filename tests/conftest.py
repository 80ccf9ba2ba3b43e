"""What all Python tests share: the repository root, tracked files, and the folder of built programs."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def root() -> Path:
    """Root of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def build() -> Path:
    """Folder of the Release build."""
    return ROOT / "build"


@pytest.fixture(scope="session")
def tracked() -> list[Path]:
    """Files that git tracks, relative to the root, deleted ones left out."""
    out = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [Path(name) for name in out.split("\0") if name and (ROOT / name).is_file()]
