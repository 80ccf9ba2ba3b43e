"""Work over many items in a pool of processes: chunk by chunk into files, so that a stop loses no more than the chunks at work.

A chunk's file depends on its items alone, never on the number of workers or on the order in which chunks finish.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from tqdm import tqdm

from engram.inputs import InputError
from engram.paths import relative

Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Chunks:
    """Files of a folder, one per chunk of `size` items of n; valid only under the same `key`: all that they depend on."""

    folder: Path
    key: str
    n: int
    size: int

    def ranges(self) -> list[range]:
        """Items of each chunk."""
        return [range(first, min(first + self.size, self.n)) for first in range(0, self.n, self.size)]

    def path(self, items: range) -> Path:
        """File of the chunk of these items."""
        return self.folder / f"{items.start:06d}-{items.stop:06d}.npz"

    def read(self, items: range) -> Arrays | None:
        """The chunk's arrays, or None if it is absent, damaged, or made under another key."""
        try:
            with np.load(self.path(items), allow_pickle=False) as file:
                arrays = dict(file)
        except (OSError, ValueError, EOFError, KeyError, BadZipFile):
            return None
        return arrays if str(arrays.pop("key", "")) == self.key else None

    def write(self, items: range, arrays: Arrays) -> None:
        """Write the chunk; a stop in the middle leaves no half of it."""
        path = self.path(items)
        part = path.with_suffix(f".{os.getpid()}.part")
        with part.open("wb") as file:
            np.savez(file, key=np.array(self.key), **arrays)
        part.replace(path)

    def joined(self) -> Arrays:
        """All chunks, arrays joined along their first axis."""
        parts = [self.read(items) for items in self.ranges()]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


_work: Callable[[int], Any] | None = None


def _start_worker(make_work: Callable[..., Callable[[range], Arrays]], arguments: tuple) -> None:
    """In a worker process: an interrupt is the parent's to handle; what the work needs is loaded once."""
    global _work
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _work = make_work(*arguments)


def _run_chunk(chunks: Chunks, items: range) -> range:
    chunks.write(items, _work(items))
    return items


def run(
    chunks: Chunks,
    make_work: Callable[..., Callable[[range], Arrays]],
    arguments: tuple,
    workers: int,
    title: str,
    cluster: str | None = None,
) -> Arrays:
    """Fill the missing chunks with `make_work(*arguments)(items)` in `workers` processes; returns all chunks, joined.

    `cluster`: address of a Dask scheduler, whose workers are used instead; the files are the same. Raises InputError if a worker
    dies (of a cluster: if it fails); what is finished is kept, and another run goes on from there.
    """
    chunks.folder.mkdir(parents=True, exist_ok=True)
    missing = [items for items in chunks.ranges() if chunks.read(items) is None]
    done = chunks.n - sum(map(len, missing))
    with tqdm(total=chunks.n, initial=done, desc=title, unit="", smoothing=0.05, mininterval=0.5) as bar:
        for items in _completed(chunks, missing, make_work, arguments, min(workers, len(missing)), cluster):
            bar.update(len(items))
    return chunks.joined()


def _completed(
    chunks: Chunks, missing: list[range], make_work, arguments: tuple, workers: int, cluster: str | None
) -> Iterator[range]:
    if not missing:
        return
    if cluster is not None:
        from engram.data.cluster import completed

        yield from completed(chunks, missing, make_work, arguments, cluster)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, _start_worker, (make_work, arguments)) as pool:
        pending = {pool.submit(_run_chunk, chunks, items) for items in missing}
        try:
            while pending:
                finished, pending = wait(pending, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
        except BrokenProcessPool:
            where = relative(chunks.folder)
            raise InputError(f"a worker process died; run again to go on from what is in {where}") from None
        finally:
            _abandon(pool, pending)


def _abandon(pool: Executor, pending: set[Future]) -> None:
    """Start no further chunk; those at work are finished."""
    for future in pending:
        future.cancel()
    pool.shutdown(wait=True, cancel_futures=True)
