"""A tensor train from the features of a step to its coefficients: the regression's own sum of products, rounded.

The regression is a sum over samples i of alpha_ij prod_k exp(-((x_k - X_ik) / l_k)^2 / 2): on a grid, a canonical tensor in the
features and the number j of the coefficient. Its train has as many ranks as there are samples; rounding (Oseledets, Tensor-train
decomposition, SIAM 2011, algorithm 2) leaves the few that matter. The evaluator is tab_tt_value.
"""

from __future__ import annotations

import numpy as np

from engram.emit import Gpr, Tt


def canonical_cores(regression: Gpr, columns: list[int], at: np.ndarray, points: int) -> list[np.ndarray]:
    """Factors (n_k, samples) over the grids of some features, the others being `at`, and last alpha (m, samples)."""
    x, factors, weight = regression.x, [], np.ones(len(regression.x))
    for k in range(x.shape[1]):
        grid = np.linspace(regression.lo[k], regression.hi[k], points) if k in columns else at[k : k + 1]
        factor = np.exp(-0.5 * ((grid[:, None] - x[None, :, k]) / regression.length[k]) ** 2)
        if k in columns:
            factors.append(factor)
        else:
            weight = weight * factor[0]
    return [*factors, regression.alpha.T * weight]


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

    def __init__(self, regression: Gpr, columns: list[int], at: np.ndarray, points: int = 12, rank: int = 32):
        cores = rounded(canonical_cores(regression, columns, at, points), rank)
        m = len(regression.mean)
        self.mean, self.columns, self.m = regression.mean, columns, m
        self.table = Tt(
            role="train",
            inputs=[regression.inputs[k] for k in columns] + [("coefficient", "1")],
            lo=np.append(regression.lo[columns], 0.0),
            hi=np.append(regression.hi[columns], m - 1.0),
            held_out_error=0.0,
            held_out_text="",
            cores=cores,
        )
