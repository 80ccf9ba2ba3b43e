"""Tensor trains beside PyTorch and teneva: bench.tt.*; networks beside PyTorch: bench.query.{ensemble,mdn}.

PyTorch is an optional extra (scripts/setup.sh torch): without it the rows that need it as gate or peer are left out.
"""

from __future__ import annotations

import numpy as np

from engram.emit import Mlp
from engram.engine import engine
from engram.learn.network import Network, fit_density, fit_ensemble
from engram.pytorch import PyTorch
from engram.study.sampling import Case

CASES = ((Case(10, 50, 60), (1, 100, 1000)), (Case(7, 100, 50), (1, 1000)), (Case(70, 100, 50), (1, 100, 1000)))
SEEDS = (1, 2, 3)  # of cross approximations
TESTS = 400  # tasks on which their trains are judged
GATE_QUERIES = 10_000
TOLERANCE = 1e-4  # floats: some 150 roundings along three layers, of terms that are several times their sum


def networks(x: np.ndarray, y: np.ndarray) -> dict[str, Network]:
    """An ensemble and a mixture density network of the Panda's sizes, hardly trained: time and rounding do not depend on it."""
    return {
        "ensemble": fit_ensemble(x, y, members=5, epochs=3),
        "mdn": fit_density(x, y, modes=8, epochs=3),
    }


def answers(network: Network) -> int:
    """Of one query: members, or modes."""
    return network.modes or len(network.weights)


def operations(network: Network) -> int:
    """Multiply-adds of a query."""
    return sum(w.size for member in network.weights for w in member)


def table(network: Network, domain: dict) -> Mlp:
    """As the controller holds it."""
    return Mlp(center=network.center, width=network.width, weights=network.weights, biases=network.biases, modes=network.modes,
               **domain)  # fmt: skip


def error(network: Network, ours: engine.Table, worker: PyTorch, lo: np.ndarray, hi: np.ndarray) -> dict[str, float]:
    """Largest differences to PyTorch in double over random queries, relative to the largest number of its kind."""
    x = np.random.default_rng(5).uniform(lo, hi, (GATE_QUERIES, len(lo)))
    worker.load_networks(network)
    peer = worker.ask("predict", x=x)
    found = ours.answers(x, answers(network))
    back = np.argsort(found["index"], axis=1)
    mine = {"p": np.take_along_axis(found["weight"], back, 1), "mean": np.take_along_axis(found["y"], back[:, :, None], 1)}
    if network.modes:
        mine["variance"] = np.take_along_axis(found["var"], back[:, :, None], 1)
    return {name: float(np.abs(a - peer[name]).max() / np.abs(peer[name]).max()) for name, a in mine.items()}
