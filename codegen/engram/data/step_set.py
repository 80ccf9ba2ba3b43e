"""The data set of steps: both feet and walks, both stages, in one file; failures counted and kept apart."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from engram.data import chunks
from engram.data.cluster import engine_digest
from engram.data.steps import FEET, OK, REASONS, WALK, WALKS, Settings, make_steps
from engram.engine import engine
from engram.inputs import InputError
from engram.paths import relative

NAME = "talos_step"
CHUNK = 25  # tasks in a file
SAMPLES = 6000  # tasks of each foot; walks: a quarter
SEED = 1
NAMES = (*FEET, "walk")
ARRAYS = ("X", "q_raw", "u_raw", "q", "u", "cost")
KEPT = (*ARRAYS, "iterations", "seeds")


def make(n: int, seed: int, workers: int, out: Path, cluster: str | None = None) -> dict:
    """Draw and solve n tasks of each foot and n // 4 walks; writes <out>/talos_step.npz, .json; returns the summary."""
    made_from = f"task {engine.TalosSteps.digest:016x} seed {seed} {Settings()}"
    key = f"{made_from} engine {engine_digest()}"  # what another build of the solver has left is not mixed with this one's
    counts = (n, n, max(1, n // 4))
    arrays, summary = {}, {"made_from": made_from, "tasks": sum(counts), "solved": 0, "failed": {}}
    for foot, name in enumerate(NAMES):
        part = chunks.Chunks(out / f"{NAME}_{name}", key, counts[foot], CHUNK)
        title = f"data:   {name}"
        solved = chunks.run(part, make_steps, (seed, foot, Settings()), workers, title, cluster)
        good = solved["outcome"] == OK
        arrays |= {f"{key}_{name}": solved[key][good] for key in (*KEPT, *(["first"] if foot == WALKS else []))}
        arrays |= {f"failed_{key}_{name}": solved[key][~good] for key in ("X", "seeds", "outcome")}
        summary["solved"] += int(good.sum())
        for outcome in solved["outcome"][~good]:
            reason = f"{name}: {REASONS[outcome]}"
            summary["failed"][reason] = summary["failed"].get(reason, 0) + 1
        summary[f"iterations_{name}"] = float(solved["iterations"][good].mean()) if good.any() else 0.0
    np.savez(out / f"{NAME}.npz", **arrays, task_digest=np.uint64(engine.TalosSteps.digest), made_from=np.array(made_from))
    (out / f"{NAME}.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    return summary


@dataclass(frozen=True)
class StepData:
    """Solved tasks of one kind: X (n, 9) of a foot, or (n, 6 + 3 WALK) of walks, whose first foot is `first` (n,);
    q (n, T + 1, nq) and u (n, T, nu) of stage one (raw) and two, cost (n,)."""

    X: np.ndarray
    q_raw: np.ndarray
    u_raw: np.ndarray
    q: np.ndarray
    u: np.ndarray
    cost: np.ndarray
    first: np.ndarray

    def __len__(self) -> int:
        return len(self.X)

    def part(self, rows: np.ndarray | slice) -> StepData:
        """Some of the rows."""
        return StepData(*(getattr(self, key)[rows] for key in (*ARRAYS, "first")))


def load(path: Path) -> tuple[list[StepData], str, str]:
    """Steps of the left and right foot, walks, digest of their bytes and what they were made from. Raises InputError."""
    mend = "run `engram data talos step`"
    try:
        with np.load(path, allow_pickle=False) as file:
            data = {key: file[key] for key in file.files if not key.startswith("failed_")}
        digest, made_from = int(data["task_digest"]), str(data["made_from"])
        sets = []
        for foot, name in enumerate(NAMES):
            arrays = [data[f"{key}_{name}"] for key in ARRAYS]
            first = np.asarray(data["first_walk"], int) if foot == WALKS else np.full(len(arrays[0]), foot)
            sets.append(StepData(*arrays, first))
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise InputError(f"{relative(path)}: cannot be read ({error}); {mend}") from None
    if digest != engine.TalosSteps.digest:
        raise InputError(f"{relative(path)}: made for another task: its digest is 0x{digest:016x}, "
                         f"the task is 0x{engine.TalosSteps.digest:016x}; {mend}")  # fmt: skip
    P = engine.TalosSteps
    nq, nu, sha = engine.talos.nq, engine.talos.nu, hashlib.sha256()
    for foot, steps in enumerate(sets):
        n, count = len(steps), WALK if foot == WALKS else 1
        T = P.knots + (count - 1) * (P.swing + P.between)
        shapes = {"X": (n, 6 + 3 * count), "q_raw": (n, T + 1, nq), "u_raw": (n, T, nu), "q": (n, T + 1, nq), "u": (n, T, nu),
                  "cost": (n,), "first": (n,)}  # fmt: skip
        if n == 0 or any(getattr(steps, k).shape != s or not np.isfinite(getattr(steps, k)).all() for k, s in shapes.items()):
            raise InputError(f"{relative(path)}: its arrays do not fit together; {mend}")
        for key in shapes:
            sha.update(np.ascontiguousarray(getattr(steps, key)).tobytes())
    return sets, sha.hexdigest()[:16], made_from
