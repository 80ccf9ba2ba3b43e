"""FDDP beside Crocoddyl's on its arm example: model of a knot, direction, and the way to the optimum."""

import ctypes

import crocoddyl
import numpy as np
import pinocchio as pin
import pytest

from engram.engine import engine
from engram.robots.tree import load

# Same formulas, other order of summation: rounding of about ten thousand operations on entries up to 1e3.
MODEL_TOLERANCE = 1e-9
# Relative. Both stop on an expected improvement below 1e-9 of a cost near 7.
COST_TOLERANCE = 1e-8
# The stopping criterion may cross its threshold one iteration apart.
ITERATION_TOLERANCE = 1
STOP = 1e-9
HORIZONS = [30, 100]


def peer_problem(T: int) -> crocoddyl.ShootingProblem:
    """The problem of bench/problems.h, stated for Crocoddyl on the Pinocchio model that robot.h was written from."""
    tree = load("panda")
    state = crocoddyl.StateMultibody(tree.model)
    actuation = crocoddyl.ActuationModelFull(state)
    x0 = np.r_[tree.q_home, np.zeros(tree.model.nv)]
    placement = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.array([0.5, 0.3, 0.4]))
    frame = tree.model.getFrameId("panda_hand_tcp")

    def term(residual):
        return crocoddyl.CostModelResidual(state, residual)

    goal = term(crocoddyl.ResidualModelFramePlacement(state, frame, placement, actuation.nu))
    running, terminal = crocoddyl.CostModelSum(state, actuation.nu), crocoddyl.CostModelSum(state, actuation.nu)
    running.addCost("goal", goal, 1.0)
    running.addCost("state", term(crocoddyl.ResidualModelState(state, x0, actuation.nu)), 0.1)
    running.addCost("control", term(crocoddyl.ResidualModelControl(state, actuation.nu)), 0.1)
    terminal.addCost("goal", goal, 1e3)

    def knot(cost, dt):
        return crocoddyl.IntegratedActionModelEuler(crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, cost), dt)

    problem = crocoddyl.ShootingProblem(x0, [knot(running, 0.01)] * T, knot(terminal, 0.0))
    problem.nthreads = 1
    return problem


def off_trajectory(T: int) -> tuple[np.ndarray, np.ndarray]:
    """States and controls far from any optimum, with a gap at every knot."""
    rng = np.random.default_rng(T)
    x0 = engine.Arm(T).x0
    return x0 + 0.2 * rng.standard_normal((T + 1, len(x0))), 5.0 * rng.standard_normal((T, 7))


@pytest.fixture(params=HORIZONS)
def both(request) -> tuple[engine.Arm, crocoddyl.ShootingProblem]:
    return engine.Arm(request.param), peer_problem(request.param)


def test_model_of_a_knot(both):
    ours, peer = both
    xs, us = off_trajectory(ours.T)
    model = ours.linearize(xs, us)
    solver = crocoddyl.SolverFDDP(peer)
    solver.setCandidate(list(xs), list(us), False)
    solver.calcDiff()
    data = [*peer.runningDatas, peer.terminalData]
    n = 2 * ours.nv
    evaluated = ours.evaluate(xs, us)
    np.testing.assert_allclose(evaluated["cost"], [d.cost for d in data], rtol=MODEL_TOLERANCE)
    np.testing.assert_allclose(evaluated["gap"], np.array(solver.fs), atol=MODEL_TOLERANCE)
    np.testing.assert_allclose(model["gap"], np.array(solver.fs), atol=MODEL_TOLERANCE)
    for k, d in enumerate(data):
        expected = {"Lx": (model["Lz"][k, :n], d.Lx), "Lxx": (model["Lzz"][k, :n, :n], d.Lxx)}
        if k < ours.T:
            expected |= {
                "Fx": (model["Fx"][k], d.Fx),
                "Fu": (model["Fu"][k], d.Fu),
                "Lu": (model["Lz"][k, n:], d.Lu),
                "Lxu": (model["Lzz"][k, :n, n:], d.Lxu),
                "Luu": (model["Lzz"][k, n:, n:], d.Luu),
            }
        for name, (mine, theirs) in expected.items():
            scale = max(1.0, np.abs(theirs).max())
            np.testing.assert_allclose(mine / scale, theirs / scale, atol=MODEL_TOLERANCE, err_msg=f"{name} of knot {k}")


def test_gains(both):
    ours, peer = both
    xs, us = off_trajectory(ours.T)
    K, k = ours.direction(xs, us)
    solver = crocoddyl.SolverFDDP(peer)
    solver.setCandidate(list(xs), list(us), False)
    solver.preg = solver.dreg = 0.0
    solver.calcDiff()
    solver.backwardPass()
    for mine, theirs in ((K, np.array(solver.K)), (k, np.array(solver.k))):
        np.testing.assert_allclose(mine, theirs, atol=MODEL_TOLERANCE * np.abs(theirs).max())


def test_way_to_the_optimum(both):
    ours, peer = both
    xs, us = ours.cold_start()["xs"], ours.cold_start()["us"]
    solution = ours.solve(xs, us, iterations=200, stop=STOP)
    solver = crocoddyl.SolverFDDP(peer)
    solver.th_stop = STOP
    assert solver.solve(list(xs), list(us), 200, False)
    assert solution["converged"]
    assert abs(solution["cost"] - solver.cost) <= COST_TOLERANCE * solver.cost
    assert abs(solution["iterations"] - (solver.iter + 1)) <= ITERATION_TOLERANCE
    # the optimum is where the gradient vanishes: states agree to about the root of the cost's tolerance
    np.testing.assert_allclose(solution["xs"], np.array(solver.xs), atol=1e-4)


def test_box_of_the_controls(build):
    """Projected Newton beside SolverBoxFDDP on motors so weak that torques saturate: same optimum, same bounds active."""
    library = build / "tests" / "libbox_oracle.so"
    assert library.is_file(), f"{library} is missing: ninja -C {build} box_oracle"
    T = 30
    us, limit, cost, iterations = np.empty((T, 7)), np.empty(7), ctypes.c_double(), ctypes.c_int()
    arrays = [a.ctypes.data_as(ctypes.c_void_p) for a in (us, limit)]
    assert ctypes.CDLL(str(library)).box_arm(ctypes.c_double(STOP), *arrays, ctypes.byref(cost), ctypes.byref(iterations)) == 0
    peer = peer_problem(T)
    for model in peer.runningModels:
        model.u_lb, model.u_ub = -limit, limit
    start = engine.Arm(T).cold_start()
    solver = crocoddyl.SolverBoxFDDP(peer)
    solver.th_stop = STOP
    assert solver.solve(list(start["xs"]), list(start["us"]), 200, False)
    theirs = np.array(solver.us)
    bound = np.abs(us) == limit
    counts = f"iterations {iterations.value} and {solver.iter + 1}, {bound.sum()} controls at a bound"
    print(f"cost {cost.value:.9f} and {solver.cost:.9f}, {counts}")
    assert abs(cost.value - solver.cost) <= COST_TOLERANCE * solver.cost
    assert np.all(np.abs(us) <= limit) and bound.sum() > T
    np.testing.assert_allclose(us, theirs, atol=1e-3)  # N m: the root of the cost's tolerance over the weight of u
    assert np.array_equal(bound, np.abs(theirs) >= limit - 1e-9)


def test_direction_solves_the_kkt_system():
    """(xs + dx, us + du) of a full step solves the quadratic program of the linearization, by one dense factorization."""
    ours = engine.Arm(30)
    xs, us = off_trajectory(ours.T)
    model = ours.linearize(xs, us)
    T, n, m = ours.T, ours.ndx, ours.nu
    size = T * (n + m) + n  # dz = (dx_0 du_0 dx_1 ... dx_T), then one multiplier per dynamics row and for x_0
    H, g = np.zeros((size, size)), np.zeros(size)
    A, b = np.zeros(((T + 1) * n, size)), np.zeros((T + 1) * n)
    A[:n, :n], b[:n] = np.eye(n), model["gap"][0]
    for k in range(T + 1):
        at, width = k * (n + m), n + (m if k < T else 0)
        H[at : at + width, at : at + width] = model["Lzz"][k, :width, :width]
        g[at : at + width] = model["Lz"][k, :width]
        if k < T:
            row = (k + 1) * n
            A[row : row + n, at : at + n + m] = -np.hstack([model["Fx"][k], model["Fu"][k]])
            A[row : row + n, at + n + m : at + 2 * n + m] = np.eye(n)
            b[row : row + n] = model["gap"][k + 1]
    # dx_{k+1} = Fx dx_k + Fu du_k + f_{k+1}
    dz = np.linalg.solve(np.block([[H, A.T], [A, np.zeros((len(b), len(b)))]]), np.r_[-g, b])[:size]

    K, k_ff = ours.direction(xs, us)
    dx, du = model["gap"][0], []
    for k in range(T):
        du.append(-k_ff[k] - K[k] @ dx)
        at = k * (n + m)
        scale = np.abs(dz).max()
        np.testing.assert_allclose(dx, dz[at : at + n], atol=MODEL_TOLERANCE * scale)
        np.testing.assert_allclose(du[k], dz[at + n : at + n + m], atol=MODEL_TOLERANCE * scale)
        dx = model["Fx"][k] @ dx + model["Fu"][k] @ du[k] + model["gap"][k + 1]
