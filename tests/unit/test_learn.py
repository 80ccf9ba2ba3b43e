"""Learning on smooth synthetic motions: compression, regression, determinism."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from engram.emit import write_tables
from engram.inputs import InputError
from engram.learn.bow import fit_bow_code, inverse_dynamics
from engram.learn.dataset import FEWEST, load_motions, rotation
from engram.learn.gpr import fit_gpr, fit_hyperparameters, round_digits
from engram.learn.memory import Memory, Motions, Settings, features, fit_memory, rms
from engram.learn.reproducible import PINNED, pinned
from engram.learn.timebase import TimeBasis
from engram.learn.trust import INPUTS, Trials, fit_trust, probability

T = 1.5
TIMES = np.linspace(0, T, 51)
TIME = TimeBasis(18, T)


class UnitMasses:
    """A robot of the compiled engine whose joints are unit masses that do not feel each other."""

    @staticmethod
    def rnea(q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        return a

    @staticmethod
    def crba(q: np.ndarray) -> np.ndarray:
        return np.broadcast_to(np.eye(q.shape[1]), (len(q), q.shape[1], q.shape[1]))


def minimum_jerk(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Task x (n, 4) and motions q (n, 51, 2) from start to goal with a bow."""
    x = np.random.default_rng(seed).uniform(-1, 1, (n, 4))
    r = TIMES / T
    s = (10 * r**3 - 15 * r**4 + 6 * r**5)[None, :, None]
    start, goal = x[:, None, :2], x[:, None, 2:]
    return x, start + s * (goal - start) + 0.3 * np.sin(np.pi * s) * start * goal


def test_gaussians_restore_smooth_motions_and_their_ends() -> None:
    _, q = minimum_jerk(50)
    weights = TIME.fit(TIMES, q)
    back = np.einsum("tk,nkc->ntc", TIME.phi(TIMES), weights)
    np.testing.assert_allclose(back[:, [0, -1]], q[:, [0, -1]], atol=1e-10)  # pinned, up to rounding of the KKT system
    assert np.abs(back - q).max() < 1e-3  # rad: 18 Gaussians follow a minimum-jerk motion
    constant = TIME.fit(TIMES, np.full((1, 51, 1), 0.7))
    np.testing.assert_allclose(constant, 0.7, atol=1e-6)  # the ridge pulls by 1e-8


def test_a_bow_decodes_to_its_motion_and_vanishes_at_the_ends() -> None:
    _, q = minimum_jerk(200)
    code = fit_bow_code(TIME, TIMES, q, inverse_dynamics(UnitMasses, TIMES, q), UnitMasses, 2)  # the data bow in two ways
    z = code.encode(TIMES, q)
    assert np.abs(code.decode(z, TIMES, q[:, 0], q[:, -1]) - q).max() < 2e-3  # rad
    np.testing.assert_allclose(z.std(axis=0), 1.0, rtol=1e-9)  # coefficients in units of their spread
    np.testing.assert_allclose(z.mean(axis=0), 0.0, atol=1e-9)
    ends = np.random.default_rng(1).normal(size=(2, 200, 2))
    anything = np.random.default_rng(2).normal(size=z.shape)
    bent = code.decode(anything, TIMES, *ends)
    np.testing.assert_allclose(bent[:, [0, -1]].transpose(1, 0, 2), ends, atol=1e-9)  # rounding of the KKT system


def test_controls_are_remembered_beyond_the_inverse_dynamics() -> None:
    _, q = minimum_jerk(200)
    friction = 2.0 * (q[:, :1] * q[:, -1:])[:, :, :1]  # N m that no model knows, but the bow tells
    u = inverse_dynamics(UnitMasses, TIMES, q) + friction
    code = fit_bow_code(TIME, TIMES, q, u, UnitMasses, 2)
    z = code.encode(TIMES, q)
    motion = inverse_dynamics(UnitMasses, TIMES, code.decode(z, TIMES, q[:, 0], q[:, -1]))
    beyond = code.decode_controls(z, TIMES[:-1])
    assert rms(motion + beyond - u) < 0.3 * rms(motion - u)
    mean, basis = code.table()
    assert mean.shape == (18 * 4,) and basis.shape == (2, 18 * 4)
    channels = np.einsum("tk,nkc->ntc", TIME.phi(TIMES[:-1]), (mean + z @ basis).reshape(len(z), 18, 4))
    np.testing.assert_allclose(channels[:, :, 2:], beyond, atol=1e-12)  # the same sums in another order


def test_more_components_never_fit_worse() -> None:
    rng = np.random.default_rng(3)
    q = minimum_jerk(100)[1] + 0.2 * np.sin(np.pi * np.outer(rng.uniform(1, 4, 100), TIMES))[:, :, None] * rng.normal(
        size=(100, 1, 2)
    )
    errors = []
    for m in (2, 4, 8, 16):
        code = fit_bow_code(TIME, TIMES, q, inverse_dynamics(UnitMasses, TIMES, q), UnitMasses, m)
        errors.append(np.abs(code.decode(code.encode(TIMES, q), TIMES, q[:, 0], q[:, -1]) - q).mean())
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.2 * errors[0]


def test_gpr_equals_scikit_learn() -> None:
    x, q = minimum_jerk(80)
    z = q[:, 25]
    length, noise = np.array([0.9, 1.1, 2.0, 0.7]), 1e-3
    own = fit_gpr(x, z, length, noise)
    kernel = ConstantKernel(1.0, "fixed") * RBF(length, "fixed") + WhiteKernel(noise, "fixed")
    x32 = x.astype(np.float32).astype(float)
    reference = GaussianProcessRegressor(kernel, optimizer=None, alpha=0.0).fit(x32, z - z.mean(axis=0))
    query = np.random.default_rng(5).uniform(-1.3, 1.3, (100, 4))
    mean, std = reference.predict(query, return_std=True)
    own_mean, own_var = own.predict(query)
    np.testing.assert_allclose(own_mean, mean + z.mean(axis=0), atol=1e-9)  # condition 1e5 times double rounding
    np.testing.assert_allclose(own_var, std[:, 0] ** 2, atol=1e-9)


def test_hyperparameters_find_the_inputs_that_matter() -> None:
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (150, 3))
    z = np.sin(4 * x[:, :1])  # the first input alone
    length, noise = fit_hyperparameters(x, (z - z.mean(0)) / z.std(0), np.ones(3))
    assert length[0] < 1 and np.all(length[1:] > 5) and noise < 0.05
    again = fit_hyperparameters(x, (z - z.mean(0)) / z.std(0), np.ones(3))
    assert np.array_equal(length, again[0]) and noise == again[1]


@pytest.mark.parametrize(
    ("value", "rounded"), [(1.23456, 1.23), (0.00098765, 0.000988), (98765.0, 98800.0), (0.0, 0.0), (-1.2345, -1.23)]
)
def test_rounding_to_digits(value: float, rounded: float) -> None:
    assert round_digits(value) == pytest.approx(rounded, rel=1e-12)


SMALL = Settings(gaussians=12, components=6, regression_samples=100, hyperparameter_samples=80, hyperparameter_outputs=2)


def arm_memory() -> Memory:
    """A memory of 150 synthetic motions of seven joints; their bow, up to 1.6 rad, depends on the first joint's start."""
    rng = np.random.default_rng(4)
    n = 150
    start, p_WT = rng.uniform(-1, 1, (n, 7)), rng.uniform(-0.5, 0.5, (n, 3))
    end = start + np.repeat(p_WT, [2, 2, 3], axis=1)
    r = TIMES / T
    s = (10 * r**3 - 15 * r**4 + 6 * r**5)[None, :, None]
    bow = np.sin(np.pi * s) ** 2 * (0.8 * np.sin(2 * start[:, :1]) * np.linspace(1, 2, 7))[:, None, :]
    q = (1 - s) * start[:, None] + s * end[:, None] + bow
    R_WT = rotation(rng.normal(size=(n, 4)))
    u = inverse_dynamics(UnitMasses, TIMES, q) + 0.5 * start[:, None]  # N m beyond the model: it does not know this friction
    motions = Motions(features(start, p_WT, R_WT), TIMES, q, u, np.arange(n) % 5 == 4)
    return fit_memory(motions, UnitMasses, SMALL)


def test_a_memory_of_smooth_motions_recalls_them() -> None:
    memory = arm_memory()
    report = {name: value for name, value, _ in memory.report}
    assert report["time.rms"] < 2e-3 and report["bow.rms"] < 2e-3  # rad
    assert report["gpr.rms"] < 0.1  # rad; 100 samples in 17 dimensions, of which it must find the one that matters
    assert memory.knn.x.shape == (120, 16) and memory.knn.value.shape == (120, 7 + 6) and memory.gpr.x.shape == (100, 17)
    assert memory.bow.basis.shape == (6, 12 * 14) and memory.time.channels == 14


def test_the_same_motions_make_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        memory = arm_memory()
        tables = [memory.knn, memory.gpr, memory.bow, memory.time]
        write_tables(tmp_path / name, "toy", tables, robot_digest=1, task_digest=2, data_digest="", provenance="")
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes(), path.name


def test_features_are_posture_position_and_two_axes() -> None:
    R_WT = rotation(np.array([[0.0, 0.0, np.sin(0.25), np.cos(0.25)]]))[0]  # 0.5 rad about z
    np.testing.assert_allclose(R_WT[:, 0], [np.cos(0.5), np.sin(0.5), 0], atol=1e-15)
    x = features(np.arange(7.0)[None], np.array([[7.0, 8.0, 9.0]]), R_WT[None])[0]
    np.testing.assert_allclose(x, [*range(10), 0, 0, 1, np.cos(0.5), np.sin(0.5), 0], atol=1e-15)


def test_trust_is_calibrated() -> None:
    rng = np.random.default_rng(6)
    n = 6000
    inputs = np.column_stack([rng.uniform(0, 3, n), np.zeros(n), rng.uniform(0, 1.2, n), np.zeros(n), rng.integers(0, 2, n)])
    truth = probability(np.array([-1.5, 0, -1.0, 0, -0.5]), 2.5, inputs)
    table, report = fit_trust(Trials(np.arange(n), inputs, rng.uniform(size=n) < truth))
    found = probability(table.weight, table.bias, inputs)
    assert np.abs(found - truth).max() < 0.06  # three standard errors of 6000 trials, at the rarest corner
    figures = {name: value for name, value, _ in report}
    assert figures["trust.brier"] < figures["trust.brier_of_base_rate"] and figures["trust.auc"] > 0.7


def test_trust_of_guesses_that_all_succeed() -> None:
    table, report = fit_trust(Trials(np.arange(50), np.zeros((50, len(INPUTS))), np.ones(50, bool)))
    assert probability(table.weight, table.bias, np.zeros((1, len(INPUTS))))[0] == pytest.approx(0.99) and report == [
        ("trust.good", 1.0, "1")
    ]


def test_a_process_pins_itself_before_numpy_is_loaded() -> None:
    code = "from engram.learn.reproducible import restart_pinned, pinned; restart_pinned(); print(pinned())"
    environment = {key: value for key, value in os.environ.items() if key not in PINNED}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "True\n" and pinned() == all(os.environ.get(k) == v for k, v in PINNED.items())


SPEC = SimpleNamespace(name="reach", digest=77, vector_name=list("xyzabcd"), robot=SimpleNamespace(name="panda", nq=7, nv=7))


def data_set(n: int = FEWEST) -> dict[str, np.ndarray]:
    """Arrays as `engram data` writes them, at random."""
    rng = np.random.default_rng(8)
    return {
        "X": rng.normal(size=(n, 14)),
        "xs": rng.normal(size=(n, 51, 14)),
        "us": rng.normal(size=(n, 50, 7)),
        "cost": np.ones(n),
        "t": TIMES,
        "task_digest": np.uint64(77),
        "made_from": np.array("a test"),
    }


def test_a_data_set_is_read_and_split(tmp_path: Path) -> None:
    data = data_set()
    np.savez(tmp_path / "d.npz", **data)
    source = load_motions(tmp_path / "d.npz", SPEC, 10)
    assert source.motions.x.shape == (FEWEST, 16) and source.motions.held_out.sum() == FEWEST // 10
    assert source.made_from == "a test" and source.vector.shape == (FEWEST, 7)
    np.savez(tmp_path / "again.npz", **data)
    assert load_motions(tmp_path / "again.npz", SPEC, 10).digest == source.digest
    data["us"][3, 2, 1] += 1e-9
    np.savez(tmp_path / "other.npz", **data)
    assert load_motions(tmp_path / "other.npz", SPEC, 10).digest != source.digest


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda d: d.update(task_digest=np.uint64(5)), "made for another task: its digest is 0x0000000000000005"),
        (lambda d: d.pop("us"), "cannot be read"),
        (lambda d: d.update(X=d["X"][:5], xs=d["xs"][:5], us=d["us"][:5]), "holds 5 motions, at least 50 are needed"),
        (lambda d: d.update(us=d["us"][:, :-1]), "its arrays do not fit together"),
        (lambda d: d["xs"].__setitem__((0, 0, 0), np.nan), "its arrays do not fit together"),
    ],
)
def test_a_bad_data_set_is_refused_with_its_mend(tmp_path: Path, change, text: str) -> None:
    data = data_set()
    change(data)
    np.savez(tmp_path / "d.npz", **data)
    with pytest.raises(InputError, match=text) as error:
        load_motions(tmp_path / "d.npz", SPEC, 10)
    assert "run `engram data panda reach`" in str(error.value)


def test_a_missing_or_cut_data_set_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        load_motions(tmp_path / "none.npz", SPEC, 10)
    np.savez(tmp_path / "d.npz", **data_set())
    whole = (tmp_path / "d.npz").read_bytes()
    (tmp_path / "d.npz").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="cannot be read"):
        load_motions(tmp_path / "d.npz", SPEC, 10)
