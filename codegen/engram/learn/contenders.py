"""Contenders for the memory of a reach: learners, and the controls they must beat. Each proposes ends and bows for a task.

A learner maps the features of a task to the posture at the end and to the leading coefficients of the bow, with many answers if
it can: that map has many modes. Controls: nothing at all, straight lines, random postures, nearest neighbours in as few bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from engram.emit import Knn, Mlp, Table
from engram.engine import engine
from engram.learn.memory import Ensemble, Memory, Motions, bow_features
from engram.learn.mixture import condition, fit_gaussian, mixture_table
from engram.learn.network import Network, fit_by_pytorch, fit_density, fit_ensemble
from engram.learn.train import POSTURES, SAMPLES, likely, poses

ANSWERS = 8  # asked of every learner, as many as the memory has neighbours
SMALLER = ("bgmr", "mdn")  # learners that compete with int8 storage as well: what it costs is measured
RANDOM = 8  # postures of the uniform control


@dataclass(frozen=True)
class Settings:
    """Sizes of the learners."""

    leading: int = 12  # coefficients of the bow that learners predict; the others are left at their mean
    components: int = 24  # of the mixture of Gaussians
    hidden: int = 64
    depth: int = 2
    members: int = 5  # of the ensemble
    modes: int = 8  # of the mixture density network
    epochs: int = 100
    seed: int = 0
    trainer: str = "own"  # of networks; or "torch": PyTorch


def table_bytes(table: Table) -> int:
    """Of the arrays of a table."""
    return sum(4 * array.words.size for array in table.arrays())


# (ends that inverse kinematics made of some of the postures, indices of these) -> coefficients of the bows (m, components)
Bows = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Contender:
    """`propose(x, start)`: postures (k, nq) at the end and their bows (None: straight lines), for features x and a start."""

    name: str
    propose: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, Bows | None]]
    near: bool  # its postures are answers: inverse kinematics may only correct them, not wander off
    tables: tuple[Table, ...] = ()
    control: bool = False  # there to be beaten, not to be chosen
    ensemble: Ensemble = field(default_factory=Ensemble)  # what the controller must ask for to have its guesses

    @property
    def bytes(self) -> int:
        """Of its tables."""
        return sum(table_bytes(table) for table in self.tables)

    def query_us(self, queries: int = 200) -> float:
        """Median processor time of a query of its table, anywhere in its domain; 0 without a table."""
        if not self.tables:
            return 0.0
        table = self.tables[0]
        x = np.random.default_rng(0).uniform(table.lo, table.hi, (queries, len(table.lo)))
        return float(np.median(engine.Table(table).time_us(x, ANSWERS)))


def from_table(name: str, table: Table, nq: int, components: int, answers: int = ANSWERS, control: bool = False,
               ensemble: Ensemble | None = None) -> Contender:  # fmt: skip
    """A learner that is a table from features to (end, leading coefficients). ensemble: by default with this table."""
    evaluator = engine.Table(table)

    def propose(x: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, Bows]:
        found = evaluator.answers(x[None], answers)
        y = found["y"][0][found["index"][0] >= 0]
        z = np.zeros((len(y), components))
        z[:, : y.shape[1] - nq] = y[:, nq:]
        return np.ascontiguousarray(y[:, :nq]), lambda ends, kept: z[kept]

    return Contender(
        name, propose, True, (table,), control, ensemble or Ensemble(learners=(replace(table, role=name.replace(".", "_")),))
    )


def smaller(knn: Knn, size: int) -> Knn:
    """The nearest-neighbour control at the same bytes: as many samples as fit, spread over the data."""
    per_sample = 4 * (knn.x.shape[1] + -(-knn.value.shape[1] // 8) * 8)
    keep = np.linspace(0, len(knn.x) - 1, int(np.clip(size // per_sample, 8, len(knn.x)))).round().astype(int)
    return Knn(**{**common(knn), "role": "knn"}, x=knn.x[keep], scale=knn.scale, value=knn.value[keep])


def common(table: Table) -> dict:
    """What the tables of the same inputs share."""
    return dict(inputs=table.inputs, lo=table.lo, hi=table.hi, held_out_error=0.0, held_out_text="not measured")


def network_table(net: Network, **rest: object) -> Mlp:
    """The table of a network."""
    return Mlp(center=net.center, width=net.width, weights=net.weights, biases=net.biases, modes=net.modes, **rest)


def learners(
    motions: Motions, memory: Memory, settings: Settings, progress: Callable[[str], None] = lambda text: None
) -> list[Contender]:
    """All learners, fitted on the motions that are not held out, each with its nearest-neighbour control."""
    train, nq, m = ~motions.held_out, motions.nq, memory.code.components
    x = np.asarray(motions.x, np.float32).astype(float)[train]
    z = memory.code.encode(motions.t, motions.q)
    y = np.hstack([motions.q[:, -1], z[:, : settings.leading]])[train]
    shared = {**common(memory.knn), "role": "learner"}
    made = []

    sizes = dict(hidden=settings.hidden, depth=settings.depth, epochs=settings.epochs, seed=settings.seed)
    torch = settings.trainer == "torch"
    ensemble, density = (fit_by_pytorch, fit_by_pytorch) if torch else (fit_ensemble, fit_density)
    for name, make in (
        ("gmr", lambda: mixture_table(condition(fit_gaussian(x, y, settings.components, seed=settings.seed)), **shared)),
        ("bgmr", lambda: memory.mixture),
        ("mlp", lambda: network_table(ensemble(x, y, members=settings.members, **sizes), **shared)),
        ("mdn", lambda: network_table(density(x, y, modes=settings.modes, **sizes), **shared)),
    ):
        progress(f"learner {name}")
        learner = from_table(name, make(), nq, m)
        control = smaller(memory.knn, learner.bytes)
        made += [learner, from_table(f"{name}.knn_at_bytes", control, nq, m, control=True)]
        if name in SMALLER:
            made.append(from_table(f"{name}.int8", replace(learner.tables[0], type="int8"), nq, m))
    return made


def remembered(memory: Memory, nq: int) -> list[Contender]:
    """The nearest neighbours of the memory, one and many."""
    m = memory.code.components
    return [from_table(f"knn{k}", memory.knn, nq, m, k, ensemble=Ensemble(neighbours=k)) for k in (1, ANSWERS)]


def regression(memory: Memory, q_home: np.ndarray) -> Contender:
    """The process between given ends: postures as the lines', bows predicted once inverse kinematics has found the ends."""

    def propose(x: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, Bows]:
        return np.array([q_home, start]), predicted_bows(memory, x, start)

    return Contender("gpr", propose, False, (memory.gpr,), ensemble=Ensemble(regression=True))


def sampled(robot: str, memory: Memory, nq: int) -> Contender:
    """The tensor train: postures by sampling, the bow to each by the process."""
    cost, train = engine.study_arm(f"{robot}.pose"), engine.TensorTrain(memory.train, SAMPLES)

    def propose(x: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, Bows]:
        return likely(cost, train, poses(x[None], nq)[0])[0], predicted_bows(memory, x, start)

    return Contender("tt", propose, True, (memory.train,), ensemble=Ensemble(trains=POSTURES))


def predicted_bows(memory: Memory, x: np.ndarray, start: np.ndarray) -> Bows:
    """The process between given ends."""
    nq = len(start)

    def bows(ends: np.ndarray, kept: np.ndarray) -> np.ndarray:
        n = len(ends)
        return memory.regression.predict(bow_features(np.tile(start, (n, 1)), ends, np.tile(x[nq : nq + 3], (n, 1))))[0]

    return bows


def controls(q_lo: np.ndarray, q_hi: np.ndarray, q_home: np.ndarray, seed: int) -> list[Contender]:
    """No memory at all: standing still, straight lines to postures found from random ones, from home and from the start."""
    rng = np.random.default_rng(seed)
    return [
        Contender("cold", lambda x, start: (np.zeros((0, len(q_lo))), None), False, control=True),
        Contender("uniform", lambda x, start: (rng.uniform(q_lo, q_hi, (RANDOM, len(q_lo))), None), False, control=True),
        Contender("line", lambda x, start: (np.array([q_home, start]), None), False),
    ]
