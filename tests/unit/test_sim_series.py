"""Task series from a seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engram.tasks.reach import sampler
from engram_sim.series import MOVE_DT, MOVE_RADII, write_reach

JUMPS = 12


@pytest.fixture(scope="module")
def series(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    path = tmp_path_factory.mktemp("series") / "series.txt"
    write_reach(path, "panda", "reach", 3, JUMPS, per_episode=5, move_every=4)
    return path.read_text().splitlines()


def numbers(line: str) -> np.ndarray:
    return np.array([float.fromhex(word) if "0x" in word else float(word) for word in line.split()[1:]])


def test_same_seed_same_bytes_other_seed_others(tmp_path: Path, series: list[str]) -> None:
    again, other = tmp_path / "again.txt", tmp_path / "other.txt"
    write_reach(again, "panda", "reach", 3, JUMPS, per_episode=5, move_every=4)
    write_reach(other, "panda", "reach", 4, JUMPS, per_episode=5, move_every=4)
    assert again.read_text().splitlines() == series
    jumps = [[line for line in lines if line.startswith("jump")] for lines in (series, other.read_text().splitlines())]
    assert not set(jumps[0]) & set(jumps[1])


def test_counts_and_digests(series: list[str]) -> None:
    spec = sampler("panda", "reach").spec
    assert series[0] == "engram_series 1"
    assert f"robot_digest 0x{spec.robot.digest:016x}" in series and f"task_digest 0x{spec.digest:016x}" in series
    assert sum(line.startswith("jump") for line in series) == JUMPS
    assert sum(line.startswith("episode") for line in series) == 3


def test_pose_and_task_vector_say_the_same(series: list[str]) -> None:
    for line in series:
        if line.startswith("jump"):
            values = numbers(line)
            pose, vector = values[:7], values[7:]
            assert np.array_equal(pose[:3], vector[:3])
            assert abs(pose[3:] @ vector[3:]) == pytest.approx(1.0, abs=1e-12)  # q and -q are one rotation
            assert vector[6] >= 0.0


def test_starts_are_clear_and_within_limits(series: list[str]) -> None:
    draw = sampler("panda", "reach")
    starts = [numbers(line) for line in series if line.startswith("episode")]
    assert all(draw.clearance(q) >= draw.spec.clearance for q in starts)
    assert all(np.all((q >= draw.tree.q_lo) & (q <= draw.tree.q_hi)) for q in starts)


def test_moving_target_is_smooth_and_comes_back(series: list[str]) -> None:
    parts: list[list[np.ndarray]] = []
    for line in series:
        if line.startswith("jump"):
            parts.append([numbers(line)[:3]])
        elif line.startswith("move"):
            values = numbers(line)
            assert values[0] == MOVE_DT
            parts[-1].append(values[1:4])
    moving = [np.array(part) for part in parts if len(part) > 1]
    assert moving
    for path in moving:
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        # a minimum-jerk round of radius r takes its fastest step at 1.875 of the mean
        assert steps.max() < 1.9 * 2.0 * np.pi * MOVE_RADII[0] / len(steps)
        assert steps[0] < 0.02 * steps.max()  # from rest
        assert np.linalg.norm(path[-1] - path[0]) < 1e-12
