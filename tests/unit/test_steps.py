"""Steps of Talos: the planner follows its references, the solver lands the foot, frames do not matter, bad feet are refused."""

import json

import numpy as np
import pytest

from engram.cli import main
from engram.data import step_set, steps
from engram.engine import engine
from engram.inputs import InputError
from engram.paths import BUILD

NQ = 39


@pytest.fixture(scope="module")
def problem():
    return engine.TalosSteps()


def solve(problem, feet, goals, foot, **options) -> dict:
    problem.set(feet, goals, foot)
    planned = problem.planned()
    return problem.solve(planned["xs"], planned["us"], stop=1e-8, **options)


def task(foot: int, i: int) -> tuple[np.ndarray, np.ndarray]:
    x = steps.draw(3, foot, i)
    return x[:6].reshape(2, 3), x[None, 6:]


@pytest.mark.parametrize("foot", [0, 1])
def test_a_step_is_planned_and_solved(problem, foot):
    feet, goal = task(foot, 0)
    problem.set(feet, goal, foot)
    planned = problem.planned()
    seen, wanted = problem.feet(planned["xs"][:, :NQ])
    # to the softness of the planner's weights; z and headings too
    np.testing.assert_allclose(seen, wanted, atol=2e-3)
    found = problem.solve(planned["xs"], planned["us"], stop=1e-8)
    assert found["converged"] and found["feasible"]
    seen, _ = problem.feet(found["xs"][:, :NQ])
    np.testing.assert_allclose(seen[-1, foot, [0, 1, 3]], goal[0], atol=5e-3)  # the weight of the landing against all others
    standing = seen[:, 1 - foot]
    assert np.abs(standing - standing[0]).max() < 2e-3  # contacts hold velocities, not places: knots of 40 ms drift
    moves = seen[problem.before : problem.before + problem.swing, foot, 2]
    assert moves.max() > 0.04  # of 0.06 m
    assert found["cost"] < problem.evaluate(planned["xs"], planned["us"])["cost"].sum()


def test_frames_do_not_matter(problem):
    feet, goal = task(0, 1)
    here = solve(problem, feet, goal, 0)
    frame = np.array([3.0, -2.0, 2.5])
    there = solve(problem, steps.place(frame, feet), steps.place(frame, goal), 0)
    assert there["cost"] == pytest.approx(here["cost"], rel=1e-6)
    start = np.repeat(here["xs"][:1, :NQ], len(here["xs"]), 0)
    start_there = np.repeat(there["xs"][:1, :NQ], len(there["xs"]), 0)
    moved = problem.difference(start, np.ascontiguousarray(here["xs"][:, :NQ]))
    moved_there = problem.difference(start_there, np.ascontiguousarray(there["xs"][:, :NQ]))
    np.testing.assert_allclose(moved_there, moved, atol=1e-4)  # both have stopped within 1e-8 of cost
    np.testing.assert_allclose(steps.step_vector(steps.place(frame, feet), steps.place(frame, goal[0])),
                               steps.step_vector(feet, goal[0]), atol=1e-12)  # fmt: skip


def test_rule_of_the_thesis_needs_two_iterations_at_the_optimum(problem):
    feet, goal = task(1, 2)
    found = solve(problem, feet, goal, 1)
    again = problem.solve(found["xs"], found["us"] + 1e-9, iterations=20, stop_gradient=1e-2)
    assert again["converged"] and again["iterations"] <= 2
    assert again["log"][-1, 5] < 1e-2
    cold = problem.cold()
    far = problem.solve(cold["xs"], cold["us"], iterations=20, stop_gradient=1e-2)
    assert far["iterations"] > 2 and np.all(far["log"][1:-1, 5] >= 1e-2)  # the first one had gaps


def test_three_steps(problem):
    feet, goals, first = steps.draw_walk(5, 0)
    found = solve(problem, feet, goals, first)
    begins = problem.begins()
    assert found["converged"] and len(found["us"]) == begins[-1] == problem.knots + 2 * (problem.swing + problem.between)
    seen, _ = problem.feet(found["xs"][:, :NQ])
    for i, goal in enumerate(goals):
        np.testing.assert_allclose(seen[begins[i + 1], (first + i) % 2, [0, 1, 3]], goal, atol=5e-3)
    assert len(problem.stances()) == 4


def test_tasks_stay_within_their_ranges_and_depend_on_seed_foot_and_number_alone():
    for foot in (0, 1):
        x = np.array([steps.draw(1, foot, i) for i in range(200)]).reshape(-1, 3, 3)
        standing = x[:, 1 - foot]
        seen = np.array([steps.seen_from(frame, poses[[foot, 2]]) for frame, poses in zip(standing, x, strict=True)])
        mirror = np.array([1, 1, 1]) if foot == 0 else np.array([1, -1, -1])
        seen = seen * mirror
        assert np.all(seen[:, 0] >= steps.START_LO - 1e-12) and np.all(seen[:, 0] <= steps.START_HI + 1e-12)
        assert np.all(seen[:, 1] >= steps.GOAL_LO - 1e-12) and np.all(seen[:, 1] <= steps.GOAL_HI + 1e-12)
    np.testing.assert_array_equal(steps.draw(1, 0, 7), steps.draw(1, 0, 7))
    assert np.abs(steps.draw(1, 0, 7) - steps.draw(2, 0, 7)).max() > 1e-3


@pytest.mark.parametrize(
    ("feet", "goals", "first", "what"),
    [
        ([[0, 3.0, 0], [0, -3.0, 0]], [[0, 0, 0]], 0, "too far apart"),
        ([[0, np.nan, 0], [0, -0.1, 0]], [[0, 0.1, 0]], 0, "not finite"),
        ([[0, 0.1, 0], [0, -0.1, 0]], [[0, 0.1, 0]] * 4, 0, "expected 1 .. 3 steps"),
        ([[0, 0.1, 0], [0, -0.1, 0]], [[0, 0.1, 0]], 2, "first"),
        ([[0, 0.1, 0], [0, -0.1, 0]], [[1.5, 0.1, 0]], 0, "too far apart"),
        ([[0, 0.1, 0], [0, -0.1, 0]], [[0.05, -0.1, 0.2]], 0, "on the other one"),
        ([[0, 0.1, 0], [0, -0.1, 0]], [[0.2, 0.1, 0], [0.2, 0.1, 0]], 0, "on the other one"),
    ],
)
def test_bad_feet_are_refused(problem, feet, goals, first, what):
    with pytest.raises(ValueError, match=what):
        problem.set(np.array(feet, float), np.array(goals, float), first)


def test_a_damaged_or_foreign_data_set_is_one_message(tmp_path):
    path = tmp_path / "talos_step.npz"
    with pytest.raises(InputError, match="engram data talos step"):
        step_set.load(path)
    step_set.make(2, 9, 1, tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="cannot be read"):
        step_set.load(path)
    middle = len(whole) // 2
    path.write_bytes(whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :])
    with pytest.raises(InputError, match="cannot be read"):
        step_set.load(path)
    path.write_bytes(whole)
    sets, _, _ = step_set.load(path)
    assert [len(part) for part in sets] == [2, 2, 1]
    with np.load(path) as file:
        np.savez(path, **(dict(file) | {"task_digest": np.uint64(1)}))
    with pytest.raises(InputError, match="made for another task"):
        step_set.load(path)


def test_the_short_study_starts_warmer_than_cold():
    """Row 3.3 on a tenth of the data: states and controls together need least iterations, and never fail."""
    assert main(["study", "3.3", "--quick"]) == 0
    found = {f["id"]: f["value"] for f in json.loads((BUILD / "figures" / "study.3.3.json").read_text(encoding="utf-8"))}
    iterations = {part: found[f"study.3.3.iterations.{part}"] for part in ("q", "qu0", "qu", "u", "cold")}
    assert min(iterations, key=iterations.get) == "qu" and iterations["qu"] < 3 < iterations["cold"]
    assert found["study.3.3.success.qu"] == 1.0 and found["study.3.3.subopt1.qu"] < 1e-2


def test_the_short_curves_fall():
    """Row 9.1: after one iteration the memory is nearer to the optimum than its neighbour, its planner and a cold start."""
    assert main(["study", "9.1", "--quick"]) == 0
    found = {f["id"]: f["value"] for f in json.loads((BUILD / "figures" / "study.9.1.json").read_text(encoding="utf-8"))}
    after = {name: found.get(f"study.9.1.excess.{name}.iteration1", np.inf) for name in ("cold", "planner", "knn", "gmr", "gpr")}
    assert after["gpr"] < after["gmr"] < after["knn"] < after["cold"] and after["gpr"] < after["planner"]


def test_no_accepted_seed_is_worse_than_the_shifted_plan_and_random_tables_do_no_harm():
    """Row 9.2: inside the domain, at its edge and outside; tables of random numbers have a valid digest."""
    assert main(["study", "9.2", "--quick"]) == 0
    found = {f["id"]: f["value"] for f in json.loads((BUILD / "figures" / "study.9.2.json").read_text(encoding="utf-8"))}
    assert all(found[f"study.9.2.worse.{where}"] == 0 for where in ("inside", "edge", "outside"))
    assert found["study.9.2.taken.inside"] > 0.9  # or nothing was at stake
    random = [key for key in found if key.startswith("study.9.2.success.random")]
    assert len(random) == 4 and all(found[key] == found["study.9.2.success.shift"] for key in random)


def test_a_memory_grows_by_what_it_knows_least():
    """Row 9.3: after two rounds both memories are better than before."""
    assert main(["study", "9.3", "--quick"]) == 0
    found = {f["id"]: f["value"] for f in json.loads((BUILD / "figures" / "study.9.3.json").read_text(encoding="utf-8"))}
    for name in ("random", "active"):
        assert found[f"study.9.3.subopt1.{name}120"] < 0.7 * found[f"study.9.3.subopt1.{name}40"]
