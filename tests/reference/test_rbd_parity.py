"""Rigid-body dynamics of the compiled controller, MuJoCo and Pinocchio agree on random states, fixed and free base.

q = [p_WB, x y z w, joints]      v = [base velocity in body axes, joints]          ours and Pinocchio's
qpos = [p_WB, w x y z, joints]   qvel = T^-1 v, T = blkdiag(R_WB^T, I, I)          MuJoCo: base linear velocity in world axes
M_mj = T^T M T    qfrc = T^T tau    qacc = T^-1 (a - c), c = [-w x v_B; 0; 0]      J_mj = J T
"""

import ctypes
import json
import os
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from engram.robots.emit_mjcf import robot_mjcf
from engram.robots.spec import read_spec
from engram.robots.tree import FREE, Tree, build, load, q_to_pin

STATES = 1000
TOLERANCE = 1e-10  # relative to the largest entry: rounding of 38 dofs, amplified by the condition of M in forward dynamics
FRAME = {"panda": "hand_tcp", "talos": "left_gripper", "anymal": "lf_foot", "ur10": "tool", "pr2": "left_tool", "zoo": "tip"}
ROBOTS = ["panda", "talos"]  # compiled into the controller
ZOO = Path(__file__).parent  # zoo/: joints of every kind about every sort of axis


class Case:
    """Random states of one robot, and what Pinocchio says about them."""

    def __init__(self, tree: Tree, n: int = STATES):
        self.tree, name = tree, tree.name
        rng = np.random.default_rng(7)
        lo, hi = np.maximum(tree.q_lo, -np.pi), np.minimum(tree.q_hi, np.pi)
        self.q = rng.uniform(lo, hi, (n, tree.nq))
        if tree.kind[0] == FREE:
            self.q[:, 3:7] = rng.standard_normal((n, 4))
            self.q[:, 3:7] /= np.linalg.norm(self.q[:, 3:7], axis=1, keepdims=True)
        self.v, self.a = rng.standard_normal((2, n, tree.nv))
        self.tau = 10.0 * rng.standard_normal((n, tree.nv))
        model = tree.model
        placement = frame_placement(tree, FRAME.get(name, tree.frame_name[0]))
        joint = int(tree.frame_joint[tree.frame_name.index(FRAME.get(name, tree.frame_name[0]))]) + 1
        frame = model.addFrame(pin.Frame("parity", joint, placement, pin.FrameType.OP_FRAME))
        data = model.createData()
        self.crba = np.empty((n, tree.nv, tree.nv))
        self.rnea, self.bias, self.aba = np.empty((3, n, tree.nv))
        self.jacobian = np.empty((n, 6, tree.nv))
        for i in range(n):
            q = q_to_pin(tree, self.q[i])
            self.rnea[i] = pin.rnea(model, data, q, self.v[i], self.a[i])
            self.bias[i] = pin.nonLinearEffects(model, data, q, self.v[i])
            upper = np.triu(pin.crba(model, data, q))
            self.crba[i] = upper + np.triu(upper, 1).T
            self.aba[i] = pin.aba(model, data, q, self.v[i], self.tau[i])
            self.jacobian[i] = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)


def frame_placement(tree: Tree, name: str) -> pin.SE3:
    """Placement of a named frame in Pinocchio's axes of its joint."""
    i = tree.frame_name.index(name)
    R_turn = tree.R_turn[tree.frame_joint[i]]
    return pin.SE3(R_turn @ tree.R_JF[i], R_turn @ tree.p_JF[i])


def difference(ours: np.ndarray, reference: np.ndarray) -> float:
    """Largest difference, relative to the largest entry of the reference in the same state."""
    ours, reference = (x.reshape(len(x), -1) for x in (ours, reference))
    return float((np.abs(ours - reference).max(1) / np.abs(reference).max(1)).max())


@pytest.fixture(scope="module", params=ROBOTS)
def case(request) -> Case:
    return Case(load(request.param))


@pytest.fixture(scope="module")
def folder(build) -> Path:
    """The build folder with the compiled parts: ENGRAM_BUILD, or build/."""
    return Path(os.environ.get("ENGRAM_BUILD", build))


@pytest.fixture(scope="module")
def figures(build):
    """Figures of this module, written to build/figures/parity.json at the end."""
    worst: dict[str, float] = {}
    yield worst
    (build / "figures").mkdir(parents=True, exist_ok=True)
    records = [
        {"id": key, "value": value, "unit": "1", "n": STATES, "gate": value <= TOLERANCE} for key, value in sorted(worst.items())
    ]
    (build / "figures" / "parity.json").write_text(json.dumps(records, indent=1) + "\n", encoding="utf-8")


def record(figures: dict[str, float], case: Case, what: str, value: float) -> float:
    """Keep the worst difference of a quantity over all comparisons."""
    key = f"parity.{case.tree.name}.{what}"
    figures[key] = max(figures.get(key, 0.0), value)
    return value


def mujoco_dynamics(folder: Path, case: Case, model_file: Path) -> dict[str, np.ndarray]:
    """What MuJoCo says about the states, in our conventions."""
    library = folder / "tests" / "libmujoco_oracle.so"
    assert library.is_file(), f"{library} is missing: ninja -C {folder} mujoco_oracle"
    tree, n, nv = case.tree, len(case.q), case.tree.nv
    qpos, T, drift = case.q.copy(), np.tile(np.eye(nv), (n, 1, 1)), np.zeros((n, nv))
    if tree.kind[0] == FREE:
        qpos[:, 3:7] = case.q[:, [6, 3, 4, 5]]
        for i in range(n):
            T[i, :3, :3] = pin.Quaternion(case.q[i, 3:7]).toRotationMatrix().T
        drift[:, :3] = -np.cross(case.v[:, 3:6], case.v[:, :3])
    T_inverse = T.transpose(0, 2, 1)  # T is orthogonal
    apply = lambda matrices, vectors: np.einsum("nij,nj->ni", matrices, vectors)  # noqa: E731
    inputs = (qpos, apply(T_inverse, case.v), apply(T_inverse, case.a - drift), apply(T_inverse, case.tau))
    inputs = [np.ascontiguousarray(x) for x in inputs]
    M, jacobian = np.empty((n, nv, nv)), np.empty((n, 6, nv))
    bias, inverse, forward = (np.empty((n, nv)) for _ in range(3))
    error = ctypes.create_string_buffer(1000)
    pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (*inputs, M, bias, inverse, forward, jacobian)]
    file, site = str(model_file).encode(), FRAME.get(tree.name, tree.frame_name[0]).encode()
    status = ctypes.CDLL(str(library)).mujoco_dynamics(file, site, n, tree.nq, nv, *pointers, error, 1000)
    assert status == 0, error.value.decode()
    return {
        "crba": T @ M @ T_inverse,
        "bias": apply(T, bias) - apply(T @ M @ T_inverse, drift),
        "rnea": apply(T, inverse),
        "aba": apply(T, forward) + drift,
        "jacobian": jacobian @ T_inverse,
    }


def test_mujoco_agrees_with_pinocchio(case, folder, root, figures):
    theirs = mujoco_dynamics(folder, case, root / "tables" / case.tree.name / "robot.xml")
    for what in ("crba", "rnea", "aba", "jacobian"):
        assert record(figures, case, what, difference(theirs[what], getattr(case, what))) <= TOLERANCE, what
    assert difference(theirs["bias"], case.bias) <= TOLERANCE


def test_mujoco_agrees_on_every_kind_of_joint(folder, tmp_path):
    zoo = Case(build(read_spec("zoo", ZOO)))
    (tmp_path / "robot.xml").write_text(robot_mjcf(zoo.tree), encoding="utf-8")
    theirs = mujoco_dynamics(folder, zoo, tmp_path / "robot.xml")
    for what in ("crba", "bias", "rnea", "aba", "jacobian"):
        assert difference(theirs[what], getattr(zoo, what)) <= TOLERANCE, what


@pytest.mark.parametrize("lanes", [False, True], ids=["double", "pack"])
def test_controller_agrees_with_pinocchio(case, figures, lanes):
    from engram.engine import engine

    robot = getattr(engine, case.tree.name)
    assert robot.digest == case.tree.digest, "robot.h is not what robot.toml and the URDF give: run `engram robot`"
    ours = {
        "rnea": robot.rnea(case.q, case.v, case.a, lanes=lanes),
        "crba": robot.crba(case.q, lanes=lanes),
        "aba": robot.aba(case.q, case.v, case.tau, lanes=lanes),
        "jacobian": robot.frame_jacobian(case.q, FRAME[case.tree.name], lanes=lanes),
    }
    for what, value in ours.items():
        assert record(figures, case, what, difference(value, getattr(case, what))) <= TOLERANCE, what
    forward = robot.forward_dynamics(case.q, case.v, case.tau, lanes=lanes)
    assert difference(forward, case.aba) <= TOLERANCE


def test_a_wrong_mass_is_seen(case):
    """The comparison is sharp: one part in a million of one body's mass fails it."""
    model = case.tree.model.copy()
    model.inertias[model.njoints - 1].mass *= 1.0 + 1e-6
    data = model.createData()
    states = zip(case.q[:10], case.v[:10], case.a[:10])
    rnea = np.array([pin.rnea(model, data, q_to_pin(case.tree, q), v, a) for q, v, a in states])
    assert difference(rnea, case.rnea[:10]) > TOLERANCE
