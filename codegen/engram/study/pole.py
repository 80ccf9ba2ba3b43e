"""S7.1: Talos reaches around a pole; the memory is asked at every period of the controller (thesis, 8.1)."""

from __future__ import annotations

import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engram.inputs import InputError
from engram.paths import BUILD, relative
from engram.study.report import Report, wilson

MOTIONS, QUICK = 200, 20
SEED = 1
MODES = {"memory": "with memory", "shift": "shifted plan only", "cold": "cold at the jump"}
SHARD = 10  # motions of one process
WORKERS = 2
AIM = {"success": 0.98, "p50": 5000.0, "p99": 10000.0}  # issue 5


@dataclass(frozen=True)
class Outcome:
    """Motions of one mode."""

    rows: list[dict[str, float]]  # what engram-pole prints of each
    times: np.ndarray  # (cycles, 2) CPU time of the whole period and of the memory's answer [us]

    def share(self, key: str) -> float:
        """Share of motions for which `key` is true."""
        return float(np.mean([row[key] > 0 for row in self.rows]))


def run(row: str, quick: bool) -> None:
    """The same random motions in three modes."""
    report = Report(row, "Talos' hand follows a target to the other side of a pole (thesis, 8.1)")
    count = QUICK if quick else MOTIONS
    report.say(f"{count} motions, seed {SEED}; half of the targets jump, half move at 0.4 to 0.8 m/s; 4 s each, then within 3 cm")
    for mode, name in MODES.items():
        outcome = run_mode(mode, count)
        success, (low, high) = outcome.share("success"), wilson(outcome.share("success"), count)
        stuck = float(
            np.mean([r["ready"] > 0 and not r["success"] and not r["fallen"] and r["error_m"] >= 0.03 for r in outcome.rows])
        )
        text = f"success {100 * success:5.1f} % ({100 * low:.0f} to {100 * high:.0f})"
        report.say(
            f"{name:18} {text}  stops elsewhere {100 * stuck:.1f} %  touches the pole {100 * outcome.share('touched'):.1f} %  "
            f"falls {100 * outcome.share('fallen'):.1f} %"
        )
        report.figure(f"success.{mode}", success, "1", count, low=low, high=high)
        report.figure(f"stuck.{mode}", stuck, "1", count)
        report.figure(f"fallen.{mode}", outcome.share("fallen"), "1", count)
        if mode == "memory":
            say_times(report, outcome)
    report.say("thesis: 100 Hz; without memory the hand stops in front of the pole")
    report.close()


def say_times(report: Report, outcome: Outcome) -> None:
    """CPU time of the whole period and of the memory's answer."""
    n = len(outcome.times)
    p50, p99, worst = np.percentile(outcome.times[:, 0], [50, 99, 100])
    answered = outcome.times[outcome.times[:, 1] > 0, 1]
    query = float(np.percentile(answered, 99))
    report.say(
        f"CPU time of a period [us]: p50 {p50:.0f} p99 {p99:.0f} max {worst:.0f}; of the memory's answer p99 {query:.0f}; n {n}"
    )
    report.say(f"asked: success {AIM['success']:.2f}, p50 {AIM['p50']:.0f} us, p99 {AIM['p99']:.0f} us")
    for name, value in (("p50", p50), ("p99", p99), ("max", worst)):
        report.figure(f"cycle_us.{name}", float(value), "us", n)
    report.figure("query_us.p99", query, "us", len(answered))


def run_mode(mode: str, count: int) -> Outcome:
    """Runs engram-pole on `count` motions, in shards. Raises InputError."""
    program = BUILD / "bin" / "engram-pole"
    if not program.is_file():
        raise InputError(f"no {relative(program)}; build it: TARGETS=engram-pole scripts/setup.sh")
    rows, times = [], []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(WORKERS) as pool:

        def shard(first: int) -> tuple[str, Path]:
            path = Path(folder) / f"{first}.bin"
            many = min(SHARD, count - first)
            command = [program, f"motions={many}", f"first={first}", f"seed={SEED}", f"memory={mode}", f"cycles={path}"]
            done = subprocess.run(command, cwd=BUILD.parent, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise InputError(f"{relative(program)}: {done.stderr.strip() or 'failed'}")
            return done.stdout, path

        for n, (text, path) in enumerate(pool.map(shard, range(0, count, SHARD)), 1):
            rows += [read_row(line) for line in text.splitlines() if line.startswith("motion ")]
            times.append(np.fromfile(path).reshape(-1, 2))
            print(f"\r{MODES[mode]}: {min(n * SHARD, count)} of {count} motions", end="", flush=True)
    print("\r", end="")
    return Outcome(rows, np.concatenate(times))


def read_row(line: str) -> dict[str, float]:
    """'motion 3 side -1 ... hand x y z' -> {name: number}, without the hand."""
    words = line.split(" hand ")[0].split()
    return {key: float(value) for key, value in zip(words[::2], words[1::2])}
