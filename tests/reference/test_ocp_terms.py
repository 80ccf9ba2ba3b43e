"""Terms, contacts and their frames beside Crocoddyl's, Pinocchio's and MuJoCo's, and against central differences.

The knot is that of tests/reference/ocp_oracle.cc: ANYmal with its left fore foot as a sole and its right hind foot as a point.
"""

import ctypes
from dataclasses import dataclass
from types import SimpleNamespace

import crocoddyl
import numpy as np
import pinocchio as pin
import pytest
from test_rbd_parity import difference, mujoco_dynamics

from engram.robots.tree import load, q_to_pin

FRAMES = {"local": pin.LOCAL, "world": pin.WORLD, "aligned": pin.LOCAL_WORLD_ALIGNED}  # in the order of enum Axes
KP, KD = 40.0, 12.0
SOLE, POINT, IMPACT = 1, 2, 1 << 31
BOTH = SOLE | POINT

# Same formulas, other order of summation: rounding of some thousand operations, relative to the largest entry.
PARITY = 1e-10
# Central differences with step h: truncation h^2 f'''/6 and rounding eps f / h, both near 1e-10 of the largest entry here,
# times the growth of forces of 1e2 N through 18 coordinates.
STEP = 1e-5
BARRIER_WEIGHT = 3.0
DIFFERENCE = 1e-7

tree = load("anymal")
model = tree.model
nq, nv, nu = tree.nq, tree.nv, tree.nu
nz, nf = 2 * nv + nu, 9
state = crocoddyl.StateMultibody(model)
names = {"LF": "LF_FOOT", "RH": "RH_FOOT", "RF": "RF_FOOT"}
frame = {key: model.getFrameId(name) for key, name in names.items()}
rng = np.random.default_rng(5)


def draw(n: int) -> np.ndarray:
    return rng.uniform(0.5, 1.5, n)


def rotation(a: np.ndarray) -> np.ndarray:
    return pin.exp3(np.asarray(a))


PLACEMENT = pin.SE3(rotation([0.1, -0.2, 0.3]), np.array([0.3, 0.2, 0.05]))
POINT_REF = np.array([-0.3, -0.2, 0.03])
CONTACTS = np.r_[PLACEMENT.translation, POINT_REF, PLACEMENT.rotation.ravel(), np.eye(3).ravel()]


def random_state(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A state near the nominal posture, tilted and moving, and controls near its weight's."""
    local = np.random.default_rng(seed)
    q = np.array(pin.integrate(model, q_to_pin(tree, tree.q_home), 0.2 * local.standard_normal(nv)))
    return np.r_[q, 0.5 * local.standard_normal(nv)], 10.0 * local.standard_normal(nu)


@dataclass
class Knot:
    next: np.ndarray
    cost: float
    force: np.ndarray  # (nf)
    Fx: np.ndarray
    Fu: np.ndarray
    Lz: np.ndarray
    Lzz: np.ndarray
    F: np.ndarray  # (nf, nz)


class Oracle:
    """The compiled knot: terms by name with their parameters."""

    def __init__(self, library):
        self.function = ctypes.CDLL(str(library)).ocp_knot

    def __call__(self, axes: str, terms: dict[str, np.ndarray], phase: int, x, u, derivatives: bool = True) -> Knot:
        terms = {**terms, "contacts": CONTACTS}
        sizes = (ctypes.c_int * len(terms))(*[len(values) for values in terms.values()])
        cost = ctypes.c_double()
        knot = Knot(
            np.zeros(nq + nv), 0.0, np.zeros(nf), *(np.zeros(s) for s in [(2 * nv, 2 * nv), (2 * nv, nu), nz, (nz, nz), (nf, nz)])
        )
        values, x, u = np.concatenate(list(terms.values())), np.ascontiguousarray(x), np.ascontiguousarray(u)
        pointer = lambda a: a.ctypes.data_as(ctypes.c_void_p)  # noqa: E731
        outputs = [pointer(a) for a in (knot.Fx, knot.Fu, knot.Lz, knot.Lzz, knot.F)] if derivatives else [None] * 5
        inputs = [pointer(values), sizes, ctypes.c_uint(phase), pointer(x), pointer(u)]
        outputs = [pointer(knot.next), ctypes.byref(cost), pointer(knot.force), *outputs]
        status = self.function(list(FRAMES).index(axes), ",".join(terms).encode(), *inputs, *outputs)
        assert status == 0, f"the oracle does not know {list(terms)} of sizes {list(sizes)}"
        knot.cost = cost.value
        return knot


@pytest.fixture(scope="module")
def oracle(build) -> Oracle:
    library = build / "tests" / "libocp_oracle.so"
    assert library.is_file(), f"{library} is missing: ninja -C {build} ocp_oracle"
    return Oracle(library)


# ---- the same terms, stated for Crocoddyl ----


def peer_terms() -> dict[str, tuple[np.ndarray, object, object]]:
    """Name -> parameters of ours, residual and activation of Crocoddyl's."""
    residual = crocoddyl
    cases = {}
    for axes, peer in FRAMES.items():
        w, V = draw(6), draw(6)
        cases[f"velocity_{axes}"] = (
            np.r_[w, V],
            residual.ResidualModelFrameVelocity(state, frame["LF"], pin.Motion(V), peer, nu),
            crocoddyl.ActivationModelWeightedQuad(w),
        )
    lo = np.full(6, -0.2)
    cases["velocity_bounds"] = (
        np.r_[np.full(6, BARRIER_WEIGHT), lo, -lo, np.zeros(6)],
        residual.ResidualModelFrameVelocity(state, frame["RH"], pin.Motion.Zero(), pin.LOCAL, nu),
        barrier(lo, -lo),
    )
    w, R = draw(3), rotation([0.3, 0.2, -0.4])
    cases["rotation"] = (
        np.r_[w, R.ravel()],
        residual.ResidualModelFrameRotation(state, frame["LF"], R, nu),
        crocoddyl.ActivationModelWeightedQuad(w),
    )
    w, h = draw(6), draw(6)
    cases["momentum"] = (
        np.r_[w, h],
        residual.ResidualModelCentroidalMomentum(state, h, nu),
        crocoddyl.ActivationModelWeightedQuad(w),
    )
    lo = np.full(2 * nv, -0.15)
    x_ref = np.r_[tree.q_home, np.zeros(nv)]
    cases["state_bounds"] = (
        np.r_[np.full(2 * nv, BARRIER_WEIGHT), lo, -lo, x_ref],
        residual.ResidualModelState(state, np.r_[q_to_pin(tree, tree.q_home), np.zeros(nv)], nu),
        barrier(lo, -lo),
    )
    c = np.array([0.1, 0.2, 0.3])
    cases["com"] = (np.r_[2.0, 2.0, 2.0, c], residual.ResidualModelCoMPosition(state, c, nu), weighted(3, 2.0))
    cases["placement"] = (
        np.r_[2.0, PLACEMENT.translation, PLACEMENT.rotation.ravel()],
        residual.ResidualModelFramePlacement(state, frame["RF"], PLACEMENT, nu),
        weighted(6, 2.0),
    )
    f = 10.0 * draw(6)
    cases["force_sole"] = (
        np.r_[0.5, f],
        residual.ResidualModelContactForce(state, frame["LF"], pin.Force(f), 6, nu),
        weighted(6, 0.5),
    )
    f3 = pin.Force(np.r_[f[:3], np.zeros(3)])
    cases["force_point"] = (
        np.r_[0.5, f[:3]],
        residual.ResidualModelContactForce(state, frame["RH"], f3, 3, nu),
        weighted(3, 0.5),
    )
    size = np.array([0.2, 0.1])
    support = crocoddyl.CoPSupport(np.eye(3), size)
    cases["cop"] = (
        np.r_[BARRIER_WEIGHT, 0.5 * size],
        residual.ResidualModelContactCoPPosition(state, frame["LF"], support, nu),
        barrier(support.lb, support.ub),
    )
    mu = 0.6
    wrench = crocoddyl.WrenchCone(np.eye(3), mu, size, 4, False, 0.0, np.inf)
    cases["wrench_cone"] = (
        np.r_[BARRIER_WEIGHT, mu, 0.5 * size, 1.0, 0.0],
        residual.ResidualModelContactWrenchCone(state, frame["LF"], wrench, nu),
        barrier(wrench.lb, wrench.ub),
    )
    friction = crocoddyl.FrictionCone(np.eye(3), mu, 4, False, 0.0, np.inf)
    cases["friction_cone"] = (
        np.r_[BARRIER_WEIGHT, mu],
        residual.ResidualModelContactFrictionCone(state, frame["RH"], friction, nu),
        barrier(friction.lb, friction.ub),
    )
    return cases


def weighted(n: int, w: float) -> object:
    return crocoddyl.ActivationModelWeightedQuad(np.full(n, w))


def barrier(lo: np.ndarray, hi: np.ndarray) -> object:
    """Weighed by the sum of costs: Crocoddyl's own weighted barrier has w in its Hessian where its gradient has w^2."""
    return crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(lo, hi))


TERMS = peer_terms()
ON_FORCES = ["force_sole", "force_point", "cop", "wrench_cone", "friction_cone"]


def peer_knot(axes: str, phase: int, x: np.ndarray, u: np.ndarray, term: str | None = None):
    """Crocoddyl's data of the knot (dynamics, cost, forces)."""
    actuation = crocoddyl.ActuationModelFloatingBase(state)
    contacts = crocoddyl.ContactModelMultiple(state, nu)
    gains = np.array([KP, KD])
    if phase & SOLE:
        contacts.addContact("0", crocoddyl.ContactModel6D(state, frame["LF"], PLACEMENT, FRAMES[axes], nu, gains))
    if phase & POINT:
        contacts.addContact("1", crocoddyl.ContactModel3D(state, frame["RH"], POINT_REF, FRAMES[axes], nu, gains))
    costs = crocoddyl.CostModelSum(state, nu)
    if term:
        _, residual, activation = TERMS[term]
        weight = BARRIER_WEIGHT if isinstance(activation, crocoddyl.ActivationModelQuadraticBarrier) else 1.0
        costs.addCost(term, crocoddyl.CostModelResidual(state, activation, residual), weight)
    action = crocoddyl.DifferentialActionModelContactFwdDynamics(state, actuation, contacts, costs, 0.0, True)
    data = action.createData()
    action.calc(data, x, u)
    action.calcDiff(data, x, u)
    return data


def close(ours, theirs, tolerance: float = PARITY) -> None:
    ours, theirs = np.asarray(ours, float), np.asarray(theirs, float)
    scale = max(1.0, float(np.abs(theirs).max(initial=0.0)))
    assert float(np.abs(ours - theirs).max(initial=0.0)) <= tolerance * scale


# Crocoddyl's contacts of kind WORLD are those of kind LOCAL_WORLD_ALIGNED: only their axes turn.
@pytest.mark.parametrize("axes", FRAMES)
@pytest.mark.parametrize("phase", [SOLE, POINT, BOTH], ids=["sole", "point", "both"])
def test_contacts_in_all_frames_are_crocoddyls(oracle, axes, phase):
    for seed in range(4):
        x, u = random_state(seed)
        ours, theirs = oracle(axes, {}, phase, x, u), peer_knot(axes, phase, x, u)
        close(ours.next[nq:] - x[nq:], theirs.xout)
        dynamics = np.hstack([theirs.Fx, theirs.Fu])
        close(np.hstack([ours.Fx, ours.Fu])[nv:] - np.eye(nv, nz, nv), dynamics)
        contacts = theirs.multibody.contacts.contacts.todict()
        rows = np.r_[0:6, 6:9] if phase == BOTH else np.r_[0:6] if phase == SOLE else np.r_[6:9]
        contacts = [contacts[key] for key in sorted(contacts)]
        close(ours.force[rows], np.concatenate([c.f.vector[: c.df_dx.shape[0]] for c in contacts]))
        close(ours.F[rows], np.vstack([np.hstack([c.df_dx, c.df_du]) for c in contacts]))


@pytest.mark.parametrize("term", TERMS)
def test_terms_are_crocoddyls(oracle, term):
    """Cost, gradient and Gauss-Newton Hessian; forces in local axes, where Crocoddyl's force residuals live."""
    costs = []
    for seed in range(4):
        x, u = random_state(seed)
        ours, theirs = oracle("local", {term: TERMS[term][0]}, BOTH, x, u), peer_knot("local", BOTH, x, u, term)
        costs.append(theirs.cost)
        close(ours.cost, theirs.cost)
        if term == "velocity_aligned":  # Pinocchio's derivative leaves out that the frame turns: differences decide, below
            continue
        close(ours.Lz, np.r_[theirs.Lx, theirs.Lu])
        close(ours.Lzz, np.block([[theirs.Lxx, theirs.Lxu], [theirs.Lxu.T, theirs.Luu]]))
    assert max(costs) > 0.0


# ---- central differences ----


def moved(x: np.ndarray, u: np.ndarray, i: int, h: float) -> tuple[np.ndarray, np.ndarray]:
    dz = np.zeros(nz)
    dz[i] = h
    return np.r_[pin.integrate(model, x[:nq], dz[:nv]), x[nq:] + dz[nv : 2 * nv]], u + dz[2 * nv :]


def differences(oracle, axes, terms, phase, x, u, of) -> np.ndarray:
    """d of / d z, of: Knot -> array."""
    columns = []
    for i in range(nz):
        high, low = (of(oracle(axes, terms, phase, *moved(x, u, i, h), derivatives=False)) for h in (STEP, -STEP))
        columns.append((np.atleast_1d(high) - np.atleast_1d(low)) / (2 * STEP))
    return np.array(columns).T


def cone_limit(cone: np.ndarray, faces: int) -> np.ndarray:
    """Penalties, bounds and multipliers of every face, and the cone's own parameters, whose weight is not used."""
    return np.r_[draw(faces), np.full(faces, -1e8), np.full(faces, -5.0), 3.0 * draw(faces), cone]


# Terms that Crocoddyl has not.
OWN = {
    "zmp": np.array([2.0, 1.5, 0.4, -0.3, 0.02]),  # weights, reference, height
    "reach": np.array([20.0, 0.15, 1.0, -0.6, 0.4]),  # weight, near, target: far beyond `near`, where the pull is bounded
    "reach_near": np.array([20.0, 2.0, 0.35, -0.2, 0.05]),
    "wrench_limit": cone_limit(TERMS["wrench_cone"][0], 17),
    "friction_limit": cone_limit(TERMS["friction_cone"][0], 5),
}


@pytest.mark.parametrize("term, axes", [(t, "aligned") for t in [*TERMS, *OWN]] + [(t, "local") for t in ON_FORCES])
def test_gradients_are_those_of_differences(oracle, term, axes):
    terms = {term.removesuffix("_near"): OWN[term] if term in OWN else TERMS[term][0]}
    for seed, phase in enumerate([BOTH, IMPACT | SOLE, IMPACT | POINT]):
        x, u = random_state(seed)
        knot = oracle(axes, terms, phase, x, u)
        gradient = differences(oracle, axes, terms, phase, x, u, lambda k: k.cost)[0]
        n = 2 * nv if phase & IMPACT else nz
        close(knot.Lz[:n], gradient[:n], DIFFERENCE)


@pytest.mark.parametrize("term", ["reach", "reach_near"])
def test_a_reaching_frame_pulls_with_a_bounded_force(oracle, term):
    """Pseudo-Huber of the distance, whatever it is; its Hessian is w / s J'J: the placement term's, weakened by the stretch s."""
    x, u = random_state(2)
    w, near, *target = OWN[term]
    knot = oracle("aligned", {"reach": OWN[term]}, BOTH, x, u)
    data = model.createData()
    pin.framesForwardKinematics(model, data, x[:nq])
    J = pin.computeFrameJacobian(model, data, x[:nq], frame["RF"], pin.LOCAL_WORLD_ALIGNED)[:3]
    r = data.oMf[frame["RF"]].translation - target
    s = np.sqrt(1.0 + r @ r / near**2)
    close(knot.cost, w * near**2 * (s - 1.0))
    close(knot.Lz[:nv], w / s * J.T @ r)
    close(knot.Lzz[:nv, :nv], w / s * J.T @ J)
    assert np.linalg.norm(w / s * r) < w * near


@pytest.mark.parametrize("axes", ["local", "aligned"])
@pytest.mark.parametrize("phase", [SOLE, POINT, BOTH, IMPACT | BOTH], ids=["sole", "point", "both", "impact"])
def test_dynamics_and_forces_are_those_of_differences(oracle, axes, phase):
    x, u = random_state(3)
    knot = oracle(axes, {}, phase, x, u)
    n = 2 * nv if phase & IMPACT else nz
    step = differences(oracle, axes, {}, phase, x, u, lambda k: k.next[nq:])
    close(np.hstack([knot.Fx, knot.Fu])[nv:, :n], step[:, :n], DIFFERENCE)
    force = differences(oracle, axes, {}, phase, x, u, lambda k: k.force)
    rows = np.r_[0:6] if phase == SOLE else np.r_[6:9] if phase == POINT else np.r_[0:9]
    close(knot.F[rows, :n], force[rows, :n], DIFFERENCE)


def test_zmp_is_where_the_ground_pushes(oracle):
    """Its value from Newton and Euler, and its Gauss-Newton Hessian from differences of the residual."""
    x, u = random_state(1)
    knot = oracle("aligned", {}, BOTH, x, u)
    data = model.createData()
    pin.rnea(model, data, x[:nq], x[nq:], knot.next[nq:] - x[nq:])
    pin.forwardKinematics(model, data, x[:nq])
    wrench = data.oMi[1].act(data.f[1])  # what the base would have to be pushed with, the ground gives
    height = OWN["zmp"][4]
    moment = wrench.angular - np.cross([0.0, 0.0, height], wrench.linear)
    zmp = np.array([-moment[1], moment[0]]) / wrench.linear[2]
    for i in range(2):
        w = np.zeros(2)
        w[i] = 2.0
        terms = {"zmp": np.r_[w, OWN["zmp"][2:]]}
        knot = oracle("aligned", terms, BOTH, x, u)
        e = zmp[i] - OWN["zmp"][2 + i]
        close(knot.cost, e * e)
        J = differences(oracle, "aligned", terms, BOTH, x, u, lambda k: np.sqrt(k.cost))[0] * np.sign(e)
        close(knot.Lzz, 2.0 * np.outer(J, J), DIFFERENCE)


def pinocchios_contacts(phase: int):
    """Its own constraint solver with the same Baumgarte gains: (x, u) -> acceleration, [(foot, its force (6), local axes)]."""
    contacts, datas, keys = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData(), []
    kinds = pin.ContactType.CONTACT_6D, pin.ContactType.CONTACT_3D
    for bit, kind, key, place in zip((SOLE, POINT), kinds, ("LF", "RH"), (PLACEMENT, pin.SE3(np.eye(3), POINT_REF))):
        if not phase & bit:
            continue
        at = model.frames[frame[key]]
        contact = pin.RigidConstraintModel(kind, model, at.parentJoint, at.placement, 0, place, pin.LOCAL)
        gains = contact.m_baumgarte_parameters
        gains.Kp, gains.Kd = KP, KD
        contacts.append(contact)
        datas.append(contact.createData())
        keys.append(key)
    data, settings = model.createData(), pin.ProximalSettings(1e-14, 1e-12, 100)
    pin.initConstraintDynamics(model, data, contacts, datas)

    def solve(x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, list[tuple[str, np.ndarray]]]:
        a = pin.constraintDynamics(model, data, x[:nq], x[nq:], np.r_[np.zeros(6), u], contacts, datas, settings)
        return a.copy(), [(key, d.contact_force.vector.copy()) for key, d in zip(keys, datas)]

    return solve


def zmp_of(x: np.ndarray, forces: list[tuple[str, np.ndarray]], height: float) -> tuple[np.ndarray, float]:
    """Where on the plane z = height the horizontal moment of the contact forces vanishes, (2) m, and how much they lift, N."""
    data, moment, total = model.createData(), np.zeros(3), np.zeros(3)
    pin.framesForwardKinematics(model, data, x[:nq])
    for key, local in forces:
        at = data.oMf[frame[key]]
        f, n = at.rotation @ local[:3], at.rotation @ local[3:]
        moment += np.cross(at.translation - [0.0, 0.0, height], f) + n
        total += f
    return np.array([-moment[1], moment[0]]) / total[2], total[2]


@pytest.mark.parametrize("phase", [SOLE, POINT, BOTH], ids=["sole", "point", "both"])
def test_zmp_is_that_of_pinocchios_forces(oracle, phase):
    """Cost, gradient and Gauss-Newton Hessian from forces that are not ours; slopes by differences of these."""
    w, ref, height = np.split(OWN["zmp"], [2, 4])
    solve, tried = pinocchios_contacts(phase), 0
    for seed in range(16):
        x, u = random_state(seed)
        zmp, lift = zmp_of(x, solve(x, u)[1], height[0])
        if lift < 100.0:  # hardly stands: the point is far off, and differences with it
            continue
        tried += 1
        e = zmp - ref
        knot = oracle("aligned", {"zmp": OWN["zmp"]}, phase, x, u)
        close(knot.cost, 0.5 * e @ (w * e))
        sides = [[moved(x, u, i, h) for h in (STEP, -STEP)] for i in range(nz)]
        points = [[zmp_of(y, solve(y, v)[1], height[0])[0] for y, v in pair] for pair in sides]
        J = np.array([(high - low) / (2 * STEP) for high, low in points]).T
        close(knot.Lz, J.T @ (w * e), DIFFERENCE)
        close(knot.Lzz, J.T @ (w[:, None] * J), DIFFERENCE)
    assert tried > 1


# ---- forward dynamics with contacts ----


def test_pinocchios_constrained_dynamics(oracle):
    """Accelerations and forces of Pinocchio's proximal constraint solver with the same Baumgarte gains."""
    solve = pinocchios_contacts(BOTH)
    for seed in range(4):
        x, u = random_state(seed)
        knot, (a, forces) = oracle("local", {}, BOTH, x, u), solve(x, u)
        close(knot.next[nq:] - x[nq:], a)
        close(knot.force, np.r_[forces[0][1], forces[1][1][:3]])


def test_mujocos_smooth_terms_balance_our_forces(oracle, build, root):
    """M a + bias of MuJoCo is tau + J' lambda with our accelerations and contact forces."""

    states = [random_state(seed) for seed in range(8)]
    knots = [oracle("aligned", {}, BOTH, x, u) for x, u in states]
    q, v = np.array([x[:nq] for x, _ in states]), np.array([x[nq:] for x, _ in states])
    a = np.array([knot.next[nq:] for knot in knots]) - v
    case = SimpleNamespace(tree=tree, q=q, v=v, a=a, tau=np.zeros_like(v))
    theirs = mujoco_dynamics(build, case, root / "tables" / "anymal" / "robot.xml")["rnea"]
    data = model.createData()
    for i, ((x, u), knot) in enumerate(zip(states, knots)):
        J = [pin.computeFrameJacobian(model, data, x[:nq], frame[key], pin.LOCAL_WORLD_ALIGNED) for key in ("LF", "RH")]
        ours = np.r_[np.zeros(6), u] + J[0].T @ knot.force[:6] + J[1][:3].T @ knot.force[6:]
        assert difference(ours[None], theirs[i : i + 1]) <= PARITY
