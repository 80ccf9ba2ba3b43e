"""The contest: every contender's guesses on held-out tasks, solved by the deployed solver; the ensemble that the numbers choose.

A contender's guesses are compared by merit, as the controller does, and the best is solved. An ensemble's best guess is the best
of its members' guesses, so that its outcome is known without solving again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from functools import reduce
from itertools import combinations
from operator import or_

import numpy as np
from tqdm import tqdm

from engram.data.reach import NEARLY, ReachSolver
from engram.data.reach import Settings as SolverSettings
from engram.learn.contenders import Contender, controls, learners, regression, remembered, sampled, table_bytes
from engram.learn.contenders import Settings as LearnerSettings
from engram.learn.dataset import Source
from engram.learn.memory import Ensemble, Memory
from engram.tasks.spec import TaskSpec

ITERATIONS = 50  # after which a motion must arrive, clear of obstacles, whether it has converged or not
AFTER = (1, 3)  # iterations after which the suboptimality is taken
REACHED = 1e-3  # m, rad: as kMemoryIkTolerance of controller/memory/memory_query.h
BASE = ("knn8", "gpr", "line")  # always in the ensemble: any memory of motions has them
LEARNERS = 2  # kMemoryLearners of controller/memory/memory.h
OTHER_END = 0.3  # rad, postures further apart in a joint are different modes: kOtherEnd of controller/loop/loop_guesses.h


@dataclass(frozen=True)
class Outcomes:
    """One contender on n tasks: merit of its best guess, success, cost reached, merits after AFTER iterations (n, 2), modes."""

    merit: np.ndarray
    good: np.ndarray
    cost: np.ndarray
    after: np.ndarray
    modes: np.ndarray


def modes_of(ends: np.ndarray) -> int:
    """Number of postures that differ by more than OTHER_END."""
    distinct: list[np.ndarray] = []
    for end in ends:
        if all(np.abs(end - other).max() > OTHER_END for other in distinct):
            distinct.append(end)
    return len(distinct)


def best_guess(
    solver: ReachSolver, memory: Memory, contender: Contender, x: np.ndarray, start: np.ndarray, vector: np.ndarray, t: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray, int]:
    """Merit, xs, us of the best of a contender's guesses, and how many modes they hold; standing still if it has none."""
    problem = solver.problem
    postures, bows = contender.propose(x, start)
    hold = problem.hold()
    guesses = [np.array(hold["xs"])[None], np.array(hold["us"])[None]]
    modes = 0
    if len(postures):
        ends, error = problem.ik(vector, postures)
        fits = error < REACHED
        if contender.near:
            fits &= np.abs(ends - postures).max(axis=1) <= solver.spec.memory["max_warp"]
        kept = np.flatnonzero(fits)
        if len(kept):
            ends = np.ascontiguousarray(ends[kept])
            modes = modes_of(ends[problem.clearance(ends) > 0])
            if bows is None:
                guesses = problem.line(ends)
            else:
                guesses = problem.warp(memory.code.decode(bows(ends, kept), t, np.tile(start, (len(kept), 1)), ends), ends)
    merit = problem.merit(*guesses)
    i = int(np.argmin(merit))
    return float(merit[i]), guesses[0][i], guesses[1][i], modes


def arrives(solver: ReachSolver, found: dict, vector: np.ndarray) -> bool:
    """Does a motion end nearly at its target, clear of obstacles all the way?"""
    xs = found["xs"]
    return bool(solver.within(xs, vector, NEARLY) and solver.problem.clearance(xs[:, : len(solver.q_lo)]).min() > 0)


def compete(
    spec: TaskSpec, memory: Memory, source: Source, contenders: list[Contender], tasks: int,
    progress: Callable[[Iterable], Iterable] = lambda items: items,
) -> tuple[dict[str, Outcomes], np.ndarray]:  # fmt: skip
    """Outcomes by name on the first `tasks` held-out motions, and the lowest cost known of each task."""
    solver = ReachSolver(spec, 0, SolverSettings(iterations=ITERATIONS))
    motions = source.motions
    chosen = np.flatnonzero(motions.held_out)[:tasks]
    rows: dict[str, list[tuple]] = {contender.name: [] for contender in contenders}
    for i in progress(chosen):
        start, vector = motions.q[i, 0], source.vector[i]
        x = np.asarray(motions.x[i], np.float32).astype(float)
        solver.set(start, vector)
        for contender in contenders:
            merit, xs, us, modes = best_guess(solver, memory, contender, x, start, vector, motions.t)
            after = []
            for iterations in AFTER:
                found = solver.problem.solve(xs, us, iterations=iterations, stop=solver.settings.stop)
                after.append(solver.problem.merit(found["xs"][None], found["us"][None])[0])
            found = solver.problem.solve(xs, us, iterations=ITERATIONS, stop=solver.settings.stop)
            rows[contender.name].append((merit, arrives(solver, found, vector), found["cost"], after, modes))
    outcomes = {name: Outcomes(*(np.array(column) for column in zip(*row, strict=True))) for name, row in rows.items()}
    lowest = source.cost[chosen].copy()
    for o in outcomes.values():
        lowest = np.where(o.good, np.minimum(lowest, o.cost), lowest)
    return outcomes, lowest


def part(outcomes: Outcomes, rows: np.ndarray) -> Outcomes:
    """The outcomes on some of the tasks."""
    return Outcomes(*(getattr(outcomes, f.name)[rows] for f in fields(Outcomes)))


def together(members: list[Outcomes]) -> Outcomes:
    """The ensemble that takes the guess of lowest merit."""
    pick = np.argmin([o.merit for o in members], axis=0), np.arange(len(members[0].merit))

    def take(name: str) -> np.ndarray:
        return np.array([getattr(o, name) for o in members])[pick]

    return replace(Outcomes(*(take(f.name) for f in fields(Outcomes))), modes=np.max([o.modes for o in members], axis=0))


def suboptimality(outcomes: Outcomes, lowest: np.ndarray) -> np.ndarray:
    """Median relative excess over the lowest known cost after AFTER iterations (2,)."""
    return np.median(outcomes.after / lowest[:, None] - 1, axis=0)


def asked(team: Iterable[Contender]) -> Ensemble:
    """What the controller must ask for to have the guesses of all of them."""
    return reduce(or_, (contender.ensemble for contender in team), Ensemble())


def choose(
    contenders: list[Contender], outcomes: dict[str, Outcomes], lowest: np.ndarray, limit: int, members: int = 3
) -> tuple[tuple[str, ...], Outcomes]:
    """BASE and at most `members` other contenders, none of them a control, within `limit` bytes: who succeed most often together.

    The controller must have room for them: at most LEARNERS tables of mixtures and networks. Among equals the least suboptimal
    after one iteration, to two digits; then the one of fewest bytes; then the first by name.
    """
    base = [contender for contender in contenders if contender.name in BASE]
    others = sorted((c for c in contenders if not c.control and c.name not in BASE), key=lambda c: c.name)
    best = None
    for n in range(members + 1):
        for more in combinations(others, n):
            team = [*base, *more]
            if not team or len(asked(team).learners) > LEARNERS:
                continue
            tables = {id(table): table for contender in team for table in contender.tables}
            size = sum(table_bytes(table) for table in tables.values())
            if size > limit:
                continue
            names = tuple(contender.name for contender in team)
            o = together([outcomes[name] for name in names])
            key = (-int(o.good.sum()), float(f"{suboptimality(o, lowest)[0]:.2g}"), size, names)
            if best is None or key < best[0]:
                best = (key, names, o)
    if best is None:
        raise ValueError("no contender fits into the bytes allowed")
    return best[1], best[2]


@dataclass(frozen=True)
class Verdict:
    """What a contest found: the lines to print, the figures (name, value, unit, n), and the ensemble that was chosen."""

    lines: list[str]
    figures: list[tuple[str, float, str, int]]
    names: tuple[str, ...]
    ensemble: Ensemble


def judge(contenders: list[Contender], outcomes: dict[str, Outcomes], lowest: np.ndarray, limit: int) -> Verdict:
    """Every contender on all tasks; the ensemble chosen on every other task and judged on the rest, where it was not chosen."""
    lines = [f"{'guesses of':<20}{'success':>9}{'subopt1':>10}{'subopt3':>10}{'modes':>7}{'bytes':>10}{'query us':>10}"]
    figures = []

    def add(name: str, o: Outcomes, lowest: np.ndarray, size: int, us: float) -> None:
        after = suboptimality(o, lowest)
        share, modes = float(o.good.mean()), float(o.modes.mean())
        lines.append(f"{name:<20}{100 * share:>8.1f}%{after[0]:>10.3g}{after[1]:>10.3g}{modes:>7.2f}{size:>10}{us:>10.1f}")
        values = {"success": share, "subopt1": after[0], "subopt3": after[1], "modes": modes, "bytes": size, "query": us}
        units = {"bytes": "byte", "query": "us"}
        figures.extend((f"{key}.{name}", float(value), units.get(key, "1"), len(lowest)) for key, value in values.items())

    for contender in contenders:
        add(contender.name, outcomes[contender.name], lowest, contender.bytes, contender.query_us())
    choosing, judging = np.arange(0, len(lowest), 2), np.arange(1, len(lowest), 2)
    names, _ = choose(contenders, {name: part(o, choosing) for name, o in outcomes.items()}, lowest[choosing], limit)
    team = [contender for contender in contenders if contender.name in names]
    size = sum(table_bytes(table) for table in {id(t): t for c in team for t in c.tables}.values())
    judged = part(together([outcomes[name] for name in names]), judging)
    add("ensemble", judged, lowest[judging], size, sum(c.query_us() for c in team))
    any_good = np.any([outcomes[name].good for name in names], axis=0)[judging]
    lines.append(f"ensemble: {', '.join(names)}; chosen on {len(choosing)} tasks, judged on {len(judging)} others")
    lines.append(f"solved from each member's guess, the first that succeeds: {100 * any_good.mean():.1f} %")
    figures.append(("success_any.ensemble", float(any_good.mean()), "1", len(judging)))
    return Verdict(lines, figures, names, asked(team))


def hold_contest(
    spec: TaskSpec, memory: Memory, source: Source, tasks: int, limit: int, settings: LearnerSettings,
    progress: Callable[[str], None] = lambda text: None,
) -> Verdict:  # fmt: skip
    """Fit all learners, let them and the controls compete on `tasks` held-out motions, judge."""
    robot = spec.robot
    contenders = [
        *controls(robot.q_lo, robot.q_hi, robot.q_home, settings.seed),
        *remembered(memory, robot.nq),
        regression(memory, robot.q_home),
        *([sampled(robot.name, memory, robot.nq)] if memory.train else []),
        *learners(source.motions, memory, settings, progress),
    ]
    progress(f"{len(contenders)} contenders on {tasks} held-out tasks")
    outcomes, lowest = compete(spec, memory, source, contenders, tasks, lambda items: tqdm(items, unit="task", leave=False))
    return judge(contenders, outcomes, lowest, limit)
