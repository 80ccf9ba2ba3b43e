"""Tensor trains of a study's cost: starting points, several seeds in cross approximation, the best one on validation tasks."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from engram.emit import Tt
from engram.engine import engine

SOLVED = 0.25  # cost at or below which a task counts as solved (thesis, caption of table 7.1)
WORKERS = 2  # seeds that are built side by side
OUTERMOST = 0.01  # share of the starting points, at either end, that a fitted grid leaves out
MARGIN = 0.02  # what it adds, of the others' range


@dataclass(frozen=True)
class Recipe:
    """How a train is built. points: of a task variable and of a decided one; the rest as in codegen/offline/tt_cross.h."""

    points: tuple[int, int]
    rank: int
    weights: tuple[int, int] = (0, 0)  # so many variables at the end are weights of motions: a coarser grid, so many points each
    fitted: bool = False  # the grid spans the starting points alone, and these move downhill on it
    enrich: int = 8
    sweeps: int = 3
    tolerance: float = 1e-3
    scale: float = 1.0  # inside the density exp(-(scale C)^power)
    power: int = 2
    type: str = "int8"
    seeds: int = 6
    alpha: float = 0.9  # priority of the samples that a seed is judged by
    starts: int = 600  # tasks from whose solutions the trains grow
    start_cost: float = SOLVED  # of a solution, at most
    uniform: int = 20  # uniform points per starting task, of which the best is refined
    evaluations: int = 200  # of cost and gradient in one refinement
    spread: bool = False  # starting points lie apart in the task, the same ones in all blocks of a sweep
    start_evaluations: int = 0  # of cost and gradient on the way to a starting point; 0: as in a refinement
    judged: tuple[int, ...] = (1, 10, 100)  # numbers of samples that a seed is judged by


@dataclass
class Built:
    """A train and what it took."""

    train: engine.TensorTrain
    table: Tt
    cores: list[np.ndarray]
    seed: int
    validation: list[float]  # success of each seed
    values: int  # of the density, all seeds together
    cpu: float  # s, all seeds and their validation together
    wall: float  # s


def table_of(cost: engine.StudyCost, cores: list[np.ndarray], type: str = "float32") -> Tt:
    """The train as a table over the cost's box."""
    inputs = [(f"x{k}", "1") for k in range(cost.d)]
    return Tt(
        inputs=inputs, lo=np.array(cost.lo), hi=np.array(cost.hi), held_out_error=0.0, held_out_text="", cores=cores, type=type
    )


def uniform_points(cost: engine.StudyCost, tasks: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """(tasks, count, d): uniform in the box, with the tasks in front."""
    x = rng.uniform(cost.lo, cost.hi, (len(tasks), count, cost.d))
    x[:, :, : cost.ntask] = tasks[:, None, :]
    return x


def lowest(cost: engine.StudyCost, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each task's points (tasks, count, d) the one of lowest cost, and its cost."""
    tasks, count, d = x.shape
    c = cost.evaluate(x.reshape(-1, d)).reshape(tasks, count)
    best = c.argmin(axis=1)
    return x[np.arange(tasks), best], c[np.arange(tasks), best]


def refined(cost: engine.StudyCost, x: np.ndarray, evaluations: int) -> tuple[np.ndarray, np.ndarray]:
    """`cost.refine` of x (m, d) on all workers."""
    parts = np.array_split(x, WORKERS)
    with ThreadPoolExecutor(WORKERS) as pool:
        ends, c = zip(*pool.map(lambda part: cost.refine(part, evaluations), parts), strict=True)
    return np.concatenate(ends), np.concatenate(c)


def solutions(cost: engine.StudyCost, tasks: np.ndarray, recipe: Recipe, rng: np.random.Generator) -> np.ndarray:
    """Solved points (m, d): the best of some uniform points of each task, refined; those above the start cost are left out."""
    start, _ = lowest(cost, uniform_points(cost, tasks, recipe.uniform, rng))
    x, c = refined(cost, start, recipe.start_evaluations or recipe.evaluations)
    return x[c <= recipe.start_cost]


def box_of(cost: engine.StudyCost, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the decided variables of the starting points lie, but for the outermost of them; the task's box stays."""
    lo, hi = np.array(cost.lo), np.array(cost.hi)
    low, high = np.quantile(starts, [OUTERMOST, 1 - OUTERMOST], axis=0)
    margin, decided = MARGIN * (high - low), np.arange(cost.d) >= cost.ntask
    return np.where(decided, np.maximum(lo, low - margin), lo), np.where(decided, np.minimum(hi, high + margin), hi)


def descended(cost: engine.StudyCost, starts: np.ndarray, points: list[int], rng: np.random.Generator) -> np.ndarray:
    """The starting points on the grid over the cost's box: rounded, which costs them dearly, then twice every variable moved to a
    neighbouring grid point if that is cheaper."""
    lo, hi = np.array(cost.lo), np.array(cost.hi)
    step = (hi - lo) / (np.array(points) - 1)
    x = lo + np.clip(np.rint((starts - lo) / step), 0, np.array(points) - 1) * step
    c = cost.evaluate(x)
    for _ in range(2):
        for k in cost.ntask + rng.permutation(cost.d - cost.ntask):
            for side in (-step[k], step[k]):
                tried = x.copy()
                tried[:, k] = np.clip(x[:, k] + side, lo[k], hi[k])
                c_tried = cost.evaluate(tried)
                x = np.where((c_tried < c)[:, None], tried, x)
                c = np.minimum(c, c_tried)
    return x


def samples(train: engine.TensorTrain, cost: engine.StudyCost, tasks: np.ndarray, alpha: float, count: int) -> np.ndarray:
    """(tasks, count, d) samples of the train, conditioned on each task."""
    fixed = np.arange(cost.d) < cost.ntask
    x = np.empty((len(tasks), count, cost.d))
    for i, task in enumerate(tasks):
        train.condition(np.concatenate([task, np.zeros(cost.d - cost.ntask)]), fixed)
        x[i] = train.sample(alpha, count, seed=i + 1)[0]
    return x


def build(
    cost: engine.StudyCost,
    recipe: Recipe,
    draw: Callable[[np.random.Generator, int], np.ndarray],
    validation: np.ndarray,
) -> Built:
    """The train of the seed from whose samples most validation tasks are solved, on average over `judged`."""
    cost.scale, cost.power = recipe.scale, recipe.power
    cpu, wall = time.process_time(), time.perf_counter()
    weights, coarser = recipe.weights
    points = [recipe.points[0]] * cost.ntask + [recipe.points[1]] * (cost.d - cost.ntask - weights) + [coarser] * weights
    rng = np.random.default_rng(1)
    starts = solutions(cost, draw(rng, recipe.starts), recipe, rng)
    box = cost.lo, cost.hi
    if recipe.fitted:
        lo, hi = box_of(cost, starts)
        cost.lo, cost.hi = list(lo), list(hi)
        starts = descended(cost, starts, points, rng)
    spread = cost.ntask if recipe.spread else 0

    def crossed(seed: int) -> tuple[list[np.ndarray], int, Tt]:
        cores, values = cost.cross(points, starts, recipe.rank, recipe.enrich, recipe.sweeps, recipe.tolerance, seed, spread)
        return cores, values, table_of(cost, cores, recipe.type)

    def judged(table: Tt) -> tuple[float, engine.TensorTrain]:
        train = engine.TensorTrain(table, 1000)
        drawn = samples(train, cost, validation, recipe.alpha, max(recipe.judged))
        c = np.array([cost.refine(lowest(cost, drawn[:, :n])[0], recipe.evaluations)[1] for n in recipe.judged])
        # among equals, the lower cost
        return float(np.mean(c <= SOLVED)) - 1e-3 * float(np.mean(np.minimum(c, 1))), train

    with ThreadPoolExecutor(WORKERS) as pool:
        made = list(pool.map(crossed, range(1, recipe.seeds + 1)))
        cost.lo, cost.hi = box  # the refiner's
        built = list(pool.map(judged, [table for _, _, table in made]))
    best = max(range(len(built)), key=lambda i: built[i][0])
    cores, _, table = made[best]
    return Built(
        train=built[best][1], table=table, cores=cores, seed=best + 1, validation=[b[0] for b in built],
        values=sum(m[1] for m in made),
        cpu=time.process_time() - cpu,
        wall=time.perf_counter() - wall,
    )  # fmt: skip
