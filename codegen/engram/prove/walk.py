"""Talos walks 20 steps at commands drawn at random, with turns and side steps, and stops: undisturbed, and under disturbances.
What the memory of steps brings is seen beside: the first walks again, by the shifted plan only, and cold at each command.

A landing error is the distance of a foot, 0.1 s after touch-down, from where it was asked to land when it was last in the air.
"""

from dataclasses import dataclass, replace

import numpy as np

from engram.prove.report import Report, all_share
from engram.prove.trial import Series, Trial, cycle_times, run_trials

MODEL, FEET = "talos_walk", 2
START, STOP, END = 0.5, 13.9, 17.5  # s: begins to walk; is asked to stop; is judged
STEPS = 20  # at least, from START to STOP and the two that end a walk
COMMANDS = (START, 5.0, 9.5)  # s
LOWEST, HIGHEST = [-0.1, -0.06, -0.25], [0.4, 0.06, 0.25]  # m/s, m/s, rad/s
ENDS = ([0.45, 0.1, 0.3], [-0.2, -0.1, -0.3])  # m/s, m/s, rad/s: of the task's range
PUSHES = ((3.0, 5.0), (7.0, 9.0), (11.0, 13.0))  # s: one within each, over 0.1 s
SETTLED = 10  # control periods from touch-down to where a foot is seen
STILL = 0.02  # m/s
LANDING = 0.01  # m, asked of undisturbed landings
PERIOD = 1e4  # us, asked of CPU times
BESIDE = 5  # walks of each case that are walked again, in other modes
MODES = ("memory", "shift", "cold")
HELD_OUT = 77  # of the proof: tuning draws from other streams


@dataclass(frozen=True)
class Case:
    """A disturbance that the controller is not told of, but for the delay of its commands."""

    name: str
    text: str
    push: float = 0.0  # N s, each
    fault: tuple[tuple[str, float | str], ...] = ()  # of engram-trial
    every: float = 0.0  # s between two commands; 0: at COMMANDS, within LOWEST and HIGHEST; else among ENDS

    def trial(self, draw: np.random.Generator) -> Trial:
        """A walk under it."""
        tasks = [(0.0, (0.0, 0.0, 0.0, 0.0))]  # stands by its plan from the first state on
        if self.every:
            times = np.arange(START, STOP - 0.5 * self.every, self.every)
            tasks += [(at, (*np.where(draw.integers(2, size=3), *ENDS), 1.0)) for at in times]
        else:
            tasks += [(at, (*draw.uniform(LOWEST, HIGHEST), 1.0)) for at in COMMANDS]
        tasks.append((STOP, (0.0, 0.0, 0.0, 0.0)))
        heading, sign, blows = draw.uniform(0.0, 360.0), draw.choice([-1.0, 1.0]), []
        for window in PUSHES:
            at, side = round(draw.uniform(*window), 3), draw.uniform(0.0, 2.0 * np.pi)
            blows.append((at, (self.push * np.cos(side), self.push * np.sin(side))))
        fault = tuple((key, sign * value if key == "uneven" else value) for key, value in self.fault)
        return Trial(MODEL, END, heading, tuple(tasks), tuple(blows) if self.push else (), fault)


CASES = (
    Case("free", "undisturbed"),
    Case("push10", "3 pushes of 10 N s at random times and directions", 10.0),
    Case("load5", "5 kg more on the torso", fault=(("load", 5.0),)),
    Case("friction40", "friction 0.4", fault=(("friction", 0.4),)),
    Case("delay10", "commands act 10 ms late, and it knows", fault=(("delay", 0.01), ("told", 0.01))),
    Case("uneven10", "every touch-down 1 cm early or late", fault=(("uneven", 0.01),)),
    Case("abrupt", "a command at the ends of the range every second", every=1.0),
    Case("random", "a memory of random numbers", fault=(("memory", "random"),)),
    Case("push20", "3 pushes of 20 N s at random times and directions", 20.0),
)


def landings(run: Series) -> np.ndarray:
    """Distance of every foot that has landed from where it was to land [m]."""
    swing, errors = run["swing"].astype(int), []
    for f in range(FEET):
        in_air = (swing >> f) & 1
        for last in np.flatnonzero((in_air[:-1] == 1) & (in_air[1:] == 0)):
            if last + SETTLED < len(swing):
                wanted, found = run["foothold"][last, 4 * f : 4 * f + 2], run["foot"][last + SETTLED, 4 * f : 4 * f + 2]
                errors.append(np.linalg.norm(found - wanted))
    return np.array(errors)


def com_error(run: Series) -> np.ndarray:
    """Horizontal distance of the centre of mass from its reference, per control period of the walk [m]."""
    rows = (run["time"] > START) & (run["time"] < STOP)
    return np.linalg.norm(run["com"][rows, :2] - run["com_wanted"][rows, :2], axis=1)


def falls(run: Series) -> bool:
    """It does not walk to the end, or does not stand still there."""
    return not run.stands or np.linalg.norm(run["com_velocity"][-1]) > STILL


def judge(report: Report, case: Case, runs: list[Series]) -> None:
    """Figures of one case: one line."""
    fallen, feet = sum(map(falls, runs)), [landings(run) for run in runs]
    steps = min((len(errors) for errors, run in zip(feet, runs) if not falls(run)), default=0)
    errors, com = 1e3 * np.concatenate(feet), 1e3 * np.concatenate([com_error(run) for run in runs])  # mm
    times, share, free = cycle_times(runs)["total"], all_share(runs), case.name == "free"
    mean, most = (errors.mean(), errors.max()) if len(errors) else (np.nan, np.nan)
    rms, (p50, p99) = np.sqrt(np.mean(com**2)), np.percentile(times, [50.0, 99.0])
    report.quiet(f"{case.name}.falls", fallen, "", len(runs), fallen == 0)
    report.quiet(f"{case.name}.steps", steps, "", len(runs), steps >= STEPS)
    report.quiet(f"{case.name}.landing.mean", mean, "mm", len(errors))
    report.quiet(f"{case.name}.landing.max", most, "mm", len(errors), not free or most < 1e3 * LANDING)
    report.quiet(f"{case.name}.com_rms", rms, "mm", len(com))
    report.quiet(f"{case.name}.torque_share", share, "", len(times), share <= 1.0)
    report.quiet(f"{case.name}.cycle_us.p50", p50, "us", len(times))
    report.quiet(f"{case.name}.cycle_us.p99", p99, "us", len(times), p99 < PERIOD)
    told = f"{fallen:3} of {len(runs):2}{steps:7}{mean:9.1f}{most:7.1f}{rms:9.1f}{100 * share:8.1f} %{p50:8.0f}{p99:6.0f}"
    print(f"  {case.text:50} {told}", flush=True)


def beside(report: Report, case: Case, runs: list[Series], jobs: int) -> None:
    """The same walks in each mode; the plan's cost is that of all periods, and of those in which a knot enters."""
    own = dict(case.fault).get("memory", "memory")
    asked = [np.flatnonzero(run["guesses"] > 1) for run in runs]
    seed, shifted = (np.concatenate([run[name][rows] for run, rows in zip(runs, asked)]) for name in ("merit", "merit_shifted"))
    for mode in (own, "shift", "cold"):
        again = runs
        if mode != own:
            trials = [replace(run.trial, faults=tuple({**dict(run.trial.faults), "memory": mode}.items())) for run in runs]
            again = run_trials(trials, jobs, f"{case.name} {mode}")
        fallen, landing = sum(map(falls, again)), 1e3 * np.concatenate([landings(run) for run in again]).mean()
        cost = np.concatenate([run["cost"][run["time"] > START] for run in again]).mean()
        entering = np.concatenate([run["cost"][rows[rows < len(run["cost"])]] for run, rows in zip(again, asked)]).mean()
        report.quiet(f"{case.name}.{mode}.falls", fallen, "", len(again))
        report.quiet(f"{case.name}.{mode}.landing", landing, "mm", len(again))
        report.quiet(f"{case.name}.{mode}.cost", cost, "", len(again))
        report.quiet(f"{case.name}.{mode}.cost_entering", entering, "", len(seed))
        told = f"falls {fallen} of {len(again)}, landing {landing:.2f} mm, cost {cost:.2f}, as a knot enters {entering:.2f}"
        print(f"    {mode:8}{told}", flush=True)
    taken = np.mean(seed < shifted)
    report.quiet(f"{case.name}.{own}.taken", taken, "1", len(seed))
    merit = f"merit {np.median(seed):.0f} where the shifted plan has {np.median(shifted):.0f}"
    print(f"    {own} is taken for {100 * taken:.0f} % of {len(seed)} knots, {merit}", flush=True)


def prove(seed: int, n: int, only: list[str], jobs: int = 1, stream: int = HELD_OUT) -> Report:
    """Run `n` walks of each case, or of those in `only`. The seed draws commands, headings, times and sides."""
    report = Report("talos.walk")
    print(f"Talos walks {STEPS} steps with turns and side steps in MuJoCo, seed {seed}:")
    print(f"  {'':50}    falls  steps      landing   centre   torque      CPU us")
    print(f"  {'':50}           least  mean    max   of mass     most     p50   p99")
    for case in CASES:
        if only and case.name not in only:
            continue
        trials = [case.trial(np.random.default_rng([stream, seed, i])) for i in range(n)]
        runs = run_trials(trials, jobs, case.name)
        judge(report, case, runs)
        beside(report, case, runs[:BESIDE], jobs)
        report.write()  # what is known so far
    return report
