"""S6.3 to S6.5: the Panda among table, box and shelf."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from engram.engine import engine
from engram.learn.contenders import table_bytes
from engram.paths import MODELS
from engram.study.learned_modes import learners, offers
from engram.study.refiners import bfgs, clocked, ik
from engram.study.report import Report
from engram.study.trains import SOLVED, WORKERS, Recipe, build, lowest, samples, uniform_points
from engram.study.warmstart import ALPHAS, COUNTS, Neighbours, compare, modes
from engram.tasks.world import read_boxes

CLEARANCE = 0.06  # [m] of a target to the nearest obstacle: "sufficiently away from the surface" (thesis, caption of table 7.1)

THESIS = {  # success in per cent for 1, 10, 100, 1000 samples (tables 7.1 to 7.3)
    "6.3": {"a09": [94, 98, 98, 99], "a075": [84, 95, 95, 97], "a05": [88, 93, 93, 98], "a0": [71, 91, 91, 96],
            "uniform": [37.75, 45.5, 59.25, 75]},
    "6.4": {"a09": [62, 86, 86, 88], "a075": [53, 72, 86, 83], "a05": [50, 64, 83, 84], "a0": [46, 60, 82, 86],
            "uniform": [19.25, 28.75, 41, 53.5]},
    "6.5": {"a09": [70, 81, 79, 89], "a075": [66, 66, 84, 78], "a05": [54, 62, 77, 76], "a0": [48, 48, 58, 71],
            "uniform": [23.75, 30.25, 39.5, 44.25]},
}  # fmt: skip


@dataclass(frozen=True)
class Study:
    """One table: its cost, how the train is built, and how many tasks it is judged on."""

    cost: str
    title: str
    recipe: Recipe
    validation: int
    test: int
    joints: slice  # of the first posture, in which solutions are told apart
    looked_at: int = 100  # test tasks whose solutions are counted


STUDIES = {
    "6.3": Study("panda.ik", "inverse kinematics, Panda with table, box and shelf, d = 10 (table 7.1)",
                 Recipe(points=(20, 48), fitted=True, rank=16, scale=2.0, enrich=16, sweeps=1, seeds=12, spread=True,
                        starts=2000), 400, 400, slice(3, 10)),
    "6.4": Study("panda.reach", "target reaching, Panda with table, box and shelf, d = 24 (table 7.2)",
                 Recipe(points=(20, 48), weights=(14, 10), fitted=True, rank=32, scale=3.0, enrich=16, sweeps=1, seeds=6,
                        alpha=0.97, spread=True, starts=2000, start_cost=0.13, start_evaluations=500, evaluations=120,
                        judged=COUNTS), 400, 400, slice(3, 10)),
    "6.5": Study("panda.pick", "pick and place, Panda with table, box and shelf, d = 62 (table 7.3)",
                 Recipe(points=(20, 48), weights=(42, 8), fitted=True, rank=16, scale=5.0, enrich=16, sweeps=1, seeds=6,
                        alpha=0.97, spread=True, starts=2000, start_cost=0.16, start_evaluations=800, evaluations=800),
                 100, 400, slice(6, 20), 25),
}  # fmt: skip


class Tasks:
    """Targets in the shelf (and above the box) that keep their distance from the obstacles."""

    def __init__(self, cost: engine.StudyCost):
        self.lo, self.hi = np.array(cost.lo[: cost.ntask]), np.array(cost.hi[: cost.ntask])
        self.boxes = read_boxes(MODELS / "panda" / "reach" / "world.xml")

    def __call__(self, rng: np.random.Generator, count: int) -> np.ndarray:
        kept = np.empty((0, len(self.lo)))
        while len(kept) < count:  # two in three are kept
            task = rng.uniform(self.lo, self.hi, (count, len(self.lo)))
            clear = [self.boxes.distance(task[:, i : i + 3]).min(axis=1) > CLEARANCE for i in range(0, len(self.lo), 3)]
            kept = np.concatenate([kept, task[np.all(clear, axis=0)]])
        return kept[:count]


def run(row: str, quick: bool) -> None:
    """Build, choose on validation tasks, judge on others."""
    study = STUDIES[row]
    report = Report(row, study.title)
    recipe, ntest, nvalidation = study.recipe, study.test, study.validation
    if quick:
        recipe, ntest, nvalidation = replace(recipe, seeds=2, starts=recipe.starts // 3), 40, 40
    counts = COUNTS[:-1] if quick else COUNTS
    cost = engine.study_arm(study.cost)
    draw = Tasks(cost)
    validation, test = draw(np.random.default_rng(1001), nvalidation), draw(np.random.default_rng(2002), ntest)

    built = build(cost, recipe, draw, validation)
    tried = ", ".join(f"{100 * v:.1f}" for v in built.validation)
    report.say(f"{recipe.seeds} seeds, validation success less a thousandth of the cost: {tried}; kept: seed {built.seed}")
    report.say(f"table {built.train.bytes} B ({recipe.type}), rank {recipe.rank}; built in {built.cpu:.1f} s of CPU time, "
               f"{built.wall:.1f} s on {WORKERS} threads; {built.values} values of the density")  # fmt: skip
    report.figure("table_bytes", built.train.bytes, "B")
    report.figure("build_cpu_s", built.cpu, "s")
    report.figure("build_wall_s", built.wall, "s")

    neighbours = Neighbours(cost, draw, recipe, built.train.bytes, seed=3003)
    compare(report, cost, built, neighbours, validation, test, recipe.evaluations, THESIS[row], counts)
    if row == "6.3":
        compare_refiners(report, cost, built, test, recipe.evaluations, counts)
    looked_at = test[: 10 if quick else study.looked_at]
    count_modes(report, cost, built, neighbours, looked_at, recipe.evaluations, study.joints)
    count_learned_modes(report, cost, neighbours, looked_at, recipe.evaluations, study.joints)
    other_subsets(report, cost, built, neighbours, looked_at)
    report.close()


def count_modes(report, cost, built, neighbours, tasks, evaluations: int, joints: slice) -> None:
    """Distinct solutions among 20 refined samples: what a train has and nearest neighbours have not."""
    parts = []
    for alpha, name in ALPHAS.items():
        found = modes(cost, samples(built.train, cost, tasks, alpha, 20), evaluations, joints)
        report.figure(f"modes.{name}", found, n=len(tasks))
        parts.append(f"alpha {alpha:g}: {found:.1f}")
    found = modes(cost, np.stack([neighbours.starts(cost, task, 20) for task in tasks]), evaluations, joints)
    report.figure("modes.knn", found, n=len(tasks))
    report.say("distinct solutions among 20 refined: " + ", ".join(parts) + f", 20 neighbours: {found:.1f}")


def compare_refiners(report, cost, built, tasks, evaluations: int, counts: tuple[int, ...]) -> None:
    """Success of both refiners from the same starts: the best of some samples, of some uniform points."""
    rng = np.random.default_rng(8)
    refiners = {"bfgs": bfgs(cost, evaluations), "ik": ik("panda", cost)}
    for n in counts[:-1]:
        starts = {
            "train": lowest(cost, samples(built.train, cost, tasks, 0.9, n))[0],
            "uniform": lowest(cost, uniform_points(cost, tasks, n, rng))[0],
        }
        parts = []
        for name, x in starts.items():
            for refiner, refine in refiners.items():
                _, c, us = clocked(refine, x)
                share = float(np.mean(c <= SOLVED))
                report.figure(f"refiner.{refiner}.{name}.n{n}", share, n=len(tasks))
                parts.append(f"{name}, {refiner} {100 * share:.1f} % ({us:.0f} us)")
        report.say(f"refiners, best of {n}, alpha 0.9: " + "; ".join(parts))


def count_learned_modes(report, cost, neighbours, tasks, evaluations: int, joints: slice) -> None:
    """The same of learners fitted to the neighbours' solutions: their 20 most probable answers."""
    parts = []
    for name, table in learners(neighbours.x, cost.ntask, 20):
        found = modes(cost, offers(table, cost, tasks, 20), evaluations, joints)
        report.figure(f"modes.{name}", found, n=len(tasks))
        parts.append(f"{name}: {found:.1f} ({table_bytes(table)} B)")
    report.say("distinct solutions among the 20 most probable answers, refined: " + ", ".join(parts))


def other_subsets(report, cost, built, neighbours, tasks: np.ndarray, count: int = 100) -> None:
    """The same train given other variables: the task and the first joint, held where a solution has it; only the first target.
    Mean cost, unrefined, of the best of some samples, beside uniform points with the same variables given."""
    rng, first = np.random.default_rng(4004), cost.ntask
    cases = {"task_and_joint": np.arange(cost.d) <= first}
    if first > 3:
        cases["first_target"] = np.arange(cost.d) < 3
    for name, fixed in cases.items():
        ours, plain = [], []
        for i, task in enumerate(tasks):
            given = neighbours.starts(cost, task, 1)[0]
            built.train.condition(given, fixed)
            ours.append(cost.evaluate(built.train.sample(0.9, count, seed=i + 1)[0]).min())
            uniform = rng.uniform(cost.lo, cost.hi, (count, cost.d))
            uniform[:, fixed] = given[fixed]
            plain.append(cost.evaluate(uniform).min())
        report.figure(f"given.{name}", float(np.mean(ours)), n=len(tasks))
        report.figure(f"given_uniform.{name}", float(np.mean(plain)), n=len(tasks))
        costs = f"best of {count} samples costs {np.mean(ours):.2f}, of uniform points {np.mean(plain):.2f}"
        report.say(f"given {name.replace('_', ' ')}: {costs}")
