"""Signed distances of a world as a tensor train: a grid's numbers by successive singular value decompositions.

Where a grid has n^3 numbers, a train has n (r_1 + r_1 r_2 + r_2). Evaluated by tab_tt_distance of controller/tab/tab_tt.h.
Source: Oseledets, Tensor-train decomposition (SIAM J. Sci. Comput. 2011), algorithm 1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from engram.emit import Tt
from engram.engine import engine

HELD_OUT = 10_000  # points off the grid, on which the error is measured


def decompose(values: np.ndarray, rms: float) -> list[np.ndarray]:
    """Cores (r_k-1, n_k, r_k) whose product is `values` (n_1, ..., n_d), but for at most `rms` in the root mean square, of the
    lowest ranks."""
    allowed = rms**2 * values.size / max(values.ndim - 1, 1)  # what each of the d - 1 truncations may leave out
    cores, rest, rank = [], values, 1
    for n in values.shape[:-1]:
        u, s, vt = np.linalg.svd(rest.reshape(rank * n, -1), full_matrices=False)
        lost = np.append(np.cumsum(s[::-1] ** 2)[::-1], 0.0)  # by keeping as many as the index says
        keep = max(1, int(np.argmax(lost <= allowed)))
        cores.append(u[:, :keep].reshape(rank, n, keep))
        rest, rank = s[:keep, None] * vt[:keep], keep
    return [*cores, rest.reshape(rank, -1, 1)]


def distance_train(
    distance: Callable[[np.ndarray], np.ndarray], lo: np.ndarray, hi: np.ndarray, points: int, rms: float = 1e-3,
    type: str = "int8", seed: int = 0,
) -> Tt:  # fmt: skip
    """The train of a signed distance (m, 3) -> (m) [m] over the box lo .. hi, on `points` per axis.

    rms: [m] what truncation may change on the grid. Between its points the train is interpolated: the error that the table states
    is measured there, storage included.
    """
    axes = [np.linspace(a, b, points) for a, b in zip(lo, hi, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    cores = decompose(distance(grid.reshape(-1, 3)).reshape(points, points, points), rms)
    table = Tt(
        inputs=[(axis, "m") for axis in "xyz"], lo=np.asarray(lo, float), hi=np.asarray(hi, float), held_out_error=0.0,
        held_out_text=f"largest error of the distance at {HELD_OUT} points [m]", cores=cores, type=type, role="distance",
    )  # fmt: skip
    p = np.random.default_rng(seed).uniform(lo, hi, (HELD_OUT, 3))
    table.held_out_error = float(np.abs(engine.TensorTrain(table, 1).distance(p)[0] - distance(p)).max())
    return table
