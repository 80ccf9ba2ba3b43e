"""S9.1: judging warm starts of a step by more than a count: cost against iteration, and quality against the number of samples."""

from __future__ import annotations

import numpy as np

from engram.engine import engine
from engram.study.report import Report
from engram.study.steps import TESTED, Count, Learners, Tested, draw_tested, load_sets

ITERATIONS = 8
SAMPLES = (250, 500, 1000, 2000, 6000)  # steps of a foot


def excess(problem: engine.TalosSteps, task: Tested, xs: np.ndarray, us: np.ndarray) -> np.ndarray:
    """Cost over the optimum's after 1 .. ITERATIONS iterations; infinite while gaps are left."""
    log = problem.solve(np.ascontiguousarray(xs), np.ascontiguousarray(us), iterations=ITERATIONS, stop=0.0)["log"]
    closed = np.maximum.accumulate(log[:, 2] == 1.0)  # the first full step closes them for good
    over = np.where(closed, log[:, 0] / task.cost - 1.0, np.inf)
    return np.pad(over, (0, ITERATIONS - len(over)), mode="edge")


def against_iteration(report: Report, learners: Learners, tested: list[Tested]) -> None:
    """Median excess of cost after each iteration."""
    problem = engine.TalosSteps()
    learners.fit_mixtures()
    guesses = {
        "cold": lambda task: problem.cold(False),
        "planner": lambda task: problem.planned(),
        "knn": lambda task: dict(zip(("xs", "us"), learners.answer("knn", task, problem), strict=True)),
        "gmr": lambda task: dict(zip(("xs", "us"), learners.answer("gmr", task, problem), strict=True)),
        "gpr": lambda task: dict(zip(("xs", "us"), learners.answer("gpr", task, problem), strict=True)),
    }
    report.say("median cost over the optimum's after iteration" + "".join(f"{k:>9}" for k in range(1, ITERATIONS + 1)))
    curves = {}
    for name, guess in guesses.items():
        rows = []
        for task in tested:
            task.pose(problem)
            found = guess(task)
            rows.append(excess(problem, task, found["xs"], found["us"]))
        curves[name] = np.median(rows, axis=0)
        report.say(f"{name:<46}" + "".join(f"{value:9.1e}" for value in curves[name]))
        for k, value in enumerate(curves[name], 1):
            if np.isfinite(value):
                report.figure(f"excess.{name}.iteration{k}", float(value), n=len(tested))
    draw_curves(report, curves)


def draw_curves(report: Report, curves: dict[str, np.ndarray]) -> None:
    """The same as a picture."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 4))
    for name, curve in curves.items():
        axes.semilogy(range(1, ITERATIONS + 1), np.maximum(curve, 1e-9), marker="o", label=name)
    axes.set(xlabel="iteration", ylabel="median cost over the optimum's", title="Steps of Talos: cost against iteration")
    axes.legend()
    figure.savefig(report.picture("cost_against_iteration"), dpi=120)
    plt.close(figure)


def against_samples(report: Report, sets: list, tested: list[Tested], samples: tuple[int, ...]) -> None:
    """What more data buy: the memory fitted on fewer steps, tables of the same size."""
    problem = engine.TalosSteps()
    report.say(f"{'steps of a foot':<18}{'iterations':>12}{'most':>6}{'excess':>10}{'after 1':>10}")
    for n in samples:
        memory, count = Learners([part.part(slice(0, n)) for part in sets], False), Count.empty()
        for task in tested:
            task.pose(problem)
            count.add(problem, *memory.gpr(task, problem.x0), task.cost)
        report.say(f"{n:<18}{np.mean(count.iterations):12.2f}{max(count.iterations):6d}"
                   f"{np.mean(count.excess):10.1e}{count.suboptimality:10.1e}")  # fmt: skip
        report.figure(f"iterations.samples{n}", float(np.mean(count.iterations)), n=len(tested))
        report.figure(f"subopt1.samples{n}", count.suboptimality, n=len(tested))


def run(row: str, quick: bool) -> None:
    """Both curves."""
    report = Report(row, "steps of Talos: cost against iteration, quality against samples (thesis, section 8.4)")
    sets, tested = load_sets(quick), draw_tested(20 if quick else TESTED)
    against_iteration(report, Learners(sets, False), tested)
    against_samples(report, sets, tested, SAMPLES[:2] if quick else SAMPLES)
    report.close()
