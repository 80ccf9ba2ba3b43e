"""The kinematic tree of a robot, in the controller's conventions, from a URDF loaded by Pinocchio.

One tree feeds both outputs (constants for C++, MJCF for MuJoCo). Joint frames are turned so that +z is the joint axis:

    R_turn[i]  takes joint axes to Pinocchio's axes of the same body;  R_PJ' = R_turn[P]^T R_PJ R_turn[J]

so that angles, travels and velocities are Pinocchio's, and only a continuous joint differs (angle instead of cosine, sine).
"""

import hashlib
import struct
from dataclasses import dataclass, fields

import numpy as np
import pinocchio as pin

from engram.inputs import closest
from engram.paths import relative
from engram.robots.linear3 import product, turn_to
from engram.robots.spec import PLANAR_BASE, RobotSpec, read_spec

FREE, REVOLUTE, PRISMATIC = 0, 1, 2  # order of JointKind in controller/rbd/rbd_types.h
CARRIAGE = 1e-6  # kg, kg m^2: bodies between the joints of a planar base, which MuJoCo would not take without mass
NO_LIMIT = 1e8  # stands for an absent limit: finite, so that arithmetic on it stays finite


@dataclass(frozen=True)
class Tree:
    """A robot as robot.h states it; joint i moves body i (SI units). Row-major matrices."""

    name: str
    joint_name: list[str]
    kind: np.ndarray  # (nj) FREE, REVOLUTE, PRISMATIC
    parent: np.ndarray  # (nj) -1: world
    iq: np.ndarray
    iv: np.ndarray
    nsub: np.ndarray
    R_PJ: np.ndarray  # (nj, 3, 3)
    p_PJ: np.ndarray  # (nj, 3)
    mass: np.ndarray
    com: np.ndarray  # (nj, 3)
    inertia: np.ndarray  # (nj, 3, 3) about the com
    armature: np.ndarray  # (nv)
    q_lo: np.ndarray
    q_hi: np.ndarray
    v_max: np.ndarray
    u_max: np.ndarray  # (nu) thrusters first, then joints or the controls of a formula
    u_lo: np.ndarray  # (nu), or empty: -u_max
    actuation: np.ndarray  # (nv, nu): tau = actuation u, or empty: u drives the last nu dofs
    q_home: np.ndarray
    gravity: np.ndarray
    frame_name: list[str]
    frame_joint: np.ndarray
    R_JF: np.ndarray
    p_JF: np.ndarray
    sphere_joint: np.ndarray
    p_JS: np.ndarray  # (nsphere, 3)
    sphere_radius: np.ndarray
    feet: dict[str, np.ndarray]  # frame -> radius of a ball (1), or half sizes of a box that stands on the frame (3)
    thruster_name: list[str]
    p_BT: np.ndarray  # (nthruster, 3) m, base axes
    axis_B: np.ndarray  # (nthruster, 3) unit vectors, base axes
    twist: np.ndarray  # (nthruster) N m per N
    formula: str  # that moves the robot, or empty
    control_name: list[str]  # of the formula: they take the place of joint motors
    R_turn: np.ndarray  # (nj, 3, 3) joint axes -> Pinocchio's axes of the same body
    continuous: np.ndarray  # (nj) bool
    model: pin.Model  # locked joints removed, armature and gravity set

    @property
    def nj(self) -> int:
        return len(self.kind)

    @property
    def nq(self) -> int:
        return len(self.q_home)

    @property
    def nv(self) -> int:
        return len(self.v_max)

    @property
    def nu(self) -> int:
        return len(self.u_max)

    @property
    def digest(self) -> int:
        """64 bits of the SHA-256 of every number of robot.h, in its order."""
        sha = hashlib.sha256()
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in ("R_turn", "continuous", "p_BT", "axis_B", "twist") or not isinstance(value, np.ndarray):
                continue
            sha.update(struct.pack(f"<{value.size}d", *value.astype(float).ravel()))
        return int.from_bytes(sha.digest()[:8], "big")


def load(name: str) -> Tree:
    """The tree of models/<name>/robot.toml. Raises InputError."""
    return build(read_spec(name))


def build(spec: RobotSpec) -> Tree:
    """Load the URDF of `spec`, weld its locked joints and turn the joint frames. Raises InputError."""
    model, home = _load_model(spec)
    nj = model.njoints - 1
    kind, continuous, R_turn = np.zeros(nj, int), np.zeros(nj, bool), np.zeros((nj, 3, 3))
    for i in range(nj):
        kind[i], continuous[i], axis = _classify(spec, model, model.names[i + 1], model.joints[i + 1])
        R_turn[i] = np.eye(3) if axis is None else turn_to(axis)
    parent = np.array(model.parents)[1:] - 1
    R_PJ, p_PJ, com, inertia = np.zeros((nj, 3, 3)), np.zeros((nj, 3)), np.zeros((nj, 3)), np.zeros((nj, 3, 3))
    nsub = np.ones(nj, int)
    for i in reversed(range(nj)):
        R_parent = np.eye(3) if parent[i] < 0 else R_turn[parent[i]]
        placement, body = model.jointPlacements[i + 1], model.inertias[i + 1]
        R_PJ[i] = product(R_parent.T, placement.rotation, R_turn[i])
        p_PJ[i] = product(R_parent.T, placement.translation)
        com[i] = product(R_turn[i].T, body.lever)
        inertia[i] = product(R_turn[i].T, body.inertia, R_turn[i])
        if parent[i] >= 0:
            nsub[parent[i]] += nsub[i]
    sizes = np.where(kind == FREE, 7, 1), np.where(kind == FREE, 6, 1)
    iq, iv = (np.concatenate([[0], np.cumsum(n)[:-1]]) for n in sizes)
    q_lo, q_hi = np.full(sizes[0].sum(), -NO_LIMIT), np.full(sizes[0].sum(), NO_LIMIT)
    for i in np.flatnonzero((kind != FREE) & ~continuous).tolist():
        q_lo[iq[i]] = model.lowerPositionLimit[model.joints[i + 1].idx_q]
        q_hi[iq[i]] = model.upperPositionLimit[model.joints[i + 1].idx_q]
    frames = [_frame(spec, model, R_turn, name, link, "frames") for name, link in spec.frames.items()]
    p_BT, axis_B = _thrusters(spec, model)
    twist = np.array([t.twist for t in spec.thrusters])
    driven_u_max, driven_u_lo = _controls(spec) if spec.formula else _joint_forces(spec, model)
    one_sided = bool(spec.thrusters) or np.any(driven_u_lo != -driven_u_max)
    spheres = [(_frame(spec, model, R_turn, link, link, "spheres"), row) for link, rows in spec.spheres.items() for row in rows]
    tree = Tree(
        name=spec.name,
        joint_name=list(model.names)[1:],
        kind=kind,
        parent=parent,
        iq=iq,
        iv=iv,
        nsub=nsub,
        R_PJ=R_PJ,
        p_PJ=p_PJ,
        mass=np.array([body.mass for body in model.inertias])[1:],
        com=com,
        inertia=inertia,
        armature=np.array(model.armature),
        q_lo=np.clip(q_lo, -NO_LIMIT, NO_LIMIT),
        q_hi=np.clip(q_hi, -NO_LIMIT, NO_LIMIT),
        v_max=np.clip(model.velocityLimit, 0.0, NO_LIMIT),
        u_max=np.concatenate([[t.u_hi for t in spec.thrusters], driven_u_max]),
        u_lo=np.concatenate([[t.u_lo for t in spec.thrusters], driven_u_lo]) if one_sided else np.zeros(0),
        actuation=_actuation(p_BT, axis_B, twist, model.nv) if spec.thrusters else np.zeros((0, 0)),
        q_home=np.zeros(len(q_lo)),
        gravity=spec.gravity,
        frame_name=list(spec.frames),
        frame_joint=np.array([joint for joint, _, _ in frames], int),
        R_JF=np.array([R for _, R, _ in frames]).reshape(-1, 3, 3),
        p_JF=np.array([p for _, _, p in frames]).reshape(-1, 3),
        sphere_joint=np.array([joint for (joint, _, _), _ in spheres], int),
        p_JS=np.array([p + product(R, row[:3]) for (_, R, p), row in spheres]).reshape(-1, 3),
        sphere_radius=np.array([row[3] for _, row in spheres]),
        feet=spec.feet,
        thruster_name=[t.name for t in spec.thrusters],
        p_BT=p_BT,
        axis_B=axis_B,
        twist=twist,
        formula=spec.formula,
        control_name=[c.name for c in spec.controls],
        R_turn=R_turn,
        continuous=continuous,
        model=model,
    )
    tree.q_home[:] = q_from_pin(tree, home)
    check(spec, tree)
    return tree


def q_from_pin(tree: Tree, q_pin: np.ndarray) -> np.ndarray:
    """Pinocchio's configuration -> ours: a continuous joint's (cosine, sine) becomes its angle in (-pi, pi]."""
    q = np.zeros(tree.nq)
    for i, joint in enumerate(tree.model.joints[1:]):
        part = q_pin[joint.idx_q : joint.idx_q + joint.nq]
        q[tree.iq[i] : tree.iq[i] + (7 if tree.kind[i] == FREE else 1)] = (
            np.arctan2(part[1], part[0]) if tree.continuous[i] else part
        )
    return q


def q_to_pin(tree: Tree, q: np.ndarray) -> np.ndarray:
    """Our configuration -> Pinocchio's."""
    q_pin = np.zeros(tree.model.nq)
    for i, joint in enumerate(tree.model.joints[1:]):
        part = q[tree.iq[i] : tree.iq[i] + (7 if tree.kind[i] == FREE else 1)]
        q_pin[joint.idx_q : joint.idx_q + joint.nq] = [np.cos(part[0]), np.sin(part[0])] if tree.continuous[i] else part
    return q_pin


def full_model(spec: RobotSpec) -> pin.Model:
    """The URDF with all its joints, on its base."""
    root = [pin.JointModelFreeFlyer()] if spec.free_base else []
    try:
        model = pin.buildModelFromUrdf(str(spec.urdf), *root)
    except (ValueError, RuntimeError) as error:
        what = f"Pinocchio cannot read {relative(spec.urdf)} ({' '.join(str(error).split())}); mend that file, or name another"
        raise spec.file.error(spec.source, what) from None
    if not spec.planar_base:
        return model
    carriage, parent = pin.Model(), 0
    for name, joint in zip(PLANAR_BASE, (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelRZ())):
        far = np.full(1, NO_LIMIT)
        parent = carriage.addJoint(parent, joint, pin.SE3.Identity(), name, far, far, -far, far)
        carriage.appendBodyToJoint(parent, pin.Inertia(CARRIAGE, np.zeros(3), CARRIAGE * np.eye(3)), pin.SE3.Identity())
        carriage.addJointFrame(parent)
    return pin.appendModel(carriage, model, carriage.getFrameId(PLANAR_BASE[-1]), pin.SE3.Identity())


def _load_model(spec: RobotSpec) -> tuple[pin.Model, np.ndarray]:
    """The Pinocchio model with joints welded and overrides applied, and its nominal posture (Pinocchio's q)."""
    model = full_model(spec)
    home = pin.neutral(model)
    if isinstance(spec.home, str):
        if spec.srdf is None:
            raise spec.file.error("home", "a posture by name needs an SRDF; give a table joint = value instead")
        pin.loadReferenceConfigurations(model, str(spec.srdf), False)
        if spec.home not in model.referenceConfigurations:
            known = [posture.key() for posture in model.referenceConfigurations]
            raise spec.file.error("home", f"{spec.srdf.name} has no posture '{spec.home}'; {closest(spec.home, known)}")
        home = np.array(model.referenceConfigurations[spec.home])  # a copy: the model is replaced below
    else:
        _put(spec, model, home, spec.home, "home")
    weld = home.copy()
    _put(spec, model, weld, spec.locked, "locked")
    model = pin.buildReducedModel(model, [model.getJointId(joint) for joint in spec.locked], weld)
    kept = pin.neutral(model)
    reference = full_model(spec)
    for name, joint in zip(list(model.names)[1:], model.joints[1:]):
        full = reference.joints[reference.getJointId(name)]
        kept[joint.idx_q : joint.idx_q + joint.nq] = home[full.idx_q : full.idx_q + full.nq]
    _override(spec, model)
    return model, kept


def _joint_id(spec: RobotSpec, model: pin.Model, joint: str, table: str) -> int:
    """Of a joint that robot.toml names in `table`."""
    if not model.existJointName(joint):
        if joint in spec.locked and table == "joint":
            raise spec.file.error(joint, "this joint does not move; delete it here, or in [locked]", f"joint.{joint}")
        raise spec.file.error(joint, f"{spec.urdf.name} has no such joint; {closest(joint, list(model.names)[1:])}", table)
    if model.joints[model.getJointId(joint)].nv != 1:
        raise spec.file.error(joint, "this joint has not one coordinate; delete it here", table)
    return model.getJointId(joint)


def _put(spec: RobotSpec, model: pin.Model, q: np.ndarray, values: dict[str, float], table: str) -> None:
    """Write joint values (rad, m) of robot.toml's `table` into Pinocchio's q."""
    for name, value in values.items():
        joint = model.joints[_joint_id(spec, model, name, table)]
        q[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else [np.cos(value), np.sin(value)]


def _override(spec: RobotSpec, model: pin.Model) -> None:
    """Gravity, armature and the limits that robot.toml states."""
    model.gravity.linear = spec.gravity
    base = 6 if spec.free_base else 0
    model.armature = np.concatenate([np.zeros(base), np.full(model.nv - base, spec.armature)])
    for name, values in spec.joint.items():
        joint = model.joints[_joint_id(spec, model, name, "joint")]
        for key in ("q_lo", "q_hi"):
            if key in values and joint.nq == 2:
                raise spec.file.error(key, "this joint turns without end; delete the key", f"joint.{name}")
        for key, (array, i) in {
            "armature": (model.armature, joint.idx_v),
            "q_lo": (model.lowerPositionLimit, joint.idx_q),
            "q_hi": (model.upperPositionLimit, joint.idx_q),
            "v_max": (model.velocityLimit, joint.idx_v),
            "u_max": (model.effortLimit, joint.idx_v),
        }.items():
            array[i] = values.get(key, array[i])


def _controls(spec: RobotSpec) -> tuple[np.ndarray, np.ndarray]:
    """Largest and least controls of a formula."""
    return np.array([c.u_hi for c in spec.controls]), np.array([c.u_lo for c in spec.controls])


def _joint_forces(spec: RobotSpec, model: pin.Model) -> tuple[np.ndarray, np.ndarray]:
    """Largest and least forces of the joints; the least is -u_max unless robot.toml says otherwise."""
    u_max = np.clip(model.effortLimit, 0.0, NO_LIMIT)
    u_lo = -u_max
    for name, values in spec.joint.items():
        i = model.joints[_joint_id(spec, model, name, "joint")].idx_v
        u_lo[i] = values.get("u_lo", u_lo[i])
        if u_lo[i] > u_max[i]:
            what = f"the least force {u_lo[i]:g} of joint '{name}' is above the largest, {u_max[i]:g}; exchange or mend them"
            raise spec.file.error("u_lo", what, f"joint.{name}")
    base = 6 if spec.free_base else 0
    return u_max[base:], u_lo[base:]


def _classify(spec: RobotSpec, model: pin.Model, name: str, joint: pin.JointModel) -> tuple[int, bool, np.ndarray | None]:
    """Kind, whether continuous, and axis in Pinocchio's joint frame (None: free), from the joint's motion subspace."""
    if joint.nv == 6:
        return FREE, False, None
    data = joint.createData()
    joint.calc(data, pin.neutral(model))
    linear, angular = np.split(np.array(data.S), 2)
    if joint.nv != 1 or (np.any(linear) and np.any(angular)):
        what = f"joint '{name}' is a {joint.shortname()}; known are revolute, continuous and prismatic, mend the URDF"
        raise spec.file.error(spec.source, what)
    kind = REVOLUTE if np.any(angular) else PRISMATIC
    return kind, joint.nq == 2, (angular if kind == REVOLUTE else linear).ravel()


def _frame(
    spec: RobotSpec, model: pin.Model, R_turn: np.ndarray, key: str, link: str, table: str
) -> tuple[int, np.ndarray, np.ndarray]:
    """Joint that carries a frame of the URDF, which `key` of `table` names, and R_JF, p_JF in turned joint axes."""
    if not model.existFrame(link):
        known = [frame.name for frame in model.frames]
        raise spec.file.error(key, f"{spec.urdf.name} has no frame '{link}'; {closest(link, known)}", table)
    frame = model.frames[model.getFrameId(link)]
    if frame.parentJoint == 0:
        raise spec.file.error(key, f"frame '{link}' does not move; name one on a moving body", table)
    joint = frame.parentJoint - 1
    R_JP = R_turn[joint].T
    return joint, product(R_JP, frame.placement.rotation), product(R_JP, frame.placement.translation)


def _thrusters(spec: RobotSpec, model: pin.Model) -> tuple[np.ndarray, np.ndarray]:
    """Positions (n, 3) m and axes (n, 3) of the thrusters in base axes."""
    p_BT, axis_B = np.zeros((len(spec.thrusters), 3)), np.zeros((len(spec.thrusters), 3))
    still = np.eye(3)[None].repeat(model.njoints - 1, 0)
    for n, thruster in enumerate(spec.thrusters):
        table = f"thruster.{thruster.name}"
        joint, R, p = _frame(spec, model, still, "link", thruster.link, table)
        if joint != 0:
            raise spec.file.error(
                "link", f"thruster '{thruster.name}' must sit on the base, not on '{thruster.link}'; name the base's link", table
            )
        p_BT[n], axis_B[n] = p + product(R, thruster.position), product(R, thruster.axis)
    return p_BT, axis_B


def _actuation(p_BT: np.ndarray, axis_B: np.ndarray, twist: np.ndarray, nv: int) -> np.ndarray:
    """tau = B u: a thruster is the base wrench [axis, p x axis + twist axis], a joint motor drives its own dof."""
    n = len(twist)
    B = np.zeros((nv, n + nv - 6))
    B[:3, :n] = axis_B.T
    B[3:6, :n] = (np.cross(p_BT, axis_B) + twist[:, None] * axis_B).T
    B[6:, n:] = np.eye(nv - 6)
    return B


def check(spec: RobotSpec, tree: Tree) -> None:
    """Refuse trees that the controller or MuJoCo could not simulate. Raises InputError."""
    if len(tree.control_name) > tree.nv:
        raise spec.file.error("control", f"more controls than the {tree.nv} coordinates of {spec.urdf.name}; delete some")
    if not any(tree.nsub):
        raise spec.file.error("locked", "nothing moves; leave a joint free, or write free_base = true")
    for i, name in enumerate(tree.joint_name):
        q, lo, hi = (a[tree.iq[i]] for a in (tree.q_home, tree.q_lo, tree.q_hi))
        stated = spec.joint.get(name, {})
        limit, of = next(((key, f"joint.{name}") for key in ("q_lo", "q_hi") if key in stated), (spec.source, ""))
        posture = (name, "home") if isinstance(spec.home, dict) and name in spec.home else ("home", "")
        if tree.parent[i] >= i or (tree.parent[i] >= 0 and i >= tree.parent[i] + tree.nsub[tree.parent[i]]):
            raise spec.file.error(spec.source, f"joint '{name}' is not in depth-first order; order the joints of the URDF")
        if tree.kind[i] == FREE and i > 0:
            raise spec.file.error(spec.source, f"joint '{name}' floats inside the tree; only the base may, mend the URDF")
        if tree.mass[i] <= 0.0 or np.linalg.eigvalsh(tree.inertia[i])[0] <= 0.0:
            what = f"the body moved by joint '{name}' has no mass or no inertia; lock the joint or mend the URDF"
            raise spec.file.error(spec.source, what)
        if lo >= hi:
            what = f"joint '{name}': lower limit {lo:g} is not below upper limit {hi:g}; mend q_lo or q_hi of [joint.{name}]"
            raise spec.file.error(limit, what, of)
        if not lo <= q <= hi:
            what = f"joint '{name}': nominal posture {q:g} is outside its limits [{lo:g}, {hi:g}]; choose another, or mend them"
            raise spec.file.error(posture[0], what, posture[1])
