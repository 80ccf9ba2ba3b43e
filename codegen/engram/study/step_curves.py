"""S9.1: judging warm starts of a step by more than a count: cost against iteration, quality against samples and against bytes.

All learners map the same features to the same coefficients and are asked through the compiled evaluators of their tables. `shift`
is the plan of before the step was asked for: the robot stands. `ensemble` is what a controller takes: the lowest merit of all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engram.emit import Table
from engram.engine import engine
from engram.learn.contenders import network_table
from engram.learn.network import fit_ensemble
from engram.learn.step_fit import nbytes
from engram.learn.steps import StepTables, fit_regression
from engram.study.report import Report
from engram.study.step_train import StepTrain, worth
from engram.study.steps import (
    SETTINGS,
    TESTED,
    VARIED,
    Count,
    Learners,
    Tested,
    draw_tested,
    learnt_from,
    load_sets,
    shared,
)

ITERATIONS = 8
SAMPLES = (100, 300, 1000)  # steps of a foot, half as many walks
INDUCING = (64, 128, 256, 512, 880)  # samples of the regression: bytes
HIDDEN, EPOCHS = 64, 100
LEARNERS = ("knn", "gmr", "mlp", "tt", "gpr")


def excess(problem: engine.TalosSteps, task: Tested, xs: np.ndarray, us: np.ndarray) -> np.ndarray:
    """Cost over the optimum's after 1 .. ITERATIONS iterations; infinite while gaps are left."""
    log = problem.solve(np.ascontiguousarray(xs), np.ascontiguousarray(us), iterations=ITERATIONS, stop=0.0)["log"]
    closed = np.maximum.accumulate(log[:, 2] == 1.0)  # the first full step closes them for good
    over = np.where(closed, log[:, 0] / task.cost - 1.0, np.inf)
    return np.pad(over, (0, ITERATIONS - len(over)), mode="edge")


class Contest:
    """The learners, fitted on one database."""

    def __init__(self, learners: Learners, epochs: int):
        self.learners, coded = learners, learners.tables.coded
        learners.add_neighbour()
        learners.add_mixture()
        net = fit_ensemble(coded.x, coded.z, hidden=HIDDEN, epochs=epochs)
        learners.add("mlp", network_table(net, **shared(coded)))
        regression = learners.tables.regression
        features = VARIED[:6]
        self.trains = [StepTrain(regression, features, np.eye(15)[14] * foot, worth(coded)) for foot in (0, 1)]

    def tables(self, name: str) -> list[Table]:
        """Of a learner, without the bases that all share."""
        if name == "gpr":
            return [self.learners.tables.regression]
        return [train.table for train in self.trains] if name == "tt" else [self.learners.made[name]]

    def guess(self, name: str, task: Tested, problem: engine.TalosSteps) -> tuple[np.ndarray, np.ndarray]:
        """xs, us of a learner for the task that the problem poses."""
        if name != "tt":
            return self.learners.answer(name, task.step, problem.x0)
        z = self.trains[task.foot].z(task.step.features())
        found = self.learners.memory.decode(z, *task.step.asked, problem.x0)
        return found["xs"], found["us"]


def against_iteration(report: Report, learners: Learners, tested: list[Tested], epochs: int) -> dict[str, np.ndarray]:
    """Median excess of cost after each iteration."""
    problem, contest = engine.TalosSteps(), Contest(learners, epochs)
    rows = {name: [] for name in ("cold", "shift", "planner", *LEARNERS, "ensemble")}
    chosen = dict.fromkeys(("shift", *LEARNERS), 0)
    for task in tested:
        task.pose(problem)
        guesses = {name: contest.guess(name, task, problem) for name in LEARNERS}
        for name, found in (("cold", problem.cold(False)), ("shift", problem.cold(True)), ("planner", problem.planned())):
            guesses[name] = found["xs"], found["us"]
        names = list(chosen)
        merit = problem.merit(np.array([guesses[name][0] for name in names]), np.array([guesses[name][1] for name in names]))
        best = names[int(np.argmin(merit))]
        chosen[best] += 1
        guesses["ensemble"] = guesses[best]
        for name, found in guesses.items():
            rows[name].append(excess(problem, task, *found))
    curves = {name: np.median(found, axis=0) for name, found in rows.items()}
    head = "".join(f"{k:>9}" for k in range(1, ITERATIONS + 1))
    report.say(f"{'median cost over the optimum after iteration':<46}{head}{'bytes':>10}")
    for name, curve in curves.items():
        size = sum(4 * a.words.size for table in contest.tables(name) for a in table.arrays()) if name in LEARNERS else 0
        line = f"{name:<46}" + "".join(f"{value:9.1e}" for value in curve)
        report.say(line + (f"{size:>10}" if size else ""))
        if size:
            report.figure(f"bytes.{name}", float(size), "byte")
        for k, value in enumerate(curve, 1):
            if np.isfinite(value):
                report.figure(f"excess.{name}.iteration{k}", float(value), n=len(tested))
    report.say("the ensemble took: " + ", ".join(f"{name} {n}" for name, n in chosen.items() if n))
    return curves


def count_memory(memory: engine.TalosStepMemory, tested: list[Tested]) -> Count:
    """Solves from the deployed query."""
    problem, count = engine.TalosSteps(), Count.empty()
    for task in tested:
        task.pose(problem)
        found = memory.query(*task.step.asked, problem.x0)
        count.add(problem, found["xs"], found["us"], task.cost)
    return count


def against(report: Report, what: str, found: list[tuple[int, int, Count]]) -> None:
    """A table of quality: (number, bytes, count)."""
    report.say(f"{what:<18}{'bytes':>9}{'iterations':>12}{'most':>6}{'excess':>10}{'after 1':>10}")
    for n, size, count in found:
        report.say(f"{n:<18}{size:>9}{np.mean(count.iterations):12.2f}{max(count.iterations):6d}"
                   f"{np.mean(count.excess):10.1e}{count.suboptimality:10.1e}")  # fmt: skip
        report.figure(f"iterations.{what}{n}", float(np.mean(count.iterations)), n=len(count.iterations))
        if np.isfinite(count.suboptimality):
            report.figure(f"subopt1.{what}{n}", count.suboptimality, n=len(count.iterations))


def against_samples(sets: list, tested: list[Tested], samples: tuple[int, ...]) -> list[tuple[int, int, Count]]:
    """What more data buy: the memory fitted on fewer steps of each foot and walks."""
    found = []
    for n in samples:
        tables = Learners([part.part(slice(0, max(1, n * len(part) // len(sets[0])))) for part in sets], False).tables
        found.append((n, nbytes(tables), count_memory(tables.memory(), tested)))
    return found


def against_bytes(tables: StepTables, tested: list[Tested], inducing: tuple[int, ...]) -> list[tuple[int, int, Count]]:
    """What more bytes buy: the regression on fewer samples, with all data in their weights."""
    length, found = tables.regression.length, []
    for n in inducing:
        fitted = fit_regression(tables.coded.x, tables.coded.z, length, replace(SETTINGS, samples=n))
        smaller = replace(tables, regression=replace(tables.regression, x=fitted.x, alpha=fitted.alpha, length=length))
        found.append((n, nbytes(smaller), count_memory(smaller.memory(), tested)))
    return found


def draw_curves(report: Report, curves: dict[str, np.ndarray], samples: list, sizes: list) -> None:
    """The same as a picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    for name, curve in curves.items():
        axes[0].semilogy(range(1, ITERATIONS + 1), np.maximum(curve, 1e-9), marker="o", markersize=3, label=name)
    axes[0].set(xlabel="iteration", ylabel="median cost over the optimum's", title="cost against iteration")
    axes[0].legend(fontsize=8)
    for ax, found, column, title in ((axes[1], samples, 0, "steps of a foot"), (axes[2], sizes, 1, "bytes of the tables")):
        ax.loglog([row[column] for row in found], [row[2].suboptimality for row in found], marker="o")
        ax.set(xlabel=title, title=f"the memory after one iteration, against {title}")
    figure.savefig(report.picture("curves"), dpi=120)
    plt.close(figure)


def run(row: str, quick: bool) -> None:
    """All curves."""
    report = Report(row, "steps of Talos: cost against iteration, quality against samples and bytes (thesis, section 8.4)")
    sets, tested = load_sets(quick), draw_tested(20 if quick else TESTED)
    learners = learnt_from(quick)
    curves = against_iteration(report, learners, tested, EPOCHS // 5 if quick else EPOCHS)
    samples = against_samples(sets, tested, () if quick else SAMPLES)
    sizes = against_bytes(learners.tables, tested, INDUCING[2:3] if quick else INDUCING)
    against(report, "samples", samples)
    against(report, "inducing", sizes)
    draw_curves(report, curves, samples, sizes)
    report.close()
