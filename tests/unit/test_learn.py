"""Learning on smooth synthetic motions: compression, regression, determinism."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from engram.learn.bow import fit_bow_code
from engram.learn.gpr import fit_gpr, fit_hyperparameters, round_digits
from engram.learn.timebase import TimeBasis

T = 1.5
TIMES = np.linspace(0, T, 51)
TIME = TimeBasis(18, T)


def minimum_jerk(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Task x (n, 4) and motions q (n, 51, 2) from start to goal with a bow."""
    x = np.random.default_rng(seed).uniform(-1, 1, (n, 4))
    r = TIMES / T
    s = (10 * r**3 - 15 * r**4 + 6 * r**5)[None, :, None]
    start, goal = x[:, None, :2], x[:, None, 2:]
    return x, start + s * (goal - start) + 0.3 * np.sin(np.pi * s) * start * goal


def test_gaussians_restore_smooth_motions_and_their_ends() -> None:
    _, q = minimum_jerk(50)
    weights = TIME.fit(TIMES, q)
    back = np.einsum("tk,nkc->ntc", TIME.phi(TIMES), weights)
    np.testing.assert_allclose(back[:, [0, -1]], q[:, [0, -1]], atol=1e-10)  # pinned, up to rounding of the KKT system
    assert np.abs(back - q).max() < 1e-3  # rad: 18 Gaussians follow a minimum-jerk motion
    constant = TIME.fit(TIMES, np.full((1, 51, 1), 0.7))
    np.testing.assert_allclose(constant, 0.7, atol=1e-6)  # the ridge pulls by 1e-8


def test_a_bow_decodes_to_its_motion_and_vanishes_at_the_ends() -> None:
    _, q = minimum_jerk(200)
    code = fit_bow_code(TIME, TIMES, q, 2)  # the data bow in two ways
    z = code.encode(TIMES, q)
    assert np.abs(code.decode(z, TIMES, q[:, 0], q[:, -1]) - q).max() < 2e-3  # rad
    np.testing.assert_allclose(z.std(axis=0), 1.0, rtol=1e-9)  # coefficients in units of their spread
    np.testing.assert_allclose(z.mean(axis=0), 0.0, atol=1e-9)
    ends = np.random.default_rng(1).normal(size=(2, 200, 2))
    anything = np.random.default_rng(2).normal(size=z.shape)
    bent = code.decode(anything, TIMES, *ends)
    np.testing.assert_allclose(bent[:, [0, -1]].transpose(1, 0, 2), ends, atol=1e-9)  # rounding of the KKT system


def test_more_components_never_fit_worse() -> None:
    rng = np.random.default_rng(3)
    q = minimum_jerk(100)[1] + 0.2 * np.sin(np.pi * np.outer(rng.uniform(1, 4, 100), TIMES))[:, :, None] * rng.normal(size=(100, 1, 2))
    errors = []
    for m in (2, 4, 8, 16):
        code = fit_bow_code(TIME, TIMES, q, m)
        errors.append(np.abs(code.decode(code.encode(TIMES, q), TIMES, q[:, 0], q[:, -1]) - q).mean())
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.2 * errors[0]


def test_gpr_equals_scikit_learn() -> None:
    x, q = minimum_jerk(80)
    z = q[:, 25]
    length, noise = np.array([0.9, 1.1, 2.0, 0.7]), 1e-3
    own = fit_gpr(x, z, length, noise)
    kernel = ConstantKernel(1.0, "fixed") * RBF(length, "fixed") + WhiteKernel(noise, "fixed")
    x32 = x.astype(np.float32).astype(float)
    reference = GaussianProcessRegressor(kernel, optimizer=None, alpha=0.0).fit(x32, z - z.mean(axis=0))
    query = np.random.default_rng(5).uniform(-1.3, 1.3, (100, 4))
    mean, std = reference.predict(query, return_std=True)
    own_mean, own_var = own.predict(query)
    np.testing.assert_allclose(own_mean, mean + z.mean(axis=0), atol=1e-9)  # condition 1e5 times double rounding
    np.testing.assert_allclose(own_var, std[:, 0] ** 2, atol=1e-9)


def test_hyperparameters_find_the_inputs_that_matter() -> None:
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (150, 3))
    z = np.sin(4 * x[:, :1])  # the first input alone
    length, noise = fit_hyperparameters(x, (z - z.mean(0)) / z.std(0), np.ones(3))
    assert length[0] < 1 and np.all(length[1:] > 5) and noise < 0.05
    again = fit_hyperparameters(x, (z - z.mean(0)) / z.std(0), np.ones(3))
    assert np.array_equal(length, again[0]) and noise == again[1]


@pytest.mark.parametrize(("value", "rounded"), [(1.23456, 1.23), (0.00098765, 0.000988), (98765.0, 98800.0)])
def test_rounding_to_digits(value: float, rounded: float) -> None:
    assert round_digits(value) == pytest.approx(rounded, rel=1e-12)
