"""`engram data`: the same files whatever the workers, stops and restarts; failures recorded and kept out."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from engram.commands.data import solve_all
from engram.data import reach
from engram.data.chunks import Chunks, run
from engram.inputs import InputError
from engram.tasks.spec import load_task

N = 24  # one whole chunk and a part


def squares(items: range) -> dict[str, np.ndarray]:
    return {"square": np.array([i * i for i in items])}


def make_squares():
    return squares


def make_deadly(limit: int):
    def work(items: range) -> dict[str, np.ndarray]:
        if items.start >= limit:
            os._exit(1)
        return squares(items)

    return work


def toy(folder: Path, key: str = "a") -> Chunks:
    return Chunks(folder, key, n=23, size=5)


@pytest.mark.parametrize("workers", [1, 2])
def test_chunks_are_joined_in_order(tmp_path, workers):
    assert np.array_equal(run(toy(tmp_path), make_squares, (), workers, "toy")["square"], np.arange(23) ** 2)


def test_only_what_is_missing_or_damaged_is_made_again(tmp_path):
    chunks = toy(tmp_path)
    run(chunks, make_squares, (), 1, "toy")
    absent, damaged, kept = chunks.ranges()[:3]
    chunks.path(absent).unlink()
    chunks.path(damaged).write_bytes(b"half a file")
    stamp = chunks.path(kept).stat().st_mtime_ns
    assert np.array_equal(run(chunks, make_squares, (), 1, "toy")["square"], np.arange(23) ** 2)
    assert chunks.path(kept).stat().st_mtime_ns == stamp


def test_chunks_of_another_key_are_not_trusted(tmp_path):
    run(toy(tmp_path, "a"), make_squares, (), 1, "toy")
    assert toy(tmp_path, "b").read(range(0, 5)) is None


def test_dead_worker_is_one_message_and_loses_no_finished_chunk(tmp_path):
    chunks = toy(tmp_path)
    with pytest.raises(InputError, match="run again"):
        run(chunks, make_deadly, (10,), 1, "toy")
    assert chunks.read(range(0, 5)) is not None and chunks.read(range(10, 15)) is None
    assert np.array_equal(run(chunks, make_squares, (), 1, "toy")["square"], np.arange(23) ** 2)


@pytest.fixture(scope="module")
def spec():
    return load_task("panda", "reach")


@pytest.fixture(scope="module")
def data(spec, tmp_path_factory) -> Path:
    """A small data set."""
    folder = tmp_path_factory.mktemp("data")
    solve_all(spec, N, 3, 2, folder)
    return folder


def test_file_does_not_depend_on_workers_or_stops(spec, data, tmp_path):
    solve_all(spec, N, 3, 1, tmp_path)
    expected = (data / "panda_reach.npz").read_bytes()
    assert (tmp_path / "panda_reach.npz").read_bytes() == expected
    for folder in ("panda_reach_lines", "panda_reach_neighbours"):
        sorted((tmp_path / folder).glob("*.npz"))[-1].unlink()  # the part
    solve_all(spec, N, 3, 1, tmp_path)
    assert (tmp_path / "panda_reach.npz").read_bytes() == expected


def test_kept_motions_are_what_they_claim(spec, data):
    solver = reach.ReachSolver(spec, 3, reach.Settings())
    file = np.load(data / "panda_reach.npz")
    assert len(file["X"]) + len(file["failed_X"]) == N and len(file["X"]) > N // 2
    for X, xs, us, cost, arrived in zip(*(file[name] for name in ("X", "xs", "us", "cost", "arrived")), strict=True):
        start, vector = X[:7], X[7:]
        solver.set(start, vector)
        evaluated = solver.problem.evaluate(xs, us)
        # closed to the rounding of a step: FDDP ends on a rollout
        assert np.abs(evaluated["gap"]).max() < 1e-12
        assert np.isclose(evaluated["cost"].sum(), cost, rtol=1e-12)
        position, rotation = solver.problem.error(xs[-1:, :7], vector)[0]
        assert arrived == (position <= spec.success["position"] and rotation <= spec.success["rotation"])
        assert position <= reach.NEARLY * spec.success["position"] and rotation <= reach.NEARLY * spec.success["rotation"]
        assert solver.problem.clearance(xs[:, :7]).min() > 0.0


def test_failures_have_a_reason(data):
    file = np.load(data / "panda_reach.npz")
    summary = json.loads((data / "panda_reach.json").read_text())
    assert set(file["failed_reason"]) <= set(reach.REASONS[1:])
    assert sum(summary["failed"].values()) == len(file["failed_seeds"]) == N - summary["solved"]
    assert not set(file["failed_seeds"]) & set(file["seeds"])


def test_unsolved_task_is_recorded_not_kept(spec):
    """One iteration solves nothing: every outcome is a reason, and the row is there all the same."""
    solver = reach.ReachSolver(spec, 3, reach.Settings(iterations=1))
    rows = reach.solve_lines(solver, range(3))
    assert len(rows["outcome"]) == 3 and not np.any(rows["outcome"] == reach.OK)


@pytest.mark.parametrize(("task", "folder"), [("panda reach", "panda_reach_lines"), ("talos step", "talos_step_left")])
def test_interrupt_keeps_finished_chunks(tmp_path, root, task, folder):
    environment = {**os.environ, "PYTHONPATH": str(root / "codegen")}
    command = [sys.executable, "-m", "engram", "data", *task.split(), "--n", "2000", "--workers", "1", "--out", str(tmp_path)]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True)
    deadline = time.monotonic() + 60.0
    while not list(tmp_path.glob(f"{folder}/*.npz")) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)  # what the terminal does
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130 and "interrupted" in err and "Traceback" not in err
    kept = list(tmp_path.glob(f"{folder}/*.npz"))
    assert kept and all(np.load(path)["outcome"].size for path in kept)
    assert not list(tmp_path.glob(f"{folder}/*.part"))
