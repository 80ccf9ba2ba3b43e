"""Distinct solutions that learners offer for one task: a mixture and a mixture density network, fitted to stored solutions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engram.emit import Mlp, Table
from engram.engine import engine
from engram.learn.mixture import condition, fit_bayesian, mixture_table
from engram.learn.network import fit_density

COMPONENTS = 40  # of the Bayesian mixture, at most
EPOCHS = 100
WIDEST = 512  # TAB_MLP_MAX_WIDTH of controller/tab/tab_mlp.h: a density of more outputs has no evaluator


def learners(x: np.ndarray, ntask: int, answers: int) -> Iterator[tuple[str, Table]]:
    """Tables from a task to what is decided, from solutions x (n, d) with the task in front: name and table."""
    task, decided = x[:, :ntask], x[:, ntask:]
    domain = dict(
        inputs=[(f"x{k}", "m") for k in range(ntask)], lo=task.min(0), hi=task.max(0), held_out_error=0.0, held_out_text=""
    )
    yield "bgmr", mixture_table(condition(fit_bayesian(task, decided, COMPONENTS)), **domain)
    if answers * (1 + 2 * decided.shape[1]) > WIDEST:
        return
    net = fit_density(task, decided, modes=answers, epochs=EPOCHS)
    yield "mdn", Mlp(center=net.center, width=net.width, weights=net.weights, biases=net.biases, modes=net.modes, **domain)


def offers(table: Table, cost: engine.StudyCost, tasks: np.ndarray, count: int) -> np.ndarray:
    """The `count` most probable answers to each task (tasks, count, d), within the cost's box; the last one again where there are
    fewer."""
    found = engine.Table(table).answers(tasks, count)
    there = np.maximum((found["index"] >= 0).sum(axis=1), 1)
    chosen = np.minimum(np.arange(count), there[:, None] - 1)
    y = np.take_along_axis(found["y"], chosen[:, :, None], axis=1)
    x = np.concatenate([np.broadcast_to(tasks[:, None, :], (*y.shape[:2], tasks.shape[1])), y], axis=2)
    return np.ascontiguousarray(np.clip(x, cost.lo, cost.hi))
