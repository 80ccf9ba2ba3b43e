"""Trying guesses: the deployed query on fitted tables, and the deployed solver from each of its guesses."""

from __future__ import annotations

import numpy as np

from engram.data.reach import OK, ReachSolver
from engram.data.reach import Settings as SolverSettings
from engram.engine import engine
from engram.learn.dataset import Source
from engram.learn.memory import Memory, rms
from engram.learn.timebase import TimeBasis
from engram.learn.trust import Trials, constant_trust
from engram.robots.emit_header import camel
from engram.tasks.spec import TaskSpec

ITERATIONS = 30  # within which the solver must succeed for a guess to count as good


def try_guesses(spec: TaskSpec, memory: Memory, source: Source, tasks: int) -> Trials:
    """Solve from every guess of `tasks` held-out tasks; good: it converges to a motion that arrives, clear of obstacles."""
    solver = ReachSolver(spec, 0, SolverSettings(iterations=ITERATIONS))
    table = memory_of(spec, memory)
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


GOALS = 4  # offered to the metric at a time


def metric_regret(spec: TaskSpec, memory: Memory, source: Source, choices: int) -> list[tuple[str, float, str]]:
    """The memory as a metric (thesis, algorithm 2): GOALS goals of held-out motions from one start, one of them chosen unsolved.

    Cost of the solved way to the chosen goal above that to the cheapest one, median, beside that of a goal chosen blindly.
    """
    solver = ReachSolver(spec, 0, SolverSettings(iterations=ITERATIONS))
    table = memory_of(spec, memory)
    held_out = np.flatnonzero(source.motions.held_out)
    chosen, blind, right = [], [], []
    for i in range(min(choices, len(held_out) - GOALS)):
        start, vectors = source.motions.q[held_out[i], 0], source.vector[held_out[i : i + GOALS]]
        x0 = np.r_[start, np.zeros(len(start))]
        best, _ = table.metric(x0, np.ascontiguousarray(vectors))
        costs = []
        for vector in vectors:
            solver.set(start, vector)
            answer = table.query(x0, vector)
            guess = int(np.argmin(solver.problem.merit(answer["xs"], answer["us"])))
            found = solver.problem.solve(
                answer["xs"][guess], answer["us"][guess], iterations=ITERATIONS, stop=solver.settings.stop
            )
            costs.append(found["cost"])
        above = np.array(costs) / min(costs) - 1
        chosen.append(above[best])
        blind.append(above.mean())
        right.append(above[best] == 0)
    return [
        ("metric.right", float(np.mean(right)), "1"),
        ("metric.excess", float(np.median(chosen)), "1"),
        ("metric.excess_blind", float(np.median(blind)), "1"),
    ]


def memory_of(spec: TaskSpec, memory: Memory):
    """The deployed query on fitted tables, whose trust knows nothing yet."""
    kind = getattr(engine, f"{camel(f'{spec.robot.name}_{spec.name}')}Memory")
    ask = memory.ensemble
    return kind(
        memory.knn, memory.gpr, memory.bow, memory.time, constant_trust(0.5), list(ask.learners), memory.train,
        neighbours=ask.neighbours, trains=ask.trains, regression=ask.regression, lines=ask.lines,
    )  # fmt: skip


def decoding_loss(spec: TaskSpec, memory: Memory, source: Source) -> list[tuple[str, float, str]]:
    """What held-out motions lose by being remembered, between their own ends, by where their controls come from.

    `dynamics`: the inverse dynamics of the decoded motion, the guess without gaps; `recalled`: with what the table remembers of
    the controls beyond that; `stored`: decoded from as many coefficients of their own, without any model. For each: error of the
    controls, and suboptimality of the guess and after one iteration (median merit above the solver's cost). `spread`: standard
    deviation of the solver's controls over a motion.
    """
    solver = ReachSolver(spec, 0, SolverSettings())
    motions, code = source.motions, memory.code
    test = motions.held_out
    q, u, cost = motions.q[test], motions.u[test], source.cost[test]
    z = code.encode(motions.t, q)
    paths, beyond = code.decode(z, motions.t, q[:, 0], q[:, -1]), code.decode_controls(z, motions.t[:-1])
    stored = recalled_alone(code.time, motions.t[:-1], motions.u[~test], u, code.components)
    errors: dict[str, list] = {"dynamics": [], "recalled": [], "stored": []}
    loss: dict[tuple[str, int], list] = {(kind, k): [] for kind in errors for k in (0, 1)}
    for i, vector in enumerate(source.vector[test]):
        solver.set(q[i, 0], vector)
        xs, us = (guess[0] for guess in solver.problem.warp(paths[i : i + 1], np.ascontiguousarray(q[i : i + 1, -1])))
        for kind, guess in (("dynamics", us), ("recalled", us + beyond[i]), ("stored", stored[i])):
            errors[kind].append(guess - u[i])
            found = solver.problem.solve(xs, guess, iterations=1, stop=solver.settings.stop)
            for k, trajectory in enumerate(((xs, guess), (found["xs"], found["us"]))):
                merit = solver.problem.merit(*(part[None] for part in trajectory))[0]
                loss[kind, k].append(merit / cost[i] - 1)
    return [
        ("us.spread", rms(u - u.mean(axis=1, keepdims=True)), "N m"),
        *((f"us.rms.{kind}", rms(np.array(error)), "N m") for kind, error in errors.items()),
        *((f"decoded.subopt{k}.{kind}", float(np.median(values)), "1") for (kind, k), values in loss.items()),
    ]


def recalled_alone(time: TimeBasis, t: np.ndarray, known: np.ndarray, u: np.ndarray, components: int) -> np.ndarray:
    """Controls u (n, nt, nu) as Gaussians over time and `components` principal components of the `known` ones, back again."""
    first, second = (time.fit(t, values, pin_ends=False).reshape(len(values), -1) for values in (known, u))
    mean = first.mean(axis=0)
    rows = np.linalg.svd(first - mean, full_matrices=False)[2][:components]
    weights = (mean + (second - mean) @ rows.T @ rows).reshape(len(u), time.k, -1)
    return np.einsum("tk,nkc->ntc", time.phi(t), weights)
