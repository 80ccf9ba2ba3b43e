"""A tensor train from the features of a step to its coefficients: the regression's own sum of products, rounded.

The regression is a sum over samples i of alpha_ij prod_k exp(-((x_k - X_ik) / l_k)^2 / 2): on a grid, a canonical tensor in the
features and the number j of the coefficient. Its train has as many ranks as there are samples; rounding (Oseledets, Tensor-train
decomposition, SIAM 2011, algorithm 2) leaves the few that matter. The evaluator is tab_tt_value.

What matters is the cost: coefficients are rounded times what a unit of each is worth, or the many that hardly move the robot take
the ranks of the few that do. Grids are as fine as the length scale of their feature asks for: between points the train is linear.
"""

from __future__ import annotations

import numpy as np

from engram.emit import Gpr, Tt
from engram.engine import engine
from engram.learn.steps import Coded, weighed

PITCH, RANK = 0.1, 48  # distance of grid points, in length scales; largest rank


def worth(coded: Coded) -> np.ndarray:
    """Of a unit of each coefficient (m): the norm of its row in a basis' metric; the squares of each basis sum to 1."""

    def norms(rows: np.ndarray) -> np.ndarray:
        return np.linalg.norm(rows, axis=1) / np.linalg.norm(rows)

    return np.concatenate([norms(weighed(b.rows, b.metric, slice(0, b.rows.shape[1]))) for b in (coded.path, coded.torque)])


def canonical_cores(regression: Gpr, columns: list[int], at: np.ndarray, worth: np.ndarray) -> list[np.ndarray]:
    """Factors (n_k, samples) over the grids of some features, the others being `at`; last alpha (m, samples) times `worth`."""
    x, factors, weight = regression.x, [], np.ones(len(regression.x))
    for k in range(x.shape[1]):
        lo, hi, length = regression.lo[k], regression.hi[k], regression.length[k]
        points = max(3, int(np.ceil((hi - lo) / length / PITCH)) + 1)
        grid = np.linspace(lo, hi, points) if k in columns else at[k : k + 1]
        factor = np.exp(-0.5 * ((grid[:, None] - x[None, :, k]) / length) ** 2)
        if k in columns:
            factors.append(factor)
        else:
            weight = weight * factor[0]
    return [*factors, worth[:, None] * regression.alpha.T * weight]


def rounded(factors: list[np.ndarray], rank: int) -> list[np.ndarray]:
    """Cores (r, n, r') of the best train of at most this rank, nearly, of a canonical tensor with factors (n_k, samples)."""
    # from the right: the tensor of the later modes is an orthonormal one times a matrix (rank, samples)
    rest, right = factors[-1], []
    for factor in reversed(factors[:-1]):
        q, r = np.linalg.qr(rest)  # (n r', samples) -> (n r', r), (r, samples)
        right.append(q)
        rest = (factor[:, None, :] * r[None]).reshape(-1, factor.shape[1])
    # from the left: what remains is cut at `rank`
    sizes = [len(factor) for factor in factors]
    carried = rest.sum(axis=1).reshape(1, sizes[0], -1)
    cores = []
    for k, q in enumerate(reversed(right), 1):
        r0, n, r1 = carried.shape
        u, s, vt = np.linalg.svd(carried.reshape(r0 * n, r1), full_matrices=False)
        keep = max(1, min(rank, int(np.sum(s > 1e-9 * s[0]))))
        cores.append(u[:, :keep].reshape(r0, n, keep))
        following = q.T.reshape(r1, sizes[k], -1)
        carried = np.einsum("ab,bnc->anc", s[:keep, None] * vt[:keep], following)
    return [*cores, carried]


class StepTrain:
    """z (m) of the features of a single step of one foot, by the train's evaluator."""

    def __init__(self, regression: Gpr, columns: list[int], at: np.ndarray, worth: np.ndarray):
        self.mean, self.columns, self.worth = regression.mean, columns, worth
        self.table = Tt(
            role="train",
            inputs=[regression.inputs[k] for k in columns] + [("coefficient", "1")],
            lo=np.append(regression.lo[columns], 0.0),
            hi=np.append(regression.hi[columns], len(worth) - 1.0),
            held_out_error=0.0,
            held_out_text="",
            cores=rounded(canonical_cores(regression, columns, at, worth), RANK),
        )
        self.evaluator = engine.TensorTrain(self.table)

    def z(self, features: np.ndarray) -> np.ndarray:
        """Coefficients (m) of a step's features (15)."""
        m = len(self.worth)
        x = np.hstack([np.tile(features[self.columns], (m, 1)), np.arange(m)[:, None]])
        return self.mean + self.evaluator.value(x)[0] / self.worth
