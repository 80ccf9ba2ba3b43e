"""Trust: how probable it is that the solver succeeds from a guess, calibrated by trying guesses on held-out tasks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score

from engram.emit import Logit
from engram.learn.gpr import round_digits

# of memory_features.h
INPUTS = [
    ("distance", "1"), ("deviation", "1"), ("warp", "rad"), ("regression", "1"), ("line", "1"), ("mixture", "1"), ("train", "1"),
    ("network", "1"),
]  # fmt: skip


@dataclass(frozen=True)
class Trials:
    """Guesses that were tried. task (n,), inputs (n, 8) as memory_trust_inputs makes them, good (n,) bool."""

    task: np.ndarray
    inputs: np.ndarray
    good: np.ndarray


def constant_trust(probability: float) -> Logit:
    """A table that knows a base rate only: what the guesses of a calibration are made with."""
    d = len(INPUTS)
    return Logit(
        role="trust", weight=np.zeros(d), bias=float(np.log(probability / (1 - probability))), inputs=INPUTS,
        lo=np.zeros(d), hi=np.full(d, 1e3), held_out_error=0.0, held_out_text="[1] not calibrated",
    )  # fmt: skip


def fit_logistic(inputs: np.ndarray, good: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights and bias, to three digits; inputs are standardized for the ridge."""
    mean, std = inputs.mean(axis=0), np.maximum(inputs.std(axis=0), 1e-9)
    model = LogisticRegression(C=1.0, max_iter=1000).fit((inputs - mean) / std, good)
    weight = model.coef_[0] / std
    return round_digits(weight), float(round_digits(model.intercept_[0] - weight @ mean))


def probability(weight: np.ndarray, bias: float, inputs: np.ndarray) -> np.ndarray:
    """What controller/tab/tab_logit.h computes inside the domain."""
    return 1 / (1 + np.exp(-(bias + inputs @ weight)))


def fit_trust(trials: Trials) -> tuple[Logit, list[tuple[str, float, str]]]:
    """The trust table and its held-out figures: fitted on two tasks of three, judged on the third, then fitted on all."""
    if trials.good.all() or not trials.good.any():
        return constant_trust(np.clip(trials.good.mean(), 0.01, 0.99)), [("trust.good", float(trials.good.mean()), "1")]
    test = trials.task % 3 == 2
    weight, bias = fit_logistic(trials.inputs[~test], trials.good[~test])
    p, good = probability(weight, bias, trials.inputs[test]), trials.good[test]
    brier = float(np.mean((p - good) ** 2))
    auc = float(roc_auc_score(good, p)) if 0 < good.mean() < 1 else float("nan")
    weight, bias = fit_logistic(trials.inputs, trials.good)
    table = Logit(
        role="trust", weight=weight, bias=bias, inputs=INPUTS, lo=trials.inputs.min(axis=0), hi=trials.inputs.max(axis=0),
        held_out_error=brier, held_out_text=f"[1] Brier score of the success of {len(good)} guesses on held-out tasks",
    )  # fmt: skip
    report = [
        ("trust.good", float(trials.good.mean()), "1"),
        ("trust.brier", brier, "1"),
        ("trust.brier_of_base_rate", float(np.mean((good.mean() - good) ** 2)), "1"),
        ("trust.auc", auc, "1"),
    ]
    return table, report
