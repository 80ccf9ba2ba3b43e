"""Trying guesses: the deployed query on fitted tables, and the deployed solver from each of its guesses."""

from __future__ import annotations

import numpy as np

from engram.data.reach import OK, ReachSolver
from engram.data.reach import Settings as SolverSettings
from engram.engine import engine
from engram.learn.dataset import Source
from engram.learn.memory import Memory
from engram.learn.trust import Trials, constant_trust
from engram.robots.emit_header import camel
from engram.tasks.spec import TaskSpec

ITERATIONS = 30  # within which the solver must succeed for a guess to count as good


def try_guesses(spec: TaskSpec, memory: Memory, source: Source, tasks: int) -> Trials:
    """Solve from every guess of `tasks` held-out tasks; good: it converges to a motion that arrives, clear of obstacles."""
    solver = ReachSolver(spec, 0, SolverSettings(iterations=ITERATIONS))
    table = getattr(engine, f"{camel(f'{spec.robot.name}_{spec.name}')}Memory")(
        memory.knn, memory.gpr, memory.bow, memory.time, constant_trust(0.5)
    )
    number, inputs, good = [], [], []
    for i in np.flatnonzero(source.motions.held_out)[:tasks]:
        start, vector = source.motions.q[i, 0], source.vector[i]
        solver.set(start, vector)
        answer = table.query(np.r_[start, np.zeros(len(start))], vector)
        for xs, us, row in zip(answer["xs"], answer["us"], answer["trust_inputs"], strict=True):
            found = solver.problem.solve(xs, us, iterations=ITERATIONS, stop=solver.settings.stop)
            number.append(i)
            inputs.append(row)
            good.append(solver.judge(found, vector) == OK)
    return Trials(np.array(number), np.array(inputs), np.array(good))


def decoding_loss(spec: TaskSpec, memory: Memory, source: Source) -> list[tuple[str, float, str]]:
    """What a held-out motion loses by being remembered, between its own ends.

    Its controls come back as the inverse dynamics of its path: their error beside the spread of the solver's own, and the cost
    of the motion above the solver's.
    """
    solver = ReachSolver(spec, 0, SolverSettings())
    motions = source.motions
    error, spread, loss = [], [], []
    for i in np.flatnonzero(motions.held_out):
        q = motions.q[i : i + 1]
        path = memory.code.decode(memory.code.encode(motions.t, q), motions.t, q[:, 0], q[:, -1])
        solver.set(q[0, 0], source.vector[i])
        xs, us = solver.problem.warp(path, np.ascontiguousarray(q[:, -1]))
        error.append(us[0] - source.us[i])
        spread.append(source.us[i] - source.us[i].mean(axis=0))
        loss.append(solver.problem.merit(xs, us)[0] / source.cost[i] - 1)
    return [
        ("us.rms", float(np.sqrt(np.mean(np.square(error)))), "N m"),
        ("us.spread", float(np.sqrt(np.mean(np.square(spread)))), "N m"),
        ("decoded.suboptimality", float(np.median(loss)), "1"),
    ]
