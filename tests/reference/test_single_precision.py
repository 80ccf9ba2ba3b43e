"""Single precision (ENGRAM_SINGLE) beside double: the programs of bench/ at the same input, with the gates of bench/run.py."""

import sys
from pathlib import Path

import numpy as np
import pytest

from engram.paths import ROOT

sys.path.insert(0, str(ROOT / "bench"))
from run import PROBLEMS, gate_problem_single, gate_rigid_body_single, run_json

PROGRAMS = ROOT / "build" / "tests"
STATES = 20


def both(name: str, *numbers: np.ndarray, folder: Path) -> tuple[dict, dict]:
    """What the single and the double program print for the numbers."""
    file = folder / f"{name}.txt"
    np.savetxt(file, np.concatenate([n.ravel() for n in numbers]), fmt="%.17g")
    return tuple(run_json(PROGRAMS / program, "compare", name, file) for program in ("precision_single", "precision_double"))


@pytest.mark.parametrize(("robot", "nq", "nv"), [("panda", 7, 7), ("talos", 39, 38)])
def test_rigid_body_algorithms(robot: str, nq: int, nv: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    q = rng.uniform(-1, 1, (STATES, nq))
    if nq > nv:
        q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    single, double = both(robot, np.hstack([q, rng.uniform(-1, 1, (STATES, 3 * nv))]), folder=tmp_path)
    assert single["rnea"] != double["rnea"]  # two programs, not one
    names = [name for name in double if isinstance(double[name], list)]
    assert gate_rigid_body_single(robot, single, {name: double[name] for name in names}, nv)


@pytest.mark.parametrize("name", ["arm30", "talos30t", "anymal", "quad33"])
def test_solver(name: str, tmp_path: Path) -> None:
    """Costs and their derivatives at the cold start, and the cost at the end of a solve from there."""
    anchor = PROBLEMS[name]
    nx = {"panda": 14, "talos": 77, "anymal": 37, "hector": 13}[anchor.robot]
    controls = (anchor.knots - len(anchor.impacts)) * anchor.nu
    rng = np.random.default_rng(3)
    x = rng.uniform(-0.1, 0.1, (anchor.knots + 1, nx))
    if anchor.robot != "panda":
        x[:, 6] = np.sqrt(1 - np.sum(x[:, 3:6] ** 2, axis=1))  # near the upright base
    single, double = both(name, x, rng.standard_normal(controls), folder=tmp_path)
    assert gate_problem_single(name, single, double)
