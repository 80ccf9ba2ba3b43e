"""S7.1: Talos reaches around a pole; the memory is asked at every period of the controller (thesis, 8.1)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engram.data.pole_runs import run_shard, shards_folder
from engram.paths import BUILD
from engram.study.report import Report, wilson

MOTIONS, QUICK = 200, 20
BESIDE = 40  # of them also without memory
SEED = 2027  # neither that of the recording nor one that weights were tuned on: 2026 was, once its failures had been looked into
MODES = {"memory": "with memory", "shift": "shifted plan only", "cold": "cold at the jump"}
SHARD = 10  # motions of one process
JOINT_SLACK = 1.0  # mrad that a joint may pass its limit by, as in the demo
QUERIES = 10_000  # answers of the memory that are judged by a rollout, a third of them in each place
PLACES = {"inside": "in the domain", "edge": "at its edge", "outside": "outside, pushed"}
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
    """The same random motions in three modes, a shard of each in turn."""
    report = Report(row, "Talos' hand follows a target to the other side of a pole (thesis, 8.1)")
    count = QUICK if quick else MOTIONS
    report.say(f"{count} motions, seed {SEED}; half of the targets jump, half move at 0.4 to 0.8 m/s; 4 s each, then within 3 cm")
    report.say(f"shifted plan and cold on the first {min(count, BESIDE)} of them")
    for mode, outcome in run_modes(report, count).items():
        many = len(outcome.rows)
        success, (low, high) = outcome.share("success"), wilson(outcome.share("success"), many)
        stuck = float(
            np.mean([r["ready"] > 0 and not r["success"] and not r["fallen"] and r["error_m"] >= 0.03 for r in outcome.rows])
        )
        beyond = float(np.mean([r["over_mrad"] > JOINT_SLACK for r in outcome.rows]))
        report.say(
            f"{MODES[mode]:18} success {100 * success:5.1f} % ({100 * low:.0f} to {100 * high:.0f}) of {many}  "
            f"stops elsewhere {100 * stuck:.1f} %  touches the pole {100 * outcome.share('touched'):.1f} %  "
            f"falls {100 * outcome.share('fallen'):.1f} %  a joint beyond its limit {100 * beyond:.1f} %"
        )
        report.figure(f"success.{mode}", success, "1", many, low=low, high=high)
        report.figure(f"stuck.{mode}", stuck, "1", many)
        report.figure(f"touched.{mode}", outcome.share("touched"), "1", many)
        report.figure(f"fallen.{mode}", outcome.share("fallen"), "1", many)
        if mode == "memory":
            say_times(report, outcome)
            asked, worse = (int(sum(r[key] for r in outcome.rows)) for key in ("asked", "worse"))
            report.say(f"never worse: of {asked} answers {worse} were taken that cost more than the shifted plan")
            report.figure("worse", worse, "1", asked)
    report.say("thesis: 100 Hz; without memory the hand stops in front of the pole")
    if not quick:
        never_worse(report)
    report.close()


def never_worse(report: Report) -> None:
    """Seeds that took the shifted plan's place, rolled out beside it (bench/pole_witness.cc); then random tables."""
    for place, text in PLACES.items():
        seen, first = np.zeros(3), 0  # asked, accepted, above
        while seen[0] < QUERIES / len(PLACES):
            found = shard("memory", first, SHARD, "witness=table", f"queries={place}")[0]
            seen += witnessed(found)
            first += SHARD
        report.say(
            f"rolled out, {text}: of {seen[0]:.0f} answers {seen[1]:.0f} taken, {seen[2]:.0f} of them above the shifted plan"
        )
        report.figure(f"rolled.{place}.above", seen[2], "1", int(seen[1]))
    found = shard("memory", 0, SHARD, "witness=random")[0]
    good = sum(row["success"] > 0 for row in motions(found))
    asked, taken, _ = witnessed(found)
    report.say(f"a table of random numbers: {taken:.0f} of {asked:.0f} answers taken, {good} of {SHARD} succeed")
    report.figure("success.random", good / SHARD, "1", SHARD)


def witnessed(text: str) -> np.ndarray:
    """Answers of the memory, those that took the shifted plan's place, those of these that cost more rolled out."""
    words = text.splitlines()[-1].split()
    return np.array([float(words[words.index(key) + 1]) for key in ("asked", "accepted", "above")])


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


def run_modes(report: Report, count: int) -> dict[str, Outcome]:
    """Runs `count` motions in shards, kept in build/study/7.1/: what is there is not run again. Raises InputError."""
    rows: dict[str, list] = {mode: [] for mode in MODES}
    times: dict[str, list] = {mode: [] for mode in MODES}
    for first in range(0, count, SHARD):
        for mode in MODES:
            if mode != "memory" and first >= BESIDE:
                continue
            text, path = shard(mode, first, min(SHARD, count - first))
            rows[mode] += motions(text)
            times[mode].append(np.fromfile(path).reshape(-1, 2))
        done = ", ".join(f"{mode} {sum(row['success'] > 0 for row in rows[mode])} of {len(rows[mode])}" for mode in MODES)
        report.say(f"so far: {done}")
    return {mode: Outcome(rows[mode], np.concatenate(times[mode])) for mode in MODES}


def shard(mode: str, first: int, many: int, *options: str) -> tuple[str, Path]:
    """What engram-pole prints of motions `first` to `first + many`, and the file of its times. Raises InputError."""
    folder = shards_folder(BUILD / "study" / "7.1")
    name = "_".join([mode, str(SEED), str(first), str(many), *(option.replace("=", "-") for option in options)])
    said, path = folder / f"{name}.txt", folder / f"{name}.bin"
    if not said.is_file():
        text = run_shard(first, many, SEED, f"memory={mode}", f"cycles={path}", *options)
        said.write_text(text, encoding="utf-8")
    return said.read_text(encoding="utf-8"), path


def motions(text: str) -> list[dict[str, float]]:
    """The rows of engram-pole's motions."""
    return [read_row(line) for line in text.splitlines() if line.startswith("motion ")]


def read_row(line: str) -> dict[str, float]:
    """'motion 3 side -1 ... hand x y z' -> {name: number}, without the hand."""
    words = line.split(" hand ")[0].split()
    return {key: float(value) for key, value in zip(words[::2], words[1::2])}
