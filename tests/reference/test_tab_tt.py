"""Tensor trains: controller/tab's evaluator, conditioning and sampling against numpy in double."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from engram.emit import Tt
from engram.engine import engine
from engram.learn.distance import distance_train
from engram.paths import MODELS
from engram.tasks.world import Boxes, read_boxes

OK, OUTSIDE, NOT_FINITE = 0, 1, 2
ULP = 2.0**-24  # half a unit in the last place of a float, relative


def random_train(points: list[int], ranks: list[int], seed: int, signed: bool = True) -> Tt:
    """A train of float32 numbers over [-1, 2] x [-1, 3] x ..."""
    rng = np.random.default_rng(seed)
    shapes = zip([1, *ranks], points, [*ranks, 1], strict=True)
    cores = [rng.uniform(-1.0 if signed else 0.0, 1.0, shape).astype(np.float32).astype(float) for shape in shapes]
    d = len(points)
    return Tt(inputs=[(f"x{k}", "1") for k in range(d)], lo=-np.ones(d), hi=2.0 + np.arange(d), held_out_error=0.0,
              held_out_text="", cores=cores)  # fmt: skip


class Oracle:
    """The same in double: thesis B.1 for the value, 7.11 for conditioning, algorithm 6 for the probabilities."""

    def __init__(self, table: Tt):
        self.cores, self.lo, self.hi = table.cores, np.asarray(table.lo, float), np.asarray(table.hi, float)
        if table.type == "int8":
            scales = [np.float32(max(np.abs(core).max(), 1e-30) / 127) for core in table.cores]
            self.cores = [np.rint(core / s) * float(s) for core, s in zip(table.cores, scales, strict=True)]

    def core_at(self, k: int, x: float) -> tuple[np.ndarray, np.ndarray]:
        """P^k(x) and its derivative."""
        core, n = self.cores[k], self.cores[k].shape[1]
        if n == 1:
            return core[:, 0], 0 * core[:, 0]
        step = (self.hi[k] - self.lo[k]) / (n - 1)
        at = np.clip((x - self.lo[k]) / step, 0, n - 1)
        i = min(int(at), n - 2)
        inside = self.lo[k] <= x <= self.hi[k]
        slope = (core[:, i + 1] - core[:, i]) / step
        return (1 - (at - i)) * core[:, i] + (at - i) * core[:, i + 1], slope * inside

    def value(self, x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Value, gradient, and the value with absolute cores: what errors are relative to."""
        at = [self.core_at(k, x[k]) for k in range(len(x))]
        left, gradient = [np.ones((1, 1))], np.zeros(len(x))
        for core, _ in at:
            left.append(left[-1] @ core)
        right, size = np.ones((1, 1)), np.ones((1, 1))
        for k in reversed(range(len(x))):
            gradient[k] = (left[k] @ at[k][1] @ right)[0, 0]
            right, size = at[k][0] @ right, np.abs(at[k][0]) @ size
        return left[-1][0, 0], gradient, size[0, 0]

    def log_prob(self, x: np.ndarray, fixed: np.ndarray, alpha: float) -> float:
        """Logarithm of the probability of a sample at grid points, where `fixed` variables are conditioned on."""
        d = len(x)
        pi = [np.ones(1)]
        for k in reversed(range(d)):
            pi.append((self.core_at(k, x[k])[0] if fixed[k] else self.cores[k].sum(1)) @ pi[-1])
        pi = pi[::-1]
        row, total = np.ones(1), 0.0
        for k in range(d):
            if not fixed[k]:
                p = np.abs(np.einsum("j,jiw,w->i", row, self.cores[k], pi[k + 1]))
                p = (p / p.max()) ** (1 / (1 - alpha))
                n = len(p)
                i = round((x[k] - self.lo[k]) / (self.hi[k] - self.lo[k]) * (n - 1)) if n > 1 else 0
                total += np.log(p[i] / p.sum())
            row = row @ self.core_at(k, x[k])[0]
            row /= np.abs(row).max()
        return total


SHAPES = {  # odd ranks and sizes, so that every padding and tail is at work; a rank of 1 in the middle
    "small": ([3, 5, 2], [2, 3]),
    "odd": ([7, 12, 31, 9, 17], [5, 21, 1, 13]),
    "wide": ([20, 50, 33], [37, 64]),
    "one point": ([4, 1, 6], [3, 2]),
}


@pytest.mark.parametrize("type", ["float32", "int8"])
@pytest.mark.parametrize("name", SHAPES)
def test_value_and_gradient(name: str, type: str) -> None:
    table = random_train(*SHAPES[name], seed=1)
    table.type = type
    tt, oracle, d = engine.TensorTrain(table), Oracle(table), len(table.cores)
    x = np.random.default_rng(2).uniform(oracle.lo - 0.2, oracle.hi + 0.2, (2500, d))
    value, gradient, status = tt.value(x)
    exact, slope, size = (np.array(a) for a in zip(*(oracle.value(row) for row in x), strict=True))
    # a float error of every product and sum along the train, relative to the sum of absolute products, of both signs
    tolerance = 8 * np.sqrt(sum(core.shape[0] for core in table.cores)) * ULP
    np.testing.assert_array_less(np.abs(value - exact), tolerance * size + 1e-300)
    steps = np.array([(oracle.hi[k] - oracle.lo[k]) / max(core.shape[1] - 1, 1) for k, core in enumerate(table.cores)])
    bound = 6 * tolerance * max(np.abs(core).sum(axis=(0, 2)).max() for core in table.cores) * size.max()
    np.testing.assert_array_less(np.abs((gradient - slope) * steps), bound)
    inside = np.all((x >= oracle.lo) & (x <= oracle.hi), axis=1)
    assert np.array_equal(np.array(status) == OK, inside) and inside.any() and not inside.all()


def test_whole_numbers_are_exact_bit_for_bit() -> None:
    """Where no operation rounds, the order does not matter: cores of small whole numbers, at grid points and half way between."""
    table = random_train([5, 9, 3, 17], [4, 11, 6], seed=3)
    table.cores = [np.rint(3 * core) for core in table.cores]
    tt, oracle = engine.TensorTrain(table), Oracle(table)
    rng = np.random.default_rng(4)
    twice = [rng.integers(0, 2 * (core.shape[1] - 1) + 1, 10_000) for core in table.cores]
    steps = [(oracle.hi[k] - oracle.lo[k]) / (core.shape[1] - 1) for k, core in enumerate(table.cores)]
    x = np.stack([oracle.lo[k] + t / 2 * steps[k] for k, t in enumerate(twice)], 1)
    value, _, _ = tt.value(x)
    exact = np.ones((10_000, 1, 1))
    for core, t in zip(table.cores, twice, strict=True):
        low, high = np.moveaxis(core, 1, 0)[t // 2], np.moveaxis(core, 1, 0)[-(-t // 2)]
        exact = exact @ ((low + high) / 2)
    assert np.array_equal(value, exact[:, 0, 0])


def test_long_trains_neither_overflow_nor_vanish() -> None:
    for size in (1e2, 1e-2):  # to the hundredth power, far outside the range of floats
        table = random_train([3] * 100, [10] * 99, seed=5)
        table.cores = [size * core for core in table.cores]
        value, _, _ = engine.TensorTrain(table).value(np.full((1, 100), 0.3))
        exact, _, scale = Oracle(table).value(np.full(100, 0.3))
        assert abs(value[0] - exact) < 1e-3 * abs(scale) and value[0] != 0


MASKS = {
    "nothing": [],
    "task first": [0, 1],
    "a variable in between": [2],
    "the last": [4],
    "first and last": [0, 4],
    "all but one": [0, 1, 2, 4],
}


@pytest.mark.parametrize("alpha", [0.0, 0.5, 0.6, 0.9])  # 1 / (1 - alpha): whole numbers, and 2.5
@pytest.mark.parametrize("mask", MASKS)
def test_conditional_probabilities(mask: str, alpha: float) -> None:
    table = random_train([6, 11, 9, 8, 5], [7, 20, 9, 4], seed=6, signed=False)
    tt, oracle = engine.TensorTrain(table), Oracle(table)
    fixed = np.isin(np.arange(5), MASKS[mask])
    given = oracle.lo + np.array([0.37, 0.5, 0.81, 0.2, 0.66]) * (oracle.hi - oracle.lo)
    assert tt.condition(np.where(fixed, given, np.nan), fixed) == OK
    x, log_prob = tt.sample(alpha, 500, seed=7)
    assert np.array_equal(x[:, fixed], np.tile(given[fixed], (500, 1)))
    exact = [oracle.log_prob(row, fixed, alpha) for row in x]
    # positive cores: every p has a relative error of a few float roundings, times the power, over at most five variables
    np.testing.assert_allclose(log_prob, exact, atol=5 * (64 * ULP + 4e-6) / (1 - alpha))


def test_samples_follow_the_distribution() -> None:
    """Frequencies of all 60 outcomes against their exact probabilities (chi-square), with a middle variable fixed."""
    table = random_train([4, 3, 5, 3], [3, 4, 2], seed=8, signed=False)
    tt, oracle = engine.TensorTrain(table, 4000), Oracle(table)
    fixed = np.array([False, False, True, False])
    tt.condition(np.array([0.0, 0.0, 1.3, 0.0]), fixed)
    draws = np.concatenate([tt.sample(0.0, 4000, seed=s)[0] for s in range(10)])
    outcomes, counts = np.unique(draws, axis=0, return_counts=True)
    expected = len(draws) * np.exp([oracle.log_prob(row, fixed, 0.0) for row in outcomes])
    assert len(outcomes) == 36 and abs(expected.sum() - len(draws)) < 1
    assert np.sum((counts - expected) ** 2 / expected) < 66  # 35 degrees of freedom: the 99.9 % quantile is 66.6


def test_priority_one_takes_the_largest_and_more_samples_change_nothing() -> None:
    table = random_train([30, 30, 30], [12, 12], seed=9, signed=False)
    tt = engine.TensorTrain(table, 1000)
    best, _ = tt.sample(1.0, 8, seed=1)
    assert np.ptp(best, axis=0).max() == 0
    many, _ = tt.sample(0.3, 1000, seed=5)
    few, _ = tt.sample(0.3, 3, seed=5)
    assert np.array_equal(few, many[:3])  # sample s depends on seed and s alone, however samples are grouped


def test_a_train_of_zeros_samples_uniformly() -> None:
    table = random_train([8, 8], [3], seed=1)
    table.cores = [0 * core for core in table.cores]
    x, log_prob = engine.TensorTrain(table, 640).sample(0.5, 640)
    np.testing.assert_allclose(log_prob, -2 * np.log(8), atol=1e-6)
    assert len(np.unique(x[:, 0])) == 8


@pytest.fixture(scope="module")
def world() -> Boxes:
    return read_boxes(MODELS / "panda" / "reach" / "world.xml")


def nearest(world: Boxes):
    return lambda p: world.distance(p).min(axis=1)


def test_a_train_of_distances_is_the_grid_it_was_made_of(world: Boxes) -> None:
    """Untruncated, at the nodes and between them: scipy's trilinear interpolation of the same numbers."""
    lo, hi = np.array([0.0, -0.6, 0.0]), np.array([1.0, 0.6, 0.9])
    table = distance_train(nearest(world), lo, hi, 13, rms=0.0, type="float32")
    axes = [np.linspace(a, b, 13) for a, b in zip(lo, hi, strict=True)]
    values = nearest(world)(np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)).reshape(13, 13, 13)
    p = np.random.default_rng(1).uniform(lo, hi, (10_000, 3))
    tt = engine.TensorTrain(table)
    d, gradient, status = tt.distance(p)
    np.testing.assert_allclose(d, RegularGridInterpolator(axes, values)(p), atol=200 * ULP)  # ranks 13, two sums of such
    assert set(status) == {OK}
    step = 1e-4
    for i in range(3):
        e = step * np.eye(3)[i]
        numeric = (tt.distance(p + e)[0] - tt.distance(p - e)[0]) / (2 * step)
        assert np.quantile(np.abs(numeric - gradient[:, i]), 0.98) < 5e-3  # a cell's border may lie between
    outside = np.array([[0.5, 0.1, 1.3], [1.3, 0.1, 1.3]])
    inner = tt.distance(np.minimum(outside, hi))[0]
    d, gradient, status = tt.distance(outside)
    np.testing.assert_allclose(d - inner, [0.4, 0.5], atol=1e-6)
    np.testing.assert_allclose(gradient[:, 2], [1, 0.8], atol=1e-6)
    assert status == [OUTSIDE, OUTSIDE]
    assert tt.distance(np.full((1, 3), np.nan))[0][0] == 0


def test_a_truncated_train_of_distances_is_small_and_says_its_error(world: Boxes) -> None:
    lo, hi = np.array([0.0, -0.6, 0.0]), np.array([1.0, 0.6, 0.9])
    table = distance_train(nearest(world), lo, hi, 48, rms=2e-3)
    assert engine.TensorTrain(table).bytes < 48**3 / 2  # of the grid in as many bits
    p = np.random.default_rng(2).uniform(lo, hi, (10_000, 3))
    worst = np.abs(engine.TensorTrain(table).distance(p)[0] - nearest(world)(p)).max()
    assert 0.5 * worst < table.held_out_error < 2 * worst and worst < 0.03
    with pytest.raises(ValueError, match="x, y, z"):
        engine.TensorTrain(random_train([3, 3], [2], seed=1)).distance(p)


def test_what_is_not_finite_says_so() -> None:
    table = random_train([5, 6, 7], [3, 3], seed=2)
    tt = engine.TensorTrain(table)
    rng = np.random.default_rng(3)
    odd = [np.nan, np.inf, -np.inf, 1e300, -1e300, 5e-324, 0.0, 1e38]
    for _ in range(300):
        x = rng.choice(odd, 3)
        value, gradient, status = tt.value(x[None])
        assert np.all(np.isfinite(value)) and np.all(np.isfinite(gradient))
        finite = np.all(np.abs(x) < 3e38)
        assert (status[0] == NOT_FINITE) != finite
        fixed = rng.random(3) < 0.5
        code = tt.condition(x, fixed)
        assert (code == NOT_FINITE) == (not np.all(np.abs(x[fixed]) < 3e38))
        sample, log_prob = tt.sample(rng.choice([0, 0.5, 0.99, 1, 2, -3]), 5)
        assert np.all(np.isfinite(sample)) and np.all(np.isfinite(log_prob))
    with pytest.raises(ValueError, match="alpha"):
        tt.sample(np.nan, 5)
