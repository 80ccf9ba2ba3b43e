"""What a log says about steps: where feet landed and were asked to land, and how the centre of mass kept to its reference."""

from typing import Any

import numpy as np
import pinocchio as pin

from engram_sim.motion import Motion

SETTLED = 0.1  # s from touch-down to where a foot is seen


def landings(swing: np.ndarray, foothold: np.ndarray) -> list[tuple[int, int, np.ndarray]]:
    """Foot, first cycle on the ground, and where it was to land (m, world axes), of every foot that landed.

    swing: (cycles,), bit f for a foot f in the air; foothold: (cycles, feet, 4).
    """
    found = []
    for f in range(foothold.shape[1]):
        in_air = (swing >> f) & 1
        found += [(f, last + 1, foothold[last, f, :2]) for last in np.flatnonzero((in_air[:-1] == 1) & (in_air[1:] == 0))]
    return found


def measure(motion: Motion, part: dict[str, Any]) -> dict[str, Any]:
    """Steps, errors of their landings (m) and of the centre of mass (m, horizontal, rms while it walks); {} if no foot swung."""
    cycles, states, tree = motion.cycles, motion.messages["ENGRAM_STATE"], motion.tree
    begin, end = (round(1e6 * part[key]) for key in ("t_start_s", "t_end_s"))
    cycles = cycles[(cycles["utime"] > begin) & (cycles["utime"] < end)]
    if not len(cycles) or not cycles["swing"].any():
        return {}
    model, data = tree.model, tree.model.createData()
    time = states["utime"]

    def configuration(utime: int) -> np.ndarray:
        return states["q"][np.searchsorted(time, utime).clip(0, len(states) - 1), : tree.nq].astype(float)

    errors = []
    feet = [tree.frame_name.index(name) for name in tree.feet]
    swing, foothold = cycles["swing"].astype(int), cycles["foot"][:, : len(feet)].astype(float)
    for f, first, wanted in landings(swing, foothold):
        seen = cycles["utime"][first] + round(1e6 * SETTLED)
        if seen >= end:
            continue
        pin.forwardKinematics(model, data, configuration(seen))
        joint = int(tree.frame_joint[feet[f]]) + 1
        errors.append(np.linalg.norm(data.oMi[joint].act(tree.R_turn[joint - 1] @ tree.p_JF[feet[f]])[:2] - wanted))
    swings = np.flatnonzero(swing)
    walked = cycles[swings[0] : swings[-1] + 1]
    com = [pin.centerOfMass(model, data, configuration(utime))[:2] for utime in walked["utime"]]
    off = np.array(com) - walked["com"][:, :2].astype(float)
    row: dict[str, Any] = {"steps": len(errors), "com_rms_m": float(np.sqrt(np.mean(np.sum(off**2, axis=1))))}
    if errors:
        row |= {"landing_mean_m": float(np.mean(errors)), "landing_max_m": float(np.max(errors))}
    return row
