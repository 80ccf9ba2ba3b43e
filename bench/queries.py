"""The memory's queries beside scikit-learn on the same tables, one query at a time."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from sklearn.neighbors import NearestNeighbors

from engram.emit import TableFile, read_folder
from engram.emit.arrays import pad, unblocks

NEAREST = 10
QUERIES = 200
# Float32 against double: rounding of inputs of order 3; of kernel values, times sum |alpha|; of |Linv k|^2.
TOLERANCE = {"distance": 1e-6, "mean": 2e-4, "variance": 5e-6}


class Peer:
    """scikit-learn on the numbers of two tables."""

    def __init__(self, folder: Path):
        tables = {table.kind: table for table in read_folder(folder)[1]}
        knn, gpr = tables["knn"], tables["gpr"]
        array, sizes = values(knn), knn.entry["sizes"]
        self.scale = array["scale"].astype(float)
        self.samples = unblocks(array["x"].reshape(-1, 8), sizes["n"], sizes["d"]).astype(float)
        self.lo, self.hi = array["lo"], array["hi"]
        self.neighbours = NearestNeighbors(n_neighbors=NEAREST, algorithm="brute").fit(self.samples)
        array, sizes = values(gpr), gpr.entry["sizes"]
        n, m = sizes["n"], sizes["m"]
        length = 1.0 / array["inv_length"].astype(float)
        kernel = ConstantKernel(sizes["variance"]) * RBF(length) + WhiteKernel(sizes["noise"])
        self.model = GaussianProcessRegressor(kernel, optimizer=None, alpha=0.0)
        self.between = unblocks(array["x"].reshape(-1, 8), n, sizes["d"]) * length
        self.model.fit(self.between, np.zeros((n, m)))  # inputs and Cholesky factor; the weights are the table's
        self.model.alpha_ = array["alpha"].reshape(n, pad(m))[:, :m].astype(float)
        self.mean = array["mean"][:m].astype(float)
        # bytes of the table, of which a query reads, and multiply-adds: tab_knn.h (all inputs), tab_gpr.h with the variance (all)
        counts = {"knn": knn.entry["sizes"]["n"] * knn.entry["sizes"]["d"], "gpr": n * (sizes["d"] + m) + n * n // 2}
        read = {"knn": 4 * counts["knn"], "gpr": gpr.entry["bytes"]}
        self.work = {kind: (tables[kind].entry["bytes"], count, read[kind]) for kind, count in counts.items()}

    def draw(self) -> tuple[np.ndarray, np.ndarray]:
        """Inputs inside the tables' domain: samples, disturbed."""
        rng = np.random.default_rng(0)
        near = self.samples[rng.integers(len(self.samples), size=QUERIES)] / self.scale
        near = np.clip(near + 0.1 * rng.standard_normal(near.shape), self.lo, self.hi)
        between = self.between[rng.integers(len(self.between), size=QUERIES)]
        return near, between + 0.1 * rng.standard_normal(between.shape)

    def knn(self, near: np.ndarray) -> np.ndarray:
        """Distances (n, NEAREST)."""
        return self.neighbours.kneighbors(near * self.scale)[0]

    def gpr(self, between: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (n, m) and variance (n,)."""
        mean, std = self.model.predict(between, return_std=True)
        return mean + self.mean, std[:, 0] ** 2


def values(table: TableFile) -> dict[str, np.ndarray]:
    """Arrays of a table by name."""
    return {item.name: item.flat for item in table.arrays}


def one_by_one(query, inputs: np.ndarray) -> np.ndarray:
    """Processor time of each query [us]."""
    query(inputs[:1])
    us = []
    for row in inputs:
        start = time.thread_time_ns()
        query(row[None])
        us.append(1e-3 * (time.thread_time_ns() - start))
    return np.array(us)


def errors(peer: Peer, ours: dict, near: np.ndarray, between: np.ndarray) -> dict[str, float]:
    """Largest differences of distances, means and variances, in units of what is allowed."""
    mean, variance = peer.gpr(between)
    pairs = {
        "distance": (np.sqrt(ours["distance2"]), peer.knn(near)),
        "mean": (ours["mean"], mean),
        "variance": (ours["variance"], variance),
    }
    return {name: float(np.abs(np.asarray(a) - b.ravel()).max()) / TOLERANCE[name] for name, (a, b) in pairs.items()}
