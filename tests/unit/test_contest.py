"""The contest's bookkeeping: who wins by merit, which ensemble is chosen, and what it is judged on."""

from __future__ import annotations

import numpy as np
import pytest

from engram.emit import Knn
from engram.learn.contenders import Contender, from_table, smaller, table_bytes
from engram.learn.contest import Outcomes, asked, choose, judge, modes_of, suboptimality, together
from engram.learn.memory import Ensemble


def outcomes(merit: list[float], good: list[bool], after: list[float]) -> Outcomes:
    n = len(merit)
    return Outcomes(np.array(merit), np.array(good), np.ones(n), np.tile(np.array(after)[:, None], 2), np.ones(n))


def contender(name: str, control: bool = False) -> Contender:
    return Contender(name, lambda x, start: (np.zeros((0, 2)), None), False, control=control)


A = outcomes([1, 9, 1, 9], [True, False, True, True], [1.0, 5.0, 1.0, 5.0])
B = outcomes([5, 5, 5, 5], [False, True, True, True], [3.0, 2.0, 3.0, 2.0])
C = outcomes([0, 0, 0, 0], [True] * 4, [1.0] * 4)
LOWEST = np.ones(4)


def test_an_ensemble_takes_the_guess_of_lowest_merit() -> None:
    both = together([A, B])
    assert both.merit.tolist() == [1, 5, 1, 5] and both.good.all() and both.after[:, 0].tolist() == [1, 2, 1, 2]
    assert suboptimality(A, LOWEST).tolist() == [2.0, 2.0]


def test_the_ensemble_of_highest_success_is_chosen_and_controls_are_not() -> None:
    team = [contender("a"), contender("b"), contender("c", control=True)]
    found = {"a": A, "b": B, "c": C}
    names, chosen = choose(team, found, LOWEST, 1000)
    assert names == ("a", "b") and chosen.good.all()
    assert choose(team, found, LOWEST, 1000, members=1)[0] == ("b",)  # as many successes as a, but closer to the optimum


def knn(n: int) -> Knn:
    rng = np.random.default_rng(0)
    return Knn(x=rng.uniform(size=(n, 3)), scale=np.ones(3), value=rng.normal(size=(n, 5)), inputs=[(c, "m") for c in "xyz"],
               lo=np.zeros(3), hi=np.ones(3), held_out_error=0.0, held_out_text="")  # fmt: skip


def test_bytes_limit_the_choice_and_a_shared_table_counts_once() -> None:
    table = knn(50)
    team = [from_table("one", table, 2, 3, 1), from_table("many", table, 2, 3, 8)]
    found = {"one": A, "many": B}
    assert choose(team, found, LOWEST, table_bytes(table))[0] == ("many", "one")
    with pytest.raises(ValueError, match="no contender fits"):
        choose(team, found, LOWEST, table_bytes(table) - 1)


def test_the_base_is_always_in_and_the_controller_has_room_for_two_learners() -> None:
    team = [contender("line"), *(from_table(name, knn(50), 2, 3) for name in ("x", "y", "z"))]
    found = {
        "line": outcomes([5] * 4, [False, True, True, True], [1.0] * 4),
        "x": outcomes([1, 9, 9, 9], [True, False, False, False], [1.0] * 4),
        "y": outcomes([9, 1, 9, 9], [False, True, False, False], [1.0] * 4),
        "z": outcomes([9, 9, 1, 9], [False, False, True, False], [1.0] * 4),
    }
    names, chosen = choose(team, found, LOWEST, 10**6)
    assert names == ("line", "x") and chosen.good.all()
    ensemble = asked([*team[:3], from_table("many", knn(50), 2, 3, 8, ensemble=Ensemble(neighbours=8))])
    assert [table.role for table in ensemble.learners] == ["x", "y"] and ensemble.neighbours == 8 and not ensemble.regression
    with pytest.raises(ValueError, match="no contender fits"):
        choose([contender("c", control=True)], {"c": C}, LOWEST, 10**6)


def test_the_control_at_the_same_bytes_is_no_larger() -> None:
    table = knn(400)
    for size in (2000, 6000, table_bytes(table)):
        assert 0.8 * size < table_bytes(smaller(table, size)) <= size + 64  # whole blocks of eight samples, domain and scale


def test_answers_of_a_table_become_ends_and_bows() -> None:
    table = knn(50)
    postures, bows = from_table("one", table, 2, 4, 3).propose(table.x[7], np.zeros(2))
    np.testing.assert_allclose(postures[0], table.value[7, :2], rtol=1e-6)  # float
    z = bows(postures[[0]], np.array([0]))
    np.testing.assert_allclose(z[0, :3], table.value[7, 2:], rtol=1e-6)
    assert z.shape == (1, 4) and z[0, 3] == 0


def test_postures_that_differ_in_a_joint_are_modes() -> None:
    assert modes_of(np.array([[0, 0], [0.1, 0.2], [0, 0.5], [0.05, 0.45]])) == 2 and modes_of(np.zeros((0, 2))) == 0


def test_the_verdict_judges_on_tasks_it_has_not_chosen_by() -> None:
    found = {
        "a": outcomes([1] * 4, [True, False, True, False], [1.0] * 4),
        "b": outcomes([2] * 4, [False, True, False, True], [1.0] * 4),
    }
    verdict = judge([contender("a"), contender("b")], found, LOWEST, 0)
    figures = {name: value for name, value, *_ in verdict.figures}
    assert verdict.names == ("a",) and verdict.ensemble == Ensemble() and figures["success.a"] == 0.5
    assert figures["success.ensemble"] == 0.0 and figures["success_any.ensemble"] == 0.0
    assert any(line.startswith("ensemble: a; chosen on 2 tasks, judged on 2 others") for line in verdict.lines)
