"""How far the guess and the first iterations at a jump are from the best known solution of the same problem.

The controller writes, for each jump, the problem (state, task vector) and the merit of its guess and after each iteration. J* is
the lowest cost among what the controller itself reached there and what comes of straight lines and detours.
"""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engram_sim.pair import Progress
from engram_sim.results import Run

ITERATIONS = 10  # that are shown
IK_STARTS = 22  # postures from which inverse kinematics looks for ends of lines
LINES, DETOURS = 3, 1  # guesses of lowest merit that are solved
SHORT, LONG, KEPT = 20, 40, 2  # iterations of each; more iterations of the cheapest two
SMALL_CHUNK = 8


@dataclass(frozen=True)
class Jump:
    """A row of jumps.csv: problem (state (nx), task vector) and merits (of the guess, after 1, 2, ... iterations)."""

    jump: int
    winner: str
    x0: np.ndarray
    task: np.ndarray
    merits: np.ndarray


def read_jumps(path: Path) -> list[Jump]:
    """jumps.csv of engram-controller; empty if there is none. An unfinished last line is left out."""
    if not path.is_file():
        return []
    header, *lines = path.read_text(encoding="utf-8").splitlines() or [""]
    names = header.split(",")
    columns = {start: [i for i, name in enumerate(names) if name.startswith(start)] for start in ("x0_", "task_", "merits")}
    jumps = []
    for line in lines:
        words = line.split(",")
        if len(words) >= len(names) and int(words[0]) > 0:  # 0: the controller was reset, there is no jump yet
            x0, task = (np.array([float(words[i]) for i in columns[start]]) for start in ("x0_", "task_"))
            merits = np.array([float(word) for word in words[columns["merits"][0] :]])
            jumps.append(Jump(int(words[0]), words[2], x0, task, merits))
    return jumps


_solver = None


def _start(robot: str, task: str) -> None:
    global _solver
    from engram.data.reach import ReachSolver, Settings
    from engram.tasks.spec import load_task

    _solver = ReachSolver(load_task(robot, task), 0, Settings())


def best_cost(x0: np.ndarray, task: np.ndarray) -> float:
    """Lowest cost without gaps that comes of straight lines and detours by way of home; infinite if all keep gaps."""
    from engram.data.reach import detour

    problem, nq = _solver.problem, len(_solver.q_lo)
    rng = np.random.default_rng(0)
    starts = np.vstack([x0[:nq], rng.uniform(_solver.q_lo, _solver.q_hi, (IK_STARTS, nq))])
    ends = _solver.ends(task, starts)
    problem.set(x0, task)
    if not len(ends):
        return np.inf
    lines = problem.line(ends)
    detours = problem.warp(detour(x0[:nq], _solver.spec.robot.q_home, ends, _solver.spec.knots), ends)
    found = []
    for (xs, us), count in ((lines, LINES), (detours, DETOURS)):
        chosen = np.argsort(problem.merit(xs, us), kind="stable")[:count]
        found += [problem.solve(xs[i], us[i], iterations=SHORT, stop=_solver.settings.stop) for i in chosen]
    found.sort(key=lambda f: (not f["feasible"], f["cost"]))
    begun = [f for f in found[:KEPT] if not f["converged"]]
    found += [problem.solve(f["xs"], f["us"], iterations=LONG, stop=_solver.settings.stop) for f in begun]
    return min((float(f["cost"]) for f in found if f["feasible"]), default=np.inf)


def _best_costs(problems: list[tuple[np.ndarray, np.ndarray]]) -> list[float]:
    return [best_cost(x0, task) for x0, task in problems]


def curves(runs: list[Run], robot: str, task: str, jobs: int = 2) -> dict[str, np.ndarray]:
    """Suboptimality (merit - J*) / J* by mode: (jumps, ITERATIONS + 1); a jump that converged early keeps its last value.

    Modes without jumps.csv are left out; without a compiled engine all are.
    """
    jumps = {run.mode: read_jumps(run.folder / "jumps.csv") for run in runs}
    jumps = {mode: rows for mode, rows in jumps.items() if rows}
    if not jumps:
        return {}
    try:
        _start(robot, task)
    except ImportError as error:
        print(f"suboptimality is left out: {error}")
        return {}
    problems = [(row.x0, row.task) for rows in jumps.values() for row in rows]
    chunks = [problems[i : i + SMALL_CHUNK] for i in range(0, len(problems), SMALL_CHUNK)]
    progress, best = Progress(len(problems), "best  "), []
    with ProcessPoolExecutor(jobs, initializer=_start, initargs=(robot, task)) as pool:
        for costs in pool.map(_best_costs, chunks):
            best += costs
            progress.show(len(best))
    found, first = {}, 0
    for mode, rows in jumps.items():
        found[mode] = np.array([suboptimality(row.merits, cost) for row, cost in zip(rows, best[first:])])
        first += len(rows)
    return found


def suboptimality(merits: np.ndarray, best: float) -> np.ndarray:
    """(ITERATIONS + 1) values (merit - J*) / J*, J* the lowest of `best` and the merits themselves; the last one is repeated."""
    lowest = min(best, merits.min())
    padded = np.concatenate([merits, np.full(ITERATIONS + 1, merits[-1])])[: ITERATIONS + 1]
    return (padded - lowest) / lowest
