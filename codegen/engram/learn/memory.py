"""The memory of one robot and task: from solved motions to the tables of controller/memory/memory.h."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from engram.emit import Gmr, Gpr, Knn, Pca, Rbf, Table, Tt
from engram.learn.bow import BowCode, Dynamics, fit_bow_code, straight
from engram.learn.gpr import FittedGpr, fit_gpr, fit_hyperparameters
from engram.learn.mixture import condition, fit_bayesian, mixture_table
from engram.learn.timebase import TimeBasis

MODES = 4  # of a learner that the controller asks for: kMemoryModes of controller/memory/memory.h


@dataclass(frozen=True)
class Settings:
    """What a fit may choose."""

    gaussians: int = 22
    width: float = 1.3  # of a Gaussian, in spacings of their centres
    components: int = 57  # coefficients of a bow
    weights: tuple[float, float, float, float] = (1.0, 4.0, 1.0, 0.5)  # k-NN: q, p_WT, target z axis, target x axis
    regression_samples: int = 500
    mixture_components: int = 24
    mixture_leading: int = 12  # coefficients of the bow that the mixture predicts
    hyperparameter_samples: int = 300
    hyperparameter_outputs: int = 10  # leading coefficients of the bow
    seed: int = 0


@dataclass(frozen=True)
class Motions:
    """Solved: x (n, nq + 9) start q [rad], target p_WT [m], its z and x axes; t (nt,) [s]; q (n, nt, nq); u (n, nt - 1, nu).

    held_out (n,): kept for judging a fit.
    """

    x: np.ndarray
    t: np.ndarray
    q: np.ndarray
    u: np.ndarray
    held_out: np.ndarray

    @property
    def nq(self) -> int:
        """Size of a configuration."""
        return self.q.shape[2]


@dataclass(frozen=True)
class Ensemble:
    """What the controller asks for (MemoryOpts of controller/memory/memory.h). learners: tables whose answers are modes."""

    neighbours: int = 0
    learners: tuple[Table, ...] = ()
    trains: int = 0
    regression: bool = False
    lines: int = 3

    def __or__(self, other: Ensemble) -> Ensemble:
        """Both."""
        return Ensemble(
            max(self.neighbours, other.neighbours), self.learners + other.learners, max(self.trains, other.trains),
            self.regression or other.regression,
        )  # fmt: skip


@dataclass(frozen=True)
class Memory:
    """A fitted memory without its trust; report: held-out errors, one (name, value, unit) per line; train: of learn/train.py."""

    code: BowCode
    regression: FittedGpr
    knn: Knn
    gpr: Gpr
    bow: Pca
    time: Rbf
    mixture: Gmr
    report: list[tuple[str, float, str]]
    train: Tt | None = None
    ensemble: Ensemble = field(default_factory=lambda: Ensemble())


def deployed(name: str, memory: Memory, trust: Table) -> tuple[list[Table], str]:
    """The tables to write for robot_task `name`, and the initializer of their MemoryTables (controller/memory/memory.h)."""
    ask = memory.ensemble
    train = [memory.train] if ask.trains else []
    first = [memory.knn, memory.gpr, memory.bow, memory.time, trust]
    tables = [*first, *ask.learners, *train]

    def address(table: Table) -> str:
        return f"&{name}_{table.role}_v{table.schema}"

    learners = ", ".join(f"{address(table)}.head" for table in ask.learners)
    counts = f"{ask.neighbours}, {MODES}, {ask.trains}, {ask.lines}, {str(ask.regression).lower()}"
    ends = address(memory.train) if train else "nullptr"
    return tables, f"{{{', '.join(map(address, first))}, {{{learners}}}, {ends}, {{{counts}}}}}"


def features(q: np.ndarray, p_WT: np.ndarray, R_WT: np.ndarray) -> np.ndarray:
    """memory_features of controller/memory/memory_features.h for n tasks: q (n, nq), p_WT (n, 3), R_WT (n, 3, 3)."""
    return np.hstack([q, p_WT, R_WT[:, :, 2], R_WT[:, :, 0]])


def bow_features(start: np.ndarray, end: np.ndarray, p_WT: np.ndarray) -> np.ndarray:
    """memory_bow_features of the same file: start, end (n, nq), p_WT (n, 3)."""
    return np.hstack([start, end, p_WT])


def posture_names(prefix: str, nq: int) -> list[tuple[str, str]]:
    """Names and units of a posture's joints."""
    return [(f"{prefix}{i}", "rad") for i in range(nq)]


def vector_names(prefix: str, unit: str) -> list[tuple[str, str]]:
    """Names and units of a vector."""
    return [(f"{prefix}{a}", unit) for a in "xyz"]


def rms(error: np.ndarray) -> float:
    """Root of the mean square of all entries."""
    return float(np.sqrt(np.mean(np.square(error))))


def fit_memory(
    motions: Motions, dynamics: Dynamics, settings: Settings, progress: Callable[[str], None] = lambda text: None
) -> Memory:
    """Fit everything but the trust on the motions that are not held out, and measure the errors on those that are."""
    x = np.asarray(motions.x, np.float32).astype(float)
    train, test = ~motions.held_out, motions.held_out
    nq, horizon = motions.nq, float(motions.t[-1])
    n_test = int(test.sum())
    progress(f"bows: {settings.gaussians} Gaussians, {settings.components} components")
    basis = TimeBasis(settings.gaussians, horizon, settings.width)
    code = fit_bow_code(basis, motions.t, motions.q[train], motions.u[train], dynamics, settings.components)
    z = code.encode(motions.t, motions.q)
    end = motions.q[:, -1]
    decoded = code.decode(z[test], motions.t, motions.q[test][:, 0], end[test])
    code_error = rms(decoded - motions.q[test])

    scale = np.repeat(settings.weights, [nq, 3, 3, 3])
    nearest = np.array([np.argmin(np.sum(((x[train] - row) * scale) ** 2, axis=1)) for row in x[test]])
    knn_error = float(np.median(np.max(np.abs(end[train][nearest] - end[test]), axis=1)))
    knn = Knn(
        role="knn", x=x[train], scale=scale, value=np.hstack([end, z])[train],
        inputs=posture_names("q", nq) + vector_names("p_WT_", "m") + vector_names("R_WT_z", "1") + vector_names("R_WT_x", "1"),
        lo=x[train].min(axis=0), hi=x[train].max(axis=0), held_out_error=knn_error,
        held_out_text=f"[rad] median largest joint difference of the nearest sample's end on {n_test} held-out motions",
    )  # fmt: skip

    progress(f"mixture: {settings.mixture_components} components")
    answer = np.hstack([end, z[:, : settings.mixture_leading]])
    fitted = condition(fit_bayesian(x[train], answer[train], settings.mixture_components, seed=settings.seed))
    h, modes, _ = fitted.predict(x[test])
    likely = np.take_along_axis(modes, np.argsort(-h, axis=1, kind="stable")[:, :MODES, None], axis=1)[:, :, :nq]
    mixture_error = float(np.median(np.abs(likely - end[test][:, None]).max(axis=2).min(axis=1)))
    mixture = mixture_table(
        fitted, role="gmr", inputs=knn.inputs, lo=knn.lo, hi=knn.hi, held_out_error=mixture_error,
        held_out_text=f"[rad] median largest joint difference of the nearest of {MODES} modes' ends on {n_test} held-out motions",
    )  # fmt: skip

    progress(f"regression: hyperparameters on {settings.hyperparameter_samples}, exported {settings.regression_samples} samples")
    ends = bow_features(motions.q[:, 0], end, x[:, nq : nq + 3])
    chosen = np.random.default_rng(settings.seed).permutation(np.flatnonzero(train))[: settings.regression_samples]
    for_fit = chosen[: settings.hyperparameter_samples]
    length, noise = fit_hyperparameters(
        ends[for_fit], z[for_fit][:, : settings.hyperparameter_outputs], np.full(ends.shape[1], 2.0)
    )
    gpr = fit_gpr(ends[chosen], z[chosen], length, noise)
    mean, variance = gpr.predict(ends[test])
    gpr_error = rms(code.decode(mean, motions.t, motions.q[test][:, 0], end[test]) - motions.q[test])
    gpr_table = Gpr(
        role="gpr", x=gpr.x, length=gpr.length, variance=gpr.variance, noise=gpr.noise, alpha=gpr.alpha, mean=gpr.mean,
        linv=gpr.linv, inputs=posture_names("start", nq) + posture_names("end", nq) + vector_names("p_WT_", "m"),
        lo=ends[train].min(axis=0), hi=ends[train].max(axis=0), held_out_error=gpr_error,
        held_out_text=f"[rad] rms of a motion between its true ends, its bow predicted, on {n_test} held-out motions",
    )  # fmt: skip

    table_mean, table_basis = code.table()
    bow = Pca(
        role="bow", mean=table_mean, basis=table_basis, inputs=[(f"z{i}", "1") for i in range(code.components)],
        lo=z[train].min(axis=0), hi=z[train].max(axis=0), held_out_error=code_error,
        held_out_text=f"[rad] rms of a decoded motion on {n_test} held-out motions",
    )  # fmt: skip
    time_error = rms(time_residual(code.time, motions.t, motions.q[test]))
    time = Rbf(
        role="time", center=code.time.center, width=code.time.width, channels=nq + motions.u.shape[2], inputs=[("t", "s")],
        lo=np.zeros(1), hi=np.array([horizon]), held_out_error=time_error,
        held_out_text=f"[rad] rms of a motion's Gaussians before PCA on {n_test} held-out motions",
    )  # fmt: skip
    report = [
        ("time.rms", time_error, "rad"),
        ("bow.rms", code_error, "rad"),
        ("knn.end", knn_error, "rad"),
        ("gmr.end", mixture_error, "rad"),
        ("gpr.rms", gpr_error, "rad"),
        ("gpr.deviation", float(np.median(np.sqrt(variance / (gpr.variance + gpr.noise)))), "1"),
        ("gpr.noise", noise, "1"),
    ]
    return Memory(code, gpr, knn, gpr_table, bow, time, mixture, report)


def time_residual(time: TimeBasis, t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Error (n, nt, nq) of bows written as Gaussians over time, without PCA."""
    bow = q - straight(t, time.horizon, q[:, 0], q[:, -1])
    return np.einsum("tk,nkc->ntc", time.phi(t), time.fit(t, bow)) - bow
