"""Runs of `engram-pole` in shards: what a build of it has left in its folder is not run again."""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path

from engram.inputs import InputError
from engram.paths import BUILD, relative

PROGRAM = BUILD / "bin" / "engram-pole"


def shards_folder(parent: Path) -> Path:
    """The folder in `parent` for what the program as it is built leaves. Raises InputError."""
    if not PROGRAM.is_file():
        raise InputError(f"no {relative(PROGRAM)}; build it: TARGETS=engram-pole scripts/setup.sh")
    folder = parent / hashlib.sha256(PROGRAM.read_bytes()).hexdigest()[:12]
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def run_shard(first: int, many: int, seed: int, *options: str) -> str:
    """What the program prints of motions `first` to `first + many` of a seed. Raises InputError."""
    command = [PROGRAM, f"motions={many}", f"first={first}", f"seed={seed}", *options]
    done = subprocess.run(command, cwd=BUILD.parent, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise InputError(f"{relative(PROGRAM)}: {done.stderr.strip() or 'failed'}")
    return done.stdout
