"""Mixture regression from inputs to outputs, fitted by scikit-learn: Gaussian (EM) or Bayesian (Student t predictions)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import gammaln
from sklearn.exceptions import ConvergenceWarning
from sklearn.mixture import BayesianGaussianMixture, GaussianMixture

from engram.emit import Gmr


@dataclass(frozen=True)
class Mixture:
    """A mixture over (x, y), x the first d dimensions: weight (k,), mean (k, d + m), scale (k, d + m, d + m), freedom (k,).

    freedom 0: Gaussians, scale their covariances; else Student t distributions and their scale matrices.
    """

    d: int
    weight: np.ndarray
    mean: np.ndarray
    scale: np.ndarray
    freedom: np.ndarray


@dataclass(frozen=True)
class Conditional:
    """What controller/tab/tab_gmr.h evaluates; shapes as there, without padding."""

    log_norm: np.ndarray  # (k,)
    freedom: np.ndarray  # (k,)
    mean_x: np.ndarray  # (k, d)
    linv: np.ndarray  # (k, d, d) lower
    mean_y: np.ndarray  # (k, m)
    slope: np.ndarray  # (k, m, d)
    var: np.ndarray  # (k, m)

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Probabilities h (n, k), means y (n, k, m) and variances (n, k, m) of the components at x (n, d)."""
        dx = x[:, None, :] - self.mean_x
        q = np.sum(np.einsum("kij,nkj->nki", self.linv, dx) ** 2, axis=2)
        d, nu = x.shape[1], self.freedom
        student = nu > 0
        safe = np.where(student, nu, 1.0)
        log_h = self.log_norm - np.where(student, 0.5 * (nu + d) * np.log1p(q / safe), 0.5 * q)
        h = np.exp(log_h - log_h.max(axis=1, keepdims=True))
        spread = np.where(student, (nu + q) / np.maximum(nu + d - 2, 1e-300), 1.0)
        y = self.mean_y + np.einsum("kmd,nkd->nkm", self.slope, dx)
        return h / h.sum(axis=1, keepdims=True), y, spread[:, :, None] * self.var


def fit_gaussian(x: np.ndarray, y: np.ndarray, components: int, *, ridge: float = 1e-4, seed: int = 0) -> Mixture:
    """Expectation maximization (thesis, equation 2.13)."""
    model = GaussianMixture(components, reg_covar=ridge, random_state=seed, max_iter=300)
    fit(model, np.hstack([x, y]))
    return Mixture(x.shape[1], model.weights_, model.means_, model.covariances_, np.zeros(components))


def fit_bayesian(x: np.ndarray, y: np.ndarray, components: int, *, ridge: float = 1e-4, seed: int = 0) -> Mixture:
    """Variational posterior under a Dirichlet process, and its predictive Student t distributions (thesis, equation 2.18).

    The posterior of a component is Wishart (nu, W) with precision beta of its mean; its prediction is a Student t distribution
    of nu + 1 - D degrees of freedom and scale (1 + beta) / ((nu + 1 - D) beta) W^-1; scikit-learn's covariance is W^-1 / nu.
    Components without data are dropped. Source: Bishop, Pattern Recognition and Machine Learning (2006), equations 10.81, 10.82.
    """
    model = BayesianGaussianMixture(n_components=components, reg_covar=ridge, random_state=seed, max_iter=300)
    fit(model, np.hstack([x, y]))
    keep = model.weights_ > 0.5 / len(x)
    dims = model.means_.shape[1]
    freedom = model.degrees_of_freedom_ + 1 - dims
    spread = (1 + model.mean_precision_) * model.degrees_of_freedom_ / (freedom * model.mean_precision_)
    weight = model.weights_[keep]
    return Mixture(
        x.shape[1], weight / weight.sum(), model.means_[keep], (spread[:, None, None] * model.covariances_)[keep], freedom[keep]
    )


def fit(model: GaussianMixture | BayesianGaussianMixture, joint: np.ndarray) -> None:
    """Fit in place; iterations that run out are no reason to complain: the held-out error judges the fit."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        model.fit(joint)


def condition(mixture: Mixture) -> Conditional:
    """The mixture conditioned on x (thesis, equations 2.14 to 2.17; for Student t: the same, with the spread of tab_gmr.h)."""
    d, nu = mixture.d, mixture.freedom
    mean_x, mean_y = mixture.mean[:, :d], mixture.mean[:, d:]
    S_xx, S_yx, S_yy = mixture.scale[:, :d, :d], mixture.scale[:, d:, :d], mixture.scale[:, d:, d:]
    lower = np.linalg.cholesky(S_xx)
    linv = np.array([solve_triangular(L, np.eye(d), lower=True) for L in lower])
    slope = S_yx @ linv.transpose(0, 2, 1) @ linv
    var = np.diagonal(S_yy - slope @ S_yx.transpose(0, 2, 1), axis1=1, axis2=2)
    log_det = np.sum(np.log(np.diagonal(lower, axis1=1, axis2=2)), axis=1)
    safe = np.where(nu > 0, nu, 1.0)
    student = gammaln(0.5 * (safe + d)) - gammaln(0.5 * safe) - 0.5 * d * np.log(safe * np.pi)
    normalisation = np.where(nu > 0, student, -0.5 * d * np.log(2 * np.pi))
    return Conditional(np.log(mixture.weight) - log_det + normalisation, nu, mean_x, linv, mean_y, slope, var)


def mixture_table(fitted: Conditional, **rest: object) -> Gmr:
    """The table of a conditioned mixture."""
    return Gmr(log_norm=fitted.log_norm, freedom=fitted.freedom, mean_x=fitted.mean_x, linv=fitted.linv, mean_y=fitted.mean_y,
               slope=fitted.slope, var=fitted.var, **rest)  # fmt: skip
