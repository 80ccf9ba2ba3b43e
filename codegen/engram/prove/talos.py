"""Talos stands, squats, and takes pushes without a step."""

import subprocess

import numpy as np
from tqdm import tqdm

from engram.paths import BUILD
from engram.prove.report import Report, all_share
from engram.prove.trial import Series, Trial, blows, more_periods, run_trial, run_trials

MODEL = "talos_stand"
STAND, SETTLED = (0.1, (0.0, 0.0, 0.0)), 2.0  # first task; s after which it has settled
DEPTH, RATE, TICK = 0.2, 0.5, 0.01  # m, Hz, s
PUSH_AT, PUSH_TICKS = 2.0, 4.0  # s: when, and how long it is watched
HEADINGS = (0.0, 90.0, 180.0, 270.0)
# name, way (forward, left), N s that it must take without a step
PUSHES = [("px", (1.0, 0.0), 20.0), ("mx", (-1.0, 0.0), 24.0), ("py", (0.0, 1.0), 28.0), ("my", (0.0, -1.0), 28.0)]


def pushed(heading: float, way: tuple[float, float], impulse: float) -> Trial:
    """Stands, is pushed over 0.1 s, and is watched."""
    push = (PUSH_AT, (way[0] * impulse, way[1] * impulse))
    return Trial(MODEL, PUSH_AT + PUSH_TICKS, heading, (STAND,), (push,))


def errand(draw: np.random.Generator) -> Trial:
    """A minute of squats: another height, depth and rate every six seconds, and pushes of at most 10 N s from random sides."""
    lowest, highest = [-0.05, 0.0, 0.1], [0.0, DEPTH, RATE]  # m, m, Hz
    squats = [(at, tuple(draw.uniform(lowest, highest))) for at in np.arange(0.1, 60.0, 6.0)]
    return Trial(MODEL, 60.0, draw.uniform(0.0, 360.0), tuple(squats), blows(draw, 60.0, 6.0, 10.0))


def drift(run: Series) -> float:
    """Farthest the centre of mass goes from where it was when the robot had settled [m]."""
    com = run["com"][run.since(SETTLED)]
    return np.linalg.norm(com - com[0], axis=1).max()


def squat_error(run: Series) -> float:
    """Root mean square of height asked less height seen, settled [m]."""
    start = run["com"][run["time"] < STAND[0]][:, 2].mean()
    time = run["time"] - STAND[0] - TICK  # the task is taken at the next tick
    asked = start - 0.5 * DEPTH * (1.0 - np.cos(2.0 * np.pi * RATE * time))
    rows = run.since(SETTLED)
    return np.sqrt(np.mean((run["com"][rows, 2] - asked[rows]) ** 2))


def largest(heading: float, way: tuple[float, float], first: float, step: float) -> float:
    """The largest multiple of `step` [N s], from `first` up or down, that is taken without a step."""
    impulse = first
    if run_trial(pushed(heading, way, impulse)).stays:
        while impulse < first + 20.0 and run_trial(pushed(heading, way, impulse + step)).stays:
            impulse += step
        return impulse
    while impulse > 0.0 and not run_trial(pushed(heading, way, impulse)).stays:
        impulse -= step
    return impulse


def prove(seed: int, quick: bool, cycles: int, jobs: int) -> Report:
    """Run the proofs. The seed draws the heading of the robot that stands and squats."""
    report = Report("talos")
    heading = float(np.random.default_rng(seed).uniform(0.0, 360.0))
    seconds = 5.0 if quick else 60.0
    print(f"Talos, heading {heading:.0f} deg, in MuJoCo by the deployable controller:")
    squats = (STAND[0], (0.0, DEPTH, RATE))
    still, squat = run_trials(
        [Trial(MODEL, seconds, heading, (STAND,)), Trial(MODEL, 6.0 if quick else 30.0, heading, (squats,))], jobs, "stand, squat"
    )
    drifted, error = drift(still), squat_error(squat)
    n, stays = len(still["time"]), still.stays and drifted < 1e-3
    report.add("stand.com_drift", 1e3 * drifted, "mm", n, f"< 1 over {seconds:.0f} s", stays)
    report.add("squat.rms_error", 1e3 * error, "mm", len(squat["time"]), "< 10", squat.stays and error < 1e-2)

    headings = HEADINGS[1:3] if quick else HEADINGS
    grid = [pushed(h, way, impulse) for h in headings for _, way, impulse in PUSHES]
    runs = run_trials(grid, jobs, "pushes")
    share = np.mean([run.stays for run in runs])
    report.add("push.taken", share, "1", len(runs), f"20 +x, 24 -x, 28 +-y N s at {len(headings)} headings", share == 1.0)
    report.add("push.slip", 1e3 * max(run["slip"].max() for run in runs), "mm", len(runs))
    if not quick:
        program = [BUILD / "bin" / "engram-trial", MODEL, "limits"]
        limits = map(float, subprocess.run(program, capture_output=True, check=True, text=True).stdout.split())
        ways = tqdm(list(zip(PUSHES, limits)), desc="largest pushes", unit="way", leave=False)
        for (name, way, wanted), limit in ways:
            most = min(largest(h, way, wanted + 2.0, 2.0) for h in headings)
            report.add(f"push.{name}", most, "N s", len(headings), f">= {wanted:.0f}", most >= wanted)
            report.add(f"push.{name}_limit", limit, "N s", 1)
    runs += [still, squat]
    report.add("torque_share", all_share(runs), "1", sum(len(run["time"]) for run in runs), "<= 1", all_share(runs) <= 1.0)
    draw = np.random.default_rng([seed, 5])
    varied = more_periods(cycles, runs, lambda: errand(draw), jobs)
    report.add_varied(varied)
    runs += varied
    report.add_times(runs)
    return report
