"""Drawing reach targets: a region by its share, a pose in it, and proof by inverse kinematics that the robot can be there."""

from functools import cache

import numpy as np
import pinocchio as pin

from engram.inputs import InputError
from engram.robots.linear3 import product
from engram.tasks.spec import Region, TaskSpec, load_task

STARTS = 24  # random starts of the inverse kinematics before a pose counts as out of reach
STEPS = 60  # Gauss-Newton steps per start
DAMPING = 1e-3  # of the Gauss-Newton step
REACHED = 1e-6  # m and rad
REDRAWS = 1000  # poses tried in a region before the region counts as unreachable


class ReachSampler:
    """Draws reachable targets of a reach task; the same generator state gives the same targets."""

    def __init__(self, spec: TaskSpec):
        self.spec = spec
        self.tree = spec.robot
        if self.tree.kind.min() == 0 or self.tree.continuous.any():
            raise InputError(f"the reach sampler knows fixed bases and limited joints only, '{self.tree.name}' has others")
        self.model, self.data = self.tree.model, self.tree.model.createData()
        frame = self.tree.frame_name.index(spec.frame)
        self.joint = int(self.tree.frame_joint[frame]) + 1
        R_turn = self.tree.R_turn[self.joint - 1]
        self.placement = pin.SE3(R_turn @ self.tree.R_JF[frame], R_turn @ self.tree.p_JF[frame])
        self.lo, self.hi = (q + s * spec.margins["joint"] for q, s in ((self.tree.q_lo, 1), (self.tree.q_hi, -1)))

    def sample(self, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A reachable target: position (3) m, rotation (3, 3), and a posture (nq) that reaches it clear of all boxes."""
        regions = self.spec.regions
        region = regions[rng.choice(len(regions), p=[r.share for r in regions])]
        for _ in range(REDRAWS):
            p_WT, R_WT = draw_pose(region, rng)
            q = self.solve(p_WT, R_WT, rng)
            if q is not None:
                return p_WT, R_WT, q
        raise InputError(
            f"region '{region.name}' of task '{self.spec.name}': no pose is in reach; move it or ask for less clearance"
        )

    def solve(self, p_WT: np.ndarray, R_WT: np.ndarray, rng: np.random.Generator) -> np.ndarray | None:
        """A posture within the limits that puts the frame at the pose with the asked clearance, or None."""
        for _ in range(STARTS):
            q = self.descend(rng.uniform(self.lo, self.hi), p_WT, R_WT)
            if q is not None and self.clearance(q) >= self.spec.clearance:
                return q
        return None

    def descend(self, q: np.ndarray, p_WT: np.ndarray, R_WT: np.ndarray) -> np.ndarray | None:
        """The posture within the limits that damped Gauss-Newton steps from `q` (nq) lead to, or None if it misses the pose."""
        target = pin.SE3(R_WT, p_WT)
        for _ in range(STEPS):
            pin.computeJointJacobians(self.model, self.data, q)
            error = self.data.oMi[self.joint].act(self.placement).actInv(target)
            residual = pin.log6(error).vector
            if np.abs(residual).max() < REACHED:
                return q
            J = self.placement.toActionMatrixInverse() @ pin.getJointJacobian(self.model, self.data, self.joint, pin.LOCAL)
            J = pin.Jlog6(error.inverse()) @ J
            q = np.clip(q + J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(6), residual), self.lo, self.hi)
        return None

    def clearance(self, q: np.ndarray) -> float:
        """Smallest distance between a sphere and a box (m), negative in contact."""
        pin.forwardKinematics(self.model, self.data, q)
        placements = [self.data.oMi[joint + 1] for joint in self.tree.sphere_joint.tolist()]
        turns = self.tree.R_turn[self.tree.sphere_joint]
        p_WS = np.array([M.act(R @ p) for M, R, p in zip(placements, turns, self.tree.p_JS)])
        return float((self.spec.boxes.distance(p_WS) - self.tree.sphere_radius[:, None]).min())


def draw_pose(region: Region, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A pose of the region: p_WT (3) m and R_WT (3, 3), reachable or not."""
    p_WT, R_WT = rng.uniform(region.lo, region.hi), region.R_WT
    if region.mirror and rng.random() < 0.5:  # in the plane y = 0; the hand is symmetric, so its x stays right-handed
        mirror = np.array([1.0, -1.0, 1.0])
        p_WT, y, z = mirror * p_WT, -mirror * R_WT[:, 1], mirror * R_WT[:, 2]
        R_WT = np.column_stack([np.cross(y, z), y, z])
    if region.flip and rng.random() < 0.5:
        R_WT = R_WT * [-1.0, -1.0, 1.0]
    return p_WT, product(R_WT, pin.exp3(region.tilt * rng.standard_normal(3)))


def task_vector(p_WT: np.ndarray, R_WT: np.ndarray) -> np.ndarray:
    """The task vector (7): p_WT m, unit quaternion x y z w with w >= 0."""
    quaternion = pin.Quaternion(R_WT).normalized().coeffs()
    return np.concatenate([p_WT, quaternion if quaternion[3] >= 0.0 else -quaternion])


@cache
def sampler(robot: str = "panda", task: str = "reach") -> ReachSampler:
    """The sampler of a task, loaded once."""
    return ReachSampler(load_task(robot, task))


def sample_target(rng: np.random.Generator, robot: str = "panda", task: str = "reach") -> tuple[np.ndarray, np.ndarray]:
    """A random reachable target: p_WT (3) m and R_WT (3, 3)."""
    p_WT, R_WT, _ = sampler(robot, task).sample(rng)
    return p_WT, R_WT
