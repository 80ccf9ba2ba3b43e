"""Queries of mixtures, networks and distances beside their peers, one at a time: bench.query.{gmr,mlp,sdf}.

Tables of the Panda's sizes, fitted to random smooth data; the evaluator is the controller's, asked through the binding, whose
clock runs around the call alone. The peer is scikit-learn's single predict: for the mixture only the probabilities of its
components, which is all that scikit-learn computes.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.mixture import GaussianMixture
from sklearn.neural_network import MLPRegressor

from engram.emit import Mlp, Sdf, Table
from engram.engine import engine
from engram.learn.mixture import Mixture, condition, mixture_table

SAMPLES, D, M = 2834, 16, 19  # as the Panda's memory: features of a task -> end posture and leading coefficients
COMPONENTS, HIDDEN, BOXES = 24, 64, 8
QUERIES = 200


@dataclass(frozen=True)
class Rival:
    """A table, how many answers are asked, multiply-adds of a query (tab_<kind>.h); the peer, and what both must agree on."""

    name: str
    table: Table
    answers: int
    operations: int
    peer: Callable[[np.ndarray], np.ndarray] | None = None
    agree: Callable[[dict], np.ndarray] | None = None
    tolerance: float = 0.0


def data() -> tuple[np.ndarray, np.ndarray, dict]:
    """Inputs, outputs, and the domain that the tables share."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (SAMPLES, D)).astype(np.float32).astype(float)
    y = np.sin(x @ rng.normal(size=(D, M)))
    names = [(f"x{i}", "1") for i in range(D)]
    return x, y, dict(inputs=names, lo=x.min(0), hi=x.max(0), held_out_error=0.0, held_out_text="not measured")


def rivals() -> list[Rival]:
    """One of each kind. Tolerances: rounding of a log probability of order 100, of sums of hundreds of terms."""
    x, y, domain = data()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        joint = GaussianMixture(COMPONENTS, random_state=0, max_iter=10, reg_covar=1e-3).fit(np.hstack([x, y]))
        network = MLPRegressor(hidden_layer_sizes=(HIDDEN, HIDDEN), random_state=0, max_iter=5).fit(x, y)
    marginal = GaussianMixture(COMPONENTS)
    marginal.weights_, marginal.means_, marginal.covariances_ = joint.weights_, joint.means_[:, :D], joint.covariances_[:, :D, :D]
    marginal.precisions_cholesky_ = np.array([np.linalg.inv(np.linalg.cholesky(S)).T for S in marginal.covariances_])
    mixture = condition(Mixture(D, joint.weights_, joint.means_, joint.covariances_, np.zeros(COMPONENTS)))
    boxes = [(np.full(3, 0.2 * i - 0.7), np.eye(3), np.full(3, 0.05)) for i in range(BOXES)]
    space = {**domain, "inputs": domain["inputs"][:3], "lo": -np.ones(3), "hi": np.ones(3)}

    def probabilities(found: dict) -> np.ndarray:
        return np.take_along_axis(found["weight"], np.argsort(found["index"], axis=1), 1)

    def first(found: dict) -> np.ndarray:
        return found["y"][:, 0]

    return [
        Rival("gmr", mixture_table(mixture, **domain), COMPONENTS, COMPONENTS * D * (D + 24), marginal.predict_proba,
              probabilities, 1e-3),
        Rival("mlp", Mlp(center=np.zeros(D), width=np.ones(D), weights=[network.coefs_], biases=[network.intercepts_], **domain),
              1, HIDDEN * (D + HIDDEN + M), network.predict, first, 1e-4),
        Rival("sdf", Sdf(boxes=boxes, **space), 1, 27 * BOXES),
    ]  # fmt: skip


def inputs(rival: Rival) -> np.ndarray:
    """Queries inside the domain."""
    lo, hi = (np.asarray(bound, float) for bound in (rival.table.lo, rival.table.hi))
    return np.random.default_rng(1).uniform(lo, hi, (QUERIES, len(lo)))


def error(rival: Rival, x: np.ndarray) -> float:
    """Largest difference to the peer."""
    found = engine.Table(rival.table).answers(x, rival.answers)
    return float(np.abs(rival.agree(found) - rival.peer(x)).max())
