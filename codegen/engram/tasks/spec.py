"""models/<robot>/<task>/task.toml of a reach task, checked, with the boxes of its world.xml."""

import hashlib
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from engram.inputs import InputError, TomlFile, closest
from engram.paths import MODELS
from engram.robots.linear3 import unit
from engram.robots.spec import known_robots, read_spec
from engram.robots.tree import Tree, build
from engram.tasks.world import Boxes, read_boxes

KINDS = ["reach", "motion"]  # this file; engram.tasks.motion
MAX_BOXES = 8
WEIGHTS = ["position", "rotation", "posture", "velocity", "torque", "collision", "joint_limit", "velocity_limit", "torque_limit"]
TERMINAL = [name for name in WEIGHTS if not name.startswith("torque") and name != "velocity_limit"]
SECTIONS = {
    "horizon": ["knots", "dt"],
    "margins": ["collision", "joint", "velocity"],
    "arrival": ["time", "factor"],
    "success": ["position", "rotation", "time"],
}
REGION = ["name", "share", "lo", "hi", "z", "y", "tilt", "flip", "mirror"]


@dataclass(frozen=True)
class Region:
    """Part of the target distribution (m, rad, world axes)."""

    name: str
    share: float
    lo: np.ndarray  # (3)
    hi: np.ndarray  # (3)
    R_WT: np.ndarray  # (3, 3) nominal axes of the target
    tilt: float  # standard deviation of a small rotation about each axis
    flip: bool  # half of them turned by pi about the approach
    mirror: bool  # half of them mirrored to -y


@dataclass(frozen=True)
class TaskSpec:
    """A checked reach task (SI units)."""

    name: str
    robot: Tree
    frame: str
    vector_name: list[str]
    vector_unit: list[str]
    vector_range: np.ndarray  # (n, 2)
    knots: int
    dt: float
    running: dict[str, float]
    terminal: dict[str, float]
    margins: dict[str, float]
    arrival: dict[str, float]
    success: dict[str, float]
    memory: dict[str, Any]  # read by the commands that build the memory
    clearance: float  # m, asked of the final posture of a sampled target
    regions: list[Region]
    boxes: Boxes

    @property
    def digest(self) -> int:
        """64 bits of the SHA-256 of every number of task.h and of the robot's digest."""
        numbers = [self.robot.digest >> 32, self.robot.digest & 0xFFFFFFFF, self.knots, self.dt, *self.vector_range.ravel()]
        for section in (self.running, self.terminal, self.margins, self.arrival, self.success):
            numbers += list(section.values())
        for array in (self.boxes.p_WO, self.boxes.R_WO, self.boxes.half):
            numbers += list(array.ravel())
        sha = hashlib.sha256(self.frame.encode())
        sha.update(struct.pack(f"<{len(numbers)}d", *map(float, numbers)))
        return int.from_bytes(sha.digest()[:8], "big")


def known_tasks(robot: str, models: Path = MODELS) -> list[str]:
    """Names of the folders of models/<robot>/ that hold a task.toml."""
    return sorted(path.parent.name for path in (models / robot).glob("*/task.toml"))


def open_task(robot: str, task: str, models: Path = MODELS) -> TomlFile:
    """models/<robot>/<task>/task.toml with one of the known kinds. Raises InputError."""
    if robot not in known_robots(models):
        raise InputError(f"unknown robot '{robot}'; {closest(robot, known_robots(models))}")
    if task not in known_tasks(robot, models):
        known = closest(task, known_tasks(robot, models))
        raise InputError(f"unknown task '{task}' of robot '{robot}'; {known}; a new one needs models/{robot}/{task}/task.toml")
    file = TomlFile(models / robot / task / "task.toml")
    if file.data.get("kind") not in KINDS:
        raise file.error("kind", f"must be one of {', '.join(KINDS)}")
    return file


def load_task(robot: str, task: str, models: Path = MODELS) -> TaskSpec:
    """Read and check task.toml and world.xml of a reach task. Raises InputError."""
    file = open_task(robot, task, models)
    data = file.data
    if data["kind"] != "reach":
        raise file.error("kind", f"'{data['kind']}': only reach tasks are sampled, solved and remembered")
    required = ["kind", "frame", "vector", "weights", *SECTIONS, "memory", "targets"]
    file.check_keys(data, required, required)
    sections = {key: _section(file, data[key], names) for key, names in SECTIONS.items() if key != "horizon"}
    file.check_keys(data["weights"], ["running", "terminal"], ["running", "terminal"])
    tree = build(read_spec(robot, models))
    if data["frame"] not in tree.frame_name:
        raise file.error("frame", f"robot '{robot}' has no frame '{data['frame']}'; {closest(data['frame'], tree.frame_name)}")
    boxes = read_boxes(file.path.parent / "world.xml")
    if len(boxes.name) > MAX_BOXES:
        raise InputError(f"{file.path.parent / 'world.xml'}: {len(boxes.name)} boxes, at most {MAX_BOXES}; merge some")
    targets = data["targets"]
    file.check_keys(targets, ["clearance", "region"], ["clearance", "region"])
    regions = [_region(file, table) for table in targets["region"]]
    if abs(sum(region.share for region in regions) - 1.0) > 1e-9:
        raise file.error("share", f"the shares of the regions must sum to 1, they sum to {sum(r.share for r in regions):g}")
    return TaskSpec(
        name=task,
        robot=tree,
        frame=data["frame"],
        **task_vector_and_horizon(file),
        running=_section(file, data["weights"]["running"], WEIGHTS),
        terminal=_section(file, data["weights"]["terminal"], TERMINAL),
        margins=sections["margins"],
        arrival=sections["arrival"],
        success=sections["success"],
        memory=data["memory"],
        clearance=float(file.numbers("clearance", targets["clearance"], ())),
        regions=regions,
        boxes=boxes,
    )


def task_vector_and_horizon(file: TomlFile) -> dict[str, Any]:
    """What tasks of all kinds have: vector_name, vector_unit, vector_range, knots, dt."""
    rows, horizon = file.data["vector"], _section(file, file.data["horizon"], SECTIONS["horizon"])
    for row in rows:
        if len(row) != 4 or not row[2] < row[3]:
            raise file.error("vector", f"expected [name, unit, lowest, highest] with lowest < highest, found {row}")
    if horizon["knots"] < 1 or horizon["knots"] != int(horizon["knots"]):
        raise file.error("knots", "expected a positive whole number")
    if horizon["dt"] <= 0.0:
        raise file.error("dt", "expected a positive time in s")
    return {
        "vector_name": [row[0] for row in rows],
        "vector_unit": [row[1] for row in rows],
        "vector_range": file.numbers("vector", [row[2:] for row in rows], (-1, 2)),
        "knots": int(horizon["knots"]),
        "dt": horizon["dt"],
    }


def _section(file: TomlFile, table: dict[str, Any], names: list[str]) -> dict[str, float]:
    """A table whose keys are exactly `names` and whose values are non-negative numbers."""
    file.check_keys(table, names, names)
    for name in names:
        if file.numbers(name, table[name], ()) < 0.0:
            raise file.error(name, "must not be negative")
    return {name: float(table[name]) for name in names}


def _region(file: TomlFile, table: dict[str, Any]) -> Region:
    """One [[targets.region]]."""
    file.check_keys(table, REGION, REGION[:7])
    lo, hi, z, y = (file.numbers(key, table[key], (3,)) for key in ("lo", "hi", "z", "y"))
    if np.any(lo > hi):
        raise file.error("lo", f"region '{table['name']}': a lower corner lies above the upper one")
    x = np.cross(y, z)
    if np.abs(x).max() < 1e-6:
        raise file.error("y", f"region '{table['name']}': y and z must not be parallel")
    x, z = unit(x), unit(z)
    return Region(
        name=table["name"],
        share=float(file.numbers("share", table["share"], ())),
        lo=lo,
        hi=hi,
        R_WT=np.column_stack([x, np.cross(z, x), z]),
        tilt=float(file.numbers("tilt", table["tilt"], ())),
        flip=bool(table.get("flip", False)),
        mirror=bool(table.get("mirror", False)),
    )
