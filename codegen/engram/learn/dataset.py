"""The solved motions of `engram data`, checked and ready to learn from."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from engram.inputs import InputError
from engram.learn.memory import Motions, features
from engram.paths import relative
from engram.tasks.spec import TaskSpec

FEWEST = 50  # motions below which a fit is refused


@dataclass(frozen=True)
class Source:
    """Motions, with the tasks (n, ntask) they solve, and where they come from."""

    motions: Motions
    vector: np.ndarray
    xs: np.ndarray  # (n, knots + 1, nx)
    cost: np.ndarray  # (n,)
    digest: str
    made_from: str


def rotation(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrices (n, 3, 3) of quaternions x y z w (n, 4)."""
    x, y, z, w = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def load_motions(path: Path, spec: TaskSpec, held_out: int) -> Source:
    """The data set of a task; every `held_out`-th motion is marked as held out. Raises InputError that names the mend."""
    mend = f"run `engram data {spec.robot.name} {spec.name}`"
    try:
        with np.load(path, allow_pickle=False) as file:
            data = dict(file)
        X, xs, us, t = (np.asarray(data[key], float) for key in ("X", "xs", "us", "t"))
        digest, made_from, cost = int(data["task_digest"]), str(data["made_from"]), np.asarray(data["cost"], float)
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise InputError(f"{relative(path)}: cannot be read ({error}); {mend}") from None
    nq = spec.robot.nq
    if digest != spec.digest:
        raise InputError(
            f"{relative(path)}: made for another task: its digest is 0x{digest:016x}, the task is 0x{spec.digest:016x}; {mend}"
        )
    if len(X) < FEWEST:
        raise InputError(f"{relative(path)}: holds {len(X)} motions, at least {FEWEST} are needed; {mend}")
    shapes = (X.shape[1] == nq + len(spec.vector_name), xs.shape[1:] == (len(t), nq + spec.robot.nv), us.shape[1] == len(t) - 1)
    if not all(shapes) or not all(np.isfinite(a).all() for a in (X, xs, us, t)):
        raise InputError(f"{relative(path)}: its arrays do not fit together; {mend}")
    sha = hashlib.sha256()
    for array in (X, xs, us, t):
        sha.update(np.ascontiguousarray(array).tobytes())
    x = features(X[:, :nq], X[:, nq : nq + 3], rotation(X[:, nq + 3 : nq + 7]))
    motions = Motions(x, t, xs[:, :, :nq], us, np.arange(len(X)) % held_out == held_out - 1)
    return Source(motions, X[:, nq:], xs, cost, sha.hexdigest()[:16], made_from)
