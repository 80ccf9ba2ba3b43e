"""Write a robot model as plain text, for the peers' C++ programs: `export_models.py OUT_DIR ROBOT...`.

One number after the other, 17 digits: the peer computes with exactly our numbers, without a URDF parser.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin

from engram.robots.tree import load as load_tree
from engram.robots.tree import q_to_pin


def load(name: str) -> tuple[pin.Model, np.ndarray]:
    """The model that models/<name>/robot.toml makes, from which our constants are written too, and its nominal posture."""
    tree = load_tree(name)
    return tree.model, q_to_pin(tree, tree.q_home)


def numbers(*arrays: object) -> str:
    """All entries, row-major, in 17 digits; what is not finite (an absent limit) as 1e8."""
    flat = np.concatenate([np.ravel(np.asarray(a, float)) for a in arrays])
    return " ".join(f"{x:.17g}" for x in np.clip(np.nan_to_num(flat, nan=1e8), -1e8, 1e8))


def placement(M: pin.SE3) -> str:
    return numbers(M.rotation, M.translation)


def text(name: str, model: pin.Model, q_ref: np.ndarray) -> str:
    lines = [f"{name} {model.nq} {model.nv} {model.njoints - 1}"]
    for i in range(1, model.njoints):
        joint, inertia = model.joints[i], model.inertias[i]
        kind = joint.shortname()
        axis = joint.extract().axis if "Unaligned" in kind else np.zeros(3)
        body = numbers(inertia.mass, inertia.lever, inertia.inertia)
        lines.append(f"{model.names[i]} {model.parents[i]} {kind} {numbers(axis)} {placement(model.jointPlacements[i])} {body}")
    lines.append(str(model.nframes - 1))
    for frame in list(model.frames)[1:]:
        lines.append(f"{frame.name} {frame.parentJoint} {int(frame.type)} {placement(frame.placement)}")
    limits = (model.lowerPositionLimit, model.upperPositionLimit, model.upperVelocityLimit, model.upperEffortLimit)
    lines += [numbers(v) for v in (*limits, q_ref, model.armature)]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    out = Path(sys.argv[1])
    out.mkdir(parents=True, exist_ok=True)
    for robot in sys.argv[2:]:
        (out / f"{robot}.txt").write_text(text(robot, *load(robot)))
