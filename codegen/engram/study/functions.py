"""S6.1: optima of benchmark functions from samples of a tensor train (thesis 7.5.1, figures 7.3 to 7.8)."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from engram.engine import engine
from engram.study.report import Report
from engram.study.trains import samples, table_of, uniform_points

SAMPLES = 100  # from which every optimum shall be found
EVALUATIONS = 400  # of one refinement
ALPHAS = (0.9, 0.5, 0.0)  # the samples are shared among these priorities
HEADS = (("optima", 8), ("train", 9), ("one, a=0.9", 12), ("uniform", 9), ("on P", 7), ("build CPU s", 13), ("values", 10))


@dataclass
class Function:
    """A benchmark: its cost, grid, tasks, and for each task the optima (m, d), all of the same value `best`."""

    name: str
    cost: engine.StudyCost
    points: int
    rank: int
    tasks: np.ndarray
    optima: list[np.ndarray]
    radius: float  # a refined sample within this of an optimum has found it
    starts: np.ndarray  # of cross approximation
    plain: engine.StudyCost | None = None  # what uniform points are refined on as well: the density itself


def rosenbrock(n: int, rng: np.random.Generator, tasks: int) -> Function:
    """One optimum (a, a^2, a, a^2, ...); a within what the box holds."""
    cost = engine.study_function("rosenbrock", n)
    task = np.column_stack([rng.uniform(-1.4, 1.4, tasks), rng.uniform(50, 150, tasks)])
    optima = [np.tile([a, a * a], n // 2)[None] for a, _ in task]
    start = uniform_points(cost, np.column_stack([rng.uniform(-1.4, 1.4, 200), rng.uniform(50, 150, 200)]), 1, rng)[:, 0]
    return Function(f"Rosenbrock {n}", cost, 200, 20, task, optima, 1e-2, cost.refine(start, 2000)[0])


def himmelblau(rng: np.random.Generator, tasks: int) -> Function:
    """Up to four roots of both squares, found by Newton's method from a fine grid; tasks with four in the box."""
    cost = engine.study_function("himmelblau")
    task, optima = [], []
    while len(task) < tasks:
        a, b = rng.uniform(5, 14, 2)
        grid = np.stack(np.meshgrid(np.linspace(-5, 5, 21), np.linspace(-5, 5, 21)), -1).reshape(-1, 2)
        y = grid.copy()
        for _ in range(60):
            u, v = y[:, 0] ** 2 + y[:, 1] - a, y[:, 0] + y[:, 1] ** 2 - b
            det = 4 * y[:, 0] * y[:, 1] - 1
            det = np.where(np.abs(det) < 1e-9, 1e-9, det)
            y = y - np.column_stack([(2 * y[:, 1] * u - v) / det, (2 * y[:, 0] * v - u) / det])
        u, v = y[:, 0] ** 2 + y[:, 1] - a, y[:, 0] + y[:, 1] ** 2 - b
        y = y[(np.abs(u) + np.abs(v) < 1e-8) & np.all(np.abs(y) <= 5, axis=1)]
        roots = np.unique(np.round(y, 6), axis=0)
        if len(roots) == 4:
            task.append([a, b])
            optima.append(roots)
    start = uniform_points(cost, rng.uniform(5, 14, (200, 2)), 1, rng)[:, 0]
    return Function("Himmelblau", cost, 200, 20, np.array(task), optima, 1e-2, cost.refine(start, 400)[0])


def mixture(d: int, components: int, sharpness: float, rng: np.random.Generator) -> Function:
    """Modes at the centres, far enough apart not to shift each other."""
    mean = rng.uniform(-1.6, 1.6, (components, d))
    weight = np.linspace(0.8, 1.0, components)
    cost = engine.study_mixture(weight, np.full(components, sharpness), mean)
    start, _ = cost.refine(uniform_points(cost, np.empty((40 * components, 0)), 1, rng)[:, 0], EVALUATIONS)
    plain = engine.study_mixture(weight, np.full(components, sharpness), mean, True)
    return Function(f"Gaussian mixture {d}", cost, 100, components + 5, np.empty((1, 0)), [mean], 1e-2, start, plain)


def found(function: Function, cost: engine.StudyCost, optima: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Which optima the starts (m, d) reach, refined on `cost`."""
    refined, _ = cost.refine(starts, EVALUATIONS)
    y = refined[:, cost.ntask :]
    return np.array([np.any(np.linalg.norm(y - optimum, axis=1) < function.radius) for optimum in optima])


def train_of(function: Function, seed: int) -> tuple[engine.TensorTrain, float, int]:
    """The function's train, CPU time [s] and values of the density it took."""
    clock, cost = time.process_time(), function.cost
    cores, values = cost.cross([function.points] * cost.d, function.starts, function.rank, 8, 3, 1e-6, seed)
    return engine.TensorTrain(table_of(cost, cores), 1000), time.process_time() - clock, values


def mixed(train: engine.TensorTrain, function: Function, task: np.ndarray) -> np.ndarray:
    """SAMPLES samples, shared among the priorities."""
    share = [SAMPLES - (len(ALPHAS) - 1) * (SAMPLES // len(ALPHAS))] + (len(ALPHAS) - 1) * [SAMPLES // len(ALPHAS)]
    parts = [samples(train, function.cost, task[None], alpha, n)[0] for alpha, n in zip(ALPHAS, share, strict=True)]
    return np.concatenate(parts)


def run(row: str, quick: bool) -> None:
    """All functions: share of optima that 100 refined samples find, over tasks; uniform points beside."""
    report = Report(row, f"benchmark functions: optima found from {SAMPLES} samples (figures 7.3 to 7.8)")
    rng = np.random.default_rng(61)
    tasks = 5 if quick else 50
    functions = [himmelblau(rng, tasks)] + [rosenbrock(n, rng, tasks) for n in ((2, 10) if quick else (2, 10, 20, 30))]
    functions += [mixture(d, 10, 175.0, rng) for d in ((10,) if quick else (2, 10, 50, 100))]
    heads = (f"{text:>{width}}" for text, width in HEADS)
    report.say(f"{'function':<22}" + "".join(heads))
    sinusoid(report)
    trains = {}
    for function in functions:
        train, clock, values = train_of(function, 1)
        trains[function.name] = (function, train)
        ours, single, uniform, plain = [], [], [], []
        for task, optima in zip(function.tasks, function.optima, strict=True):
            ours.append(found(function, function.cost, optima, mixed(train, function, task)).mean())
            sample = samples(train, function.cost, task[None], 0.9, 1)[0]
            single.append(found(function, function.cost, optima, sample).any())
            start = uniform_points(function.cost, task[None], SAMPLES, rng)[0]
            uniform.append(found(function, function.cost, optima, start).mean())
            if function.plain is not None:
                plain.append(found(function, function.plain, optima, start).mean())
        key = function.name.lower().replace(" ", "_")
        for what, values_of in (("found", ours), ("one", single), ("uniform", uniform), ("uniform_on_p", plain)):
            if values_of:
                report.figure(f"{key}.{what}", float(np.mean(values_of)), n=len(values_of))
        cells = [f"{100 * np.mean(v):.1f}" if v else "" for v in (ours, single, uniform, plain)]
        report.say(f"{function.name:<22}{len(function.optima[0]):>8}{cells[0]:>9}{cells[1]:>12}{cells[2]:>9}{cells[3]:>7}"
                   f"{clock:>13.2f}{values:>10}")  # fmt: skip
    subsets(report, *trains[functions[-1].name], rng)
    pictures(report, {name: pair for name, pair in trains.items() if pair[0].cost.d <= 4})
    report.say("per cent of the optima; 'one': the single sample ends in one; 'on P': uniform points refined on the density")
    report.close()


def sinusoid(report: Report) -> None:
    """Optima are circles: how many of the four that meet the box hold a sample, without refinement."""
    cost = engine.study_function("sinusoid")
    rng = np.random.default_rng(1)
    cores, values = cost.cross([200, 200], cost.refine(rng.uniform(-2, 2, (100, 2)), 50)[0], 40, 8, 3, 1e-6, 1)
    train = engine.TensorTrain(table_of(cost, cores), 1000)
    y = np.concatenate([train.sample(alpha, 50, seed=3)[0] for alpha in (0.75, 0.0)])
    radii = np.sqrt(2) * (0.125 + 0.5 * np.arange(4))
    hit = [bool(np.any(np.abs(np.linalg.norm(y, axis=1) - r) < 0.05)) for r in radii]
    report.figure("sinusoid.found", float(np.mean(hit)), n=1)
    near = float(np.mean(cost.evaluate(y[:50]) < 0.05))
    report.say(f"{'sinusoid':<22}{len(radii):>8}{100 * np.mean(hit):>9.1f}{'':>41}{values:>10}")
    report.say(f"{'':<22}(optima are circles; unrefined, {100 * near:.0f} % of samples at a=0.75 cost below 0.05)")


def subsets(report: Report, function: Function, train: engine.TensorTrain, rng: np.random.Generator) -> None:
    """Any subset of the variables as the task: half of a mode's coordinates, drawn at random, find the rest of it."""
    d, hits, trials = function.cost.d, 0, 40
    for trial in range(trials):
        mode = function.optima[0][trial % len(function.optima[0])]
        fixed = rng.random(d) < 0.5
        train.condition(mode, fixed)
        y, _ = train.sample(0.9, 1, seed=trial)
        refined, _ = function.cost.refine(y, EVALUATIONS)
        hits += np.linalg.norm(refined[0] - mode) < function.radius
    report.figure("subset.found", hits / trials, n=trials)
    report.say(f"{function.name}, half of a mode's coordinates given (any half): one sample finds the rest in {hits} of {trials}")


def pictures(report: Report, trains: dict[str, tuple[Function, engine.TensorTrain]]) -> None:
    """Contours of the cost and 1000 unrefined samples for three priorities (figures 7.5 and 7.7)."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(len(trains), 3, figsize=(9, 3 * len(trains)), squeeze=False)
    for row, (name, (function, train)) in zip(axes, trains.items(), strict=True):
        cost, task = function.cost, function.tasks[0]
        lo, hi = np.array(cost.lo[cost.ntask :]), np.array(cost.hi[cost.ntask :])
        grid = np.stack(np.meshgrid(np.linspace(lo[0], hi[0], 120), np.linspace(lo[1], hi[1], 120)), -1)
        x = np.concatenate([np.broadcast_to(task, (*grid.shape[:2], cost.ntask)), grid], axis=-1)
        c = cost.evaluate(np.ascontiguousarray(x.reshape(-1, cost.d))).reshape(grid.shape[:2])
        for axis, alpha in zip(row, ALPHAS[::-1], strict=True):
            y = samples(train, cost, task[None], alpha, 1000)[0][:, cost.ntask :]
            axis.contourf(grid[..., 0], grid[..., 1], np.log1p(c - c.min()), 20, cmap="Greys_r")
            axis.plot(y[:, 0], y[:, 1], ".", ms=2, color="tab:blue")
            axis.plot(*function.optima[0].T, "x", ms=7, mew=2, color="tab:red")
            axis.set_title(f"{name}, alpha {alpha:g}", fontsize=9)
    fig.tight_layout()
    fig.savefig(report.picture("samples"), dpi=90)
    plt.close(fig)
