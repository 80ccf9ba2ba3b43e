"""`engram data --cluster`: a real scheduler and worker processes of this machine; the same bytes as the process pool."""

import json
import os
import subprocess
import sys
import time
from concurrent.futures import CancelledError
from pathlib import Path

import numpy as np
import pytest

from engram.data import step_set
from engram.data.chunks import Chunks, run
from engram.data.cluster import connect
from engram.inputs import InputError

DASK = Path(sys.executable).parent / "dask"
N = 30  # tasks of each foot: one whole chunk and a part


def make_deadly_once(mark: Path):
    """The first worker that gets to chunk 10 dies of it."""

    def work(items: range) -> dict[str, np.ndarray]:
        if items.start == 10 and not mark.exists():
            mark.touch()
            os._exit(1)
        return {"square": np.array([i * i for i in items])}

    return work


def make_wrong():
    def work(items: range) -> dict[str, np.ndarray]:
        raise ArithmeticError(f"no squares of {items.start}")

    return work


class Cluster:
    """Processes in a folder; `workers` have one thread each."""

    def __init__(self, folder: Path):
        self.folder, self.processes = folder, []
        self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(folder / "scheduler.json"))
        deadline = time.monotonic() + 60
        while not (folder / "scheduler.json").exists():
            assert time.monotonic() < deadline, (folder / "log").read_text()
            time.sleep(0.1)
        self.address = json.loads((folder / "scheduler.json").read_text())["address"]

    def _start(self, *arguments: str) -> subprocess.Popen:
        environment = os.environ | {"DASK_TEMPORARY_DIRECTORY": str(self.folder), "PYTHONPATH": str(Path(__file__).parent)}
        with (self.folder / "log").open("a") as log:
            command = [str(DASK), *arguments, "--no-dashboard"]
            self.processes.append(subprocess.Popen(command, stdout=log, stderr=log, env=environment, cwd=self.folder))
        return self.processes[-1]

    def add_worker(self) -> subprocess.Popen:
        return self._start("worker", self.address, "--nthreads", "1", "--no-nanny")

    def wait_for(self, workers: int) -> None:
        from distributed import Client

        with Client(self.address, timeout=30) as client:
            client.wait_for_workers(workers, timeout=60)

    def stop(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    cluster = Cluster(tmp_path_factory.mktemp("cluster"))
    yield cluster
    cluster.stop()


def test_scheduler_without_workers_is_one_message(cluster):
    with pytest.raises(InputError, match="no workers"):
        connect(cluster.address)


def test_the_same_bytes_as_from_the_pool_though_a_worker_dies(cluster, tmp_path):
    cluster.add_worker()
    cluster.add_worker()
    cluster.wait_for(2)
    step_set.make(N, 5, 2, tmp_path / "pool")
    step_set.make(N, 5, 1, tmp_path / "cluster", cluster.address)
    same = [(tmp_path / where / "talos_step.npz").read_bytes() for where in ("pool", "cluster")]
    assert same[0] == same[1]

    chunks = Chunks(tmp_path / "squares", "a", n=60, size=5)
    found = run(chunks, make_deadly_once, (tmp_path / "mark",), 1, "squares", cluster.address)
    assert np.array_equal(found["square"], np.arange(60) ** 2) and (tmp_path / "mark").exists()


def test_a_result_that_was_lost_with_its_worker_is_asked_for_again(cluster, tmp_path, monkeypatch):
    """As the package says it: the scheduler has forgotten the task."""
    from distributed import Future

    result, lost = Future.result, []

    def lose_the_first(future, *arguments, **options):
        if not lost:
            lost.append(future.key)
            raise CancelledError(future.key)
        return result(future, *arguments, **options)

    monkeypatch.setattr(Future, "result", lose_the_first)
    mark = tmp_path / "mark"
    mark.touch()
    found = run(Chunks(tmp_path / "lost", "c", n=20, size=5), make_deadly_once, (mark,), 1, "squares", cluster.address)
    assert lost and np.array_equal(found["square"], np.arange(20) ** 2)


def test_arguments_that_were_lost_with_the_last_worker_that_held_them_are_shared_again(cluster, tmp_path, monkeypatch):
    from distributed import Client, Future

    scatter, result, shared = Client.scatter, Future.result, []

    def remember(client, *arguments, **options):
        shared.append((client, scatter(client, *arguments, **options)))
        return shared[-1][1]

    def lose_them_once(future, *arguments, **options):
        if len(shared) == 1:
            client, held = shared[0]
            client.cancel(held, force=True)
        return result(future, *arguments, **options)

    monkeypatch.setattr(Client, "scatter", remember)
    monkeypatch.setattr(Future, "result", lose_them_once)
    mark = tmp_path / "mark"
    mark.touch()
    found = run(Chunks(tmp_path / "shared", "d", n=60, size=5), make_deadly_once, (mark,), 1, "squares", cluster.address)
    assert len(shared) > 1 and np.array_equal(found["square"], np.arange(60) ** 2)


def test_work_that_fails_is_one_message(cluster, tmp_path):
    cluster.add_worker()
    cluster.wait_for(1)
    with pytest.raises(InputError, match="no squares of 0; run again"):
        run(Chunks(tmp_path, "b", n=5, size=5), make_wrong, (), 1, "wrong", cluster.address)


# Last: a client that could not start leaves the package's event loop in no state to start another one.
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://"])
def test_address_that_nobody_answers_is_one_message(address, monkeypatch):
    monkeypatch.setattr("engram.data.cluster.PATIENCE", 1)
    with pytest.raises(InputError, match="nobody answers"):
        connect(address)
