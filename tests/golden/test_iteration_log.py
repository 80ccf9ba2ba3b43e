"""FDDP's way to the optimum, iteration by iteration, as it was when it was last reviewed.

A change of these files is a change of the solver: it needs a cause in the commit that makes it.
    .venv/bin/python tests/golden/test_iteration_log.py     writes them anew
"""

from pathlib import Path

import numpy as np
import pytest

from engram.engine import engine

FOLDER = Path(__file__).parent
HORIZONS = [30, 100]
STOP = 1e-9
# Rounding (1e-16) grows along the iterations by the sensitivity of the rollout; another order of sums stays below this.
COST_TOLERANCE = 1e-7
HEAD = "FDDP on the arm problem of bench/problems.h from its cold start, T = {T}: cost, step length"


def iteration_log(T: int) -> np.ndarray:
    """Cost and step length (iterations, 2) of a solve from the cold start."""
    problem = engine.Arm(T)
    start = problem.cold_start()
    solution = problem.solve(start["xs"], start["us"], iterations=200, stop=STOP)
    assert solution["converged"]
    return solution["log"][:, [0, 2]]


@pytest.mark.parametrize("T", HORIZONS)
def test_iterations_are_those_of_the_golden_log(T: int) -> None:
    golden = np.loadtxt(FOLDER / f"fddp_arm{T}.txt")
    log = iteration_log(T)
    assert len(log) == len(golden)
    np.testing.assert_array_equal(log[:, 1], golden[:, 1])
    np.testing.assert_allclose(log[:, 0], golden[:, 0], rtol=COST_TOLERANCE)


@pytest.mark.parametrize("T", HORIZONS)
def test_a_solve_repeats_bit_for_bit(T: int) -> None:
    assert iteration_log(T).tobytes() == iteration_log(T).tobytes()


if __name__ == "__main__":
    for horizon in HORIZONS:
        np.savetxt(FOLDER / f"fddp_arm{horizon}.txt", iteration_log(horizon), fmt="%.12g", header=HEAD.format(T=horizon))
