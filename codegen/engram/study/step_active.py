"""S9.3: active sampling (thesis, 4.4 and 9.2): tasks are added where the memory is worst after one iteration, or at random.

Both memories grow from the same few single steps, in the same bases, round by round. The active one asks of tasks it has not
solved what a full step is still expected to gain after one iteration from its own guess: the solver's own figure, no optimum is
needed. It takes the tasks that tell most about where that gain is large, in the kernel of its own regression.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from engram.data.step_set import StepData
from engram.data.steps import WALKS
from engram.engine import engine
from engram.learn.steps import FROM_WALK, INTO_WALK, StepTables, fit_regression, kernel
from engram.study.report import Report
from engram.study.steps import SETTINGS, TESTED, Tested, draw_tested, learnt_from, load_sets

START, ADDED, ROUNDS, POOL = 40, 40, 8, 300  # steps of both feet together; tasks that are asked in every round
RUNS = 3  # of both, from other first steps
TAIL = 0.9  # quantile of the suboptimality after one iteration


COST, STOP, LENGTH = 0, 1, 2  # columns of the solver's log: cost, expected improvement of a full step, step length


def after_one(problem: engine.TalosSteps, memory: engine.TalosStepMemory, step: tuple) -> tuple[float, float]:
    """Cost after one iteration from the memory's guess, and what a full step is still expected to gain there. A short step, which
    leaves gaps, has no cost: it is that of the second iteration then, infinite if this is short too."""
    feet, goal, foot = step
    problem.set(feet, goal[None], foot)
    found = memory.query(feet, goal, foot, problem.x0)
    log = problem.solve(found["xs"], found["us"], iterations=2, stop=0.0)["log"]
    closed = log[log[:, LENGTH] == 1.0, COST]
    return (float(closed[0]) if len(closed) else np.inf), (max(0.0, float(log[1, STOP])) if len(log) > 1 else 0.0)


def most_telling(covariance: np.ndarray, weight: np.ndarray, noise: float, count: int) -> list[int]:
    """Rows of a Gaussian process (n, n), one by one that which leaves the least sum of `weight` (n) times variance."""
    left, chosen = covariance.copy(), []
    for _ in range(count):
        told = weight @ left**2 / (np.diag(left) + noise)  # by which the sum falls
        told[chosen] = -1.0
        i = int(np.argmax(told))
        chosen.append(i)
        left -= np.outer(left[i], left[i]) / (left[i, i] + noise)
    return chosen


class Grower:
    """A memory of single steps that grows by rows of one data set."""

    def __init__(self, sets: list[StepData], tables: StepTables, pool: int):
        self.tables, self.problem, self.pool = tables, engine.TalosSteps(), pool
        coded = tables.coded
        single = ~coded.x[:, [FROM_WALK, INTO_WALK]].any(axis=1)
        self.x, self.z, self.length = coded.x[single], coded.z[single], tables.regression.length
        held = np.arange(max(map(len, sets[:WALKS]))) % 20 == 19  # as the split of the fit
        self.tasks = [(x[:6].reshape(2, 3), x[6:], foot) for foot in (0, 1)
                      for x, out in zip(sets[foot].X, held, strict=False) if not out]  # fmt: skip

    def memory(self, rows: list[int]) -> engine.TalosStepMemory:
        """The memory of these steps alone, all of them in the regression."""
        settings = replace(SETTINGS, samples=len(rows))
        fitted = fit_regression(self.x[rows], self.z[rows], self.length, settings)
        regression = replace(self.tables.regression, x=fitted.x, alpha=fitted.alpha, mean=fitted.mean, length=self.length)
        return replace(self.tables, regression=regression).memory()

    def worst(self, rows: list[int], rng: np.random.Generator) -> list[int]:
        """Steps to add that tell most about where the memory of `rows` has most to gain. The gain is a square of what is off: its
        root is the weight, or the few worst tasks would take all."""
        memory = self.memory(rows)
        pool = rng.choice(np.setdiff1d(np.arange(len(self.x)), rows), self.pool, replace=False)
        weight = np.sqrt([after_one(self.problem, memory, self.tasks[row])[1] for row in pool])
        known, told = self.x[rows], kernel(self.x[pool], self.x[rows], self.length)
        within = kernel(known, known, self.length) + SETTINGS.noise * np.eye(len(rows))
        covariance = kernel(self.x[pool], self.x[pool], self.length) - told @ np.linalg.solve(within, told.T)
        return [int(pool[i]) for i in most_telling(covariance, weight, SETTINGS.noise, ADDED)]

    def anywhere(self, rows: list[int], rng: np.random.Generator) -> list[int]:
        """Steps to add at random."""
        return [int(i) for i in rng.choice(np.setdiff1d(np.arange(len(self.x)), rows), ADDED, replace=False)]

    def quality(self, rows: list[int], tested: list[Tested]) -> np.ndarray:
        """Suboptimality after one iteration of every tested task."""
        memory = self.memory(rows)
        return np.array([after_one(self.problem, memory, task.step.asked)[0] / task.cost - 1.0 for task in tested])


def grow(
    grower: Grower, add: Callable[[list[int], np.random.Generator], list[int]], tested: list[Tested], rounds: int, run: int
) -> list[tuple[float, float]]:
    """Median and tail after every round."""
    rng = np.random.default_rng([13, run])
    rows = [int(i) for i in rng.choice(len(grower.x), START, replace=False)]
    found = []
    for k in range(rounds):
        quality = grower.quality(rows, tested)
        found.append((float(np.median(quality)), float(np.quantile(quality, TAIL, method="higher"))))
        if k + 1 < rounds:
            rows += add(rows, rng)
    return found


def needed(curve: np.ndarray, level: float, counts: np.ndarray) -> float:
    """Samples at which a falling curve reaches a level, between rounds on logarithmic axes; infinite if it does not."""
    below = np.flatnonzero(curve <= level)
    if len(below) == 0:
        return np.inf
    k = int(below[0])
    if k == 0:
        return float(counts[0])
    share = (np.log(curve[k - 1]) - np.log(level)) / (np.log(curve[k - 1]) - np.log(curve[k]))
    return float(np.exp(np.log(counts[k - 1]) + share * (np.log(counts[k]) - np.log(counts[k - 1]))))


def run(row: str, quick: bool) -> None:
    """Both curves, and how many samples the active memory needs for what the random one has at the end."""
    report = Report(row, "active sampling: steps where the memory is worst, against steps at random (thesis, 4.4 and 9.2)")
    sets, tested = load_sets(quick), draw_tested(20 if quick else TESTED)
    grower, rounds, runs = (
        Grower(sets, learnt_from(quick).tables, POOL // 3 if quick else POOL),
        3 if quick else ROUNDS,
        1 if quick else RUNS,
    )
    curves = {}
    for name, add in (("random", grower.anywhere), ("active", grower.worst)):
        found = [grow(grower, add, tested, rounds, i) for i in range(runs)]
        curves[name] = np.exp(np.mean(np.log(found), axis=0))  # (rounds, 2), geometric mean of the runs
    counts = START + ADDED * np.arange(rounds)
    report.say(f"suboptimality after one iteration, {runs} runs: {'median':>10}{'':>12}{'90 % quantile':>18}")
    report.say(f"{'steps':>8}" + 2 * f"{'random':>12}{'active':>12}")
    for k, n in enumerate(counts):
        values = [curves[name][k, level] for level in (0, 1) for name in ("random", "active")]
        report.say(f"{n:>8}" + "".join(f"{value:>12.2e}" for value in values))
        for name in curves:
            report.figure(f"subopt1.{name}{n}", float(curves[name][k, 0]), n=runs * len(tested))
            report.figure(f"subopt1_q90.{name}{n}", float(curves[name][k, 1]), n=runs * len(tested))
    for level, what in enumerate(("median", "q90")):
        n = needed(curves["active"][:, level], curves["random"][-1, level], counts)
        report.say(f"{what}: what {counts[-1]} steps at random reach takes {n:.0f} active ones")
        if np.isfinite(n):
            report.figure(f"samples_needed.{what}", n / float(counts[-1]), n=runs * len(tested))
    report.close()
