"""Steps of Talos drawn at random, planned and optimized: what the memory of steps is made from (docs/steps.md).

A task is where both feet stand and where one of them goes, x in R^9: left, right, goal, each (x, y, yaw) [m, rad] in the
frame of the body (middle of the feet at the start, mean of their headings). Stage one (*Hpp*) plans it: centre of mass by a
pendulum, swing foot by a curve, inverse kinematics, inverse dynamics. Stage two (*Crl*) refines that by FDDP. Item i depends
on (seed, foot, i) alone. Walks of three steps are made in the same way: steps that begin or end under way are cut out of them.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from engram.data.chunks import Arrays
from engram.engine import engine

FEET = ("left", "right")  # that swing: 0, 1, as the engine counts them
WALKS = 2  # in the place of a foot: walks
# Of the swinging foot in the axes of the other one, which stands; y away from it. [m, m, rad]
START_LO, START_HI = np.array([-0.30, 0.15, -0.25]), np.array([0.30, 0.28, 0.25])
GOAL_LO, GOAL_HI = np.array([-0.25, 0.15, -0.25]), np.array([0.33, 0.28, 0.25])

OK, NO_POSTURE, NOT_PLANNED, NOT_CONVERGED, MISSED, TOO_STRONG = range(6)
REASONS = ["solved", "no posture stands on the feet", "no posture follows the plan", "not converged", "foot lands too far off",
           "torque beyond its limit"]  # fmt: skip


WALK = 3  # steps of a walk: its first, one in the middle, its last


@dataclass(frozen=True)
class Settings:
    """When a step counts as solved."""

    iterations: int = 100
    stop: float = 1e-5  # expected improvement
    planned: float = 0.05  # error of the planner's feet and centre of mass [m, rad]
    landing: float = 0.01  # of the foot at rest [m, rad]


def place(frame: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Poses `at` (..., 3) given in the axes of `frame` (3), as (x, y, yaw) where the frame is."""
    c, s = math.cos(frame[2]), math.sin(frame[2])  # numpy's own depend on the processor
    x, y, yaw = at[..., 0], at[..., 1], at[..., 2]
    return np.stack([frame[0] + c * x - s * y, frame[1] + s * x + c * y, frame[2] + yaw], axis=-1)


def seen_from(frame: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The inverse of `place`: poses `at` (..., 3) in the axes of `frame` (3)."""
    c, s = math.cos(frame[2]), math.sin(frame[2])  # numpy's own depend on the processor
    x, y = at[..., 0] - frame[0], at[..., 1] - frame[1]
    return np.stack([c * x + s * y, -s * x + c * y, at[..., 2] - frame[2]], axis=-1)


def body_of(feet: np.ndarray) -> np.ndarray:
    """The body's frame (3): middle of the feet (2, 3), mean of their headings."""
    return feet.mean(axis=0)


def step_vector(feet: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """x in R^9 of a step from feet (2, 3) to goal (3), all in one frame of any kind."""
    return seen_from(body_of(feet), np.vstack([feet, goal])).ravel()


def draw(seed: int, foot: int, i: int) -> np.ndarray:
    """Task i of a foot (9,)."""
    rng = np.random.default_rng([seed, foot, i])
    mirror = np.array([1.0, 1.0, 1.0]) if foot == 0 else np.array([1.0, -1.0, -1.0])
    start, goal = rng.uniform(START_LO, START_HI) * mirror, rng.uniform(GOAL_LO, GOAL_HI) * mirror
    feet = np.zeros((2, 3))  # the standing foot is the frame
    feet[foot] = start
    return step_vector(feet, goal)


def draw_walk(seed: int, i: int, steps: int = WALK) -> tuple[np.ndarray, np.ndarray, int]:
    """Walk i: feet (2, 3), goals (steps, 3), the foot of the first step; every step within the range of single ones."""
    rng = np.random.default_rng([seed, 2, i])
    first = int(rng.integers(2))
    feet = draw(seed, first, 10**6 + i)[:6].reshape(2, 3)
    now, goals = feet.copy(), []
    for k in range(steps):
        foot = (first + k) % 2
        mirror = np.array([1.0, 1.0, 1.0]) if foot == 0 else np.array([1.0, -1.0, -1.0])
        now[foot] = place(now[1 - foot], rng.uniform(GOAL_LO, GOAL_HI) * mirror)
        goals.append(now[foot].copy())
    return feet, np.array(goals), first


class StepSolver:
    """Plans and refines single steps; one per process."""

    def __init__(self, seed: int, settings: Settings):
        self.seed, self.settings = seed, settings
        self.problem = engine.TalosSteps()
        self.nq = self.problem.nx - self.problem.nv

    def solve(self, feet: np.ndarray, goals: np.ndarray, first: int) -> dict:
        """Both stages of steps from feet (2, 3) to goals (n, 3): q, u of each, cost, iterations, outcome."""
        problem, settings = self.problem, self.settings
        row = self.nothing(len(goals))
        try:
            problem.set(feet, goals, first)
        except ValueError:
            return row | {"outcome": NO_POSTURE}
        planned = problem.planned()
        row |= {"q_raw": planned["xs"][:, : self.nq].astype(np.float32), "u_raw": planned["us"].astype(np.float32)}
        if not planned["error"] <= settings.planned:
            return row | {"outcome": NOT_PLANNED}
        found = problem.solve(planned["xs"], planned["us"], iterations=settings.iterations, stop=settings.stop)
        row |= {"q": found["xs"][:, : self.nq].astype(np.float32), "u": found["us"].astype(np.float32),
                "cost": found["cost"], "iterations": found["iterations"]}  # fmt: skip
        return row | {"outcome": self.judge(found, goals, first)}

    def judge(self, found: dict, goals: np.ndarray, first: int) -> int:
        """OK or the first reason against a solution."""
        if not found["converged"]:
            return NOT_CONVERGED
        feet, _ = self.problem.feet(found["xs"][:, : self.nq])
        for i, (end, goal) in enumerate(zip(self.problem.begins()[1:], goals, strict=True)):
            if np.abs(feet[end, (first + i) % 2][[0, 1, 3]] - goal).max() > self.settings.landing:
                return MISSED
        return OK if np.all(np.abs(found["us"]) <= engine.talos.u_max) else TOO_STRONG

    def nothing(self, steps: int) -> dict:
        """The row of a task before anything is known about it."""
        T, nu = self.problem.knots + (steps - 1) * (self.problem.swing + self.problem.between), self.problem.nu
        q, u = np.zeros((T + 1, self.nq), np.float32), np.zeros((T, nu), np.float32)
        return {"q_raw": q, "u_raw": u, "q": q, "u": u, "cost": np.nan, "iterations": 0}


def draw_row(seed: int, foot: int, i: int) -> tuple[dict, tuple[np.ndarray, np.ndarray, int]]:
    """Item i of a foot, or of the walks (foot 2): how its row begins, and feet, goals, first foot."""
    if foot == WALKS:
        feet, goals, first = draw_walk(seed, i)
        return {"X": np.vstack([feet, goals]).ravel(), "first": first, "seeds": i}, (feet, goals, first)
    x = draw(seed, foot, i)
    return {"X": x, "seeds": i}, (x[:6].reshape(2, 3), x[None, 6:], foot)


def solve_items(solver: StepSolver, foot: int, items: range) -> Arrays:
    """The items of a foot, or the walks."""
    drawn = [draw_row(solver.seed, foot, i) for i in items]
    rows = [row | solver.solve(*task) for row, task in drawn]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def make_steps(seed: int, foot: int, settings: Settings) -> Callable[[range], Arrays]:
    """What a worker process runs."""
    return partial(solve_items, StepSolver(seed, settings), foot)
