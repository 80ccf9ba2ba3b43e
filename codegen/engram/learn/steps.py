"""The memory of steps: from the data of `engram data talos step` to the tables of controller/memory/step_memory.h.

Steps from rest to rest are learnt whole; steps that begin or end under way are cut out of the walks, and have the knots about
their swing alone. The right foot's steps are mirrored into the left's. One PCA of paths and one of torques serve all of them, and
one regression. Torques are compressed in the metric of the problem's own Hessian of u, averaged over steps; the error that is
left then costs least.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from engram.data.step_set import StepData
from engram.data.steps import WALK, WALKS
from engram.emit import Gpr, Pca
from engram.engine import engine
from engram.learn.gpr import fit_hyperparameters, kernel_matrix

STEPS = engine.TalosSteps
OTHER, SIGN = (np.array(part) for part in engine.TALOS_MIRROR)
BASE = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])  # TalosMirror::base
HOME, NV, NU = engine.talos.q_home, engine.talos.nv, engine.talos.nu


@dataclass(frozen=True)
class Settings:
    """What a fit may choose."""

    path: int = 40  # coefficients of dq(t)
    torque: int = 64  # of u(t)
    samples: int = 880  # inducing samples of the regression, half of them steps from rest to rest
    stretch: float = 1.3  # of the length scales of the largest likelihood: the errors of float32 are smaller
    noise: float = 1e-4
    basis_steps: int = 500  # of each kind and foot, for the PCA
    rounds: int = 3  # of the PCA, which fills knots that a step within a walk does not have
    prior: float = 1e-4  # of the coefficients of such a step, which are fewer than its numbers
    metric_steps: int = 40
    hyperparameter_samples: int = 400
    hyperparameter_outputs: int = 10


@dataclass(frozen=True)
class Step:
    """One step as the memory is asked for it (StepTask): feet (2, 3), goal (3), foot; within a walk previous and next (3) too."""

    feet: np.ndarray
    goal: np.ndarray
    foot: int
    previous: np.ndarray | None = None
    next: np.ndarray | None = None

    @property
    def asked(self) -> tuple:
        return self.feet, self.goal, self.foot

    @property
    def within(self) -> dict:
        return {"previous": self.previous, "next": self.next}

    def features(self) -> np.ndarray:
        """step_features of controller/memory/step_memory.h (15)."""
        return engine.TalosStepMemory.features(*self.asked, **self.within)

    def level(self) -> np.ndarray:
        """step_level there (nq)."""
        q, yaw = np.array(HOME), self.feet[:, 2].mean()
        q[:2] = self.feet[:, :2].mean(axis=0)
        q[3:7] = 0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)
        return q


def steps_of(feet: np.ndarray, goals: np.ndarray, first: int) -> list[Step]:
    """The steps of a walk from feet (2, 3) to goals (n, 3), `first` foot first; of a single one, if there is one goal."""
    stood, steps = [feet.copy()], []
    for i, goal in enumerate(goals):
        now = stood[-1].copy()
        now[(first + i) % 2] = goal
        stood.append(now)
    for i, goal in enumerate(goals):
        foot = (first + i) % 2
        previous = stood[i - 1][1 - foot] if i > 0 else None
        following = goals[i + 1] if i + 1 < len(goals) else None
        steps.append(Step(stood[i], goal, foot, previous, following))
    return steps


def mirrored_dofs(dq: np.ndarray) -> np.ndarray:
    """Tangents (..., nv) seen in a mirror."""
    return np.concatenate([BASE * dq[..., :6], SIGN * dq[..., 6:][..., OTHER]], axis=-1)


def mirrored_controls(u: np.ndarray) -> np.ndarray:
    """Controls (..., nu) seen in a mirror."""
    return SIGN * u[..., OTHER]


@dataclass(frozen=True)
class Steps:
    """Steps of one kind (single, first, middle, last) as the learners see them, all of the left foot: features x (n, 15),
    dq (n, T + 1, nv) about `level` and u (n, T, nu) at knots first .. first + T of a step from rest to rest."""

    x: np.ndarray
    dq: np.ndarray
    u: np.ndarray
    first: int

    @property
    def dq_columns(self) -> slice:
        """Of a step from rest to rest, flat."""
        return slice(self.first * NV, (self.first + self.dq.shape[1]) * NV)

    @property
    def u_columns(self) -> slice:
        return slice(self.first * NU, (self.first + self.u.shape[1]) * NU)


def cut(data: StepData, step: int, raw: bool, count: int) -> Steps:
    """Step number `step` of every task with `count` of them, mirrored where the right foot swings."""
    period = STEPS.swing + STEPS.between
    here = 0 if step == 0 else STEPS.before + step * period - STEPS.between // 2
    end = STEPS.knots + (count - 1) * period if step == count - 1 else STEPS.before + (step + 1) * period - STEPS.between // 2
    whole_q, whole_u = (data.q_raw, data.u_raw) if raw else (data.q, data.u)
    steps = [
        steps_of(x[:6].reshape(2, 3), x[6:].reshape(-1, 3), int(first))[step] for x, first in zip(data.X, data.first, strict=True)
    ]
    q = np.asarray(whole_q[:, here : end + 1], float)
    level = np.repeat(np.array([s.level() for s in steps])[:, None], q.shape[1], axis=1)
    dq = STEPS.difference(np.ascontiguousarray(level.reshape(-1, q.shape[2])), np.ascontiguousarray(q.reshape(-1, q.shape[2])))
    dq, u = dq.reshape(*q.shape[:2], NV), np.asarray(whole_u[:, here:end], float)
    right = np.array([s.foot == 1 for s in steps])
    dq[right], u[right] = mirrored_dofs(dq[right]), mirrored_controls(u[right])
    return Steps(np.array([s.features() for s in steps]), dq, u, here - step * period)


def learnt(sets: list[StepData], raw: bool = False) -> list[Steps]:
    """Single steps of the left and of the right foot; first, middle and last steps of the walks."""
    single = [cut(data, 0, raw, 1) for data in sets[:WALKS]]
    return single + [cut(sets[WALKS], i, raw, WALK) for i in range(WALK)]


def control_metric(steps: StepData, count: int) -> np.ndarray:
    """L (T, nu, nu), lower: mean Hessian L L' of the cost in u at each knot, of the first left steps."""
    problem = STEPS()
    total = np.zeros((problem.knots, problem.nu, problem.nu))
    for x, q, u in zip(steps.X[:count], steps.q, steps.u):
        problem.set(x[:6].reshape(2, 3), x[None, 6:], 0)
        along = problem.along(np.ascontiguousarray(q, float))
        total += problem.linearize(along["xs"], np.ascontiguousarray(u, float))["Lzz"][:-1, problem.ndx :, problem.ndx :]
    return np.linalg.cholesky(total / min(count, len(steps)) + 1e-9 * np.eye(problem.nu))


@dataclass(frozen=True)
class Basis:
    """PCA: numbers (n) = mean + z @ rows, z of unit variance; metric L (T, d, d) weighs their errors, if there is one."""

    mean: np.ndarray
    rows: np.ndarray  # (m, n)
    metric: np.ndarray | None

    def encode(self, numbers: np.ndarray, columns: slice, prior: float) -> np.ndarray:
        """z (k, m) of numbers (k, columns): what is left is least in the metric."""
        rows, left = weighed(self.rows[:, columns], self.metric, columns), numbers.reshape(len(numbers), -1) - self.mean[columns]
        left = weighed(left, self.metric, columns)
        gram = rows @ rows.T
        return np.linalg.solve(gram + prior * np.trace(gram) / len(gram) * np.eye(len(gram)), rows @ left.T).T


def weighed(rows: np.ndarray, metric: np.ndarray | None, columns: slice) -> np.ndarray:
    """Numbers (k, columns) of knots, times the metric of these knots."""
    if metric is None:
        return rows
    d = metric.shape[1]
    part = metric[columns.start // d : columns.stop // d]
    return np.einsum("nki,kij->nkj", rows.reshape(len(rows), -1, d), part).reshape(len(rows), -1)


def fit_basis(
    parts: list[tuple[np.ndarray, slice]], size: int, components: int, rounds: int, metric: np.ndarray | None = None
) -> Basis:
    """PCA of parts (n, columns) of vectors of `size` numbers: what is missing is what the round before says (expectation
    maximization; Roweis, NIPS 1997). The sign of a component is chosen so that its largest entry is positive."""
    count = sum(len(numbers) for numbers, _ in parts)
    flat, known = np.zeros((count, size)), np.zeros((count, size), bool)
    at = 0
    for numbers, columns in parts:
        flat[at : at + len(numbers), columns] = numbers.reshape(len(numbers), -1)
        known[at : at + len(numbers), columns] = True
        at += len(numbers)
    mean = flat.sum(axis=0) / known.sum(axis=0)
    flat = np.where(known, flat, mean)
    for k in range(rounds):
        mean = flat.mean(axis=0)
        seen = weighed(flat - mean, metric, slice(0, size))
        value, vector = eigh(seen.T @ seen / count, subset_by_index=[size - components, size - 1])
        rows = vector.T[::-1]
        rows = rows * np.sign(rows[np.arange(len(rows)), np.argmax(np.abs(rows), axis=1)])[:, None]
        rows = rows * np.sqrt(value[::-1])[:, None]
        if metric is not None:
            inverse = np.linalg.inv(metric)
            rows = weighed(rows, inverse, slice(0, size))
        basis = Basis(mean, rows, metric)
        if k + 1 == rounds:
            break
        at = 0
        for numbers, columns in parts:
            if columns != slice(0, size):
                z = basis.encode(numbers, columns, 1e-6)
                missing = np.ones(size, bool)
                missing[columns] = False
                flat[at : at + len(numbers), missing] = (mean + z @ rows)[:, missing]
            at += len(numbers)
    return basis


def kernel(a: np.ndarray, b: np.ndarray, length: np.ndarray) -> np.ndarray:
    """The kernel (len(a), len(b)), a few rows at a time."""
    return np.vstack([kernel_matrix(a[i : i + 64], b, length, 1.0) for i in range(0, len(a), 64)])


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
    """A sparse Gaussian process: mean of all samples on `x` (m, 15)."""

    x: np.ndarray
    length: np.ndarray
    noise: float
    alpha: np.ndarray
    mean: np.ndarray


def fit_regression(x: np.ndarray, z: np.ndarray, length: np.ndarray, settings: Settings) -> Regression:
    """Deterministic training conditional (Quinonero-Candela, Rasmussen, JMLR 2005): alpha = (K_mn K_nm + s K_mm)^-1 K_mn z."""
    walking = x[:, [FROM_WALK, INTO_WALK]].any(axis=1)
    kinds = [rows for rows in (np.flatnonzero(~walking), np.flatnonzero(walking)) if len(rows)]
    share = settings.samples // len(kinds)
    chosen = np.concatenate([rows[pivots(x[rows], length, min(share, len(rows)))] for rows in kinds])
    inducing = np.asarray(x[chosen], np.float32).astype(float)
    K, Kmm = kernel(inducing, x, length), kernel(inducing, inducing, length)
    mean = z.mean(axis=0)
    alpha = np.linalg.solve(K @ K.T + settings.noise * Kmm + 1e-9 * np.eye(len(chosen)), K @ (z - mean))
    return Regression(inducing, length, settings.noise, alpha, mean)


FROM_WALK, INTO_WALK = 12, 13  # of the features
POSES = ("start", "goal", "previous", "next")
INPUTS = [(f"{what}_{axis}", "rad" if axis == "yaw" else "m") for what in POSES for axis in ("x", "y", "yaw")]
INPUTS += [("from_walk", "1"), ("into_walk", "1"), ("foot", "1")]


@dataclass(frozen=True)
class Coded:
    """What every learner learns: features x (n, 15) -> coefficients z (n, m) of two bases."""

    x: np.ndarray
    z: np.ndarray
    path: Basis
    torque: Basis


@dataclass(frozen=True)
class StepTables:
    """The three tables of a memory of steps."""

    regression: Gpr
    path: Pca
    torque: Pca
    coded: Coded  # what the regression was fitted on

    @property
    def all(self) -> tuple[Gpr, Pca, Pca]:
        return self.regression, self.path, self.torque

    def memory(self) -> engine.TalosStepMemory:
        """The deployed query on them."""
        return engine.TalosStepMemory(*self.all)


def encode(seen: list[Steps], path: Basis, torque: Basis, settings: Settings) -> np.ndarray:
    """Coefficients (n, m) of steps of several kinds."""
    return np.vstack(
        [
            np.hstack([path.encode(s.dq, s.dq_columns, settings.prior), torque.encode(s.u, s.u_columns, settings.prior)])
            for s in seen
        ]
    )


def code(seen: list[Steps], metric: np.ndarray, settings: Settings) -> Coded:
    """Fit the bases, and encode all steps."""
    some = slice(0, settings.basis_steps)
    path = fit_basis([(s.dq[some], s.dq_columns) for s in seen], (STEPS.knots + 1) * NV, settings.path, settings.rounds)
    torque = fit_basis([(s.u[some], s.u_columns) for s in seen], STEPS.knots * NU, settings.torque, settings.rounds, metric)
    return Coded(np.vstack([s.x for s in seen]), encode(seen, path, torque, settings), path, torque)


def length_scales(coded: Coded, settings: Settings) -> np.ndarray:
    """Of the largest likelihood (15)."""
    every = max(1, len(coded.x) // settings.hyperparameter_samples)
    leading = slice(settings.path, settings.path + settings.hyperparameter_outputs)  # torques change faster than paths
    length, _ = fit_hyperparameters(coded.x[::every], coded.z[::every, leading], np.full(coded.x.shape[1], 0.5))
    return length * settings.stretch


def fit(train: list[StepData], test: list[StepData], settings: Settings, raw: bool = False) -> StepTables:
    """Fit on the left and right feet's steps and on the walks; errors are of those in `test`."""
    seen, unseen = learnt(train, raw), learnt(test, raw)
    coded = code(seen, control_metric(train[0], settings.metric_steps), settings)
    found = fit_regression(coded.x, coded.z, length_scales(coded, settings), settings)
    truth = encode(unseen, coded.path, coded.torque, settings)

    def rms(z: np.ndarray, basis: Basis, columns: list[slice], numbers: list[np.ndarray]) -> float:
        total, at = [], 0
        for part, kept in zip(numbers, columns, strict=True):
            said = basis.mean[kept] + z[at : at + len(part)] @ basis.rows[:, kept]
            total.append((said - part.reshape(len(part), -1)).ravel() ** 2)
            at += len(part)
        return float(np.sqrt(np.mean(np.concatenate(total))))

    n = sum(len(s.x) for s in unseen)
    paths = ([s.dq_columns for s in unseen], [s.dq for s in unseen])
    torques = ([s.u_columns for s in unseen], [s.u for s in unseen])
    said = found.mean + kernel(np.vstack([s.x for s in unseen]), found.x, found.length) @ found.alpha
    regression = Gpr(role="regression", x=found.x, length=found.length, variance=1.0, noise=found.noise, alpha=found.alpha,
                     mean=found.mean, linv=None, inputs=INPUTS, lo=coded.x.min(axis=0), hi=coded.x.max(axis=0),
                     held_out_error=rms(said[:, : settings.path], coded.path, *paths),
                     held_out_text=f"[m, rad] rms of dq on {n} held-out steps")  # fmt: skip

    def basis(role: str, found: Basis, z: np.ndarray, z_test: np.ndarray, parts: tuple, unit: str) -> Pca:
        return Pca(role=role, mean=found.mean, basis=found.rows, inputs=[(f"z{i}", "1") for i in range(len(found.rows))],
                   lo=z.min(axis=0), hi=z.max(axis=0), held_out_error=rms(z_test, found, *parts),
                   held_out_text=f"[{unit}] rms of a decoded step on {n} held-out steps")  # fmt: skip

    cols = slice(0, settings.path), slice(settings.path, None)
    return StepTables(regression, basis("path", coded.path, coded.z[:, cols[0]], truth[:, cols[0]], paths, "m, rad"),
                      basis("torque", coded.torque, coded.z[:, cols[1]], truth[:, cols[1]], torques, "N m"), coded)  # fmt: skip
