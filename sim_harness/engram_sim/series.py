"""Writing task series (format: sim_harness/sim_series.h): jumps between random reachable poses, and moving targets."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from engram.tasks.reach import ReachSampler, sampler, task_vector

HELD_OUT = 0x5E21E5  # mixed into the seed, so that no series repeats the draws of the training data
HOLD = 0.3  # s, that the hand must stay at the target
MOVE_DT = 0.01  # s, between two poses of a moving target
MOVE_TIME = 2.4  # s, one round of the moving target
MOVE_RADII = (0.06, 0.03, 0.015)  # m, of its circle; the largest that the arm can follow clear of all boxes
MAX_STEP = 0.1  # rad, largest change of a joint between two poses of a moving target


def write_reach(path: Path, robot: str, task: str, seed: int, jumps: int, per_episode: int = 30, move_every: int = 10) -> int:
    """Write a series of `jumps` jumps; the same seed gives the same bytes.

    Each episode starts in a random posture; after every `move_every`-th jump the target goes round a circle. Returns the number
    of moving parts.
    """
    draw = sampler(robot, task)
    spec, rng = draw.spec, np.random.default_rng([HELD_OUT, seed])
    success = spec.success
    lines = [
        "engram_series 1",
        f"# seed {seed}: {jumps} jumps of {robot} {task}",
        f"robot_digest 0x{draw.tree.digest:016x}",
        f"task_digest 0x{spec.digest:016x}",
        f"hand {spec.frame}",
        f"window {success['time']!r}",
        f"hold {HOLD!r}",
        f"tolerance {success['position']!r} {success['rotation']!r}",
        f"speed {numbers(draw.tree.v_max)}",
    ]
    moving = 0
    for jump in range(jumps):
        if jump % per_episode == 0:
            lines.append(f"episode {numbers(draw.sample(rng)[2])}")
        p_WT, R_WT, q = draw.sample(rng)
        lines.append(f"jump {target(p_WT, R_WT)}")
        if move_every and jump % move_every == move_every - 1:
            poses = circle(draw, p_WT, R_WT, q, rng)
            lines += [f"move {MOVE_DT!r} {target(p, R)}" for p, R in poses]
            moving += bool(poses)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return moving


def circle(
    draw: ReachSampler, p_WT: np.ndarray, R_WT: np.ndarray, q: np.ndarray, rng: np.random.Generator
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Poses of a target that leaves p_WT, goes round a circle and comes back, at rest at both ends.

    The circle lies in a random plane; its radius is the first of MOVE_RADII at which the posture `q` can follow without a leap
    and with the clearance asked of targets. Empty if none is.
    """
    e1 = rng.standard_normal(3)
    e2 = np.cross(e1 / np.linalg.norm(e1), rng.standard_normal(3))
    e2 /= np.linalg.norm(e2)
    e1 = np.cross(e2, e1 / np.linalg.norm(e1))
    s = np.arange(1, round(MOVE_TIME / MOVE_DT) + 1) * MOVE_DT / MOVE_TIME
    phase = 2.0 * np.pi * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)  # minimum jerk
    for radius in MOVE_RADII:
        poses = [(p_WT + radius * ((1.0 - np.cos(a)) * e1 + np.sin(a) * e2), R_WT) for a in phase]
        if can_follow(draw, q, poses):
            return poses
    return []


def can_follow(draw: ReachSampler, q: np.ndarray, poses: list[tuple[np.ndarray, np.ndarray]]) -> bool:
    """Whether every fifth pose is reached from the one before it, clear of all boxes."""
    for p, R in poses[4::5]:
        before, q = q, draw.descend(q, p, R)
        if q is None or np.abs(q - before).max() > 5.0 * MAX_STEP or draw.clearance(q) < draw.spec.clearance:
            return False
    return True


def target(p_WT: np.ndarray, R_WT: np.ndarray) -> str:
    """Pose and task vector of one target."""
    quaternion = pin.Quaternion(R_WT).normalized().coeffs()
    return f"{numbers(np.concatenate([p_WT, quaternion]))}  {numbers(task_vector(p_WT, R_WT))}"


def numbers(values: np.ndarray) -> str:
    """Numbers in hexadecimal notation: every bit survives."""
    return " ".join(float(value).hex() for value in values)
