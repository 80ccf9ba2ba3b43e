"""Robots beyond those that the controller is built for: compiled here, from robot.toml to dynamics, and compared.

Two are of models/; two are given as nothing but the robot.toml below, by names of example-robot-data.
"""

import ctypes
import os
import shutil
import subprocess

import numpy as np
import pytest
from test_rbd_parity import TOLERANCE, Case, difference, mujoco_dynamics

from engram.cli import main
from engram.paths import MODELS, ROOT
from engram.robots.emit_header import camel
from engram.robots.spec import read_spec
from engram.robots.tree import build

STATES = 100
NEW = {
    "kinova": """
example_robot_data = "kinova"
free_base = false
home = { j2s6s200_joint_2 = 3.14, j2s6s200_joint_3 = 3.14, j2s6s200_joint_5 = 3.14 }

[frames]
hand = "j2s6s200_end_effector"
""",
    "go2": """
example_robot_data = "go2"
free_base = true
home = "standing"

[frames]
foot = "FL_foot"
""",
}


@pytest.fixture(scope="module", params=["ur10", "pr2", *NEW])
def made(request, tmp_path_factory):
    """(folder of robot.h and robot.xml, states) of a robot."""
    name, folder = request.param, tmp_path_factory.mktemp(request.param)
    models = folder / "models"
    if name in NEW:
        (models / name).mkdir(parents=True)
        (models / name / "robot.toml").write_text(NEW[name], encoding="utf-8")
    else:
        shutil.copytree(MODELS / name, models / name)
    assert main(["robot", name, "--models", str(models), "--tables", str(folder / "tables")]) == 0
    return folder, Case(build(read_spec(name, models)), STATES)


def test_mujoco_and_pinocchio_agree(made, build):
    folder, case = made
    theirs = mujoco_dynamics(build, case, folder / "tables" / case.tree.name / "robot.xml")
    for what in ("crba", "rnea", "aba", "jacobian"):
        assert difference(theirs[what], getattr(case, what)) <= TOLERANCE, what


def test_the_compiled_robot_agrees(made):
    folder, case = made
    name, n, nv = case.tree.name, STATES, case.tree.nv
    library = folder / "dynamics.so"
    eigen = subprocess.run(["pkg-config", "--cflags-only-I", "eigen3"], check=True, capture_output=True, text=True).stdout.strip()
    compiler = [*(["ccache"] if shutil.which("ccache") else []), os.environ.get("CXX", "g++")]
    flags = ["-std=c++17", "-O1", "-fPIC", "-shared", "-Wall", "-Wextra", "-Werror", "-Wno-maybe-uninitialized"]
    paths = [f"-I{folder}", f"-I{ROOT}", "-isystem", eigen.removeprefix("-I")]
    robot = [f"-DROBOT={camel(name)}", f'-DROBOT_HEADER="tables/{name}/robot.h"', "-march=native"]
    source = ROOT / "tests" / "reference" / "rbd_oracle.cc"
    subprocess.run([*compiler, *flags, *paths, *robot, str(source), "-o", str(library)], check=True)
    rnea, aba, crba = np.empty((n, nv)), np.empty((n, nv)), np.empty((n, nv, nv))
    arrays = [np.ascontiguousarray(x) for x in (case.q, case.v, case.a, case.tau)] + [rnea, aba, crba]
    ctypes.CDLL(str(library)).rbd_dynamics(n, *[x.ctypes.data_as(ctypes.c_void_p) for x in arrays])
    for what, ours in (("rnea", rnea), ("aba", aba), ("crba", crba)):
        assert difference(ours, getattr(case, what)) <= TOLERANCE, what


def test_a_planar_base_moves_in_the_plane(made):
    """The base of PR2 is three joints: m, m, rad; all of it moves with them."""
    _, case = made
    if case.tree.name != "pr2":
        assert "base_x" not in case.tree.joint_name
        return
    tree = case.tree
    assert tree.joint_name[:3] == ["base_x", "base_y", "base_yaw"] and (tree.nq, tree.nu) == (17, 17)
    M = case.crba[0]
    assert np.isclose(M[0, 0], tree.mass.sum()) and np.isclose(M[1, 1], tree.mass.sum()) and abs(M[0, 1]) < 1e-9
