"""S6.6: time to sample, beside the thesis' figure 7.18, PyTorch and teneva; time to build, beside teneva's cross.

`make bench` times the same rows with the same functions (bench/trains.py).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from engram import pytorch
from engram.emit import Tt
from engram.engine import engine
from engram.study.panda import Tasks
from engram.study.report import Report
from engram.study.trains import SOLVED, Recipe, lowest, samples, solutions, table_of

ALPHA = 0.9
CALLS = 16  # single samples of ours between two readings of the clock
SEEDS = (1, 2, 3)  # of the cross approximations that are compared
RECIPE = Recipe(points=(40, 50), rank=16, enrich=16, sweeps=1, spread=True, starts=600)  # of the crosses
BEST_OF = 12  # of our own seeds the best on VALIDATION tasks is kept, as in every study; all of that is timed
VALIDATION = 400


@dataclass(frozen=True)
class Case:
    """Variables, points, rank; the thesis' time for one sample [ms], read off figure 7.18 and text line 1964."""

    d: int
    n: int
    r: int
    thesis: float | None = None

    def name(self, count: int) -> str:
        """As in figure ids."""
        return f"d{self.d}r{self.r}n{count}"

    def table(self) -> Tt:
        """A positive train over the unit box, the same every time."""
        rng, ranks = np.random.default_rng(1), [1] + [self.r] * (self.d - 1) + [1]
        cores = [rng.random((ranks[k], self.n, ranks[k + 1])).astype(np.float32).astype(float) for k in range(self.d)]
        inputs = [(f"x{k}", "1") for k in range(self.d)]
        return Tt(inputs=inputs, lo=np.zeros(self.d), hi=np.ones(self.d), held_out_error=0.0, held_out_text="", cores=cores)

    def operations(self, count: int) -> int:
        """Multiply-adds of `count` samples, at most (tab_tt.h)."""
        ranks = [1] + [self.r] * (self.d - 1)
        return count * sum(r * (self.n + self.r) for r in ranks)

    def bytes_read(self, count: int) -> int:
        """Of marginals and of the slices that as many samples can choose, floats."""
        slices = min(count, self.n) * (self.d - 2) * self.r * -(-self.r // 8) * 8
        return 4 * (self.d * self.r * -(-self.n // 8) * 8 + slices)

    @property
    def tolerance(self) -> float:
        """What rounding may do to the logarithm of a sample's probability: a few floats' roundings of each variable's powers."""
        return self.d * (64 * 2.0**-24 + 4e-6) / (1 - ALPHA)


CASES = (Case(10, 50, 60), Case(7, 100, 10, 1.0), Case(7, 100, 50, 3.0), Case(70, 100, 10, 15.0), Case(70, 100, 50, 15.0))


def calls_of(count: int) -> int:
    """Calls of ours, `count` samples each, between two readings of the clock."""
    return CALLS if count == 1 else 1


class Sides:
    """One train on all sides: ours; PyTorch (None: not installed) as algorithm 6 is printed, and tuned; teneva at alpha = 0."""

    def __init__(self, case: Case, worker: pytorch.PyTorch | None):
        self.case, self.worker, table = case, worker, case.table()
        self.ours, self.cores = engine.TensorTrain(table, 1000), table.cores
        if worker:
            worker.load_train(self.cores)

    def error(self) -> float:
        """Largest difference to PyTorch of the logarithms of our samples' probabilities."""
        x, log_prob = self.ours.sample(ALPHA, 100, seed=3)
        points = np.rint(x * (self.case.n - 1)).astype(np.int64)
        return float(np.abs(log_prob - self.worker.ask("log_probability", alpha=ALPHA, points=points)["log_probability"]).max())

    def times_us(self, count: int, rounds: int) -> dict[str, np.ndarray]:
        """Processor times of drawing `count` samples, all sides in turn in short blocks: what slows the machine slows them all.

        Reading the clock takes a tenth of our single sample, so it is read around CALLS of them, each a call with a seed of its
        own, and a time is their mean.
        """
        import teneva

        single = count == 1
        repeats = 12 if single else max(1, 400 // count)  # of the peers: the first of a block finds its numbers in no cache
        found: dict[str, list[np.ndarray]] = {}
        for block in range(rounds * (3 if single else 1)):
            found.setdefault("ours", []).append(self.ours.time_us(ALPHA, count, 40 if single else 4, calls_of(count)))
            for name, tuned in (("pytorch", False), ("tuned", True)) if self.worker else ():
                us = self.worker.ask("sample", alpha=ALPHA, count=count, tuned=tuned, repeats=repeats)["us"]
                found.setdefault(name, []).append(us)
            if self.case.d < 70 and count != 100 and block < 3:
                clock = time.process_time()
                teneva.sample(self.cores, m=count, seed=1)
                found.setdefault("teneva", []).append(np.array([1e6 * (time.process_time() - clock)]))
        return {name: np.concatenate(us) for name, us in found.items()}


def run(row: str, quick: bool) -> None:
    """Sampling times, then building times."""
    report = Report(row, "time to sample (figure 7.18) and to build; CPU time of one thread")
    heads = {"samples": 8, "ours ms": 10, "PyTorch ms": 12, "ratio": 7, "tuned ms": 10, "ratio ": 7, "teneva ms": 11, " ratio": 7,
             "thesis ms": 11}  # fmt: skip
    report.say(f"{'train':<20}" + "".join(f"{text:>{width}}" for text, width in heads.items()))
    with pytorch.optional() as worker:
        for case in CASES[:2] if quick else CASES:
            sides = Sides(case, worker)
            for count in (1, 100) if quick else (1, 100, 1000):
                us = {name: float(np.median(values)) for name, values in sides.times_us(count, 3).items()}
                cells = f"d={case.d:<3} n={case.n:<4} r={case.r:<5}{count:>8}{1e-3 * us['ours']:>10.4f}"
                for name, width in (("pytorch", 12), ("tuned", 10), ("teneva", 11)):
                    cells += f"{1e-3 * us[name]:>{width}.2f}{us[name] / us['ours']:>7.0f}" if name in us else " " * (width + 7)
                report.say(cells + (f"{case.thesis:>11g}" if case.thesis and count == 1 else ""))
                for name in us.keys() - {"ours"}:
                    report.figure(
                        f"sample.{case.name(count)}.{name}", us["ours"], "us", peer=us[name], ratio=us[name] / us["ours"]
                    )
    if not worker:
        report.say(pytorch.MISSING)
    report.say("PyTorch: algorithm 6 as printed, in double, all samples at once; tuned: marginals kept, slices contiguous")
    report.say("teneva samples with alpha = 0; the thesis' times are wall clock on a laptop")
    found = list(crosses(SEEDS[:1] if quick else SEEDS, 40 if quick else 200))
    for who in ("ours", "teneva"):
        side = [cross for cross in found if cross.who == who]
        mean = {key: float(np.mean([getattr(cross, key) for cross in side])) for key in ("seconds", "success", "values")}
        what = f"{100 * mean['success']:5.1f} % from one sample, {mean['values']:.0f} values of the density"
        report.say(f"cross, table 7.1, rank {side[0].rank}, {who:<7}{mean['seconds']:6.2f} s  {what}")
        report.figure(f"cross.{who}", mean["seconds"], "s", n=len(side))
        report.figure(f"cross_success.{who}", mean["success"], n=len(side))
    report.close()


@dataclass(frozen=True)
class Cross:
    """One cross approximation: CPU time, success of one sample, values of the density it asked for."""

    who: str
    rank: int
    seconds: float
    success: float
    values: int


def crosses(seeds: tuple[int, ...], tests: int) -> Iterator[Cross]:
    """Ours, the best of BEST_OF, and teneva's by turns, of table 7.1's density, from the same starting points at equal rank."""
    import teneva

    cost, recipe = engine.study_arm("panda.ik"), RECIPE
    draw, rng = Tasks(cost), np.random.default_rng(66)
    starts = solutions(cost, draw(rng, recipe.starts), recipe, rng)
    validation, test = draw(rng, VALIDATION), draw(rng, tests)
    points = [recipe.points[0]] * 3 + [recipe.points[1]] * 7
    lo, step = np.array(cost.lo), (np.array(cost.hi) - np.array(cost.lo)) / (np.array(points) - 1)
    index = np.clip(np.rint((starts - lo) / step), 0, np.array(points) - 1).astype(int)

    def success(cores: list[np.ndarray], tasks: np.ndarray) -> float:
        train = engine.TensorTrain(table_of(cost, cores), 10)
        start, _ = lowest(cost, samples(train, cost, tasks, ALPHA, 1))
        return float(np.mean(cost.refine(start, recipe.evaluations, SOLVED)[1] <= SOLVED))

    for seed in seeds:
        clock = time.process_time()
        built = [
            cost.cross(
                points, starts, recipe.rank, recipe.enrich, recipe.sweeps, recipe.tolerance, BEST_OF * seed + i, cost.ntask
            )
            for i in range(BEST_OF)
        ]
        cores = max((cores for cores, _ in built), key=lambda cores: success(cores, validation))
        clock = time.process_time() - clock
        yield Cross("ours", recipe.rank, clock, success(cores, test), sum(values for _, values in built))
        chosen = index[np.random.default_rng(seed).permutation(len(index))[: recipe.rank]]
        first = [np.zeros((1 if k == 0 else recipe.rank, n, 1 if k == 9 else recipe.rank)) for k, n in enumerate(points)]
        for j, i in enumerate(chosen):  # the sum of as many points as the rank
            for k in range(10):
                first[k][0 if k == 0 else j, i[k], 0 if k == 9 else j] = 1.0
        info: dict = {}
        clock = time.process_time()
        cores = teneva.cross(lambda at: cost.density(lo + at * step), first, nswp=3, dr_min=0, dr_max=0, info=info)
        clock = time.process_time() - clock
        yield Cross("teneva", recipe.rank, clock, success(cores, test), int(info["m"]))
