"""FDDP and Ipopt on the same compiled problem: two methods, one optimum."""

import numpy as np
import pytest

from engram.engine import engine

# Relative. Both solve to an optimality of 1e-9 or better; the cost is quadratic in what is left.
COST_TOLERANCE = 1e-6
# Ipopt's largest constraint violation [rad, rad/s]: its own tolerance
VIOLATION_TOLERANCE = 1e-8


@pytest.mark.parametrize("T", [30, 100])
def test_arm(T):
    arm = engine.Arm(T)
    cold = arm.cold_start()
    fddp = arm.solve(cold["xs"], cold["us"], iterations=200, stop=1e-12)
    nlp = arm.ipopt(cold["xs"], cold["us"])
    assert fddp["converged"] and nlp["converged"], (fddp["status"], nlp["status"])
    assert nlp["violation"] <= VIOLATION_TOLERANCE
    assert abs(fddp["cost"] - nlp["cost"]) <= COST_TOLERANCE * fddp["cost"]
    np.testing.assert_allclose(fddp["xs"], nlp["xs"], atol=1e-4)  # the root of the cost's tolerance, and a margin


def test_first_derivatives_alone():
    """With Ipopt's own approximation of second derivatives the optimum is the same, on a horizon short enough for it."""
    arm = engine.Arm(3)
    cold = arm.cold_start()
    fddp = arm.solve(cold["xs"], cold["us"], iterations=200, stop=1e-12)
    nlp = arm.ipopt(cold["xs"], cold["us"], tolerance=1e-7, limited_memory=True)
    assert nlp["converged"], nlp["status"]
    assert abs(fddp["cost"] - nlp["cost"]) <= COST_TOLERANCE * fddp["cost"]
