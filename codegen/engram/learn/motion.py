"""Motions as a few coefficients: weights of Gaussians over time, then PCA over the whole data set (thesis, chapters 3 and 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engram.learn.timebase import TimeBasis


@dataclass(frozen=True)
class MotionCode:
    """Encoder and decoder of motions with `nq + nu` channels. Decoding: weights = mean + z @ basis, y(t) = phi(t) @ weights."""

    time: TimeBasis
    nq: int
    nu: int
    mean: np.ndarray  # (k (nq + nu))
    basis: np.ndarray  # (m, k (nq + nu))  rows scaled so that coefficients are in units of 1
    project: np.ndarray  # (k (nq + nu), m)  weights -> coefficients

    @property
    def components(self) -> int:
        """Number of coefficients of a motion."""
        return len(self.basis)

    def encode(self, t: np.ndarray, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Coefficients (n, m) of motions q (n, nt, nq) at times t (nt,) and u (n, nt - 1, nu) at t[:-1]."""
        return (stack_weights(self.time, t, q, u) - self.mean) @ self.project

    def decode(self, z: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """q (n, nt, nq) and u (n, nt, nu) at times t of coefficients z (n, m)."""
        weights = (self.mean + z @ self.basis).reshape(len(z), self.time.k, self.nq + self.nu)
        y = np.einsum("tk,nkc->ntc", self.time.phi(t), weights)
        return y[..., : self.nq], y[..., self.nq :]


def stack_weights(time: TimeBasis, t: np.ndarray, q: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Weights of q and u, (n, k (nq + nu)): the layout that controller/tab/tab_rbf.h reads. Ends of q are met exactly."""
    weights = np.concatenate([time.fit(t, q), time.fit(t[:-1], u, pin_ends=False)], axis=2)
    return weights.reshape(len(q), -1)


def fit_motion_code(
    time: TimeBasis, t: np.ndarray, q: np.ndarray, u: np.ndarray, u_scale: np.ndarray, components: int
) -> MotionCode:
    """PCA of the stacked weights, an error of u_scale (nu,) [N m] counting as much as one of 1 rad.

    The sign of a component is chosen so that its largest entry is positive: the same data give the same table.
    """
    nq, nu = q.shape[2], u.shape[2]
    weights = stack_weights(time, t, q, u)
    scale = np.tile(np.concatenate([np.ones(nq), u_scale]), time.k)
    mean = weights.mean(axis=0)
    _, singular, rows = np.linalg.svd((weights - mean) / scale, full_matrices=False)
    rows = rows[:components]
    rows *= np.sign(rows[np.arange(len(rows)), np.argmax(np.abs(rows), axis=1)])[:, None]
    unit = singular[: len(rows), None] / np.sqrt(len(q))  # standard deviation of a coefficient becomes 1
    return MotionCode(time, nq, nu, mean, unit * rows * scale, (rows / unit / scale).T)
