"""What the report of a walk says about landings."""

from __future__ import annotations

import numpy as np

from engram_sim.walking import landings


def test_landings_are_where_a_foot_was_last_asked_to_land() -> None:
    swing = np.array([0, 1, 1, 0, 0, 2, 2, 2, 0, 1])  # left, right, and left again, which has not landed
    foothold = np.zeros((10, 2, 4))
    foothold[:, 0, 0], foothold[:, 1, 1] = np.arange(10), -np.arange(10)
    found = landings(swing, foothold)
    assert [(f, first) for f, first, _ in found] == [(0, 3), (1, 8)]
    assert np.array_equal(found[0][2], [2.0, 0.0]) and np.array_equal(found[1][2], [0.0, -7.0])
