"""Studies of chapter 7: the costs' gradients, the cross approximation, and the short forms of the rows."""

from __future__ import annotations

import json

import numpy as np
import pytest

from engram.cli import main
from engram.engine import engine
from engram.paths import BUILD
from engram.study.trains import SOLVED, box_of, descended, table_of

COSTS = {
    "panda.ik": lambda: engine.study_arm("panda.ik"),
    "panda.reach": lambda: engine.study_arm("panda.reach"),
    "panda.pick": lambda: engine.study_arm("panda.pick"),
    "panda.transfer": lambda: engine.study_arm("panda.transfer", [0.0, 0, 0, -2, 0, 1.5, 0.7], [0.5, 0, 0, -2, 0, 1.5, 0.7]),
    "ur10.ik": lambda: engine.study_arm("ur10.ik"),
    "planar3.reach": lambda: engine.study_arm("planar3.reach"),
    "planar4.transfer": lambda: engine.study_arm("planar4.transfer", [0.0, 0, 0, 0], [2.0, 0.3, 0.2, 0.1]),
    "rosenbrock": lambda: engine.study_function("rosenbrock", 6),
    "himmelblau": lambda: engine.study_function("himmelblau"),
    "sinusoid": lambda: engine.study_function("sinusoid"),
    "mixture": lambda: engine.study_mixture(np.array([1.0, 0.7]), np.array([2.0, 3.0]), np.eye(2, 4) - 0.3),
}


@pytest.mark.parametrize("name", COSTS)
def test_gradient_is_the_slope_of_the_cost(name: str) -> None:
    cost = COSTS[name]()
    x = np.random.default_rng(1).uniform(cost.lo, cost.hi, (7, cost.d))
    c, gradient = cost.gradient(x)
    np.testing.assert_allclose(c, cost.evaluate(x), rtol=1e-14)  # the gradient may change the order of a sum
    h = 1e-6
    for k in range(cost.ntask, cost.d):
        e = h * (np.arange(cost.d) == k)
        slope = (cost.evaluate(x + e) - cost.evaluate(x - e)) / (2 * h)
        # central differences: rounding 1e-15 c / h; curvature and kinks of the obstacles' cost, relative to the gradient
        np.testing.assert_allclose(gradient[:, k], slope, atol=1e-15 * np.abs(c).max() / h + 1e-6 * np.abs(gradient).max())


def test_refinement_never_climbs_and_stays_in_the_box() -> None:
    cost = engine.study_arm("panda.ik")
    x = np.random.default_rng(2).uniform(cost.lo, cost.hi, (30, cost.d))
    refined, c = cost.refine(x, 100)
    assert np.all(c <= cost.evaluate(x)) and np.all(refined >= cost.lo) and np.all(refined <= cost.hi)
    np.testing.assert_array_equal(refined[:, : cost.ntask], x[:, : cost.ntask])
    np.testing.assert_allclose(cost.evaluate(refined), c, atol=1e-12)


def test_starting_points_move_onto_a_fitted_grid() -> None:
    cost = engine.study_arm("panda.reach")
    rng = np.random.default_rng(4)
    starts, c = cost.refine(rng.uniform(cost.lo, cost.hi, (200, cost.d)), 200)
    starts = starts[c < SOLVED]  # only at a solution does rounding cost much
    lo, hi = box_of(cost, starts)
    assert np.all(lo >= cost.lo) and np.all(hi <= cost.hi) and np.prod((hi - lo) / (np.array(cost.hi) - cost.lo)) < 0.5
    np.testing.assert_array_equal((lo[:3], hi[:3]), (cost.lo[:3], cost.hi[:3]))  # the task keeps its box
    cost.lo, cost.hi = list(lo), list(hi)
    points = np.array([20] * 3 + [48] * 7 + [10] * 14)
    step = (hi - lo) / (points - 1)
    x = descended(cost, starts, list(points), rng)
    np.testing.assert_allclose((x - lo) / step, np.rint((x - lo) / step), atol=1e-9)
    rounded = lo + np.clip(np.rint((starts - lo) / step), 0, points - 1) * step
    np.testing.assert_array_equal(x[:, :3], rounded[:, :3])  # so does each point's task
    assert np.all(cost.evaluate(x) <= cost.evaluate(rounded)) and np.median(cost.evaluate(x) / cost.evaluate(rounded)) < 0.8


def test_cross_is_exact_where_the_rank_suffices() -> None:
    """A mixture of three Gaussians has rank three: the train equals it on the whole grid, and rounding finds the rank."""
    rng = np.random.default_rng(3)
    mean = rng.uniform(-1, 1, (3, 5))
    cost = engine.study_mixture(np.array([1.0, 0.8, 0.6]), np.array([1.0, 2.0, 1.5]), mean)
    cores, values = cost.cross([12] * 5, mean, rank=6, enrich=3, sweeps=2, tolerance=1e-10, seed=1)
    assert max(core.shape[2] for core in cores) == 3 and values < 12**5 / 10
    index = rng.integers(0, 12, (2000, 5))
    x = -2 + index * 4 / 11
    product = np.ones((2000, 1))
    for k, core in enumerate(cores):
        product = np.einsum("ma,mab->mb", product, np.moveaxis(core, 1, 0)[index[:, k]])
    np.testing.assert_allclose(product[:, 0], cost.density(x), atol=1e-10)
    grown = [np.concatenate([core, 1e-14 * core], axis=2) if k < 4 else core for k, core in enumerate(cores)]
    grown = [np.concatenate([core, core], axis=0) if k > 0 else core for k, core in enumerate(grown)]
    rounded = engine.tt_round(grown, 64, 1e-9)
    assert max(core.shape[2] for core in rounded) == 3
    value, _, _ = engine.TensorTrain(table_of(cost, rounded)).value(x)
    np.testing.assert_allclose(value, cost.density(x), atol=1e-6)  # floats


QUICK = {
    "6.1": ["himmelblau.found", "gaussian_mixture_10.found"],
    "6.2": ["all_eight"],
    "6.3": ["success.best.n1", "success.uniform.n1", "success.knn.n1"],
    "6.7": ["panda.solutions_min", "planar4.solutions_min"],
    "6.8": ["planar3.success.n50"],
}


@pytest.mark.parametrize("row", QUICK)
def test_short_forms(row: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", row, "--quick"]) == 0
    assert f"=== S{row}" in capsys.readouterr().out
    figures = {f["id"]: f["value"] for f in json.loads((BUILD / "figures" / f"study.{row}.json").read_text())}
    values = [figures[f"study.{row}.{what}"] for what in QUICK[row]]
    assert values[0] >= 0.9, figures
    if row == "6.3":
        assert values[1] < 0.7  # the world is as hard as it was


def test_inverse_kinematics_takes_postures_to_their_targets() -> None:
    """Of the UR10 to the axes of the world, as its cost judges; of the Panda, blind to the shelf, to the nearest level hand.
    Starts are solutions, moved by 0.2 rad a joint."""
    rng = np.random.default_rng(5)
    for robot in ("ur10", "panda"):
        cost = engine.study_arm(f"{robot}.ik")
        x, c = cost.refine(rng.uniform(cost.lo, cost.hi, (400, cost.d)), 400)
        x = x[c < 1e-2]
        x[:, 3:] = np.clip(x[:, 3:] + rng.uniform(-0.2, 0.2, x[:, 3:].shape), cost.lo[3:], cost.hi[3:])
        found = engine.study_ik(robot, x)
        np.testing.assert_array_equal(found[:, :3], x[:, :3])
        if robot == "ur10":
            assert np.mean(cost.evaluate(found) < 1e-6) > 0.9
            continue
        R, p = engine.panda.frame_placement(found[:, 3:], "hand_tcp")
        there = np.linalg.norm(p - found[:, :3], axis=1) < 1e-6
        assert there.mean() > 0.9
        np.testing.assert_allclose(np.abs(R[there][:, 2, 0]), 1.0, atol=1e-9)
        start = engine.panda.frame_placement(x[:, 3:], "hand_tcp")[0]
        assert np.all(R[there][:, 2, 0] * start[there][:, 2, 0] > 0)  # up stays up
    with pytest.raises(ValueError, match="panda, ur10"):
        engine.study_ik("talos", x)
