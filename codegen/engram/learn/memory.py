"""The memory of one robot and task: from solved motions to the five tables of controller/memory/memory.h."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engram.emit import Gpr, Knn, Logit, Pca, Rbf, Table
from engram.learn.bow import BowCode, fit_bow_code
from engram.learn.gpr import FittedGpr, fit_gpr, fit_hyperparameters
from engram.learn.timebase import TimeBasis


@dataclass(frozen=True)
class Settings:
    """What a fit may choose."""

    gaussians: int = 18
    components: int = 40  # coefficients of a bow
    weights: tuple[float, float, float, float] = (1.0, 4.0, 1.0, 0.5)  # k-NN: q, p_WT, target z axis, target x axis
    regression_samples: int = 400
    hyperparameter_samples: int = 300
    hyperparameter_outputs: int = 8  # of the end posture and of the bow each
    seed: int = 0


@dataclass(frozen=True)
class Motions:
    """Solved motions. x (n, nq + 9): start q [rad], target p_WT [m], its z and x axes; t (nt,) [s]; q (n, nt, nq); held_out (n,) bool."""

    x: np.ndarray
    t: np.ndarray
    q: np.ndarray
    held_out: np.ndarray

    @property
    def nq(self) -> int:
        """Size of a configuration."""
        return self.q.shape[2]


@dataclass(frozen=True)
class Memory:
    """A fitted memory without its trust; `report`: held-out errors, one (name, value, unit) per line."""

    code: BowCode
    gpr: FittedGpr
    knn: Knn
    tables: list[Table]
    report: list[tuple[str, float, str]]


def features(q: np.ndarray, p_WT: np.ndarray, R_WT: np.ndarray) -> np.ndarray:
    """memory_features of controller/memory/memory_features.h for n tasks: q (n, nq), p_WT (n, 3), R_WT (n, 3, 3)."""
    return np.hstack([q, p_WT, R_WT[:, :, 2], R_WT[:, :, 0]])


def input_names(nq: int) -> list[tuple[str, str]]:
    """Names and units of the features."""
    return (
        [(f"q{i}", "rad") for i in range(nq)]
        + [(f"p_WT_{a}", "m") for a in "xyz"]
        + [(f"R_WT_z{a}", "1") for a in "xyz"]
        + [(f"R_WT_x{a}", "1") for a in "xyz"]
    )


def rms(error: np.ndarray) -> float:
    """Root of the mean square of all entries."""
    return float(np.sqrt(np.mean(np.square(error))))


def fit_memory(motions: Motions, settings: Settings, progress: Callable[[str], None] = lambda text: None) -> Memory:
    """Fit everything but the trust on the motions that are not held out, and measure the errors on those that are."""
    x = np.asarray(motions.x, np.float32).astype(float)
    train, test = ~motions.held_out, motions.held_out
    nq, horizon = motions.nq, float(motions.t[-1])
    n_test = int(test.sum())
    progress(f"bows: {settings.gaussians} Gaussians, {settings.components} components")
    code = fit_bow_code(TimeBasis(settings.gaussians, horizon), motions.t, motions.q[train], settings.components)
    z = code.encode(motions.t, motions.q)
    end = motions.q[:, -1]
    value = np.hstack([end, z])
    decoded = code.decode(z[test], motions.t, motions.q[test][:, 0], end[test])
    code_error = rms(decoded - motions.q[test])

    scale = np.repeat(settings.weights, [nq, 3, 3, 3])
    domain = {"inputs": input_names(nq), "lo": x[train].min(axis=0), "hi": x[train].max(axis=0)}

    def end_error(found: np.ndarray) -> float:
        return float(np.median(np.max(np.abs(found - end[test]), axis=1)))

    nearest = np.array([np.argmin(np.sum(((x[train] - row) * scale) ** 2, axis=1)) for row in x[test]])
    knn_error = end_error(end[train][nearest])
    knn = Knn(
        role="knn", x=x[train], scale=scale, value=value[train], held_out_error=knn_error,
        held_out_text=f"[rad] median largest joint difference of the nearest sample's end on {n_test} held-out motions", **domain,
    )  # fmt: skip

    progress(f"regression: hyperparameters on {settings.hyperparameter_samples}, exported {settings.regression_samples} samples")
    rng = np.random.default_rng(settings.seed)
    chosen = rng.permutation(np.flatnonzero(train))[: settings.regression_samples]
    for_fit = chosen[: settings.hyperparameter_samples]
    outputs = np.r_[0 : min(nq, settings.hyperparameter_outputs), nq : nq + min(code.components, settings.hyperparameter_outputs)]
    normal = (value[:, outputs] - value[train][:, outputs].mean(axis=0)) / value[train][:, outputs].std(axis=0)
    length, noise = fit_hyperparameters(x[for_fit], normal[for_fit], 2.0 / np.maximum(scale, 1e-3))
    gpr = fit_gpr(x[chosen], value[chosen], length, noise)
    mean, variance = gpr.predict(x[test])
    gpr_error = end_error(mean[:, :nq])
    gpr_table = Gpr(
        role="gpr", x=gpr.x, length=gpr.length, variance=gpr.variance, noise=gpr.noise, alpha=gpr.alpha, mean=gpr.mean,
        linv=gpr.linv, held_out_error=gpr_error,
        held_out_text=f"[rad] median largest joint error of the predicted end on {n_test} held-out motions", **domain,
    )  # fmt: skip

    bow = Pca(
        role="bow", mean=code.mean, basis=code.basis, inputs=[(f"z{i}", "1") for i in range(code.components)],
        lo=z[train].min(axis=0), hi=z[train].max(axis=0), held_out_error=code_error,
        held_out_text=f"[rad] rms of a decoded motion on {n_test} held-out motions",
    )  # fmt: skip
    time_error = rms(fit_bow_time_error(code.time, motions.t, motions.q[test]))
    time = Rbf(
        role="time", center=code.time.center, width=code.time.width, channels=nq, inputs=[("t", "s")],
        lo=np.zeros(1), hi=np.array([horizon]), held_out_error=time_error,
        held_out_text=f"[rad] rms of a motion's Gaussians before PCA on {n_test} held-out motions",
    )  # fmt: skip
    report = [
        ("time.rms", time_error, "rad"),
        ("bow.rms", code_error, "rad"),
        ("knn.end", knn_error, "rad"),
        ("gpr.end", gpr_error, "rad"),
        ("gpr.deviation", float(np.median(np.sqrt(variance / (gpr.variance + gpr.noise)))), "1"),
        ("gpr.noise", noise, "1"),
    ]
    return Memory(code, gpr, knn, [knn, gpr_table, bow, time], report)


def fit_bow_time_error(time: TimeBasis, t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Error (n, nt, nq) of motions written as Gaussians alone."""
    all_components = min(len(q), time.k * q.shape[2])
    code = fit_bow_code(time, t, q, all_components)
    return code.decode(code.encode(t, q), t, q[:, 0], q[:, -1]) - q


def constant_trust(probability: float) -> Logit:
    """A trust table that knows nothing but a base rate: the start of its own calibration."""
    names = [("distance", "1"), ("deviation", "1"), ("warp", "rad"), ("regression", "1"), ("line", "1")]
    return Logit(
        role="trust", weight=np.zeros(len(names)), bias=float(np.log(probability / (1 - probability))), inputs=names,
        lo=np.zeros(len(names)), hi=np.array([1e3, 1.0, np.pi, 1.0, 1.0]), held_out_error=0.0, held_out_text="[1] not calibrated",
    )  # fmt: skip
