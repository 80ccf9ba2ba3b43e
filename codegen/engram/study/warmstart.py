"""Tables 7.1 to 7.3: success of a solver from the best of N samples of a train, uniform points, nearest neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engram.engine import engine
from engram.study.report import Report, wilson
from engram.study.trains import SOLVED, Built, lowest, refined, samples, solutions, uniform_points

COUNTS = (1, 10, 100, 1000)
ALPHAS = {0.97: "a097", 0.9: "a09", 0.75: "a075", 0.5: "a05", 0.0: "a0"}  # priorities and their names in figures
CHUNK = 50  # tasks whose points are held at a time


@dataclass(frozen=True)
class Row:
    """Means over tasks: cost of the start, cost after refinement, share that is solved."""

    start: float
    end: float
    success: float

    def text(self) -> str:
        return f"{self.start:6.2f} {self.end:5.2f} {100 * self.success:5.1f}"


def judged(cost: engine.StudyCost, start: np.ndarray, evaluations: int) -> Row:
    """Refines one start of each task."""
    _, c = refined(cost, start, evaluations)
    return Row(float(cost.evaluate(start).mean()), float(c.mean()), float(np.mean(c <= SOLVED)))


def of_train(built: Built, cost: engine.StudyCost, tasks: np.ndarray, alpha: float, count: int, evaluations: int) -> Row:
    """From the best of `count` samples."""
    parts = [tasks[i : i + CHUNK] for i in range(0, len(tasks), CHUNK)]
    start = [lowest(cost, samples(built.train, cost, part, alpha, count))[0] for part in parts]
    return judged(cost, np.concatenate(start), evaluations)


def of_uniform(cost: engine.StudyCost, tasks: np.ndarray, count: int, evaluations: int, seed: int) -> Row:
    """From the best of `count` uniform points."""
    rng = np.random.default_rng(seed)
    parts = [tasks[i : i + CHUNK] for i in range(0, len(tasks), CHUNK)]
    start = [lowest(cost, uniform_points(cost, part, count, rng))[0] for part in parts]
    return judged(cost, np.concatenate(start), evaluations)


class Neighbours:
    """The plain control: stored solutions, in as many bytes as the train takes.

    The first are refined from uniform points, the others from the cheapest of those.
    """

    def __init__(self, cost: engine.StudyCost, draw, recipe, nbytes: int, seed: int):
        room = nbytes // (4 * cost.d)
        rng = np.random.default_rng(seed)
        first = self.x = solutions(cost, draw(rng, 500), recipe, rng)
        while len(self.x) < room:  # most tasks are solved, so this ends
            tasks = draw(rng, 500)
            start = np.repeat(first[None], len(tasks), axis=0)
            start[:, :, : cost.ntask] = tasks[:, None]
            x, c = refined(cost, lowest(cost, start)[0], recipe.start_evaluations or recipe.evaluations)
            self.x = np.concatenate([self.x, x[c <= SOLVED]])
        self.x = self.x[:room].astype(np.float32).astype(float)
        self.range = np.array(cost.hi[: cost.ntask]) - np.array(cost.lo[: cost.ntask])

    def starts(self, cost: engine.StudyCost, task: np.ndarray, count: int) -> np.ndarray:
        """The `count` nearest solutions, with the task put in."""
        distance = np.square((self.x[:, : cost.ntask] - task) / self.range).sum(axis=1)
        x = self.x[np.argsort(distance, kind="stable")[:count]].copy()
        x[:, : cost.ntask] = task
        return x

    def row(self, cost: engine.StudyCost, tasks: np.ndarray, count: int, evaluations: int) -> Row:
        count = min(count, len(self.x))
        x = np.stack([self.starts(cost, task, count) for task in tasks])
        return judged(cost, lowest(cost, x)[0], evaluations)


def modes(cost: engine.StudyCost, starts: np.ndarray, evaluations: int, joints: slice, apart: float = 0.35) -> float:
    """Distinct solutions per task among the refined starts (tasks, count, d): some joint differs by more than `apart` [rad]."""
    tasks, count, d = starts.shape
    x, c = refined(cost, starts.reshape(-1, d), evaluations)
    x, solved, total = x.reshape(tasks, count, d), (c <= SOLVED).reshape(tasks, count), 0
    for i in range(tasks):
        kept: list[np.ndarray] = []
        for q in x[i, solved[i]][:, joints]:
            if all(np.abs(q - other).max() > apart for other in kept):
                kept.append(q)
        total += len(kept)
    return total / tasks


def compare(
    report: Report,
    cost: engine.StudyCost,
    built: Built,
    neighbours: Neighbours,
    validation: np.ndarray,
    test: np.ndarray,
    evaluations: int,
    thesis: dict[str, list[float]],
    counts: tuple[int, ...] = COUNTS,
) -> None:
    """Prints the table beside the thesis' and files its figures. alpha is chosen for each count on the validation tasks."""
    report.say(f"{'start: best of':<22}" + "".join(f"{n:>24}" for n in counts))
    report.say(f"{'':<22}" + "    c_i   c_f    % thesis" * len(counts))

    def line(label: str, key: str, rows: list[Row], old: list[float] | None) -> None:
        old = old or []
        cells = [row.text() + (f" {old[i]:6.1f}" if i < len(old) else " " * 7) for i, row in enumerate(rows)]
        report.say(f"{label:<22}" + "".join(f"{cell:>24}" for cell in cells))
        for n, row in zip(counts, rows, strict=True):
            report.figure(f"success.{key}.n{n}", row.success, n=len(test))

    chosen = {}
    by_alpha = {}
    for alpha, name in ALPHAS.items():
        for n in counts:
            row = of_train(built, cost, validation, alpha, n, evaluations)
            if n not in chosen or (row.success, -row.end) > chosen[n][0]:
                chosen[n] = ((row.success, -row.end), alpha)
        by_alpha[alpha] = [of_train(built, cost, test, alpha, n, evaluations) for n in counts]
        line(f"train, alpha {alpha:g}", name, by_alpha[alpha], thesis.get(name))
    best = [by_alpha[chosen[n][1]][i] for i, n in enumerate(counts)]
    line("train, alpha chosen", "best", best, thesis.get("a09"))
    line("uniform", "uniform", [of_uniform(cost, test, n, evaluations, 7) for n in counts], thesis.get("uniform"))
    line(f"{len(neighbours.x)} neighbours", "knn", [neighbours.row(cost, test, n, evaluations) for n in counts], None)
    report.say("alpha chosen on validation: " + ", ".join(f"{n}: {chosen[n][1]:g}" for n in counts))
    intervals = [wilson(row.success, len(test)) for row in best]
    report.say(f"95 % intervals over {len(test)} tasks: " + ", ".join(f"{100 * a:.1f} .. {100 * b:.1f}" for a, b in intervals))
