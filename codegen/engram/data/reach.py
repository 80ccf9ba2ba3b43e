"""Reach tasks drawn at random and solved: what the memory of a reach is made from.

A task is a start posture at rest and a target pose. Pass 1 solves it by FDDP from straight lines to several postures that reach
the target, and from detours by way of home; pass 2 also from the motions of its neighbours in pass 1, bent to the task, which
makes neighbours alike. The cheapest motion that succeeds is kept. Item i of pass 1 depends on (seed, i) and the settings alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from engram.data.chunks import Arrays
from engram.engine import engine
from engram.inputs import InputError
from engram.robots.emit_header import camel
from engram.tasks.reach import draw_pose, task_vector
from engram.tasks.spec import TaskSpec, load_task

# Where the arm is when the target jumps: at rest at another target, at the nominal posture, anywhere clear of obstacles.
START_SHARES = {"target": 0.7, "home": 0.1, "random": 0.2}
REDRAWS = 1000
IK_ANYWHERE = 14  # random postures from which inverse kinematics starts ...
IK_NEAR = 8  # ... and postures near the start, so that a short way is not missed
NEAR = 0.7  # rad, standard deviation of these
REACHED = 1e-6  # m, rad
SAME_POSTURE = 0.05  # rad, closer in every joint counts as one posture
NEIGHBOURS = 3  # whose motions are tried in pass 2
# A motion counts as solved if it ends within this many times the tolerances of success: the horizon is half the time a jump is
# given, and a motion that speed limits keep from arriving in it, but which is nearly there, is worth remembering.
NEARLY = 4.0
NEIGHBOUR_WEIGHTS = (1.0, 4.0, 1.0, 0.5)  # of q, p_WT, target z axis, target x axis

OK, NO_POSTURE, NOT_CONVERGED, MISSED, COLLIDES = range(5)
REASONS = ["solved", "no posture reaches the target", "not converged", "misses the target", "collides"]


@dataclass(frozen=True)
class Settings:
    """How hard a task is tried."""

    lines: int = 4  # straight lines of lowest merit that are solved
    detours: int = 2  # paths by way of home of lowest merit that are solved
    iterations: int = 150
    stop: float = 1e-4  # expected improvement


@dataclass(frozen=True)
class Task:
    """Start posture (nq), task vector, and postures (m, nq) that reach the target clear of obstacles."""

    start: np.ndarray
    vector: np.ndarray
    ends: np.ndarray


class ReachSolver:
    """Draws and solves the tasks of one spec; one per process."""

    def __init__(self, spec: TaskSpec, seed: int, settings: Settings):
        self.spec, self.seed, self.settings = spec, seed, settings
        name = camel(f"{spec.robot.name}_{spec.name}")
        if not hasattr(engine, name) or getattr(engine, name).digest != spec.digest:
            raise InputError(
                f"the compiled engine does not hold {spec.robot.name}/{spec.name} as it is now: "
                f"run `engram task {spec.robot.name} {spec.name}` and build again"
            )
        self.problem = getattr(engine, name)()
        margin = spec.margins["joint"]
        self.q_lo, self.q_hi = spec.robot.q_lo + margin, spec.robot.q_hi - margin

    # ---- drawing -------------------------------------------------------------------------------------------------------------

    def draw(self, i: int) -> Task:
        """Task i of the seed."""
        rng = np.random.default_rng([self.seed, i])
        start = self._start(rng)
        vector, ends = self._target(rng, start)
        return Task(start, vector, ends)

    def ends(self, vector: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """Distinct postures (m, nq) that inverse kinematics finds from the starts, within limits and clear of obstacles."""
        q, error = self.problem.ik(vector, starts)
        fits = (error < REACHED) & np.all((q >= self.q_lo) & (q <= self.q_hi), axis=1)
        q = q[fits]
        q = q[self.problem.clearance(q) >= self.spec.clearance]
        distinct: list[np.ndarray] = []
        for posture in q:
            if all(np.abs(posture - other).max() > SAME_POSTURE for other in distinct):
                distinct.append(posture)
        return np.array(distinct).reshape(-1, len(self.q_lo))

    def _start(self, rng: np.random.Generator) -> np.ndarray:
        kind = rng.choice(list(START_SHARES), p=list(START_SHARES.values()))
        if kind == "home":
            return self.spec.robot.q_home.copy()
        if kind == "target":
            _, ends = self._target(rng, self.spec.robot.q_home)
            return ends[rng.integers(len(ends))]
        for _ in range(REDRAWS):
            q = self._random_postures(rng, 1)
            if self.problem.clearance(q)[0] >= self.spec.clearance:
                return q[0]
        raise InputError(f"no posture is clear of obstacles by {self.spec.clearance} m; ask for less clearance")

    def _target(self, rng: np.random.Generator, start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A task vector within reach, and the postures that reach it."""
        regions = self.spec.regions
        region = regions[rng.choice(len(regions), p=[r.share for r in regions])]
        for _ in range(REDRAWS):
            vector = task_vector(*draw_pose(region, rng))
            near = start + NEAR * rng.standard_normal((IK_NEAR, len(start)))
            starts = np.vstack([start, np.clip(near, self.q_lo, self.q_hi), self._random_postures(rng, IK_ANYWHERE)])
            ends = self.ends(vector, starts)
            if len(ends):
                return vector, ends
        raise InputError(f"region '{region.name}': no pose is in reach; move it or ask for less clearance")

    def _random_postures(self, rng: np.random.Generator, n: int) -> np.ndarray:
        return rng.uniform(self.q_lo, self.q_hi, (n, len(self.q_lo)))

    # ---- solving -------------------------------------------------------------------------------------------------------------

    def set(self, start: np.ndarray, vector: np.ndarray) -> None:
        """Make (start at rest, target) the problem to solve."""
        self.problem.set(np.r_[start, np.zeros(len(start))], vector)

    def judge(self, solution: dict, vector: np.ndarray) -> int:
        """OK or the first reason against a solution."""
        q = solution["xs"][:, : len(self.q_lo)]
        if not solution["converged"]:
            return NOT_CONVERGED
        if not self.within(solution["xs"], vector, NEARLY):
            return MISSED
        return OK if self.problem.clearance(q).min() > 0.0 else COLLIDES

    def within(self, xs: np.ndarray, vector: np.ndarray, tolerances: float = 1.0) -> bool:
        """Does a motion end within `tolerances` times the tolerances of success?"""
        position, rotation = self.problem.error(xs[-1:, : len(self.q_lo)], vector)[0]
        return position <= tolerances * self.spec.success["position"] and rotation <= tolerances * self.spec.success["rotation"]

    def best(self, guesses: Sequence[np.ndarray], vector: np.ndarray, known: dict | None = None) -> dict:
        """The cheapest successful motion among `known` and those solved from the guesses xs (m, ...), us (m, ...).

        If none succeeds: the one with the least reason against it.
        """
        best = known
        for xs, us in zip(*guesses, strict=True):
            found = self.problem.solve(xs, us, iterations=self.settings.iterations, stop=self.settings.stop)
            found["outcome"] = self.judge(found, vector)
            if best is None or (found["outcome"] != OK, found["cost"]) < (best["outcome"] != OK, best["cost"]):
                best = found
        return best

    def row(self, i: int, task: Task, found: dict) -> dict:
        """What is kept of item i."""
        return {
            "seeds": i,
            "X": np.r_[task.start, task.vector],
            "xs": found["xs"],
            "us": found["us"],
            "cost": found["cost"],
            "iterations": found["iterations"],
            "arrived": self.within(found["xs"], task.vector),
            "outcome": found["outcome"],
        }


def features(solver: ReachSolver, X: np.ndarray) -> np.ndarray:
    """Rows of X (start, task vector) as points whose distance says how alike two tasks are."""
    nq = len(solver.q_lo)
    x, y, z, w = X[:, nq + 3 :].T
    axis_z = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    axis_x = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    parts = (X[:, :nq], X[:, nq : nq + 3], axis_z, axis_x)
    return np.hstack([weight * part for weight, part in zip(NEIGHBOUR_WEIGHTS, parts, strict=True)])


def detour(start: np.ndarray, via: np.ndarray, ends: np.ndarray, knots: int) -> np.ndarray:
    """Paths (m, knots + 1, nq) from start (nq) to ends (m, nq) that rest at `via` halfway."""
    r = np.linspace(0.0, 2.0, knots + 1)[:, None]

    def blend(tau: np.ndarray) -> np.ndarray:
        tau = np.clip(tau, 0.0, 1.0)
        return tau**3 * (10 + tau * (6 * tau - 15))

    return start + blend(r) * (via - start) + blend(r - 1.0) * (ends[:, None, :] - via)


def solve_lines(solver: ReachSolver, items: range) -> Arrays:
    """Pass 1: each task from lines and detours to the postures that reach its target."""
    rows = []
    for i in items:
        task = solver.draw(i)
        solver.set(task.start, task.vector)
        detours = detour(task.start, solver.spec.robot.q_home, task.ends, solver.spec.knots)
        found = None
        for guesses, count in (
            (solver.problem.line(task.ends), solver.settings.lines),
            (solver.problem.warp(detours, task.ends), solver.settings.detours),
        ):
            chosen = np.argsort(solver.problem.merit(*guesses), kind="stable")[:count]
            found = solver.best([guess[chosen] for guess in guesses], task.vector, found)
        rows.append(solver.row(i, task, found))
    return stack(rows)


def solve_neighbours(solver: ReachSolver, first: Arrays, items: range) -> Arrays:
    """Pass 2: each task again from the motions of its nearest solved neighbours, bent to it."""
    solved = np.flatnonzero(first["outcome"] == OK)
    points = features(solver, first["X"])
    nq = len(solver.q_lo)
    rows = []
    for i in items:
        known = {name: values[i] for name, values in first.items()}
        start, vector = known["X"][:nq], known["X"][nq:]
        solver.set(start, vector)
        distance = np.sum((points[solved] - points[i]) ** 2, axis=1)
        nearest = [j for j in solved[np.argsort(distance, kind="stable")[: NEIGHBOURS + 1]] if j != i][:NEIGHBOURS]
        paths = first["xs"][nearest][:, :, :nq]
        ends, error = solver.problem.ik(vector, np.ascontiguousarray(paths[:, -1]))
        fits = (error < REACHED) & (np.abs(ends - paths[:, -1]).max(axis=1) <= solver.spec.memory["max_warp"])
        guesses = solver.problem.warp(np.ascontiguousarray(paths[fits]), ends[fits])
        found = solver.best(guesses, vector, known)
        rows.append(solver.row(i, Task(start, vector, ends), found))
    return stack(rows)


def stack(rows: list[dict]) -> Arrays:
    """Rows of equal keys -> arrays with one row each."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def make_lines(robot: str, task: str, seed: int, settings: Settings) -> Callable[[range], Arrays]:
    """What a worker process runs in pass 1."""
    return partial(solve_lines, ReachSolver(load_task(robot, task), seed, settings))


def make_neighbours(robot: str, task: str, seed: int, settings: Settings, first: Arrays) -> Callable[[range], Arrays]:
    """What a worker process runs in pass 2, given all of pass 1."""
    return partial(solve_neighbours, ReachSolver(load_task(robot, task), seed, settings), first)
