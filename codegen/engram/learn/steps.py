"""The memory of steps: from the data of `engram data talos step` to the tables of controller/memory/step_memory.h.

The right foot's steps are mirrored into the left's. One PCA of paths and one of torques serve both feet, a regression each.
Torques are compressed in the metric of the problem's own Hessian of u, averaged over steps; the error that is left then costs
least.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engram.data.step_set import StepData
from engram.data.steps import seen_from
from engram.emit import Gpr, Pca
from engram.engine import engine
from engram.learn.gpr import fit_hyperparameters, kernel_matrix

STEPS = engine.TalosSteps
OTHER, SIGN = (np.array(part) for part in engine.TALOS_MIRROR)
BASE = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # TalosMirror::base
MIRROR = np.array([1.0, -1.0, -1.0])  # a pose (x, y, yaw)


@dataclass(frozen=True)
class Settings:
    """What a fit may choose."""

    path: int = 30  # coefficients of dq(t)
    torque: int = 60  # of u(t)
    samples: int = 256  # inducing samples of a regression
    stretch: float = 1.3  # of the length scales of the largest likelihood: the errors of float32 are smaller
    noise: float = 1e-4
    basis_steps: int = 1500  # of each foot, for the PCA
    metric_steps: int = 40
    hyperparameter_samples: int = 300
    hyperparameter_outputs: int = 10


@dataclass(frozen=True)
class Mirrored:
    """Steps as the learners see them: features (n, 6), dq (n, T, nv) at knots 1 .. T, u (n, T, nu); of the left foot."""

    x: np.ndarray
    dq: np.ndarray
    u: np.ndarray


def features(X: np.ndarray, foot: int) -> np.ndarray:
    """step_features of controller/memory/step_memory.h for tasks X (n, 9)."""
    poses = X.reshape(-1, 3, 3)
    seen = np.array([seen_from(task[1 - foot], task[[foot, 2]]) for task in poses])
    return (seen * (MIRROR if foot == 1 else 1.0)).reshape(-1, 6)


def mirrored_dofs(dq: np.ndarray) -> np.ndarray:
    """Tangents (..., nv) seen in a mirror."""
    return np.concatenate([BASE * dq[..., :6], SIGN * dq[..., 6:][..., OTHER]], axis=-1)


def mirrored_controls(u: np.ndarray) -> np.ndarray:
    """Controls (..., nu) seen in a mirror."""
    return SIGN * u[..., OTHER]


def tangents(q: np.ndarray) -> np.ndarray:
    """dq (n, T, nv) = q (-) q_0 at knots 1 .. T of paths q (n, T + 1, nq)."""
    n, knots, nq = q.shape
    start = np.repeat(q[:, :1], knots, axis=1)
    dq = STEPS.difference(np.ascontiguousarray(start.reshape(-1, nq)), np.ascontiguousarray(q.reshape(-1, nq)))
    return dq.reshape(n, knots, -1)[:, 1:]


def mirrored(steps: StepData, foot: int, raw: bool = False) -> Mirrored:
    """Steps of a foot, of stage two or one (raw)."""
    dq, u = tangents(steps.q_raw if raw else steps.q), steps.u_raw if raw else steps.u
    if foot == 1:
        dq, u = mirrored_dofs(dq), mirrored_controls(u)
    return Mirrored(features(steps.X, foot), dq, u)


def control_metric(steps: StepData, count: int) -> np.ndarray:
    """L (T, nu, nu), lower: mean Hessian L L' of the cost in u at each knot, of the first left steps."""
    problem = STEPS()
    total = np.zeros((problem.knots, problem.nu, problem.nu))
    for x, q, u in zip(steps.X[:count], steps.q, steps.u):
        problem.set(x[:6].reshape(2, 3), x[None, 6:], 0)
        along = problem.along(np.ascontiguousarray(q))
        total += problem.linearize(along["xs"], np.ascontiguousarray(u))["Lzz"][:-1, problem.ndx :, problem.ndx :]
    return np.linalg.cholesky(total / min(count, len(steps)) + 1e-9 * np.eye(problem.nu))


@dataclass(frozen=True)
class Basis:
    """PCA: numbers = mean + z @ rows; z = (numbers - mean) @ project, of unit variance."""

    mean: np.ndarray  # (n)
    rows: np.ndarray  # (m, n)
    project: np.ndarray  # (n, m)

    def encode(self, numbers: np.ndarray) -> np.ndarray:
        return (numbers.reshape(len(numbers), -1) - self.mean) @ self.project


def fit_basis(numbers: np.ndarray, components: int) -> Basis:
    """Of numbers (n, ...); the sign of a component is chosen so that its largest entry is positive."""
    flat = numbers.reshape(len(numbers), -1)
    mean = flat.mean(axis=0)
    _, singular, rows = np.linalg.svd(flat - mean, full_matrices=False)
    rows = rows[:components]
    rows = rows * np.sign(rows[np.arange(len(rows)), np.argmax(np.abs(rows), axis=1)])[:, None]
    deviation = singular[: len(rows), None] / np.sqrt(len(flat))
    return Basis(mean, rows * deviation, (rows / deviation).T)


def fit_torque_basis(u: np.ndarray, metric: np.ndarray, components: int) -> Basis:
    """PCA of controls u (n, T, nu) in the metric L (T, nu, nu)."""
    inverse = np.linalg.inv(metric)
    found = fit_basis(np.einsum("nki,kij->nkj", u, metric), components)

    def back(rows: np.ndarray) -> np.ndarray:
        return np.einsum("nkj,kji->nki", rows.reshape(len(rows), *metric.shape[:2]), inverse).reshape(len(rows), -1)

    project = found.project.T.reshape(components, *metric.shape[:2])
    project = np.einsum("mkj,kij->mki", project, metric).reshape(components, -1)
    return Basis(back(found.mean[None])[0], back(found.rows), project.T)


def pivots(x: np.ndarray, length: np.ndarray, count: int) -> np.ndarray:
    """Rows of x (n, d) that a pivoted Cholesky factorization of the kernel takes: where the ones before know least."""
    left, lower, chosen = np.ones(len(x)), np.zeros((count, len(x))), []
    for k in range(count):
        i = int(np.argmax(left))
        chosen.append(i)
        column = kernel_matrix(x[i : i + 1], x, length, 1.0)[0]
        lower[k] = (column - lower[:k, i] @ lower[:k]) / np.sqrt(left[i])
        left = np.maximum(left - lower[k] ** 2, 0.0)
    return np.array(chosen)


@dataclass(frozen=True)
class Regression:
    """A sparse Gaussian process: mean of all samples on `x` (m, 6), variance of these alone (tab_gpr.h)."""

    x: np.ndarray
    length: np.ndarray
    noise: float
    alpha: np.ndarray
    mean: np.ndarray
    linv: np.ndarray


def fit_regression(x: np.ndarray, z: np.ndarray, length: np.ndarray, settings: Settings) -> Regression:
    """Deterministic training conditional (Quinonero-Candela, Rasmussen, JMLR 2005): alpha = (K_mn K_nm + s K_mm)^-1 K_mn z."""
    chosen = pivots(x, length, min(settings.samples, len(x)))
    inducing = np.asarray(x[chosen], np.float32).astype(float)
    K, Kmm = kernel_matrix(inducing, x, length, 1.0), kernel_matrix(inducing, inducing, length, 1.0)
    mean = z.mean(axis=0)
    alpha = np.linalg.solve(K @ K.T + settings.noise * Kmm + 1e-9 * np.eye(len(chosen)), K @ (z - mean))
    linv = np.linalg.inv(np.linalg.cholesky(Kmm + settings.noise * np.eye(len(chosen))))
    return Regression(inducing, length, settings.noise, alpha, mean, linv)


INPUTS = [(f"{what}_{axis}", "rad" if axis == "yaw" else "m") for what in ("start", "goal") for axis in ("x", "y", "yaw")]


@dataclass(frozen=True)
class StepTables:
    """The four tables of a memory of steps."""

    left: Gpr
    right: Gpr
    path: Pca
    torque: Pca

    def memory(self) -> engine.TalosStepMemory:
        """The deployed query on them."""
        return engine.TalosStepMemory(self.left, self.right, self.path, self.torque)


def fit(train: list[StepData], test: list[StepData], settings: Settings, raw: bool = False) -> StepTables:
    """Fit on the left and right feet's steps; errors are of those in `test`."""
    data = [mirrored(steps, foot, raw) for foot, steps in enumerate(train)]
    unseen = [mirrored(steps, foot, raw) for foot, steps in enumerate(test)]
    some = slice(0, settings.basis_steps)
    path = fit_basis(np.concatenate([d.dq[some] for d in data]), settings.path)
    metric = control_metric(train[0], settings.metric_steps)
    torque = fit_torque_basis(np.concatenate([d.u[some] for d in data]), metric, settings.torque)

    def encode(d: Mirrored) -> np.ndarray:
        return np.hstack([path.encode(d.dq), torque.encode(d.u)])

    z, z_test = [encode(d) for d in data], [encode(d) for d in unseen]
    few, leading = (
        slice(0, settings.hyperparameter_samples),
        slice(settings.path, settings.path + settings.hyperparameter_outputs),
    )
    length, _ = fit_hyperparameters(data[0].x[few], z[0][few, leading], np.full(6, 0.5))  # torques change faster than paths
    length = length * settings.stretch
    lo = np.min([d.x.min(axis=0) for d in data], axis=0)
    hi = np.max([d.x.max(axis=0) for d in data], axis=0)

    def table(foot: int, role: str) -> Gpr:
        found = fit_regression(data[foot].x, z[foot], length, settings)
        y = found.mean + kernel_matrix(unseen[foot].x, found.x, length, 1.0) @ found.alpha
        error = float(
            np.sqrt(np.mean((y[:, : settings.path] @ path.rows + path.mean - unseen[foot].dq.reshape(len(y), -1)) ** 2))
        )
        return Gpr(role=role, x=found.x, length=length, variance=1.0, noise=found.noise, alpha=found.alpha, mean=found.mean,
                   linv=found.linv, inputs=INPUTS, lo=lo, hi=hi, held_out_error=error,
                   held_out_text=f"[m, rad] rms of dq on {len(y)} held-out steps")  # fmt: skip

    def basis(role: str, found: Basis, columns: slice, truth: list[np.ndarray], unit: str) -> Pca:
        both, numbers = np.concatenate([part[:, columns] for part in z]), np.concatenate(truth)
        coefficients = np.concatenate([part[:, columns] for part in z_test])
        error = float(np.sqrt(np.mean((found.mean + coefficients @ found.rows - numbers.reshape(len(numbers), -1)) ** 2)))
        return Pca(role=role, mean=found.mean, basis=found.rows, inputs=[(f"z{i}", "1") for i in range(len(found.rows))],
                   lo=both.min(axis=0), hi=both.max(axis=0), held_out_error=error,
                   held_out_text=f"[{unit}] rms of a decoded step on {len(numbers)} held-out steps")  # fmt: skip

    return StepTables(
        table(0, "left"),
        table(1, "right"),
        basis("path", path, slice(0, settings.path), [d.dq for d in unseen], "m, rad"),
        basis("torque", torque, slice(settings.path, None), [d.u for d in unseen], "N m"),
    )
