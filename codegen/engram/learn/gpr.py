"""Gaussian process regression from task features to motion coefficients, trained by scikit-learn."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel


def round_digits(value: np.ndarray | float, digits: int = 3) -> np.ndarray | float:
    """Rounded to significant digits: the last bits of an optimiser shall not reach the tables."""
    value = np.asarray(value, float)
    power = 10.0 ** (digits - 1 - np.floor(np.log10(np.where(value == 0, 1.0, np.abs(value)))))
    return np.round(value * power) / power


@dataclass(frozen=True)
class FittedGpr:
    """What controller/tab/tab_gpr.h evaluates."""

    x: np.ndarray  # (n, d) float32
    length: np.ndarray  # (d,)
    variance: float
    noise: float
    alpha: np.ndarray  # (n, m)
    mean: np.ndarray  # (m,)
    linv: np.ndarray  # (n, n) lower

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (nx, m) and variance (nx,)."""
        k = kernel_matrix(x, self.x, self.length, self.variance)
        return self.mean + k @ self.alpha, self.variance + self.noise - np.sum((k @ self.linv.T) ** 2, axis=1)


def kernel_matrix(a: np.ndarray, b: np.ndarray, length: np.ndarray, variance: float) -> np.ndarray:
    """variance * exp(-1/2 |(a - b) / length|^2)."""
    difference = a[:, None, :] / length - b[None, :, :] / length
    return variance * np.exp(-0.5 * np.einsum("abd,abd->ab", difference, difference))


def fit_hyperparameters(x: np.ndarray, z: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, float]:
    """ARD length scales and noise (kernel variance 1) of the largest marginal likelihood of z (n, m), z of unit variance."""
    kernel = ConstantKernel(1.0, "fixed") * RBF(length, (1e-1, 1e2)) + WhiteKernel(0.1, (1e-4, 1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a length scale at its bound means: this input does not matter
        model = GaussianProcessRegressor(kernel, alpha=0.0, n_restarts_optimizer=0).fit(x, z)
    return round_digits(model.kernel_.k1.k2.length_scale), float(round_digits(model.kernel_.k2.noise_level))


def fit_gpr(x: np.ndarray, z: np.ndarray, length: np.ndarray, noise: float) -> FittedGpr:
    """The process with given hyperparameters and unit kernel variance on samples x (n, d), z (n, m)."""
    x = np.asarray(x, np.float32).astype(float)
    mean = z.mean(axis=0)
    lower = np.linalg.cholesky(kernel_matrix(x, x, length, 1.0) + noise * np.eye(len(x)))
    linv = solve_triangular(lower, np.eye(len(x)), lower=True)
    return FittedGpr(x, length, 1.0, noise, linv.T @ (linv @ (z - mean)), mean, linv)
