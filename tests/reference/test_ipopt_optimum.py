"""FDDP and Ipopt on the same compiled problem: two methods, one optimum."""

import numpy as np
import pytest

from engram.data.reach import OK, ReachSolver, Settings
from engram.engine import engine
from engram.tasks.spec import load_task

# Relative. Both solve to an optimality of 1e-9 or better; the cost is quadratic in what is left.
COST_TOLERANCE = 1e-6
# Ipopt's largest constraint violation [rad, rad/s, m]: its own tolerance
VIOLATION_TOLERANCE = 1e-8
# Of the numbers that Ipopt holds to hard bounds: rounding of a sum of terms near 1
BOUND_TOLERANCE = 1e-9


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


@pytest.fixture(scope="module")
def reach():
    """Solved reach tasks: (problem, start, task vector, solution) by their number."""
    solver = ReachSolver(load_task("panda", "reach"), 0, Settings())

    def solve(i: int):
        task = solver.draw(i)
        solver.set(task.start, task.vector)
        found = solver.best(solver.problem.line(task.ends), task.vector)
        assert found["outcome"] == OK
        return solver.problem, solver.problem.solve(found["xs"], found["us"], iterations=500, stop=1e-12)

    return solve


@pytest.mark.parametrize("i", [2, 3, 5])
def test_reach(reach, i):
    """Where FDDP ends, Ipopt ends too, put off a little: an optimum of the same program, barriers included."""
    problem, fddp = reach(i)
    rng = np.random.default_rng(i)
    xs = fddp["xs"] + 0.002 * rng.standard_normal(fddp["xs"].shape)
    us = fddp["us"] + 0.05 * rng.standard_normal(fddp["us"].shape)
    nlp = problem.ipopt(xs, us, limits=False, torque_box=False, tolerance=1e-9)
    assert nlp["converged"], nlp["status"]
    assert nlp["violation"] <= VIOLATION_TOLERANCE
    assert abs(fddp["cost"] - nlp["cost"]) <= COST_TOLERANCE * fddp["cost"]
    np.testing.assert_allclose(fddp["xs"], nlp["xs"], atol=1e-3)


def test_hard_constraints_hold(reach):
    """Limits of joints, speeds and torques, and a clearance beyond the barriers' margin, at every knot."""
    problem, fddp = reach(2)
    robot, clearance = engine.panda, 0.045
    tight = problem.ipopt(fddp["xs"], fddp["us"], clearance=clearance)
    assert tight["converged"], tight["status"]
    q, v = tight["xs"][1:, :7], tight["xs"][1:, 7:]
    assert problem.clearance(q).min() >= clearance - BOUND_TOLERANCE
    assert np.all(q >= robot.q_lo - BOUND_TOLERANCE) and np.all(q <= robot.q_hi + BOUND_TOLERANCE)
    assert np.all(np.abs(v) <= robot.v_max + BOUND_TOLERANCE)
    assert np.all(np.abs(tight["us"]) <= robot.u_max + BOUND_TOLERANCE)
    assert problem.clearance(fddp["xs"][1:, :7]).min() < clearance  # the constraint had something to do
    assert tight["cost"] >= fddp["cost"] * (1 - COST_TOLERANCE)
