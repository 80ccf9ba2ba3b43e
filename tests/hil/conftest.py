"""A plant and a stand-in controller on a network port of their own."""

from __future__ import annotations

import itertools
import json
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from engram_sim.pair import lcm_url, private_port, program, stop

ARM = Path(__file__).with_name("arm.xml")
SERIES = """engram_series 1
robot_digest 0x1234
task_digest 0x77
hand hand_tcp
window 3
hold 0.3
tolerance 0.01 0.1
episode 0 -0.785 0 -2.356 0 1.571 0
jump 0.45 -0.10 0.40 1 0 0 0  0.45 -0.10 0.40 1 0 0 0
jump 0.40  0.20 0.30 1 0 0 0  0.40  0.20 0.30 1 0 0 0
move 0.01 0.40 0.201 0.30 1 0 0 0  0.40 0.201 0.30 1 0 0 0
move 0.01 0.40 0.203 0.30 1 0 0 0  0.40 0.203 0.30 1 0 0 0
episode 0.3 -0.785 0 -2.356 0 1.571 0
jump 0.45  0.05 0.35 1 0 0 0  0.45  0.05 0.35 1 0 0 0
"""
JUMPS = 3
ports = itertools.count()


@dataclass
class Arena:
    """Starts programs, keeps what they said, and ends them."""

    folder: Path
    scene: Path = ARM
    port: int = field(default_factory=lambda: private_port() + 8 * next(ports) % 4096)
    children: list[subprocess.Popen] = field(default_factory=list)

    @property
    def url(self) -> str:
        return lcm_url(self.port)

    def series(self, text: str = SERIES) -> Path:
        path = self.folder / "series.txt"
        path.write_text(text)
        return path

    def controller(self, *options: str) -> subprocess.Popen:
        call = [program("engram-standin"), "--scene", self.scene, "--lcm-url", self.url, *options]
        self.children.append(subprocess.Popen(call, stdin=subprocess.DEVNULL))
        return self.children[-1]

    def plant_call(self, *options: str | Path) -> list[str]:
        """The test series, unless `options` name another one or none: --series ''."""
        base = ["--scene", self.scene, "--series", self.series(), "--lcm-url", self.url, "--give-up", "5", "--resend-ms", "50"]
        call = [
            program("engram-plant"),
            *base,
            "--log",
            self.folder / "run.lcm",
            "--results",
            self.folder / "results.json",
            *options,
        ]
        return [str(word) for word in call]

    def plant(self, *options: str | Path, **keywords) -> subprocess.CompletedProcess:
        """Run the plant to its end (at most 60 s)."""
        return subprocess.run(
            self.plant_call(*options), capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL, **keywords
        )

    def results(self) -> dict:
        return json.loads((self.folder / "results.json").read_text())

    def close(self) -> None:
        for child in self.children:
            stop(child)


@pytest.fixture
def arena(tmp_path: Path) -> Iterator[Arena]:
    """An arena that is cleaned up."""
    arena = Arena(tmp_path)
    yield arena
    arena.close()
