"""The tensor train of a memory: a density over goals and postures, whose samples are ends for motions (thesis, chapter 7).

It is built from the cost of a posture for a goal (codegen/offline/study_pose.h), not from data; the ends of solved motions are
where the cross approximation starts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from engram.emit import Tt
from engram.engine import engine
from engram.learn.memory import Motions

NAMES = [("p_WT_x", "m"), ("p_WT_y", "m"), ("p_WT_z", "m"), ("beta", "rad"), ("alpha", "rad"), ("gamma", "rad")]
POSE = 6  # numbers of a goal
SAMPLES, PRIORITY, POSTURES, APART = 64, 0.8, 4, 0.3  # as controller/memory/memory_train.h draws them
TOO_MUCH = 3.0  # a cost from which inverse kinematics is not expected to get to the goal
MARGIN = 0.02  # of the range of the goals seen, on either side: the table's domain


@dataclass(frozen=True)
class Settings:
    """Of the cross approximation, as `codegen/offline/tt_cross.h`; `scale` inside the density exp(-(scale C)^2)."""

    goal_points: int = 14
    joint_points: int = 18
    rank: int = 24
    enrich: int = 24
    sweeps: int = 3
    tolerance: float = 1e-3
    scale: float = 0.4
    evaluations: int = 60  # of cost and gradient, when ends are moved to where the density is high
    start_cost: float = 0.25  # of a start, at most
    seeds: int = 12  # crosses, of which the best on goals of the training set is kept
    trials: int = 200  # of these goals


def poses(x: np.ndarray, nq: int) -> np.ndarray:
    """memory_pose of controller/memory/memory_pose.h: (n, 6) from the features (n, nq + 9) of tasks."""
    p, z, ex = x[:, nq : nq + 3], x[:, nq + 3 : nq + 6], x[:, nq + 6 : nq + 9]
    ey = np.cross(z, ex)
    beta, alpha = np.arctan2(z[:, 0], z[:, 2]), np.arcsin(np.clip(-z[:, 1], -1, 1))
    gamma = np.arctan2(ex[:, 1], ey[:, 1])
    angles = [np.where(a < -np.pi / 2, a + 2 * np.pi, a) for a in (beta, gamma)]
    return np.column_stack([p, angles[0], alpha, angles[1]])


def fit_train(robot: str, motions: Motions, settings: Settings, progress: Callable[[str], None] = lambda text: None) -> Tt:
    """The train of an arm's cost '<robot>.pose' over the goals of the motions; its error is measured on those held out.

    Raises ValueError where the arm has no such cost.
    """
    cost = engine.study_arm(f"{robot}.pose")
    cost.scale = settings.scale
    nq = motions.nq
    goals = poses(np.asarray(motions.x, float), nq)
    train = ~motions.held_out
    lo, hi = goals[train].min(axis=0), goals[train].max(axis=0)
    margin = MARGIN * (hi - lo)
    cost.lo, cost.hi = [*(lo - margin), *cost.lo[POSE:]], [*(hi + margin), *cost.hi[POSE:]]
    ends, c = cost.refine(np.hstack([goals, motions.q[:, -1]])[train], settings.evaluations)
    starts = ends[c <= settings.start_cost]
    progress(f"train: {settings.seeds} cross approximations from {len(starts)} ends, rank {settings.rank}")
    points = [settings.goal_points] * POSE + [settings.joint_points] * nq
    inputs = NAMES + [(f"q{i}", "rad") for i in range(nq)]

    def made(seed: int) -> Tt:
        cores, _ = cost.cross(points, starts, settings.rank, settings.enrich, settings.sweeps, settings.tolerance, seed)
        return Tt(
            role="tt", inputs=inputs, lo=np.array(cost.lo), hi=np.array(cost.hi), held_out_error=0.0, held_out_text="",
            cores=cores, type="int8",
        )  # fmt: skip

    trained = goals[train][:: max(1, int(train.sum()) // settings.trials)][: settings.trials]
    tables = [made(seed) for seed in range(1, settings.seeds + 1)]
    table = min(tables, key=lambda t: float(np.mean(cheapest(cost, t, trained))))
    table.held_out_error = float(np.median(cheapest(cost, table, goals[motions.held_out])[:, 0]))
    table.held_out_text = f"[1] median lowest cost of {SAMPLES} samples on {int(motions.held_out.sum())} held-out goals"
    return table


def cheapest(cost: engine.StudyCost, table: Tt, goals: np.ndarray) -> np.ndarray:
    """Costs (n, POSTURES) of the postures that the controller would draw for goals (n, 6); at most TOO_MUCH each."""
    train = engine.TensorTrain(table, SAMPLES)
    costs = np.full((len(goals), POSTURES), TOO_MUCH)
    for i, goal in enumerate(goals):
        c = likely(cost, train, goal)[1]
        costs[i, : len(c)] = np.minimum(c, TOO_MUCH)
    return costs


def likely(cost: engine.StudyCost, train: engine.TensorTrain, goal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """likely_postures of controller/memory/memory_train.h: (k, nq) for a goal (6,), k at most POSTURES, and their costs (k,)."""
    train.condition(np.concatenate([goal, np.zeros(cost.d - POSE)]), np.arange(cost.d) < POSE)
    x = train.sample(PRIORITY, SAMPLES, seed=1)[0]
    c = cost.evaluate(x)
    kept: list[int] = []
    for j in np.argsort(c, kind="stable"):
        if all(np.abs(x[j] - x[k]).max() > APART for k in kept):
            kept.append(j)
        if len(kept) == POSTURES:
            break
    return np.ascontiguousarray(x[kept, POSE:]), c[kept]
