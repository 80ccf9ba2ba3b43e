"""Trajectories as weights of normalised Gaussians over time (controller/tab/tab_rbf.h)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


def basis(t: np.ndarray, center: np.ndarray, width: float) -> np.ndarray:
    """phi (nt, k) at times t [s] inside the range of the data."""
    z = (np.asarray(t, float)[:, None] - np.asarray(center, float)[None, :]) / width
    g = np.exp(0.5 * (np.min(z**2, axis=1, keepdims=True) - z**2))
    return g / g.sum(axis=1, keepdims=True)


@dataclass(frozen=True)
class TimeBasis:
    """k Gaussians spread evenly over [0, horizon] s; width in spacings of the centres."""

    k: int
    horizon: float
    width_spacings: float = 1.0

    @property
    def center(self) -> np.ndarray:
        """Centres [s], as the controller will read them (float32)."""
        return np.linspace(0.0, self.horizon, self.k).astype(np.float32).astype(float)

    @property
    def width(self) -> float:
        """Width h [s], as the controller will read it."""
        return float(np.float32(self.width_spacings * self.horizon / (self.k - 1)))

    def phi(self, t: np.ndarray) -> np.ndarray:
        """Basis at times t [s] (nt, k)."""
        return basis(t, self.center, self.width)

    def fit(self, t: np.ndarray, y: np.ndarray, *, pin_ends: bool = True) -> np.ndarray:
        """Least-squares weights w (n, k, c) of trajectories y (n, nt, c) at times t (nt,); the ends are met exactly.

        Minimises |phi w - y|^2 + 1e-8 |w|^2 subject to phi_0 w = y_0 and phi_T w = y_T, by its KKT system.
        """
        phi = self.phi(t)
        ends = phi[[0, -1]] if pin_ends else np.zeros((0, self.k))
        hessian = phi.T @ phi + 1e-8 * np.eye(self.k)  # the Gaussians overlap: a trace of ridge keeps the weights small
        kkt = np.block([[hessian, ends.T], [ends, np.zeros((len(ends), len(ends)))]])
        n, nt, c = y.shape
        flat = y.transpose(1, 0, 2).reshape(nt, n * c)
        right = np.vstack([phi.T @ flat, flat[[0, -1]] if pin_ends else np.zeros((0, n * c))])
        return np.linalg.solve(kkt, right)[: self.k].reshape(self.k, n, c).transpose(1, 0, 2)
