"""The memory of reaching around a pole: paths of torso and arm, cut from guided runs (docs/pole.md).

Every `EVERY` s of a run that arrived is a sample: where hand and elbow were, how the hand moved and where it was going ->
how the joints went on over the horizon. Mirrors controller/loop/loop_pole_memory.h.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from engram.emit import Knn, Pca, write_tables
from engram.inputs import InputError
from engram.robots.tree import q_to_pin
from engram.tasks.motion import MotionSpec

MOVED = np.array([12, 13, 22, 23, 24, 25, 26, 27, 28])  # driven dofs: torso, right arm (TalosPole::moved)
HAND, ELBOW = "right_gripper", "arm_right_4_joint"
PERIOD = 0.01  # s, between rows of a recording
EVERY = 0.1  # s, between samples of a run
UNTIL = 1.8  # s, the last sample of a run: later the hand has arrived
COMPONENTS = 16
SCALE = np.repeat([1.0, 0.7, 0.15, 1.0, 0.6], [3, 3, 3, 2, 1])  # 1/m, 1/m, s/m, 1/m: height of the target matters less
HELD_OUT = 10  # every tenth run
AXES = "xyz"


@dataclass(frozen=True)
class Samples:
    """n samples of `runs` runs."""

    feature: np.ndarray  # (n, 12) hand, elbow [m], velocity of the hand [m/s], target [m]: world axes
    path: np.ndarray  # (n, knots + 1, 9) joint angles [rad]
    run: np.ndarray  # (n)


def read_recording(path: Path, spec: MotionSpec) -> list[np.ndarray]:
    """Runs of `engram-pole record=`: arrays (ticks, 2 + nq + nv + 3). Raises InputError."""
    width = 2 + spec.robot.nq + spec.robot.nv + 3
    data = np.fromfile(path)
    if data.size == 0 or data.size % width:
        raise InputError(f"{path}: not a recording of engram-pole for this robot, or cut short; record it again")
    rows = data.reshape(-1, width)
    return np.split(rows, np.flatnonzero(np.diff(rows[:, 0])) + 1)


def cut(spec: MotionSpec, runs: list[np.ndarray]) -> tuple[Samples, int]:
    """Samples of the runs that arrived, and the number of runs left out."""
    tree = spec.robot
    radius = float(spec.constants["success_position"])
    stride = round(spec.dt / PERIOD)
    features, paths, labels, lost = [], [], [], 0
    for label, run in enumerate(runs):
        q = run[:, 2 : 2 + tree.nq]
        p, elbow = np.swapaxes([_arm(spec, row) for row in q], 0, 1)
        if np.linalg.norm(p[-1] - run[-1, -3:]) > radius:
            lost += 1
            continue
        v = np.gradient(p, PERIOD, axis=0)
        joints = q[:, tree.nq - tree.nu + MOVED]
        for t in np.arange(0.0, UNTIL, EVERY):
            i = round(t / PERIOD)
            ahead = np.minimum(i + stride * np.arange(spec.knots + 1), len(run) - 1)
            features.append(np.concatenate([p[i], elbow[i], v[i], run[i, -3:]]))
            paths.append(joints[ahead])
            labels.append(label)
    if not features:
        raise InputError("no run of the recording arrived: nothing to learn from")
    return Samples(np.array(features), np.array(paths), np.array(labels)), lost


def _arm(spec: MotionSpec, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of hand and elbow (m, world)."""
    tree, f = spec.robot, spec.robot.frame_name.index(HAND)
    data = tree.model.createData()
    pin.forwardKinematics(tree.model, data, q_to_pin(tree, q))
    joint = int(tree.frame_joint[f])
    hand = data.oMi[joint + 1].act(tree.R_turn[joint] @ tree.p_JF[f])
    return hand, data.oMi[tree.model.getJointId(ELBOW)].translation.copy()


def fit(spec: MotionSpec, samples: Samples, folder: Path, provenance: str) -> dict:
    """Fit PCA and neighbours to nine runs in ten, measure on the rest, write the tables; returns the manifest."""
    held = samples.run % HELD_OUT == 0
    flat = samples.path.reshape(len(samples.path), -1)
    mean = flat[~held].mean(axis=0)
    _, sigma, basis = np.linalg.svd(flat[~held] - mean, full_matrices=False)
    basis, unit = basis[:COMPONENTS], np.maximum(sigma[:COMPONENTS], 1e-9) / np.sqrt(np.sum(~held))
    value = (flat - mean) @ basis.T / unit
    error = flat[held] - mean - (value[held] * unit) @ basis
    near = _nearest(samples.feature[held], samples.feature[~held])
    other = np.abs(flat[~held][near] - flat[held]).max(axis=1)
    n = int(held.sum())
    inputs = [
        (f"{name}_{axis}", unit_)
        for name, unit_ in (("p_WH", "m"), ("p_WE", "m"), ("v_WH", "m/s"), ("p_WT", "m"))
        for axis in AXES
    ]
    lo, hi = samples.feature.min(axis=0), samples.feature.max(axis=0)
    knn = Knn(
        inputs=inputs,
        lo=lo,
        hi=hi,
        held_out_error=float(np.median(other)),
        held_out_text=f"[rad] median largest joint difference of the nearest path on {n} held-out samples",
        x=samples.feature[~held],
        scale=SCALE,
        value=value[~held],
    )
    pca = Pca(
        role="path",
        inputs=[(f"z{i}", "1") for i in range(COMPONENTS)],
        lo=value.min(axis=0),
        hi=value.max(axis=0),
        held_out_error=float(np.sqrt(np.mean(error**2))),
        held_out_text=f"[rad] rms of a decoded path on {n} held-out samples",
        mean=mean,
        basis=basis * unit[:, None],
    )
    digest = hashlib.sha256(np.ascontiguousarray(flat, np.float32).tobytes()).hexdigest()[:16]
    return write_tables(
        folder,
        f"{spec.robot.name}_{spec.name}",
        [knn, pca],
        robot_digest=spec.robot.digest,
        task_digest=spec.digest,
        data_digest=digest,
        provenance=provenance,
    )


def _nearest(query: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Index of the nearest known feature of each query: (m)."""
    return np.array([np.argmin((((known - row) * SCALE) ** 2).sum(axis=1)) for row in query])
