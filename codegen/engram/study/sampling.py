"""S6.6: time to sample, beside the thesis' figure 7.18, numpy and teneva; time to build, beside teneva's cross."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from engram.emit import Tt
from engram.engine import engine
from engram.study.panda import STUDIES, Tasks
from engram.study.report import Report
from engram.study.trains import SOLVED, lowest, samples, solutions, table_of

CASES = [  # variables, points, rank; the thesis' time for one sample [ms], read off figure 7.18 and text line 1964
    (10, 50, 60, None), (7, 100, 10, 1.0), (7, 100, 50, 3.0), (70, 100, 10, 15.0), (70, 100, 50, 15.0),
]  # fmt: skip
COUNTS = (1, 100, 1000)
ALPHA = 0.9


def random_train(d: int, n: int, r: int, seed: int = 1) -> Tt:
    """A positive train over the unit box."""
    rng = np.random.default_rng(seed)
    ranks = [1] + [r] * (d - 1) + [1]
    cores = [rng.random((ranks[k], n, ranks[k + 1])).astype(np.float32).astype(float) for k in range(d)]
    inputs = [(f"x{k}", "1") for k in range(d)]
    return Tt(inputs=inputs, lo=np.zeros(d), hi=np.ones(d), held_out_error=0.0, held_out_text="", cores=cores)


def marginals(cores: list[np.ndarray]) -> list[np.ndarray]:
    """W_k = P^k pi_k+1 (r, n): lines 2 to 4 and 7 of algorithm 6."""
    pi, weights = np.ones(1), []
    for core in reversed(cores):
        weights.append(core @ pi)
        pi = weights[-1].sum(axis=1)
        pi /= np.abs(pi).max()
    return weights[::-1]


def sample_numpy(
    cores: list[np.ndarray], weights: list[np.ndarray], alpha: float, count: int, rng: np.random.Generator
) -> np.ndarray:
    """Lines 5 to 16 of algorithm 6, all samples at once, in double, rows rescaled."""
    row, index = np.ones((count, 1)), np.empty((count, len(cores)), int)
    for k, core in enumerate(cores):
        p = np.abs(row @ weights[k])
        p = (p / p.max(axis=1, keepdims=True)) ** (1 / (1 - alpha + 1e-9))
        total = np.cumsum(p, axis=1)
        index[:, k] = (rng.random((count, 1)) * total[:, -1:] < total).argmax(axis=1)
        row = np.einsum("lr,lrs->ls", row, core[:, index[:, k], :].transpose(1, 0, 2))
        row /= np.abs(row).max(axis=1, keepdims=True)
    return index


def least(call: Callable[[], object], seconds: float, most: int) -> float:
    """The shortest CPU time of a call [s], repeated for about `seconds`."""
    best, spent, times = np.inf, 0.0, 0
    while times < 2 or (spent < seconds and times < most):
        clock = time.process_time()
        call()
        clock = time.process_time() - clock
        best, spent, times = min(best, clock), spent + clock, times + 1
    return best


def many(call: Callable[[], object], repeats: int) -> Callable[[], object]:
    """A call often enough for the clock."""
    return lambda: [call() for _ in range(repeats)]


def run(row: str, quick: bool) -> None:
    """Sampling times, then building times."""
    report = Report(row, "time to sample (figure 7.18) and to build; CPU time of one thread")
    heads = {"samples": 8, "ours ms": 10, "numpy ms": 10, "ratio": 8, "kept": 8, "teneva ms": 11, "ratio ": 8, "thesis ms": 11}
    report.say(f"{'train':<24}" + "".join(f"{text:>{width}}" for text, width in heads.items()))
    rivals = teneva()
    for d, n, r, thesis in CASES[:2] if quick else CASES:
        table = random_train(d, n, r)
        train, cores = engine.TensorTrain(table, max(COUNTS)), table.cores
        weights, rng = marginals(cores), np.random.default_rng(1)
        for count in COUNTS[:2] if quick else COUNTS:
            repeats = max(1, 200 // count)
            ours = least(many(lambda: train.sample(ALPHA, count, seed=3), repeats), 0.3, 20) / repeats  # noqa: B023
            kept = least(lambda: sample_numpy(cores, weights, ALPHA, count, rng), 0.2, 5)  # noqa: B023
            numpy = least(lambda: sample_numpy(cores, marginals(cores), ALPHA, count, rng), 0.2, 5)  # noqa: B023
            timed = rivals and d < 70 and count != 100
            rival = least(lambda: rivals.sample(cores, m=count, seed=1), 0.1, 3) if timed else None  # noqa: B023
            cells = f"{1e3 * ours:>10.4f}{1e3 * numpy:>10.2f}{numpy / ours:>8.0f}{kept / ours:>8.0f}"
            cells += f"{1e3 * rival:>11.2f}{rival / ours:>8.0f}" if rival else " " * 19
            report.say(f"d={d:<3} n={n:<4} r={r:<9}{count:>9}" + cells + (f"{thesis:>11g}" if thesis and count == 1 else ""))
            report.figure(f"bench.tt.sample.d{d}r{r}n{count}", 1e6 * ours, "us", peer=1e6 * numpy, ratio=numpy / ours)
            if rival:
                report.figure(f"bench.tt.sample_teneva.d{d}r{r}n{count}", 1e6 * ours, "us", peer=1e6 * rival, ratio=rival / ours)
    report.say("numpy: algorithm 6 as printed, in double, all samples at once; kept: the ratio where it keeps the marginals, too")
    report.say("teneva samples with alpha = 0; the thesis' times are wall clock on a laptop")
    if rivals:
        crosses(report, rivals, quick)
    report.close()


def teneva():
    """The peer, if it is installed."""
    try:
        import teneva
    except ImportError:
        return None
    return teneva


def crosses(report: Report, rival, quick: bool) -> None:
    """Cross approximation of table 7.1's density from the same starting points at equal rank: time, and success of one sample."""
    study = STUDIES["6.3"]
    cost, recipe = engine.study_arm(study.cost), replace(study.recipe, starts=600)
    draw = Tasks(cost)
    rng = np.random.default_rng(66)
    starts, test = solutions(cost, draw(rng, recipe.starts), recipe, rng), draw(rng, 40 if quick else 200)
    points = [recipe.points[0]] * 3 + [recipe.points[1]] * 7
    lo, step = np.array(cost.lo), (np.array(cost.hi) - np.array(cost.lo)) / (np.array(points) - 1)
    index = np.clip(np.rint((starts - lo) / step), 0, np.array(points) - 1).astype(int)

    def success(cores: list[np.ndarray]) -> float:
        train = engine.TensorTrain(table_of(cost, cores), 10)
        start, _ = lowest(cost, samples(train, cost, test, ALPHA, 1))
        return float(np.mean(cost.refine(start, recipe.evaluations)[1] <= SOLVED))

    rows: dict[str, list[tuple[float, float, int]]] = {"ours": [], "teneva": []}
    for seed in range(1, 2 if quick else 4):
        clock = time.process_time()
        cores, values = cost.cross(points, starts, recipe.rank, 8, 3, recipe.tolerance, seed)
        rows["ours"].append((time.process_time() - clock, success(cores), values))
        chosen = index[np.random.default_rng(seed).permutation(len(index))[: recipe.rank]]
        first = [np.zeros((1 if k == 0 else recipe.rank, n, 1 if k == 9 else recipe.rank)) for k, n in enumerate(points)]
        for j, i in enumerate(chosen):  # the sum of as many points as the rank
            for k in range(10):
                first[k][0 if k == 0 else j, i[k], 0 if k == 9 else j] = 1.0
        info: dict = {}
        clock = time.process_time()
        cores = rival.cross(lambda at: cost.density(lo + at * step), first, nswp=3, dr_min=0, dr_max=0, info=info)
        rows["teneva"].append((time.process_time() - clock, success(cores), int(info["m"])))
    means = {who: np.mean(found, axis=0) for who, found in rows.items()}
    for who, (clock, share, values) in means.items():
        report.say(f"cross, table 7.1, rank {recipe.rank}, {who:<7} {clock:6.2f} s  {100 * share:5.1f} % from one sample, "
                   f"{values:.0f} values")  # fmt: skip
    ratio = means["teneva"][0] / means["ours"][0]
    report.say(f"ratio {ratio:.1f} over {len(rows['ours'])} seeds")
    report.figure("bench.tt.cross", means["ours"][0], "s", n=len(rows["ours"]), peer=means["teneva"][0], ratio=ratio)
    report.figure("bench.tt.cross_success", means["ours"][1], n=len(test), peer=means["teneva"][1])
