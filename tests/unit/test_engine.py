"""The binding: what it refuses, what it returns, and that a solve leaves Python free to run."""

import threading

import numpy as np
import pytest

from engram.engine import engine


@pytest.fixture(scope="module")
def batch() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    return tuple(rng.uniform(-1.0, 1.0, (7, 7)) for _ in range(3))  # 7 is no multiple of the lanes


@pytest.mark.parametrize("name", ["rnea", "aba", "forward_dynamics", "rnea_derivatives", "forward_derivatives"])
def test_lanes_compute_what_the_scalar_does(batch, name):
    algorithm = getattr(engine.panda, name)
    np.testing.assert_array_equal(algorithm(*batch, lanes=True), algorithm(*batch))


def test_any_real_array_is_taken(batch):
    q, v, a = batch
    expected = engine.panda.rnea(q, v, a)
    np.testing.assert_array_equal(engine.panda.rnea(np.asfortranarray(q), v[::1], a), expected)
    np.testing.assert_allclose(engine.panda.rnea(q.astype(np.float32), v, a), expected, rtol=1e-5)


def test_wrong_shapes_name_the_array(batch):
    q, v, a = batch
    with pytest.raises(ValueError, match=r"v: expected shape \( 7 7 \), found \( 6 7 \)"):
        engine.panda.rnea(q, v[:6], a)
    arm = engine.Arm(3)
    with pytest.raises(ValueError, match="us: expected shape"):
        arm.solve(np.zeros((4, 14)), np.zeros((4, 7)))


def test_wrong_values_name_the_argument():
    with pytest.raises(ValueError, match="no frame 'elbow'"):
        engine.panda.frame_placement(np.zeros((1, 7)), "elbow")
    with pytest.raises(ValueError, match="T: expected 1"):
        engine.Arm(0)
    reach = engine.PandaReach()
    with pytest.raises(ValueError, match="quaternion"):
        reach.set(np.zeros(14), np.zeros(7))
    arm = engine.Arm(3)
    cold = arm.cold_start()
    with pytest.raises(ValueError, match="step_lengths"):
        arm.solve(cold["xs"], cold["us"], step_lengths=0)


def test_guess_that_is_not_finite_is_a_status():
    arm = engine.Arm(3)
    cold = arm.cold_start()
    cold["us"][1, 2] = np.nan
    found = arm.solve(cold["xs"], cold["us"])
    assert found["status"] == "not finite" and not found["converged"]
    with pytest.raises(ValueError, match="not finite"):
        arm.linearize(cold["xs"], cold["us"])


def test_log_tells_the_solve():
    arm = engine.Arm(30)
    cold = arm.cold_start()
    found = arm.solve(cold["xs"], cold["us"])
    assert found["log"].shape == (found["iterations"], 6)
    assert found["log"][-1, 0] == found["cost"] and found["feasible"]
    evaluated = arm.evaluate(found["xs"], found["us"])
    assert np.isclose(evaluated["cost"].sum(), found["cost"], rtol=1e-12)
    # gap-free: the merit is the cost
    assert np.isclose(arm.merit(found["xs"][None], found["us"][None])[0], found["cost"], rtol=1e-9)


def test_solve_releases_python():
    """One long solve, and this thread gets its turns meanwhile."""
    arm = engine.Arm(100)
    cold = arm.cold_start()
    started = threading.Event()

    def solve() -> None:
        started.set()
        arm.solve(cold["xs"], cold["us"], iterations=200, stop=-1.0)

    thread = threading.Thread(target=solve)
    thread.start()
    started.wait()
    turns = 0
    while thread.is_alive():
        turns += 1
        thread.join(0.001)
    assert turns >= 5  # one or two if the solve kept the interpreter to itself
