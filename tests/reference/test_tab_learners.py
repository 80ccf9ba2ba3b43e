"""Mixtures, networks and distances as the controller evaluates them, against scikit-learn, scipy and numpy in double."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal, multivariate_t

from engram import pytorch
from engram.emit import Gmr, Gpr, Knn, Logit, Mlp, Sdf, Table
from engram.emit.arrays import Array
from engram.engine import engine
from engram.inputs import InputError
from engram.learn.mixture import Conditional, Mixture, condition, fit_bayesian, fit_gaussian, mixture_table
from engram.learn.network import Network, density_gradient, fit_by_pytorch, fit_density, fit_ensemble, split_head
from engram.pytorch import PyTorch

QUERIES = 10_000
OK, OUTSIDE, NOT_FINITE = range(3)
ULP = 2.0**-24  # half a unit in the last place of a float, relative
D, M = 3, 5


def inputs(n: int) -> list[tuple[str, str]]:
    return [(f"x{i}", "m") for i in range(n)]


def domain(x: np.ndarray) -> dict:
    return dict(inputs=inputs(x.shape[1]), lo=x.min(0), hi=x.max(0), held_out_error=0.0, held_out_text="")


@pytest.fixture(scope="module")
def data() -> tuple[np.ndarray, np.ndarray]:
    """Two branches: one input, two answers."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (600, D))
    branch = rng.integers(2, size=(600, 1))
    y = np.sin(2 * x @ rng.normal(size=(D, M))) + 4 * (2 * branch - 1) + 0.05 * rng.normal(size=(600, M))
    return x, y


def gmr(fitted: Conditional, x: np.ndarray, type: str = "float32") -> Gmr:
    return mixture_table(fitted, type=type, **domain(x))


def mlp(net: Network, x: np.ndarray, type: str = "float32") -> Mlp:
    parts = dict(center=net.center, width=net.width, weights=net.weights, biases=net.biases, modes=net.modes)
    return Mlp(type=type, **parts, **domain(x))


def by_index(answer: dict, h: np.ndarray) -> tuple[np.ndarray, ...]:
    """Answers in the order of the components instead of their probability."""
    back = np.argsort(answer["index"], axis=1)
    return (
        np.take_along_axis(answer["weight"], back, 1),
        np.take_along_axis(answer["y"], back[:, :, None], 1),
        np.take_along_axis(answer["var"], back[:, :, None], 1),
    )


def queries(seed: int, n: int = QUERIES) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.2, 1.2, (n, D))


# ---- mixtures --------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=["gaussian", "bayesian"])
def mixture(request: pytest.FixtureRequest, data) -> Mixture:
    return {"gaussian": fit_gaussian, "bayesian": fit_bayesian}[request.param](*data, 6)


def test_a_conditioned_mixture_is_the_joint_over_the_marginal(mixture: Mixture) -> None:
    """p(y | x) p(x) = p(x, y), densities by scipy, where the conditional is what eq 2.15 to 2.18 say."""
    fitted, rng = condition(mixture), np.random.default_rng(1)
    x, y = rng.uniform(-1, 1, (20, D)), rng.normal(size=(20, M))
    h, mean, _ = fitted.predict(x)
    for k, (weight, mu, scale, nu) in enumerate(zip(mixture.weight, mixture.mean, mixture.scale, mixture.freedom, strict=True)):

        def density(values: np.ndarray, mu: np.ndarray, scale: np.ndarray, nu: float = nu) -> np.ndarray:
            return multivariate_t.pdf(values, mu, scale, nu) if nu > 0 else multivariate_normal.pdf(values, mu, scale)

        q = np.sum(((x - fitted.mean_x[k]) @ fitted.linv[k].T) ** 2, axis=1)
        S = scale[D:, D:] - fitted.slope[k] @ scale[:D, D:]
        for i in range(len(x)):
            grown = S * ((nu + q[i]) / (nu + D) if nu > 0 else 1.0)
            joint = density(np.r_[x[i], y[i]], mu, scale)
            conditional = density(y[i], mean[i, k], grown, nu + D if nu > 0 else 0.0)
            assert conditional * density(x[i], mu[:D], scale[:D, :D]) == pytest.approx(joint, rel=1e-8)  # conditioning of S
        log_marginal = np.log(weight * density(x, mu[:D], scale[:D, :D]))
        assert np.ptp(log_marginal - np.log(np.maximum(h[:, k], 1e-300)) - total(mixture, x)) < 1e-8


def total(mixture: Mixture, x: np.ndarray) -> np.ndarray:
    """log p(x)"""
    parts = [
        w * (multivariate_t.pdf(x, mu[:D], S[:D, :D], nu) if nu > 0 else multivariate_normal.pdf(x, mu[:D], S[:D, :D]))
        for w, mu, S, nu in zip(mixture.weight, mixture.mean, mixture.scale, mixture.freedom, strict=True)
    ]
    return np.log(np.sum(parts, axis=0))


def gmr_bounds(fitted: Conditional, x: np.ndarray) -> tuple[float, float]:
    """What rounding may do to a log probability and to an answer: 2 (d + 2) roundings of terms as large as the largest."""
    dx = np.abs(x[:, None, :] - fitted.mean_x)
    z = np.einsum("kij,nkj->nki", np.abs(fitted.linv), dx)
    y = np.abs(fitted.mean_y) + np.einsum("kmd,nkd->nkm", np.abs(fitted.slope), dx)
    return 2 * (D + 2) * ULP * np.max(np.sum(z**2, axis=2)), 2 * (D + 2) * ULP * np.max(y)


def test_mixture_equals_double(mixture: Mixture, data) -> None:
    fitted, x = condition(mixture), queries(2)
    count = len(fitted.log_norm)
    answer = engine.Table(gmr(fitted, data[0])).answers(x, count)
    h, y, var = fitted.predict(x.astype(float))
    weight, mean, variance = by_index(answer, h)
    log_error, y_error = gmr_bounds(fitted, x)
    np.testing.assert_allclose(weight, h, atol=log_error)
    np.testing.assert_allclose(mean, y, atol=y_error)
    np.testing.assert_allclose(variance, var, rtol=log_error)
    assert np.all(np.diff(answer["weight"], axis=1) <= 0) and np.allclose(answer["weight"].sum(1), 1, atol=count * ULP)
    inside = np.all((x >= np.float32(data[0].min(0))) & (x <= np.float32(data[0].max(0))), axis=1)
    assert np.array_equal(answer["status"], np.where(inside, OK, OUTSIDE))


def test_moment_matching_equals_double(mixture: Mixture, data) -> None:
    fitted, x = condition(mixture), queries(3, 2000)
    mean, var = engine.Table(gmr(fitted, data[0])).moments(x)
    h, y, v = fitted.predict(x)
    exact = np.einsum("nk,nkm->nm", h, y)
    exact_var = np.einsum("nk,nkm->nm", h, v + y**2) - exact**2
    log_error, y_error = gmr_bounds(fitted, x)
    size = np.abs(y).max()
    np.testing.assert_allclose(mean, exact, atol=y_error + 2 * len(h[0]) * log_error * size)
    np.testing.assert_allclose(var, exact_var, atol=2 * size * (y_error + 2 * len(h[0]) * log_error * size))


def test_a_bayesian_mixture_drops_idle_components() -> None:
    rng = np.random.default_rng(13)
    x, y = rng.normal(size=(400, 1)), np.sign(rng.normal(size=(400, 1)))
    found = fit_bayesian(x, y + 0.01 * rng.normal(size=(400, 1)), 20, ridge=1e-6)
    assert len(found.weight) < 20 and found.weight.sum() == pytest.approx(1) and np.all(found.freedom > 0)


def test_a_bayesian_mixture_finds_both_branches(data) -> None:
    x, y = data
    fitted = condition(fit_bayesian(x, y, 12))
    answer = engine.Table(gmr(fitted, x)).answers(x, len(fitted.log_norm))
    likely = answer["weight"] > 0.1
    upper, lower = (likely & (answer["y"][:, :, 0] > 2)).any(1), (likely & (answer["y"][:, :, 0] < -2)).any(1)
    assert np.mean(upper & lower) > 0.9  # both answers are offered; their mean, near 0, is none
    assert np.abs(engine.Table(gmr(fitted, x)).moments(x)[0][:, 0]).mean() < 2


@pytest.mark.parametrize(("type", "loss"), [("float16", 2.0**-11), ("int8", 0.5 / 127)])
def test_slopes_stored_small_lose_what_their_type_must(data, type: str, loss: float) -> None:
    fitted, x = condition(fit_gaussian(*data, 4)), queries(4, 1000)
    whole, small = (by_index(engine.Table(gmr(fitted, data[0], t)).answers(x, 4), None)[1] for t in ("float32", type))
    dx = np.abs(x[:, None, :] - fitted.mean_x).sum(axis=2).max()
    assert np.abs(small - whole).max() <= 1.01 * loss * np.abs(fitted.slope).max() * dx
    assert np.abs(small - whole).max() > 0


# ---- networks --------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ensemble(data) -> Network:
    return fit_ensemble(*data, hidden=21, depth=3, members=3, epochs=20)


@pytest.fixture(scope="module")
def density(data) -> Network:
    return fit_density(*data, modes=3, hidden=24, depth=2, epochs=40)


def network_bound(net: Network, x: np.ndarray) -> float:
    """What rounding may do to an output: every layer adds (inputs + 3) roundings of terms as large as those it sums."""
    worst = 0.0
    for weights, biases in zip(net.weights, net.biases, strict=True):
        z = np.abs((x - net.center) / net.width)
        error = 3 * ULP * z
        for i, (w, b) in enumerate(zip(weights, biases, strict=True)):
            error = error @ np.abs(w) + (len(w) + 3) * ULP * (z @ np.abs(w) + np.abs(b))
            y = z @ w + b if i else ((x - net.center) / net.width) @ w + b
            z = np.maximum(y, 0) if i + 1 < len(weights) else y
        worst = max(worst, float(error.max()))
    return worst


def test_ensemble_equals_double(ensemble: Network, data) -> None:
    x = queries(5)
    table = engine.Table(mlp(ensemble, data[0]))
    answer = table.answers(x, 3)
    weight, y, var = by_index(answer, None)
    bound = network_bound(ensemble, x)
    assert bound < 1e-3
    np.testing.assert_allclose(y, ensemble.predict(x)[1], atol=bound)
    assert np.all(weight == np.float32(1 / 3)) and np.all(np.isinf(var)) and np.array_equal(answer["index"][0], [0, 1, 2])
    mean, spread = table.moments(x)
    np.testing.assert_allclose(mean, y.mean(axis=1), atol=4 * ULP * np.abs(y).max())
    np.testing.assert_allclose(spread, y.var(axis=1), atol=1e-6 * np.abs(y).max() ** 2)  # float, of squares


def test_density_network_equals_double(density: Network, data) -> None:
    x = queries(6)
    answer = engine.Table(mlp(density, data[0])).answers(x, 3)
    weight, y, var = by_index(answer, None)
    h, exact, exact_var = density.predict(x)
    bound = network_bound(density, x)
    assert bound < 1e-3
    np.testing.assert_allclose(weight, h, atol=2 * bound)
    np.testing.assert_allclose(y, exact, atol=bound)
    np.testing.assert_allclose(var, exact_var, rtol=4 * bound)
    assert np.all(np.diff(answer["weight"], axis=1) <= 0)


def test_networks_by_pytorch_or_the_mend_that_is_missing(data) -> None:
    """An ensemble and a density of the same data, where the optional extra is installed; where it is not, what installs it."""
    x, y = data
    if not pytorch.available():
        with pytest.raises(InputError, match="scripts/setup.sh torch"):
            fit_by_pytorch(x, y)
        return
    net = fit_by_pytorch(x, y, modes=3, hidden=24, epochs=60)
    h, means, _ = net.predict(x)
    likely = h > 0.1
    assert np.mean((likely & (means[:, :, 0] > 2)).any(1) & (likely & (means[:, :, 0] < -2)).any(1)) > 0.9  # both branches
    smooth = np.sin(2 * x @ np.ones((D, 2)))
    pair = fit_by_pytorch(x, smooth, hidden=21, depth=3, members=2, epochs=60)
    found = engine.Table(mlp(pair, x)).answers(x, 2)
    assert np.abs(np.sort(found["y"], 1) - np.sort(pair.predict(x)[1], 1)).max() < 2 * network_bound(pair, x)
    assert np.mean((found["y"].mean(axis=1) - smooth) ** 2) < 0.1 * smooth.var()  # nine tenths are learnt
    with PyTorch() as worker:
        for each in (net, pair):
            worker.load_networks(each)
            answer = worker.ask("predict", x=x)
            for mine, theirs in zip(each.predict(x), (answer["p"], answer["mean"], answer["variance"]), strict=True):
                np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-12)


def test_the_gradient_of_the_likelihood() -> None:
    rng = np.random.default_rng(7)
    out, y, step = rng.normal(size=(4, 3 * 5)), rng.normal(size=(4, 2)), 1e-6
    _, gradient = density_gradient(out, y, 3)
    for i in range(out.size):
        moved = [out.copy(), out.copy()]
        moved[0].flat[i] += step
        moved[1].flat[i] -= step
        difference = (density_gradient(moved[0], y, 3)[0] - density_gradient(moved[1], y, 3)[0]) / (2 * step)
        assert gradient.flat[i] == pytest.approx(difference, abs=1e-8)  # step^2, rounding / step


def test_a_density_network_finds_both_branches(density: Network, data) -> None:
    h, y, _ = density.predict(data[0])
    likely = h > 0.1
    assert np.mean((likely & (y[:, :, 0] > 2)).any(1) & (likely & (y[:, :, 0] < -2)).any(1)) > 0.9
    assert split_head(density.raw(data[0])[0], 3)[0].sum(axis=1) == pytest.approx(1)


@pytest.mark.parametrize(("type", "loss"), [("float16", 2.0**-11), ("int8", 0.5 / 127)])
def test_weights_stored_small_answer_nearly_the_same(ensemble: Network, data, type: str, loss: float) -> None:
    x = queries(8, 1000)
    whole, small = (engine.Table(mlp(ensemble, data[0], t)).answers(x, 1)["y"] for t in ("float32", type))
    worst = np.abs(small - whole).max() / np.abs(whole).max()
    assert 0 < worst < 40 * loss  # four layers, each of tens of weights with errors of both signs


# ---- signed distance -------------------------------------------------------------------------------------------------------


def turned(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diagonal(r))
    return q * np.sign(np.linalg.det(q))


def box_distance(p: np.ndarray, center: np.ndarray, R: np.ndarray, half: np.ndarray) -> np.ndarray:
    q = np.abs((p - center) @ R) - half
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def sdf(**parts) -> Sdf:
    names = [("x", "m"), ("y", "m"), ("z", "m")]
    return Sdf(inputs=names, lo=-np.ones(3), hi=np.ones(3), held_out_error=0.0, held_out_text="", **parts)


@pytest.fixture(scope="module")
def world() -> tuple[list, np.ndarray]:
    rng = np.random.default_rng(9)
    boxes = [(rng.uniform(-1, 1, 3), turned(rng), rng.uniform(0.05, 0.4, 3)) for _ in range(11)]
    return boxes, np.hstack([rng.uniform(-1, 1, (5, 3)), rng.uniform(0.05, 0.3, (5, 1))])


def test_distances_to_boxes_and_spheres(world) -> None:
    boxes, spheres = world
    p = np.random.default_rng(10).uniform(-1.3, 1.3, (QUERIES, 3))
    table = engine.Table(sdf(boxes=boxes, spheres=spheres))
    d, gradient = table.distance(p)
    to_spheres = [np.linalg.norm(p - s[:3], axis=1) - s[3] for s in spheres]
    exact = np.min([*(box_distance(p, *box) for box in boxes), *to_spheres], axis=0)
    np.testing.assert_allclose(d[:, 0], exact, atol=40 * ULP)  # sums of terms up to 3 m
    np.testing.assert_array_equal(table.answers(p[:100])["y"][:, 0, 0], d[:100, 0])
    np.testing.assert_allclose(np.linalg.norm(gradient, axis=1), 1, atol=1e-4)  # near a surface its rounding shows
    step = 1e-3
    ahead, behind = table.distance(p + step * gradient)[0][:, 0], table.distance(p - step * gradient)[0][:, 0]
    slope = (ahead - behind) / (2 * step)
    assert np.quantile(np.abs(slope - 1), 0.98) < 2e-3  # but for the few points whose nearest object changes within a step


def test_a_grid_is_trilinear_and_exact_at_its_nodes(world) -> None:
    boxes, _ = world
    axis, spacing = np.linspace(-1, 1, 21), 0.1
    nodes = np.stack(np.meshgrid(axis, axis[:17], axis[:9], indexing="ij"), axis=-1)
    values = np.min([box_distance(nodes.reshape(-1, 3), *box) for box in boxes], axis=0).reshape(21, 17, 9)
    table = engine.Table(sdf(grid=values, origin=-np.ones(3), spacing=spacing))
    d, gradient = table.distance(nodes.reshape(-1, 3))
    np.testing.assert_allclose(d[:, 0], values.ravel(), atol=32 * ULP * 10)  # a cell is found to 1e-6 of its size
    from scipy.interpolate import RegularGridInterpolator

    p = np.random.default_rng(11).uniform([-1, -1, -1], [1, 0.6, -0.2], (QUERIES, 3))
    exact = RegularGridInterpolator((axis, axis[:17], axis[:9]), values)(p)
    d, gradient = table.distance(p)
    np.testing.assert_allclose(d[:, 0], exact, atol=1e-5)
    step = 1e-4
    for i in range(3):
        e = step * np.eye(3)[i]
        numeric = (table.distance(p + e)[0][:, 0] - table.distance(p - e)[0][:, 0]) / (2 * step)
        assert np.quantile(np.abs(numeric - gradient[:, i]), 0.99) < 5e-3  # float differences; a cell's border may lie between
    outside = np.array([[0.0, 0.0, 0.5]])
    inner = table.distance(np.array([[0.0, 0.0, -0.2]]))[0][0, 0]
    d, gradient = table.distance(outside)
    assert d[0, 0] == pytest.approx(inner + 0.7, abs=1e-5) and gradient[0, 2] == pytest.approx(1)
    for type, loss in (("float16", 2.0**-11), ("int8", 0.5 / 127)):
        small = engine.Table(sdf(grid=values, origin=-np.ones(3), spacing=spacing, type=type)).distance(p)[0]
        assert 0 < np.abs(small[:, 0] - exact).max() < 1.01 * loss * np.abs(values).max() + 1e-5


# ---- bad inputs ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def all_tables(data, ensemble: Network, density: Network, world) -> list[tuple[object, int]]:
    """One of each kind, and its number of inputs."""
    x = data[0]
    return [
        (engine.Table(gmr(condition(fit_gaussian(*data, 4)), x)), D),
        (engine.Table(gmr(condition(fit_bayesian(*data, 4)), x)), D),
        (engine.Table(mlp(ensemble, x)), D),
        (engine.Table(mlp(density, x)), D),
        (engine.Table(sdf(boxes=world[0], spheres=world[1])), 3),
        (engine.Table(sdf(grid=np.ones((3, 3, 3)), spacing=0.5)), 3),
    ]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_not_finite_queries_are_answered_neutrally(all_tables, bad: float) -> None:
    for table, d in all_tables:
        x = np.zeros((1, d))
        x[0, 1] = bad
        answer = table.answers(x, 4)
        assert answer["status"][0] == NOT_FINITE and np.all(answer["index"] == -1)
        assert not answer["weight"].any() and not answer["y"].any()


def test_odd_but_finite_queries_are_answered(all_tables) -> None:
    """Denormals, zeros of both signs, huge numbers, random bits: finite answers, and a word about the domain."""
    rng = np.random.default_rng(12)
    bits = rng.integers(0, 2**32, 4000, dtype=np.uint32).view(np.float32)
    odd = np.r_[1e-320, -1e-320, 1e-40, -0.0, 1e30, -3e38, bits[np.isfinite(bits)].astype(float)]
    for table, d in all_tables:
        x = rng.choice(odd, (len(odd), d))
        answer = table.answers(x, 3)
        assert np.all(answer["status"] < NOT_FINITE) and np.all(answer["index"][:, 0] >= 0)
        assert np.all(np.isfinite(answer["weight"])) and np.all(np.isfinite(answer["y"]))
        assert np.all(answer["status"][np.any(np.abs(x) > 2, axis=1)] == OUTSIDE)


class Cut:
    """A table one of whose arrays is short."""

    def __init__(self, table: Table, array: int):
        self.table, self.array = table, array
        self.role, self.number, self.schema = table.role, table.number, table.schema
        self.inputs, self.outputs = table.inputs, table.outputs

    def fields(self) -> dict:
        return self.table.fields()

    def arrays(self) -> list[Array]:
        arrays = self.table.arrays()
        whole = arrays[self.array]
        arrays[self.array] = Array(whole.name, "", whole.flat[: -4 // whole.flat.itemsize].copy())
        return arrays


def test_a_table_of_another_schema_is_refused(data, ensemble: Network) -> None:
    table = Cut(mlp(ensemble, data[0]), -1)
    table.schema += 1
    with pytest.raises(ValueError, match="has schema 0x0*2, this controller reads 0x0*1; run 'make tables' and build again"):
        engine.Table(table)


def test_a_table_whose_sizes_contradict_is_refused(data, ensemble: Network, world) -> None:
    x, y = data
    tables = [
        gmr(condition(fit_gaussian(x, y, 4)), x, "int8"), mlp(ensemble, x, "float16"),
        sdf(boxes=world[0], grid=np.ones((3, 3, 3))),
        Knn(x=x, scale=np.ones(D), value=y, **domain(x)),
        Gpr(x=x, length=np.ones(D), variance=1, noise=1, alpha=y, mean=np.zeros(M), linv=np.eye(len(x)), **domain(x)),
        Logit(weight=np.ones(D), bias=0, **domain(x)),
    ]  # fmt: skip
    for table in tables:
        engine.Table(table)
        for i in range(len(table.arrays())):
            with pytest.raises(ValueError, match="table '' has array sizes that contradict each other; run 'make tables'"):
                engine.Table(Cut(table, i))
