"""What a run has shown: results of the plant, CPU times of the controller, and the statistics of both."""

import json
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from engram.inputs import InputError
from engram.paths import ROOT, relative

MODES = ("memory", "line", "shift", "cold")
WILSON_Z = 1.959963984540054  # two-sided 95 %


def wilson(successes: int, n: int, z: float = WILSON_Z) -> tuple[float, float]:
    """Wilson score interval of a share; (0, 1) without trials."""
    if n == 0:
        return 0.0, 1.0
    share, spread = successes / n, z * z / n
    centre = (share + spread / 2.0) / (1.0 + spread)
    half = z / (1.0 + spread) * np.sqrt(share * (1.0 - share) / n + spread / (4.0 * n))
    return max(0.0, centre - half), min(1.0, centre + half)


def enumerators(name: str) -> list[str]:
    """Words of an enum of controller/engram.h, by value: engram_status -> ["converged", "iterating", ...]."""
    header = (ROOT / "controller" / "engram.h").read_text(encoding="utf-8")
    body = re.search(rf"typedef enum {name} \{{(.*?)\}} {name};", header, re.S)
    if body is None:
        return []
    words = re.findall(r"^\s*ENGRAM_(\w+)\b", re.sub(r"//.*", "", body[1]), re.M)
    prefix = re.sub(r"[a-z]+_", "", name).upper() + "_"
    words = [word.removeprefix("RUNG_").removeprefix("CANDIDATE_").removeprefix("MODE_").removeprefix(prefix) for word in words]
    return [word.lower().replace("_", " ") for word in words if not word.endswith("COUNT")]


def read_csv(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV of numbers with a header; no rows if the file is missing or empty. An unfinished last line is left out."""
    if not path.is_file():
        return {}
    header, *lines = path.read_text(encoding="utf-8").splitlines() or [""]
    names = header.split(",")
    rows = [line.split(",") for line in lines]
    table = np.array([row for row in rows if len(row) == len(names)], dtype=float).reshape(-1, len(names))
    return {name: table[:, i] for i, name in enumerate(names)}


@dataclass
class Run:
    """One mode of a demo, or one run of the plant by hand."""

    mode: str
    folder: Path
    plant: dict[str, Any]  # results.json of engram-plant
    timing: dict[str, np.ndarray]  # us per cycle and phase
    suboptimality: dict[int, np.ndarray] = field(default_factory=dict)  # after k iterations at each jump

    @property
    def jumps(self) -> list[dict[str, Any]]:
        return self.plant["jumps"]

    @property
    def log(self) -> Path:
        return self.folder / "run.lcm"

    def finished(self) -> list[dict[str, Any]]:
        """Jumps that came to their end."""
        return [jump for jump in self.jumps if jump["t_end_s"] > 0.0]

    def won(self) -> dict[str, float]:
        """Shares of the jumps at which a guess of each kind seeded the solver; of a controller that writes jumps.csv."""
        path = self.folder / "jumps.csv"
        lines = path.read_text(encoding="utf-8").splitlines()[1:] if path.is_file() else []
        kinds = [line.split(",")[2] for line in lines if line.count(",") > 2 and not line.startswith("0,")]
        return {kind: kinds.count(kind) / len(kinds) for kind in sorted(set(kinds))}

    def asked(self) -> dict[str, dict[str, float]]:
        """CPU time [us] of asking the memory for guesses of each kind, decoding included, over the cycles that asked for it."""
        times = {}
        for i, kind in enumerate(enumerators("engram_candidate")):
            us = self.timing.get(f"asked{i}_us", np.array([]))
            if np.any(us > 0.0):
                times[kind] = percentiles(us[us > 0.0]) | {"cycles": int(np.sum(us > 0.0))}
        return times

    def summary(self) -> dict[str, Any]:
        """The mode's row of the table: shares, times (s, us), errors."""
        jumps = self.finished()
        n, good = len(jumps), sum(jump["success"] for jump in jumps)
        low, high = wilson(good, n)
        row: dict[str, Any] = {"jumps": n, "successes": good}
        if n:
            row |= {"success": good / n, "success_low": low, "success_high": high}
        arrivals = [jump["arrival_s"] for jump in jumps if jump["success"]]
        if arrivals:
            row |= {"arrival_median_s": float(np.median(arrivals)), "arrival_p95_s": float(np.percentile(arrivals, 95))}
        for reason in ("late", "contact", "limit"):
            row[reason] = sum(reason in jump["reason"] for jump in jumps)
        for k, values in self.suboptimality.items():
            if len(values):
                row[f"subopt{k}"] = float(np.median(values))
        if won := self.won():
            row["won"] = won
        if asked := self.asked():
            row["asked_us"] = asked
        total = self.timing.get("total_us", np.array([]))
        if len(total):
            row["cycle_us"] = percentiles(total)
            row["query_us"] = percentiles(self.timing["query_us"])
            row["query_share"] = float(self.timing["query_us"].sum() / total.sum()) if total.sum() > 0.0 else 0.0
        moves = [jump["move"] for jump in jumps if "move" in jump]
        if moves:
            row["move_error_mean_m"] = float(np.mean([move["mean_error_m"] for move in moves]))
            row["move_contacts"] = sum(move["contact"] for move in moves)
        return row


def percentiles(values: np.ndarray) -> dict[str, float]:
    """Median, 99th percentile and maximum."""
    return {"p50": float(np.median(values)), "p99": float(np.percentile(values, 99)), "max": float(np.max(values))}


def read_run(mode: str, folder: Path) -> Run:
    """Read what engram-plant and engram-controller left in `folder`. Raises InputError."""
    path = folder / "results.json"
    try:
        plant = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise InputError(f"{relative(path)}: cannot be read ({error}); was the run interrupted?") from None
    return Run(mode, folder, plant, read_csv(folder / "timing.csv"))


def read_runs(folder: Path) -> list[Run]:
    """All modes of a demo, in the order of MODES. Raises InputError if there is none."""
    runs = [read_run(mode, folder / mode) for mode in MODES if (folder / mode / "results.json").is_file()]
    if not runs:
        raise InputError(f"{relative(folder)}: holds no run; `engram demo` makes one")
    return runs


SEED = 1  # of the series whose figures bear no seed in their name


def figures_name(seed: int) -> str:
    """The file in build/figures/ that a demo of this seed writes: another seed leaves the figures of SEED alone."""
    return "demo.json" if seed == SEED else f"demo-seed{seed}.json"


def figures(robot: str, runs: list[Run], seed: int = SEED) -> list[dict[str, Any]]:
    """Records of figures_name(seed); what was not measured is absent."""
    records = []
    prefix = f"demo.{robot}" if seed == SEED else f"demo.{robot}.seed{seed}"

    def add(name: str, value: float | None, unit: str, n: int) -> None:
        if value is not None:
            records.append({"id": f"{prefix}.{name}", "value": value, "unit": unit, "n": n})

    rows = {run.mode: run.summary() for run in runs}
    for mode, row in rows.items():
        add(f"success.{mode}", row.get("success"), "1", row["jumps"])
        add(f"subopt1.{mode}", row.get("subopt1"), "1", row["jumps"])
        add(f"subopt3.{mode}", row.get("subopt3"), "1", row["jumps"])
    row = rows.get("memory", {})
    for kind, share in row.get("won", {}).items():
        add(f"won.{kind}", share, "1", row["jumps"])
    for kind, us in row.get("asked_us", {}).items():
        for share in ("p50", "p99"):
            add(f"asked_us.{kind}.{share}", us[share], "us", us["cycles"])
    cycles = next((len(run.timing.get("total_us", [])) for run in runs if run.mode == "memory"), 0)
    for kind in ("p50", "p99", "max"):
        add(f"cycle_us.{kind}", row.get("cycle_us", {}).get(kind), "us", cycles)
    for kind in ("p50", "p99"):
        add(f"query_us.{kind}", row.get("query_us", {}).get(kind), "us", cycles)
    add("success_low.memory", row.get("success_low"), "1", row.get("jumps", 0))
    add("success_high.memory", row.get("success_high"), "1", row.get("jumps", 0))
    add("arrival_s.memory", row.get("arrival_median_s"), "s", row.get("successes", 0))
    return records
