"""What is remembered of a motion: its end and its bow, the deviation from the straight line between its own ends.

    q(t) = (1 - s) q(0) + s q(T) + bow(t),   s = 10 r^3 - 15 r^4 + 6 r^5,   r = t / T

The bow vanishes at both ends. As weights of Gaussians over time and after PCA (thesis, chapters 3 and 4) it still does,
since that is a linear condition: a remembered motion always starts and ends where it should (controller/memory/memory_warp.h).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engram.learn.timebase import TimeBasis


def straight(t: np.ndarray, horizon: float, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Minimum-jerk straight lines (n, nt, nq) from start (n, nq) to end (n, nq) in `horizon` s."""
    r = np.clip(t / horizon, 0.0, 1.0)
    s = (r**3 * (10 + r * (-15 + 6 * r)))[None, :, None]
    return (1 - s) * start[:, None, :] + s * end[:, None, :]


@dataclass(frozen=True)
class BowCode:
    """Encoder and decoder of bows of nq channels: weights over time = mean + z @ basis."""

    time: TimeBasis
    nq: int
    mean: np.ndarray  # (k nq)
    basis: np.ndarray  # (m, k nq)  rows scaled so that coefficients have unit variance
    project: np.ndarray  # (k nq, m)  weights -> coefficients

    @property
    def components(self) -> int:
        """Number of coefficients of a bow."""
        return len(self.basis)

    def encode(self, t: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Coefficients (n, m) of motions q (n, nt, nq) at times t (nt,) over [0, horizon]."""
        return (bow_weights(self.time, t, q) - self.mean) @ self.project

    def decode(self, z: np.ndarray, t: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Motions (n, nt, nq) at times t with given ends (n, nq) and coefficients z (n, m)."""
        weights = (self.mean + z @ self.basis).reshape(len(z), self.time.k, self.nq)
        return straight(t, self.time.horizon, start, end) + np.einsum("tk,nkc->ntc", self.time.phi(t), weights)


def bow_weights(time: TimeBasis, t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Weights (n, k nq) of the bows of motions q (n, nt, nq): the layout that controller/tab/tab_rbf.h reads."""
    return time.fit(t, q - straight(t, time.horizon, q[:, 0], q[:, -1])).reshape(len(q), -1)


def fit_bow_code(time: TimeBasis, t: np.ndarray, q: np.ndarray, components: int) -> BowCode:
    """PCA of the bows of motions q (n, nt, nq).

    The sign of a component is chosen so that its largest entry is positive: the same data give the same table.
    """
    weights = bow_weights(time, t, q)
    mean = weights.mean(axis=0)
    _, singular, rows = np.linalg.svd(weights - mean, full_matrices=False)
    rows = rows[:components]
    rows *= np.sign(rows[np.arange(len(rows)), np.argmax(np.abs(rows), axis=1)])[:, None]
    unit = singular[: len(rows), None] / np.sqrt(len(q))  # standard deviation of a coefficient becomes 1
    return BowCode(time, q.shape[2], mean, unit * rows, (rows / unit).T)
