"""ANYmal stands, trots at a commanded velocity and in place, and takes lateral pushes at random phases of its gait."""

import numpy as np

from engram.prove.report import Report, all_share
from engram.prove.trial import Series, Trial, blows, more_periods, run_trials

MODEL = "anymal_trot"
STAND = (0.1, (0.0, 0.0, 0.0, 0.0))  # first task
WALK_AT, STEADY = 0.5, 2.0  # s: when it begins to trot, and when it does so steadily
CYCLE = 0.64  # s, of the gait: both pairs
SPEEDS = (0.0, 0.3, 0.6)  # m/s
PUSH_WANTED, PUSH_AIM = 15.0, 25.0  # N s


def trot(seconds: float, speed: float, heading: float, pushes: tuple = ()) -> Trial:
    """Stands, then trots forward."""
    return Trial(MODEL, seconds, heading, (STAND, (WALK_AT, (speed, 0.0, 0.0, 1.0))), pushes)


def errand(draw: np.random.Generator) -> Trial:
    """A minute of trotting: another command every five seconds, and a push of at most 15 N s at a random phase of the gait."""
    lowest, highest = [0.0, -0.1, -0.3], [0.6, 0.1, 0.3]  # m/s, m/s, rad/s
    commands = [(at, (*draw.uniform(lowest, highest), 1.0)) for at in np.arange(WALK_AT, 60.0, 5.0)]
    return Trial(MODEL, 60.0, draw.uniform(0.0, 360.0), (STAND, *commands), blows(draw, 60.0, 5.0, PUSH_WANTED))


def velocity(run: Series) -> np.ndarray:
    """Mean velocity in the axes of the start's heading, over whole cycles once it is steady [m/s]."""
    time, angle = run["time"], np.radians(run.trial.heading)
    last = STEADY + CYCLE * np.floor((time[-1] - STEADY) / CYCLE)
    first, last = np.searchsorted(time, [STEADY, last])
    x, y = (run["com"][last] - run["com"][first])[:2] / (time[last] - time[first])
    return np.array([np.cos(angle) * x + np.sin(angle) * y, -np.sin(angle) * x + np.cos(angle) * y])


def prove(seed: int, quick: bool, cycles: int, jobs: int) -> Report:
    """Run the proofs. The seed draws headings, speeds, phases and sides of the pushes."""
    report = Report("anymal")
    draw = np.random.default_rng(seed)
    seconds = 5.0 if quick else 60.0
    print("ANYmal in MuJoCo by the deployable controller:")
    headings = draw.uniform(0.0, 360.0, len(SPEEDS) + 1)
    trials = [Trial(MODEL, seconds, headings[0], (STAND,)), *(trot(seconds, v, h) for v, h in zip(SPEEDS, headings[1:]))]
    still, *runs = run_trials(trials, jobs, "stand, trot")
    com = still["com"][still.since(STEADY)]
    drift = np.linalg.norm(com - com[0], axis=1).max()
    n, stays = len(still["time"]), still.stays and drift < 1e-3
    report.add("stand.com_drift", 1e3 * drift, "mm", n, f"< 1 over {seconds:.0f} s", stays)
    for speed, run in zip(SPEEDS, runs):
        error = np.linalg.norm(velocity(run) - [speed, 0.0])
        name, keeps = f"trot{round(100 * speed):02d}.speed_error", run.stands and error < 0.02
        report.add(name, 1e3 * error, "mm/s", len(run["time"]), f"{seconds:.0f} s at {speed} m/s", keeps)
    runs.append(still)

    n = 4 if quick else 40
    for impulse, name in ((PUSH_WANTED, "push15"), (PUSH_AIM, "push25")):
        trials = []
        for _ in range(n):
            at, side, speed = STEADY + round(draw.uniform(0.0, CYCLE), 3), draw.choice([-1.0, 1.0]), draw.choice(SPEEDS)
            trials.append(trot(5.5, speed, draw.uniform(0.0, 360.0), ((at, (0.0, side * impulse)),)))
        pushed = run_trials(trials, jobs, f"pushes of {impulse:.0f} N s")
        share = np.mean([run.stands for run in pushed])
        if impulse == PUSH_WANTED:
            report.add(f"{name}.stands", share, "1", n, f"{impulse:.0f} N s at random phases", share == 1.0)
        else:
            report.add(f"{name}.stands", share, "1", n)
        runs += pushed
    report.add("torque_share", all_share(runs), "1", sum(len(run["time"]) for run in runs), "<= 1", all_share(runs) <= 1.0)
    varied = more_periods(cycles, runs, lambda: errand(draw), jobs)
    report.add_varied(varied)
    runs += varied
    report.add_times(runs)
    return report
