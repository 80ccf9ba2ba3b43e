"""What is remembered of a motion: its end and its bow, the deviation from the straight line between its own ends.

    q(t) = (1 - s) q(0) + s q(T) + bow(t),   s = 10 r^3 - 15 r^4 + 6 r^5,   r = t / T

The bow vanishes at both ends. As weights of Gaussians over time and after PCA (thesis, chapters 3 and 4) it still does,
since that is a linear condition: a remembered motion always starts and ends where it should (controller/memory/memory_warp.h).

States and controls are remembered together. The few coefficients that PCA keeps are those that lose least of q, v and u, and the
decoder has channels for the controls as well: what the solver's are beyond the inverse dynamics of the decoded motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from engram.learn.timebase import TimeBasis

SPEED = 0.05  # s^2, weight of |error of v|^2 beside |error of q|^2 in what a bow's coefficients shall keep
TORQUE = 5e-5  # 1/(N m)^2, weight of |error of u|^2
RIDGE = 1.0  # of the regression from coefficients (of unit variance) to controls


class Dynamics(Protocol):
    """A robot of the compiled engine (codegen/binding/engine_rbd.cc), as far as learning needs it."""

    def rnea(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Joint forces (n, nv)."""

    def crba(self, q: np.ndarray) -> np.ndarray:
        """Mass matrices (n, nv, nv)."""


def straight(t: np.ndarray, horizon: float, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Minimum-jerk straight lines (n, nt, nq) from start (n, nq) to end (n, nq) in `horizon` s."""
    r = np.clip(t / horizon, 0.0, 1.0)
    s = (r**3 * (10 + r * (-15 + 6 * r)))[None, :, None]
    return (1 - s) * start[:, None, :] + s * end[:, None, :]


def rates(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matrices from q at the knots to v (nt, nt) and a (nt - 1, nt), from rest, as the integrator of the problem has them."""
    dt = np.diff(t)[:, None]
    v = np.vstack([np.zeros(len(t)), np.diff(np.eye(len(t)), axis=0) / dt])
    return v, np.diff(v, axis=0) / dt


def inverse_dynamics(dynamics: Dynamics, t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Controls (n, nt - 1, nv) along motions q (n, nt, nq) from rest: follow_path of controller/memory/memory_warp.h."""
    v, a = (np.einsum("kt,ntc->nkc", matrix, q) for matrix in rates(t))
    n, knots, nv = a.shape
    rows = (np.ascontiguousarray(part[:, :knots].reshape(n * knots, -1)) for part in (q, v, a))
    return dynamics.rnea(*rows).reshape(n, knots, nv)


@dataclass(frozen=True)
class BowCode:
    """Encoder and decoder of bows of nq channels, with controls of nu channels: weights over time = mean + z @ basis."""

    time: TimeBasis
    nq: int
    mean: np.ndarray  # (k nq)
    basis: np.ndarray  # (m, k nq)  rows scaled so that coefficients have unit variance
    project: np.ndarray  # (k nq, m)  weights -> coefficients
    controls_mean: np.ndarray  # (k nu)
    controls_basis: np.ndarray  # (m, k nu)

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

    def decode_controls(self, z: np.ndarray, t: np.ndarray) -> np.ndarray:
        """What the controls (n, nt, nu) at times t are beyond the inverse dynamics of the decoded motion."""
        weights = (self.controls_mean + z @ self.controls_basis).reshape(len(z), self.time.k, -1)
        return np.einsum("tk,nkc->ntc", self.time.phi(t), weights)

    def table(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean (k (nq + nu)) and basis (m, k (nq + nu)) of all channels: the layout that controller/tab/tab_rbf.h reads."""
        k = self.time.k

        def join(bow: np.ndarray, controls: np.ndarray) -> np.ndarray:
            n = len(bow)
            return np.concatenate([bow.reshape(n, k, -1), controls.reshape(n, k, -1)], axis=2).reshape(n, -1)

        return join(self.mean[None], self.controls_mean[None])[0], join(self.basis, self.controls_basis)


def bow_weights(time: TimeBasis, t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Weights (n, k nq) of the bows of motions q (n, nt, nq)."""
    return time.fit(t, q - straight(t, time.horizon, q[:, 0], q[:, -1])).reshape(len(q), -1)


def metric(time: TimeBasis, t: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """L (k nq, k nq): |dw L|^2 = sum over knots of |dq|^2 + SPEED |dv|^2 + TORQUE |M da|^2 for an error dw of the weights.

    `inertia`: M (nq, nq), the mean mass matrix: to first order M da is the error of the controls.
    """
    phi = time.phi(t)
    v, a = (matrix @ phi for matrix in rates(t))
    same = phi.T @ phi + SPEED * v.T @ v + 1e-8 * np.eye(time.k)  # a trace of ridge, as in TimeBasis.fit
    gram = np.kron(same, np.eye(len(inertia))) + TORQUE * np.kron(a.T @ a, inertia.T @ inertia)
    return np.linalg.cholesky(gram)


def fit_bow_code(time: TimeBasis, t: np.ndarray, q: np.ndarray, u: np.ndarray, dynamics: Dynamics, components: int) -> BowCode:
    """PCA of the bows of motions q (n, nt, nq), controls u (n, nt - 1, nu), in the metric of states and controls.

    The sign of a component is chosen so that its largest entry is positive: the same data give the same table.
    """
    nq = q.shape[2]
    weights = bow_weights(time, t, q)
    mean = weights.mean(axis=0)
    inertia = dynamics.crba(np.ascontiguousarray(q[:, :: max(1, len(t) // 4)].reshape(-1, nq))).mean(axis=0)
    L = metric(time, t, inertia)
    _, singular, rows = np.linalg.svd((weights - mean) @ L, full_matrices=False)
    rows = rows[:components]
    rows *= np.sign(rows[np.arange(len(rows)), np.argmax(np.abs(rows), axis=1)])[:, None]
    unit = singular[: len(rows), None] / np.sqrt(len(q))  # standard deviation of a coefficient becomes 1
    basis, project = np.linalg.solve(L.T, (unit * rows).T).T, L @ (rows / unit).T

    z = (weights - mean) @ project
    decoded = BowCode(time, nq, mean, basis, project, np.zeros(0), np.zeros(0)).decode(z, t, q[:, 0], q[:, -1])
    beyond = time.fit(t[:-1], u - inverse_dynamics(dynamics, t, decoded), pin_ends=False).reshape(len(q), -1)
    controls_mean = beyond.mean(axis=0)
    controls_basis = np.linalg.solve(z.T @ z + RIDGE * np.eye(z.shape[1]), z.T @ (beyond - controls_mean))
    return BowCode(time, nq, mean, basis, project, controls_mean, controls_basis)
