"""models/<robot>/<task>/task.toml of a motion (stand, walk, fly), checked: what its controller model reads as constants.

Besides `vector` and `horizon`, which every task has, a motion holds tables of its own: each key of a table [name] becomes the
constant `name_key`, a number or an array. The controller model says by using them which ones it needs.

A task that stays clear of obstacles may say which part of the robot has to: [spheres], link = [[x, y, z, radius], ...] in link
axes, as in robot.toml. They join those of the robot in this task alone, in its problem and in its scene.
"""

import hashlib
import struct
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from engram.paths import MODELS
from engram.robots.spec import read_spec
from engram.robots.tree import Tree, build
from engram.tasks.spec import open_task, task_vector_and_horizon
from engram.tasks.world import Boxes, read_boxes

COMMON = ["kind", "vector", "horizon"]
OPTIONAL = ["spheres"]


@dataclass(frozen=True)
class MotionSpec:
    """A checked motion (SI units)."""

    name: str
    robot: Tree
    vector_name: list[str]
    vector_unit: list[str]
    vector_range: np.ndarray  # (n, 2)
    knots: int
    dt: float
    constants: dict[str, np.ndarray]  # <table>_<key> -> number () or numbers (n)
    boxes: Boxes
    guarded: Tree  # the robot with the task's own spheres; the robot itself without any

    @property
    def digest(self) -> int:
        """64 bits of the SHA-256 of every number of task.h and of the robot's digest."""
        numbers = [self.robot.digest >> 32, self.robot.digest & 0xFFFFFFFF, self.knots, self.dt, *self.vector_range.ravel()]
        for array in (*self.constants.values(), self.boxes.p_WO, self.boxes.R_WO, self.boxes.half):
            numbers += list(array.ravel())
        if self.has_spheres:
            numbers += [self.guarded.digest >> 32, self.guarded.digest & 0xFFFFFFFF]
        sha = hashlib.sha256(" ".join([*self.vector_name, *self.constants]).encode())
        sha.update(struct.pack(f"<{len(numbers)}d", *map(float, numbers)))
        return int.from_bytes(sha.digest()[:8], "big")

    @property
    def has_spheres(self) -> bool:
        """True if the task has spheres of its own."""
        return self.guarded is not self.robot


def load_motion(robot: str, task: str, models: Path = MODELS) -> MotionSpec:
    """Read and check task.toml and world.xml of a motion. Raises InputError."""
    file = open_task(robot, task, models)
    tables = {key: table for key, table in file.data.items() if key not in COMMON + OPTIONAL}
    file.check_keys(file.data, [*COMMON, *OPTIONAL, *tables], required=COMMON)
    constants = {}
    for name, table in tables.items():
        if not isinstance(table, dict):
            raise file.error(name, f"a motion's own numbers stand in tables; put it into one, such as [weights] {name} = ...")
        for key, value in table.items():
            constants[f"{name}_{key}"] = file.numbers(key, value, (-1,) if isinstance(value, list) else ())
    base = read_spec(robot, models)
    tree = build(base)
    spheres = {link: file.numbers(link, rows, (-1, 4), "spheres") for link, rows in file.data.get("spheres", {}).items()}
    for link, rows in spheres.items():
        if np.any(rows[:, 3] <= 0.0):
            raise file.error(link, "a sphere's radius (fourth number) must be positive", "spheres")
    return MotionSpec(
        name=task,
        robot=tree,
        guarded=build(replace(base, file=file, spheres={**base.spheres, **spheres})) if spheres else tree,
        **task_vector_and_horizon(file),
        constants=constants,
        boxes=read_boxes(file.path.parent / "world.xml"),
    )
