"""Chunks of work on an existing Dask cluster. Workers need this repository, built; they return arrays, this process writes files.

The package `distributed` is imported here alone, and only when a cluster is asked for.
"""

import hashlib
import logging
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from pathlib import Path

from engram.data.chunks import Arrays, Chunks
from engram.inputs import InputError
from engram.paths import relative

PATIENCE = 10  # s, for an answer of the scheduler
RETRIES = 2  # of a chunk whose worker died

_work: dict[tuple, Callable[[range], Arrays]] = {}  # of this worker process: what was made for a key, in each of its threads


def engine_digest() -> str:
    """Which build of the engine this process loads: another one's data would not be the same bytes."""
    from engram.engine import engine

    return hashlib.sha256(Path(engine.__file__).read_bytes()).hexdigest()[:16]


def work_on(key: str, make_work: Callable[..., Callable[[range], Arrays]], arguments: tuple, items: range) -> Arrays:
    """On a worker: the arrays of a chunk. A solver is made once a thread, since it serves one solve at a time."""
    mine = (key, threading.get_ident())
    if mine not in _work:
        _work[mine] = make_work(*arguments)
    return _work[mine](items)


def connect(address: str):
    """A client of the scheduler at `address`, whose workers all have our engine. Raises InputError that names the mend."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError("--cluster needs Dask: pip install -r requirements-cluster.txt") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what it has to say, our own messages say
    try:
        client = Client(address, timeout=PATIENCE)
    except (OSError, ValueError, TypeError):
        mend = "start `dask scheduler` there, or correct the address (tcp://host:port)"
        raise InputError(f"--cluster: nobody answers at {address}; {mend}") from None
    try:
        _check(client, address)
    except InputError:
        client.close()
        raise
    return client


def _check(client, address: str) -> None:
    if not client.scheduler_info(n_workers=-1)["workers"]:
        raise InputError(f"--cluster: the scheduler at {address} has no workers; start `dask worker {address}` on them")
    try:
        theirs = client.run(engine_digest)
    except Exception as error:  # whatever a worker without the package raises
        raise InputError(f"--cluster: a worker cannot load the engine ({error}); build this repository there") from None
    ours = engine_digest()
    for worker, digest in theirs.items():
        if digest != ours:
            other = f"the worker at {worker} has another build of the engine ({digest}, here {ours})"
            raise InputError(f"--cluster: {other}; build the same there")


def completed(chunks: Chunks, missing: list[range], make_work, arguments: tuple, address: str) -> Iterator[range]:
    """Fill the missing chunks on the cluster; yields the items of each as it is written.

    A worker that dies loses nothing: the scheduler gives its chunks to others, and what it had done but not yet sent is asked for
    again, with arguments that are shared anew: it may have held the last copy. Raises InputError if the cluster fails; what is
    written is kept.
    """
    from distributed import as_completed

    client = connect(address)
    key = f"{chunks.folder.name} {chunks.key} {make_work.__qualname__}"  # what a solver depends on
    where = relative(chunks.folder)
    try:

        def share():
            try:
                return client.scatter([arguments], broadcast=True, hash=False)[0]
            except TimeoutError:
                raise InputError(
                    f"--cluster: {address} has no workers left; run again to go on from what is in {where}"
                ) from None

        def submit(items: range, shared):
            return client.submit(work_on, key, make_work, shared, items, pure=False, retries=RETRIES)

        shared = share()
        futures, lost = {submit(items, shared): items for items in missing}, Counter()
        running = as_completed(futures)
        for future in running:
            items = futures[future]
            try:
                arrays = future.result()
            except Exception as error:  # of the work, of a worker that dies again and again, of the connection
                lost[items] += 1
                if not isinstance(error, CancelledError) or lost[items] > RETRIES:
                    raise InputError(f"--cluster: {_text(error)}; run again to go on from what is in {where}") from None
                again = submit(items, share())
                futures[again] = items
                running.add(again)
                continue
            chunks.write(items, arrays)
            yield items
            future.release()
    finally:
        client.close(timeout=PATIENCE)


def _text(error: Exception) -> str:
    return (str(error) or type(error).__name__).splitlines()[0]
