"""S3.1 to S3.4: warm starts of single steps and of walks of three, tables 4.1 to 4.4 of the thesis beside ours.

The memory is the deployed query (controller/memory/step_memory.h), its competitors go through the compiled evaluators of their
tables. Solves are counted by the thesis' rule: sum |Qu|^2 < 1e-2 at a trajectory without gaps, at most 20 iterations; the
iteration that finds the rule fulfilled counts, so that two are the least from a guess with gaps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from engram.data import step_set, steps
from engram.data.step_set import StepData
from engram.emit import Knn, Table
from engram.engine import engine
from engram.learn.mixture import condition, fit_gaussian, mixture_table
from engram.learn.step_fit import split
from engram.learn.steps import FROM_WALK, INPUTS, INTO_WALK, Coded, Settings, Step, StepTables, fit, steps_of
from engram.paths import BUILD
from engram.study.report import Report

TESTED = 200
SEED = 2  # of the tested tasks; the memory's data have another one
RULE = {"iterations": 20, "stop_gradient": 1e-2}
TODAY = {"iterations": 20, "stop": 1e-2}  # expected improvement of a full step
THESIS = {  # learner: trajectory error (rad), contact error (m), raw and refined (table 4.1)
    "gpr": (9.53, 0.07, 13.04, 0.04), "gmr": (12.39, 0.13, 18.51, 0.09), "knn": (18.78, 0.49, 29.93, 0.51),
}  # fmt: skip
NQ, NV = engine.talos.nq, engine.talos.nv
SETTINGS = Settings()
MIXTURE_SAMPLES, MIXTURE_COMPONENTS = 1000, 12
VARIED = [0, 1, 2, 3, 4, 5, 14]  # features that differ among single steps
JITTER = 1e-3  # of the mixture's inputs: the foot is 0 or 1, of which no Gaussian has a width


@dataclass(frozen=True)
class Tested:
    """A task of a foot, and its optimum."""

    x: np.ndarray
    foot: int
    q: np.ndarray
    cost: float
    q_raw: np.ndarray

    def pose(self, problem: engine.TalosSteps) -> None:
        problem.set(self.feet, self.x[None, 6:], self.foot)

    @property
    def feet(self) -> np.ndarray:
        return self.x[:6].reshape(2, 3)

    @property
    def step(self) -> Step:
        return Step(self.feet, self.x[6:], self.foot)


@cache
def draw_tested(count: int) -> list[Tested]:
    """Half of the left foot, half of the right."""
    problem, found = engine.TalosSteps(), []
    for i in range(count):
        x, foot = steps.draw(SEED, i % 2, i), i % 2
        problem.set(x[:6].reshape(2, 3), x[None, 6:], foot)
        planned = problem.planned()
        best = problem.solve(planned["xs"], planned["us"], stop=1e-7)
        if not best["converged"]:
            raise RuntimeError(f"the tested task {i} has no converged cold solution")
        found.append(Tested(x, foot, best["xs"][:, :NQ], best["cost"], planned["xs"][:, :NQ]))
    return found


# ---- learners -----------------------------------------------------------------------------------------------------------------


def spread(x: np.ndarray) -> np.ndarray:
    """Standard deviations of the columns, 1 where one is constant."""
    std = x.std(axis=0)
    return np.where(std > 1e-9, std, 1.0)


def shared(coded: Coded, columns: list[int] | None = None) -> dict:
    """What all tables from features to coefficients have in common."""
    columns = list(range(len(INPUTS))) if columns is None else columns
    x = coded.x[:, columns]
    return {
        "role": "learner",
        "inputs": [INPUTS[i] for i in columns],
        "lo": x.min(axis=0),
        "hi": x.max(axis=0),
        "held_out_error": 0.0,
        "held_out_text": "",
    }


class Learners:
    """GPR, GMR and k-NN on one database, with the same bases, each through the compiled evaluator of its table."""

    def __init__(self, sets: list[StepData], raw: bool, settings: Settings = SETTINGS):
        train, test = zip(*map(split, sets), strict=True)
        self.tables: StepTables = fit(list(train), list(test), settings, raw)
        self.memory, self.made, self.others = self.tables.memory(), {}, {}

    def add(self, name: str, table: Table) -> None:
        """Another learner of the same coefficients."""
        self.made[name], self.others[name] = table, engine.Table(table)

    def add_neighbour(self) -> None:
        """The nearest of all steps, in inputs of unit variance."""
        if "knn" in self.made:
            return
        coded = self.tables.coded
        self.add("knn", Knn(**shared(coded), x=coded.x, scale=1.0 / spread(coded.x), value=coded.z))

    def add_mixture(self) -> None:
        """GMR takes a while: of some of the single steps, and only where it is asked for."""
        if "gmr" in self.made:
            return
        coded = self.tables.coded
        single = np.flatnonzero(~coded.x[:, [FROM_WALK, INTO_WALK]].any(axis=1))
        some = single[:: max(1, len(single) // MIXTURE_SAMPLES)]
        x = coded.x[some][:, VARIED] + JITTER * np.random.default_rng(0).standard_normal((len(some), len(VARIED)))
        fitted = condition(fit_gaussian(x, coded.z[some], MIXTURE_COMPONENTS, ridge=1e-4))
        self.add("gmr", mixture_table(fitted, **shared(coded, VARIED)))

    def gpr(self, step: Step, x0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The deployed query: xs (T + 1, nx), us (T, nu)."""
        found = self.memory.query(*step.asked, x0, **step.within)
        return found["xs"], found["us"]

    def answer(self, name: str, step: Step, x0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """xs (T + 1, nx), us (T, nu) of a learner."""
        if name == "gpr":
            return self.gpr(step, x0)
        x, table = step.features()[None], self.others[name]
        if name == "gmr":
            z = table.moments(x[:, VARIED])[0][0]
        elif name == "knn":
            z = table.answers(x)["y"][0, 0]
        else:
            z = table.moments(x)[0][0]
        found = self.memory.decode(np.ascontiguousarray(z), *step.asked, x0, **step.within)
        return found["xs"], found["us"]


# ---- counting -----------------------------------------------------------------------------------------------------------------


@dataclass
class Count:
    """Solves from the guesses of one method."""

    iterations: list[int]
    today: list[int]
    solved: list[bool]
    cost: list[float]
    best: list[float]
    first: list[float]  # cost after one iteration, infinite if gaps are left

    @staticmethod
    def empty() -> Count:
        return Count([], [], [], [], [], [])

    def add(self, problem: engine.TalosSteps, xs: np.ndarray, us: np.ndarray, best: float) -> None:
        xs, us = np.ascontiguousarray(xs), np.ascontiguousarray(us)
        found = problem.solve(xs, us, **RULE)
        self.today.append(problem.solve(xs, us, **TODAY)["iterations"])
        self.iterations.append(found["iterations"])
        self.solved.append(found["converged"])
        self.cost.append(found["cost"])
        self.best.append(best)
        closed = found["log"][0, 2] == 1.0  # a shorter step leaves gaps, and a cost beside gaps says nothing
        self.first.append(found["log"][0, 0] if closed else np.inf)

    @property
    def excess(self) -> np.ndarray:
        return np.array(self.cost) / self.best - 1.0

    @property
    def suboptimality(self) -> float:
        return float(np.median(np.array(self.first) / self.best - 1.0))

    def line(self, label: str, thesis: str = "") -> str:
        return (f"{label:<26}{100 * np.mean(self.solved):7.1f} {np.mean(self.cost):8.3f} +- {np.std(self.cost):5.3f}"
                f"{np.mean(self.iterations):9.2f} +- {np.std(self.iterations):4.2f} {max(self.iterations):4d}"
                f"{np.mean(self.today):8.2f}{np.mean(self.excess):11.1e}{self.suboptimality:10.1e}   {thesis}")  # fmt: skip


HEAD = (f"{'guess':<26}{'% done':>7} {'cost':>8}{'':>9}{'iterations':>9}{'':>8} {'most':>4}{'today':>8}{'excess':>11}"
        f"{'after 1':>10}   thesis: % done, iterations")  # fmt: skip
LEGEND = (
    "today: iterations until a full step is expected to gain less than 1e-2; "
    "excess: mean cost over the converged cold one's; after 1: median after one iteration, inf: gaps are left"
)


def figures(report: Report, name: str, count: Count) -> None:
    """File what a method achieved."""
    n = len(count.iterations)
    report.figure(f"iterations.{name}", float(np.mean(count.iterations)), n=n)
    report.figure(f"success.{name}", float(np.mean(count.solved)), n=n)
    report.figure(f"excess.{name}", float(np.mean(count.excess)), n=n)
    if np.isfinite(count.suboptimality):
        report.figure(f"subopt1.{name}", count.suboptimality, n=n)


@cache
def load_sets(quick: bool) -> list[StepData]:
    """What `engram data talos step` left, or a small set of our own."""
    if quick:
        step_set.make(step_set.CHUNK * 8, 3, 2, BUILD / "data" / "quick")
        return step_set.load(BUILD / "data" / "quick" / "talos_step.npz")[0]
    return step_set.load(BUILD / "data" / "talos_step.npz")[0]


# ---- the rows -----------------------------------------------------------------------------------------------------------------


@cache
def learnt_from(quick: bool, raw: bool = False) -> Learners:
    """The learners on all data; fitted once, however many rows are asked for."""
    return Learners(load_sets(quick), raw, replace(SETTINGS, hyperparameter_samples=200) if quick else SETTINGS)


def accuracy(report: Report, quick: bool, tested: list[Tested]) -> None:
    """Table 4.1: what the learners predict beside the truth of each database."""
    problem, rows = engine.TalosSteps(), {name: [] for name in THESIS}
    for raw in (True, False):
        learners = learnt_from(quick, raw)
        learners.add_neighbour()
        learners.add_mixture()
        for name in THESIS:
            path, contact = [], []
            for task in tested:
                task.pose(problem)
                truth = task.q_raw if raw else task.q
                q = learners.answer(name, task.step, problem.x0)[0][:, :NQ]
                path.append(np.linalg.norm(q - truth))
                feet, _ = problem.feet(np.ascontiguousarray(q))
                true_feet, _ = problem.feet(np.ascontiguousarray(truth))
                contact.append(np.linalg.norm((feet - true_feet)[-1][:, [0, 1, 3]]))
            rows[name] += [np.mean(path), np.mean(contact)]
            if not raw:
                report.figure(f"{name}.trajectory_error", float(np.mean(path)), "rad", n=len(tested))
                report.figure(f"{name}.contact_error", float(np.mean(contact)), "m", n=len(tested))
    report.say(f"{'':<6}{'Hpp: path (rad)':>17}{'contact (m)':>13}{'Crl: path (rad)':>17}{'contact (m)':>13}   thesis")
    for name, (p0, c0, p1, c1) in rows.items():
        report.say(f"{name:<6}{p0:>17.4f}{c0:>13.5f}{p1:>17.4f}{c1:>13.5f}   {' / '.join(map(str, THESIS[name]))}")


def single(report: Report, quick: bool, tested: list[Tested]) -> None:
    """Table 4.2: warm against cold."""
    problem = engine.TalosSteps()
    raw, refined = learnt_from(quick, True), learnt_from(quick)
    for learners in (raw, refined):
        learners.add_neighbour()
        learners.add_mixture()
    methods = [
        ("cold", "cold", "98.5, 9.52", lambda task: tuple(problem.cold(False)[k] for k in ("xs", "us"))),
        ("cold, torques of stance", "cold_torques", "", lambda task: tuple(problem.cold(True)[k] for k in ("xs", "us"))),
        ("planner (stage one)", "planner", "", lambda task: tuple(problem.planned()[k] for k in ("xs", "us"))),
        ("GPR on Hpp", "gpr_hpp", "99.0, 5.01", lambda task: raw.answer("gpr", task.step, problem.x0)),
        ("GMR on Hpp", "gmr_hpp", "100, 4.85", lambda task: raw.answer("gmr", task.step, problem.x0)),
        ("k-NN on Crl", "knn", "", lambda task: refined.answer("knn", task.step, problem.x0)),
        ("GMR on Crl", "gmr", "100, 3.06", lambda task: refined.answer("gmr", task.step, problem.x0)),
        ("GPR on Crl: the memory", "memory", "100, 3.04", lambda task: refined.answer("gpr", task.step, problem.x0)),
    ]
    report.say(HEAD)
    for label, key, thesis, guess in methods:
        count = Count.empty()
        for task in tested:
            task.pose(problem)
            count.add(problem, *guess(task), task.cost)
        figures(report, key, count)
        report.say(count.line(label, thesis))
    report.say(LEGEND)
    at_cone_of_the_walk(report, refined, tested)


def at_cone_of_the_walk(report: Report, refined: Learners, tested: list[Tested], cone: float = 0.3) -> None:
    """The same tasks where wrenches weigh as in the walk, from the same memory."""
    problem = engine.TalosSteps(cone)
    counts = {"cold": Count.empty(), "memory": Count.empty()}
    for task in tested:
        task.pose(problem)
        planned = problem.planned()
        best = problem.solve(planned["xs"], planned["us"], stop=1e-7)["cost"]
        cold = problem.cold(False)
        counts["cold"].add(problem, cold["xs"], cold["us"], best)
        counts["memory"].add(problem, *refined.gpr(task.step, problem.x0), best)
    report.say("wrenches outside their cone weigh 0.3, as in the walk; the memory was learnt at 0.01:")
    for name, count in counts.items():
        figures(report, f"{name}_cone_of_walk", count)
        report.say(count.line(f"{name}, cone {cone}"))


def parts(report: Report, quick: bool, tested: list[Tested]) -> None:
    """Table 4.3: which part of the guess is remembered."""
    problem, memory = engine.TalosSteps(), learnt_from(quick)
    zero = np.zeros((problem.knots, problem.nu))

    def guess(kind: str, task: Tested) -> tuple[np.ndarray, np.ndarray]:
        xs, us = memory.gpr(task.step, problem.x0)
        still = np.repeat(problem.x0[None], len(xs), 0)
        if kind in ("qu0", "qid"):
            us = problem.along(np.ascontiguousarray(xs[:, :NQ]), kind == "qid")["us"]
        return {"q": (xs, zero), "u": (still, us), "cold": (still, zero)}.get(kind, (xs, us))

    report.say(HEAD)
    for label, kind, thesis in (("q", "q", "96.5, 5.30"), ("(q, u0), torques of rest", "qu0", "100, 3.04"),
                                ("(q, inverse dynamics)", "qid", ""), ("(q, u)", "qu", "100, 2.93"), ("u", "u", "97.5, 6.83"),
                                ("none", "cold", "98.5, 9.52")):  # fmt: skip
        count = Count.empty()
        for task in tested:
            task.pose(problem)
            count.add(problem, *guess(kind, task), task.cost)
        figures(report, kind, count)
        report.say(count.line(label, thesis))
    report.say(LEGEND)


def compose(memory: engine.TalosStepMemory, steps: list[Step], x0: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A walk of steps that are remembered one by one, each in its own frame, from where the one before ends."""
    xs, us = [x0[None]], []
    for step in steps:
        found = memory.query(*step.asked, np.ascontiguousarray(xs[-1][-1]), **step.within)
        xs.append(found["xs"][1:])
        us.append(found["us"])
    return np.vstack(xs), np.vstack(us)


def alone(steps: list[Step]) -> list[Step]:
    """The same steps, each from rest to rest."""
    return [Step(*step.asked) for step in steps]


def walks(report: Report, quick: bool, count: int) -> None:
    """Table 4.4: three steps composed of remembered ones, at the gait of the walk; and with a rest between them."""
    raw, refined = learnt_from(quick, True).memory, learnt_from(quick).memory
    rest = engine.TalosSteps.knots - engine.TalosSteps.swing
    labels = {
        "cold": "100, 6.17", "hpp": "100, 6.40", "memory": "100, 4.54",
        "cold_with_rests": "", "memory_with_rests": "",
    }  # fmt: skip
    counts = {key: Count.empty() for key in labels}
    gaits = ((engine.TalosSteps.between, "", list, count), (rest, "_with_rests", alone, -(-count // 4)))
    for between, suffix, part, walked in gaits:
        problem = engine.TalosSteps(between=between)
        for i in range(walked):
            feet, goals, first = steps.draw_walk(SEED, i)
            problem.set(feet, goals, first)
            planned = problem.planned()
            best = problem.solve(planned["xs"], planned["us"], stop=1e-7, iterations=200)
            if not best["converged"]:
                raise RuntimeError(f"the tested walk {i} has no converged solution")
            cold, asked = problem.cold(False), part(steps_of(feet, goals, first))
            counts[f"cold{suffix}"].add(problem, cold["xs"], cold["us"], best["cost"])
            counts[f"memory{suffix}"].add(problem, *compose(refined, asked, problem.x0), best["cost"])
            if not suffix:
                counts["hpp"].add(problem, *compose(raw, asked, problem.x0), best["cost"])
    report.say(HEAD)
    for key, thesis in labels.items():
        figures(report, key, counts[key])
        report.say(counts[key].line(key, thesis))
    report.say(
        f"with_rests: {rest} knots on both feet between two swings, not {engine.TalosSteps.between}; steps from rest to rest"
    )
    report.say(LEGEND)


TITLES = {
    "3.1": "accuracy of learners on raw and refined steps (table 4.1)",
    "3.2": "single steps, warm against cold (table 4.2)",
    "3.3": "which part is remembered (table 4.3)",
    "3.4": "walks of three steps, composed of single ones (table 4.4)",
}


def run(row: str, quick: bool) -> None:
    """Print the table beside the thesis' and file its figures."""
    report = Report(row, TITLES[row])
    sets, count = load_sets(quick), 20 if quick else TESTED
    report.say(f"{sum(map(len, sets))} steps in the database, {count} tested")
    if row == "3.4":
        walks(report, quick, count)
    else:
        {"3.1": accuracy, "3.2": single, "3.3": parts}[row](report, quick, draw_tested(count))
    report.close()
