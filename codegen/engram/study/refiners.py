"""controller/ik beside the studies' own refiner, from the same starts: Gauss-Newton on the pose, obstacles unseen."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from engram.engine import engine

IK_ITERATIONS = 24
Refiner = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def bfgs(cost: engine.StudyCost, evaluations: int) -> Refiner:
    """The studies' refiner: the whole cost, within bounds."""
    return lambda x: cost.refine(x, evaluations)


def ik(robot: str, cost: engine.StudyCost) -> Refiner:
    """The controller's inverse kinematics, judged by the same cost."""

    def refine(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = engine.study_ik(robot, x, IK_ITERATIONS)
        return found, cost.evaluate(found)

    return refine


def clocked(refine: Refiner, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """What a refiner makes of x (m, d), its cost (m), and CPU time of one point [us]."""
    clock = time.process_time()
    found, c = refine(x)
    return found, c, 1e6 * (time.process_time() - clock) / len(x)
