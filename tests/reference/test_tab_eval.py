"""Tables emitted, compiled as C and evaluated by the deployed archive of controller/tab, against numpy and scikit-learn."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from sklearn.neighbors import NearestNeighbors

from engram.emit import Gmr, Gpr, Knn, Logit, Mlp, Pca, Rbf, Sdf, Tt, write_tables
from engram.emit.kinds import KINDS
from engram.learn.timebase import basis

ROOT = Path(__file__).resolve().parents[2]
QUERIES = 10_000
OK, OUTSIDE, NOT_FINITE, BAD = range(4)
ULP = 2.0**-24  # half a unit in the last place of a float, relative
NAME = "unit_test"
D, M, N = 5, 11, 203  # odd sizes, so that every padding is at work


def inputs(n: int) -> list[tuple[str, str]]:
    return [(f"x{i}", "m") for i in range(n)]


def small_tables(rng: np.random.Generator) -> list:
    """The kinds whose evaluators tests/reference/test_tab_learners.py and test_tab_tt.py judge: here they only have to link."""
    domain = dict(inputs=inputs(3), lo=-np.ones(3), hi=np.ones(3), held_out_error=0.0, held_out_text="")
    net = [rng.normal(size=shape) for shape in ((3, 9), (9, 9), (9, 2))]
    return [
        Gmr(log_norm=np.zeros(2), freedom=np.zeros(2), mean_x=np.zeros((2, 3)), linv=np.tile(np.eye(3), (2, 1, 1)),
            mean_y=np.ones((2, 4)), slope=rng.normal(size=(2, 4, 3)), var=np.ones((2, 4)), type="int8", **domain),
        Mlp(center=np.zeros(3), width=np.ones(3), weights=[net], biases=[[np.zeros(w.shape[1]) for w in net]], type="float16",
            **domain),
        Sdf(boxes=[(np.zeros(3), np.eye(3), np.ones(3))], grid=rng.normal(size=(3, 3, 3)), type="int8", **domain),
        Tt(cores=[rng.normal(size=shape) for shape in ((1, 4, 2), (2, 4, 2), (2, 4, 1))], type="int8", **domain),
    ]  # fmt: skip


class Tables:
    """The compiled tables and evaluators, called through ctypes."""

    def __init__(self, folder: Path):
        rng = np.random.default_rng(1)
        self.x = rng.uniform(-1, 1, (N, D)).astype(np.float32)
        self.scale = rng.uniform(0.5, 3, D).astype(np.float32)
        self.value = rng.normal(size=(N, M)).astype(np.float32)
        domain = dict(inputs=inputs(D), lo=self.x.min(0), hi=self.x.max(0), held_out_error=0.25, held_out_text="[m] on 10")

        targets = np.sin(2 * self.x @ rng.normal(size=(D, M)))
        kernel = ConstantKernel(1.3, "fixed") * RBF(rng.uniform(0.7, 2, D), "fixed") + WhiteKernel(1e-3, "fixed")
        self.gpr = GaussianProcessRegressor(kernel, optimizer=None, alpha=0.0).fit(self.x, targets)
        linv = np.linalg.inv(self.gpr.L_)
        k1 = kernel.k1
        self.basis, self.mean = rng.normal(size=(7, 45)).astype(np.float32), rng.normal(size=45).astype(np.float32)
        self.center = np.linspace(0, 1.5, 13)
        self.width = 0.11
        self.weight, self.bias = rng.normal(size=3).astype(np.float32), np.float32(0.3)
        tables = [
            Knn(x=self.x, scale=self.scale, value=self.value, **domain),
            Gpr(x=self.x, length=k1.k2.length_scale, variance=k1.k1.constant_value, noise=kernel.k2.noise_level,
                alpha=self.gpr.alpha_, mean=np.zeros(M), linv=linv, **domain),
            Pca(mean=self.mean, basis=self.basis, **{**domain, "inputs": inputs(7), "lo": -9 * np.ones(7), "hi": 9 * np.ones(7)}),
            Rbf(center=self.center, width=self.width, channels=4,
                **{**domain, "inputs": [("time", "s")], "lo": np.zeros(1), "hi": np.array([1.5])}),
            Logit(weight=self.weight, bias=self.bias,
                  **{**domain, "inputs": inputs(3), "lo": -np.ones(3), "hi": np.ones(3)}),
            *small_tables(rng),
        ]  # fmt: skip
        self.folder = folder / "tables" / NAME
        self.manifest = write_tables(
            self.folder, NAME, tables, robot_digest=0xABC, task_digest=0xDEF, data_digest="none", provenance="a test"
        )
        flags = ["-fPIC", "-O3", "-march=x86-64-v3", "-Wall", "-Wextra", "-Werror", f"-I{ROOT}", f"-I{folder}"]
        sources = [*sorted(self.folder.glob("*.c")), *sorted(self.folder.glob("*.S"))]
        objects = []
        for source in sources:
            objects.append(folder / f"{source.name}.o")
            subprocess.run(
                ["cc", "-std=c11", "-pedantic", *flags, f"-I{self.folder}", "-c", source, "-o", objects[-1]], check=True
            )
        library, archive = folder / "tables.so", ROOT / "build/controller/tab/libengram_tab.a"
        whole = ["-Wl,--whole-archive", archive, "-Wl,--no-whole-archive"]
        subprocess.run(["c++", "-shared", "-o", library, *objects, *whole], check=True)
        self.lib = ctypes.CDLL(str(library))
        self.lib.tab_digest.restype = ctypes.c_uint64

    def table(self, kind: str) -> ctypes.c_char:
        return ctypes.c_char.in_dll(self.lib, f"{NAME}_{kind}_v1")

    def knn(self, x: np.ndarray, k: int) -> tuple[int, np.ndarray, np.ndarray]:
        x = np.ascontiguousarray(x, float)
        index, d2 = np.zeros(k, np.int32), np.zeros(k, np.float32)
        status = self.lib.tab_knn_query(ctypes.byref(self.table("knn")), p(x), k, p(index), p(d2))
        return status, index, d2

    def gpr_query(self, x: np.ndarray) -> tuple[int, np.ndarray, float]:
        x = np.ascontiguousarray(x, float)
        mean, var = np.zeros(16, np.float32), np.zeros(1, np.float32)
        status = self.lib.tab_gpr_query(ctypes.byref(self.table("gpr")), p(x), p(mean), p(var))
        return status, mean[:M], float(var[0])


def p(array: np.ndarray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> Tables:
    return Tables(tmp_path_factory.mktemp("tables"))


def test_knn_equals_brute_force(tables: Tables) -> None:
    rng = np.random.default_rng(2)
    queries = rng.uniform(-1.2, 1.2, (QUERIES, D))
    k = 10
    exact, _ = NearestNeighbors(n_neighbors=k, algorithm="brute").fit(tables.x * tables.scale).kneighbors(queries * tables.scale)
    tolerance = (D + 2) * ULP + 4 * ULP  # stated bound of the sum, plus rounding of query and samples relative to their size
    status, index, d2 = (np.array(found) for found in zip(*(tables.knn(query, k) for query in queries)))
    assert np.all(np.diff(np.sort(index)) > 0) and np.all(np.diff(d2) >= 0)
    # inputs are of order 3 after scaling: their rounding enters the distance absolutely
    np.testing.assert_allclose(np.sqrt(d2), exact, rtol=tolerance, atol=3 * np.sqrt(D) * 2 * ULP)
    own = np.linalg.norm((tables.x[index] - queries[:, None]) * tables.scale, axis=2)
    np.testing.assert_allclose(own, exact, rtol=tolerance, atol=3 * np.sqrt(D) * 2 * ULP)
    inside = np.all((queries >= tables.x.min(0)) & (queries <= tables.x.max(0)), axis=1)
    assert np.sum(status == OUTSIDE) == QUERIES - inside.sum()


def test_knn_finds_itself_at_distance_zero(tables: Tables) -> None:
    for i in range(N):
        status, index, d2 = tables.knn(tables.x[i], 1)
        assert (status, index[0], d2[0]) == (OK, i, 0.0)


def test_gpr_equals_scikit_learn(tables: Tables) -> None:
    queries = np.random.default_rng(3).uniform(-1.5, 1.5, (QUERIES, D)).astype(np.float32)
    mean, std = tables.gpr.predict(queries, return_std=True)
    size = np.abs(tables.gpr.alpha_).sum(0)  # a float error of every kernel value times its weight, at worst
    got = [tables.gpr_query(query) for query in queries]
    # kernel values carry about 2 D ULP (distance) + 2 ULP (exp); errors of both signs, so far below the worst case
    np.testing.assert_allclose([m for _, m, _ in got], mean, atol=np.max(size) * 2 * ULP)
    # |L^-1 k|^2 is at most 1.3; each entry of L^-1 k is a cancelling sum of terms up to |L^-1| |k|
    linv = np.abs(np.linalg.inv(tables.gpr.L_)).sum(1).max()
    np.testing.assert_allclose([v for _, _, v in got], np.broadcast_to(std.T**2, (M, QUERIES))[0], atol=2 * linv * 8 * ULP)


def test_pca_equals_numpy(tables: Tables) -> None:
    rng = np.random.default_rng(4)
    y = np.zeros(48, np.float32)
    for _ in range(1000):
        z = rng.normal(size=7).astype(np.float32)
        assert tables.lib.tab_pca_decode(ctypes.byref(tables.table("pca")), p(z), p(y)) == OK
        exact = tables.mean + z.astype(float) @ tables.basis
        bound = np.abs(tables.mean) + np.abs(z) @ np.abs(tables.basis)
        assert np.all(np.abs(y[:45] - exact) <= 8 * ULP * bound)  # a sum of 8 terms


def test_rbf_equals_numpy_and_its_derivative(tables: Tables) -> None:
    rng = np.random.default_rng(5)
    times = np.sort(rng.uniform(0, 1.5, 200))
    phi, dphi = np.zeros((200, 13)), np.zeros((200, 13))
    table = ctypes.byref(tables.table("rbf"))
    assert tables.lib.tab_rbf_basis(table, 200, p(times), p(phi), p(dphi)) == OK
    center, width = np.float32(tables.center), float(np.float32(tables.width))
    np.testing.assert_allclose(phi, basis(times, center.astype(float), width), rtol=1e-13, atol=1e-15)  # double rounding
    step = 1e-6  # central difference: error step^2 / width^3 ~ 1e-9, rounding 1e-16 / step ~ 1e-10
    difference = basis(times + step, center, width) - basis(times - step, center, width)
    np.testing.assert_allclose(dphi, difference / (2 * step), atol=1e-7)

    weights = rng.normal(size=(13, 4)).astype(np.float32)
    y = np.zeros((200, 2))
    tables.lib.tab_rbf_eval(table, p(weights), 1, 2, 200, p(phi), p(y))
    np.testing.assert_allclose(y, phi @ weights[:, 1:3].astype(float), rtol=1e-13, atol=1e-14)  # double rounding

    constant = np.full((13, 4), np.float32(0.7))
    tables.lib.tab_rbf_eval(table, p(constant), 0, 2, 200, p(phi), p(y))
    np.testing.assert_allclose(y, np.float32(0.7), rtol=1e-14)  # normalised: a constant is exact

    edge = np.array([-1.0, 0.0, 1.5, 9.0, np.nan])
    phi, dphi = np.zeros((5, 13)), np.zeros((5, 13))
    assert tables.lib.tab_rbf_basis(table, 5, p(edge), p(phi), p(dphi)) == NOT_FINITE
    assert np.array_equal(phi[0], phi[1]) and np.array_equal(phi[2], phi[3]) and not phi[4].any()
    assert not dphi[0].any() and not dphi[3].any() and dphi[1].any()


def test_logit_equals_numpy(tables: Tables) -> None:
    rng = np.random.default_rng(6)
    out = np.zeros(1)
    for x in rng.uniform(-2, 2, (1000, 3)):
        status = tables.lib.tab_logit_eval(ctypes.byref(tables.table("logit")), p(x), p(out))
        assert status == (OK if np.all(np.abs(x) <= 1) else OUTSIDE)
        score = tables.bias + tables.weight.astype(float) @ np.clip(x, -1, 1)
        np.testing.assert_allclose(out[0], 1 / (1 + np.exp(-score)), rtol=1e-14)  # double rounding


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_not_finite_queries_are_answered_neutrally(tables: Tables, bad: float) -> None:
    query = np.zeros(D)
    query[3] = bad
    status, index, d2 = tables.knn(query, 4)
    assert status == NOT_FINITE and np.all(index == -1) and np.all(np.isinf(d2))
    status, mean, var = tables.gpr_query(query)
    assert status == NOT_FINITE and not mean.any() and var == pytest.approx(1.3 + 1e-3, rel=4 * ULP)


@pytest.mark.parametrize("odd", [1e-320, -0.0, 1e-40, 1e30, -3e38])
def test_odd_but_finite_queries_are_answered(tables: Tables, odd: float) -> None:
    query = np.zeros(D)
    query[0] = odd
    status, index, d2 = tables.knn(query, 4)
    assert status == (OUTSIDE if abs(odd) > 1 else OK)
    assert np.all(index[: 1 if abs(odd) > 1 else 4] >= 0) and np.all(np.isfinite(d2))
    status, mean, var = tables.gpr_query(query)
    assert np.all(np.isfinite(mean)) and np.isfinite(var)
    if abs(odd) > 1:  # far from all data: the prior
        assert not mean.any() and var == pytest.approx(1.3 + 1e-3, rel=4 * ULP)


def test_more_neighbours_than_samples(tables: Tables) -> None:
    _, index, d2 = tables.knn(np.zeros(D), N + 5)
    assert sorted(index[:N]) == list(range(N)) and np.all(index[N:] == -1) and np.all(np.isinf(d2[N:]))


def test_compiled_tables_pass_the_check(tables: Tables) -> None:
    text = ctypes.create_string_buffer(256)
    for constant, (number, _) in KINDS.items():
        kind = constant.removeprefix("kTab").lower()
        table = ctypes.byref(tables.table(kind))
        assert tables.lib.tab_check(table, number, ctypes.c_uint64(0xABC), ctypes.c_uint64(0xDEF), text) == OK, text.value
        entry = next(e for e in tables.manifest["tables"] if e["kind"] == kind)
        assert f"0x{tables.lib.tab_digest(table):016x}" == entry["digest"]
