"""S9.2: never worse than without memory. A step enters the horizon; the shifted plan and the memory's walk compete by merit.

The robot is in the plan of a single step, solved, that ends at rest. A second one enters, in the domain of the memory, at its
edge or outside. What a controller has without memory is that plan, shifted: it stands at its end, with torques that carry the
weight. The memory proposes both steps. The lower merit of controller/loop/loop_merit.h is accepted.

Two checks do not use that code: cost and gaps of the accepted seed are summed knot by knot (never above the shifted plan's), and
both are given one iteration. Tables of random numbers with a valid digest pass the check of tables, and must do no harm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from engram.data import steps
from engram.data.step_set import StepData
from engram.data.steps import GOAL_HI, GOAL_LO
from engram.engine import engine
from engram.learn.steps import Step, StepTables, steps_of
from engram.study.report import Report
from engram.study.steps import RULE, compose, learnt_from, load_sets

QUERIES, HARMED = 10_000, 200  # of the proof; tasks that every adversarial table gets
ONE_OF = 10  # queries whose seeds are given an iteration
MERIT_WEIGHT = 10.0  # kMeritWeight
WHERE = ("inside", "edge", "outside")
OUTSIDE = 0.6  # of half the range, how far beyond it a goal may lie
SCALES = (1e-2, 1.0, 1e2, 1e20)  # of the adversarial numbers


@dataclass(frozen=True)
class Asked:
    """A walk of two steps, and the plan of its first."""

    feet: np.ndarray
    goals: np.ndarray
    first: int
    q: np.ndarray
    u: np.ndarray

    @property
    def steps(self) -> list[Step]:
        return steps_of(self.feet, self.goals, self.first)


def draw(sets: list[StepData], where: str, i: int) -> Asked:
    """Task i: a step that was solved, and one after it."""
    rng = np.random.default_rng([9, WHERE.index(where), i])
    first = int(rng.integers(2))
    row = int(rng.integers(len(sets[first])))
    x, other = sets[first].X[row], 1 - first
    middle, half = 0.5 * (GOAL_LO + GOAL_HI), 0.5 * (GOAL_HI - GOAL_LO)
    share = rng.uniform(-1.0, 1.0, 3)
    if where != "inside":
        axis = int(rng.integers(3))
        share[axis] = np.sign(share[axis]) * (1.0 if where == "edge" else rng.uniform(1.0, 1.0 + OUTSIDE))
    mirror = np.array([1.0, 1.0, 1.0]) if other == 0 else np.array([1.0, -1.0, -1.0])
    goal = steps.place(x[6:], (middle + share * half) * mirror)
    return Asked(x[:6].reshape(2, 3), np.array([x[6:], goal]), first, sets[first].q[row], sets[first].u[row])


def shifted(problem: engine.TalosSteps, asked: Asked) -> tuple[np.ndarray, np.ndarray]:
    """The plan of the first step, that stands at its end from there on."""
    more = problem.begins()[-1] - len(asked.u)
    q = np.vstack([asked.q, np.repeat(asked.q[-1:], more, axis=0)]).astype(float)
    still = problem.along(np.ascontiguousarray(q), False)  # velocities of the path, torques of rest in each posture
    return still["xs"], np.vstack([asked.u, still["us"][len(asked.u) :]])


def summed(problem: engine.TalosSteps, xs: np.ndarray, us: np.ndarray) -> float:
    """Merit, knot by knot; infinite where it is not a number."""
    found = problem.evaluate(xs, us)
    merit = found["cost"].sum() + MERIT_WEIGHT * np.abs(found["gap"]).sum()
    return float(merit) if np.isfinite(merit) else np.inf


def first_cost(problem: engine.TalosSteps, xs: np.ndarray, us: np.ndarray) -> float:
    """Cost after one iteration; infinite if it left gaps."""
    log = problem.solve(xs, us, iterations=1, stop=0.0)["log"]
    return float(log[0, 0]) if log[0, 2] == 1.0 else np.inf


def accept(problem: engine.TalosSteps, memory: engine.TalosStepMemory, asked: Asked) -> tuple[list, int]:
    """The candidates (shifted, memory), and which is accepted. The walk of a memory that has no number to say is not there."""
    candidates = [shifted(problem, asked)]
    try:
        candidates.append(compose(memory, asked.steps, problem.x0))
    except ValueError:
        return candidates, 0
    merit = problem.merit(np.array([c[0] for c in candidates]), np.array([c[1] for c in candidates]))
    return candidates, int(merit[1] < merit[0])


def prove(report: Report, sets: list[StepData], memory: engine.TalosStepMemory, queries: int) -> None:
    """The accepted seed against the shifted plan."""
    problem = engine.TalosSteps()
    head = f"{'goal':<9}{'queries':>9}{'no posture':>12}{'memory taken':>14}{'worse':>7}{'smallest margin':>17}"
    report.say(head + f"{'worse after 1':>15}{'share of merit':>16}{'of cost after 1':>17}")
    for where in WHERE:
        refused = taken = worse = worse_first = 0
        margin, share, share_first = np.inf, [], []
        n = queries // len(WHERE) + (where == WHERE[0]) * (queries % len(WHERE))
        for i in range(n):
            asked = draw(sets, where, i)
            try:
                problem.set(asked.feet, asked.goals, asked.first)
            except ValueError:
                refused += 1
                continue
            candidates, best = accept(problem, memory, asked)
            without, accepted = (summed(problem, *candidates[k]) for k in (0, best))
            taken += best
            worse += accepted > without
            share.append(accepted / without)
            if best == 1:
                margin = min(margin, 1.0 - accepted / without)
                if i % ONE_OF == 0:
                    costs = [first_cost(problem, *candidates[k]) for k in (0, 1)]
                    worse_first += costs[1] > costs[0]
                    share_first.append(costs[1] / costs[0])
        report.say(f"{where:<9}{n:>9}{refused:>12}{taken:>14}{worse:>7}{margin:>17.3g}{worse_first:>15}"
                   f"{np.median(share):>16.3g}{np.nanmedian(share_first) if share_first else np.nan:>17.3g}")  # fmt: skip
        report.figure(f"worse.{where}", float(worse), n=n)
        report.figure(f"taken.{where}", taken / max(1, n - refused), n=n - refused)
        report.figure(f"worse_after_one_iteration.{where}", float(worse_first), n=len(share_first))


def adversarial(tables: StepTables, scale: float, seed: int) -> StepTables:
    """The same tables full of random numbers."""
    rng = np.random.default_rng([11, seed])

    def noise(like: np.ndarray) -> np.ndarray:
        return scale * rng.standard_normal(like.shape)

    def basis(table):
        return replace(table, mean=noise(table.mean), basis=noise(table.basis))

    regression = replace(tables.regression, alpha=noise(tables.regression.alpha), mean=noise(tables.regression.mean))
    return StepTables(regression, basis(tables.path), basis(tables.torque), tables.coded)


def harm(report: Report, sets: list[StepData], tables: StepTables, count: int) -> None:
    """Success of solves from the accepted seed: with shift only, the memory, and tables of random numbers."""
    problem, success = engine.TalosSteps(), {}
    report.say(f"{'tables':<22}{'taken':>7}{'% done':>8}{'iterations':>12}    of {count} walks of two steps, goals inside")
    memories = {"shift": None, "memory": tables.memory()}
    memories |= {f"random_{scale:.0e}": adversarial(tables, scale, k).memory() for k, scale in enumerate(SCALES)}
    for name, memory in memories.items():
        taken, solved, iterations = 0, [], []
        for i in range(count):
            asked = draw(sets, "inside", i)
            problem.set(asked.feet, asked.goals, asked.first)
            candidates, best = ([shifted(problem, asked)], 0) if memory is None else accept(problem, memory, asked)
            found = problem.solve(*candidates[best], **RULE)
            taken += best
            solved.append(found["converged"])
            iterations.append(found["iterations"])
        success[name] = float(np.mean(solved))
        report.say(f"{name:<22}{taken:>7}{100 * success[name]:>8.1f}{np.mean(iterations):>12.2f}")
        report.figure(f"success.{name}", success[name], n=count)
        report.figure(f"iterations.{name}", float(np.mean(iterations)), n=count)
        if name.startswith("random"):
            report.figure(f"taken.{name}", taken / count, n=count)


def run(row: str, quick: bool) -> None:
    """Both."""
    report = Report(row, "never worse than without memory; tables of random numbers (design, rule 6)")
    sets = load_sets(quick)
    tables = learnt_from(quick).tables
    prove(report, sets, tables.memory(), 60 if quick else QUERIES)
    harm(report, sets, tables, 10 if quick else HARMED)
    report.close()
