"""One closed loop: runs build/bin/engram-trial and reads its time series."""

import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from tqdm import tqdm

from engram.inputs import InputError
from engram.paths import BUILD, ROOT

# as `Row` of bench/trial_main.cc: name and number of doubles
PHASES = ["pose", "linearize", "backward", "rollout", "total"]
VECTORS = ["com", "com_velocity"]
SCALARS = ["up", "yaw", "slip", "torque", "status", "rung", "cost", *(f"{phase}_us" for phase in PHASES)]
COLUMNS = [("time", 1), *((name, 3) for name in VECTORS), *((name, 1) for name in SCALARS[:7])]
COLUMNS += [
    ("swing", 1),
    ("com_wanted", 3),
    ("foot", 16),
    ("foothold", 16),
    ("gap", 1),
    ("guesses", 1),
    ("merit_shifted", 1),
    ("merit", 1),
    *((name, 1) for name in SCALARS[7:]),
]
WIDTH = sum(n for _, n in COLUMNS)


@dataclass(frozen=True)
class Trial:
    """What to run: a model, for so long, looking that way (deg), with tasks and pushes (s, values) and faults (name, value)."""

    model: str
    seconds: float
    heading: float = 0.0
    tasks: tuple[tuple[float, tuple[float, ...]], ...] = ()
    pushes: tuple[tuple[float, tuple[float, float]], ...] = ()  # N s forward and left, in the axes of the start
    faults: tuple[tuple[str, float | str], ...] = ()  # what the controller is not told: load, friction, delay, uneven; its memory

    def arguments(self) -> list[str]:
        """Of engram-trial."""
        events = [("task", self.tasks), ("push", self.pushes)]
        words = [f"{key}={at}:{','.join(map(str, values))}" for key, items in events for at, values in items]
        words += [f"{key}={value}" for key, value in self.faults]
        return [self.model, f"seconds={self.seconds}", f"heading={self.heading}", *words]


@dataclass(frozen=True)
class Series:
    """What came of it: one row per control period (SI units; CPU times in us)."""

    trial: Trial
    columns: dict[str, np.ndarray] = field(repr=False)

    def __getitem__(self, name: str) -> np.ndarray:
        return self.columns[name]

    def since(self, seconds: float) -> np.ndarray:
        """Rows later than so many seconds."""
        return self["time"] > seconds

    @property
    def stands(self) -> bool:
        """It ran to its end, upright, and every number is finite."""
        finite = all(np.isfinite(column).all() for column in self.columns.values())
        return finite and self["time"][-1] > self.trial.seconds - 0.02 and self["up"].min() > 0.9

    @property
    def stays(self) -> bool:
        """It stands, and took no step: no foot moved by 2 cm."""
        return self.stands and self["slip"].max() < 0.02


def run_trial(trial: Trial) -> Series:
    """Run it. Raises InputError if the program is not there or refuses."""
    program = BUILD / "bin" / "engram-trial"
    if not program.exists():
        raise InputError("build/bin/engram-trial is not built: run `ninja -C build engram-trial`")
    done = subprocess.run([program, *trial.arguments()], cwd=ROOT, capture_output=True, check=False)
    if done.returncode != 0:
        raise InputError(done.stderr.decode().strip())
    table = np.frombuffer(done.stdout).reshape(-1, WIDTH)
    columns, first = {}, 0
    for name, n in COLUMNS:
        columns[name] = table[:, first : first + n] if n > 1 else table[:, first]
        first += n
    return Series(trial, columns)


def run_trials(trials: list[Trial], jobs: int, title: str) -> list[Series]:
    """Run them side by side, in order, with a progress bar."""
    with ThreadPoolExecutor(jobs) as pool, tqdm(total=len(trials), desc=title, unit="run", leave=False) as bar:
        found = []
        for series in pool.map(run_trial, trials):
            found.append(series)
            bar.update()
        return found


def more_periods(cycles: int, have: list[Series], draw: Callable[[], Trial], jobs: int) -> list[Series]:
    """Runs that `draw` makes up, each another one, until all runs together have so many control periods (10 ms each)."""
    left, trials = cycles - sum(len(run["time"]) for run in have), []
    while left > 0:
        trials.append(draw())
        left -= round(100 * trials[-1].seconds)
    return run_trials(trials, jobs, "periods to time") if trials else []


def blows(draw: np.random.Generator, seconds: float, every: float, most: float) -> tuple:
    """Pushes of Trial from random sides, of at most `most` N s, at a random time of each `every` s after the first."""
    times = [start + round(draw.uniform(0.0, 0.5 * every), 3) for start in np.arange(every, seconds - 0.5 * every, every)]
    sizes, sides = draw.uniform(0.0, most, len(times)), draw.uniform(0.0, 2.0 * np.pi, len(times))
    return tuple((at, (size * np.cos(side), size * np.sin(side))) for at, size, side in zip(times, sizes, sides))


def cycle_times(runs: list[Series]) -> dict[str, np.ndarray]:
    """CPU time of the control periods of all runs that had a plan [us], by phase."""
    used = [(run["rung"] == 0) & (run["total_us"] > 0) for run in runs]
    return {phase: np.concatenate([run[f"{phase}_us"][rows] for run, rows in zip(runs, used)]) for phase in PHASES}
