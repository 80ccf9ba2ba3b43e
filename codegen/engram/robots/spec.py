"""models/<robot>/robot.toml: which URDF, what is kept of it, and what the URDF does not say."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engram.inputs import InputError, TomlFile, closest
from engram.paths import MODELS
from engram.robots.linear3 import unit

SOURCE_KEYS = ["example_robot_data", "urdf", "srdf"]
KEYS = [
    *SOURCE_KEYS,
    "free_base",
    "planar_base",
    "home",
    "armature",
    "gravity",
    "locked",
    "joint",
    "frames",
    "spheres",
    "feet",
    "thruster",
]
JOINT_KEYS = ["armature", "q_lo", "q_hi", "v_max", "u_max", "u_lo"]
PLANAR_BASE = ["base_x", "base_y", "base_yaw"]  # its joints: m, m, rad; world axes, then about the vertical
THRUSTER_KEYS = ["link", "position", "axis", "twist", "u_lo", "u_hi"]


@dataclass(frozen=True)
class Thruster:
    """A propeller on the free base: a force u along its axis, and a torque twist * u about it (SI units)."""

    name: str
    link: str
    position: np.ndarray  # (3) m, link axes
    axis: np.ndarray  # (3) unit vector, link axes
    twist: float  # N m per N
    u_lo: float  # N
    u_hi: float  # N


@dataclass(frozen=True)
class RobotSpec:
    """A checked robot.toml (SI units)."""

    name: str
    file: TomlFile
    urdf: Path
    srdf: Path | None
    package_dirs: list[str]
    free_base: bool
    planar_base: bool  # the whole robot rides on three more joints: PLANAR_BASE
    home: str | dict[str, float]
    armature: float
    gravity: np.ndarray  # (3) m/s^2, world axes
    locked: dict[str, float]
    joint: dict[str, dict[str, float]]  # per joint: overrides of JOINT_KEYS
    frames: dict[str, str]  # name in code -> frame of the URDF
    spheres: dict[str, np.ndarray]  # link -> (n, 4): centre in link axes, radius
    feet: dict[str, np.ndarray]  # frame -> radius of a ball about its origin (1), or half sizes of a box that stands on it (3)
    thrusters: list[Thruster]


def known_robots(models: Path = MODELS) -> list[str]:
    """Names of the folders of models/ that hold a robot.toml."""
    return sorted(path.parent.name for path in models.glob("*/robot.toml"))


def read_spec(name: str, models: Path = MODELS) -> RobotSpec:
    """Read and check models/<name>/robot.toml. Raises InputError."""
    if name not in known_robots(models):
        raise InputError(
            f"unknown robot '{name}'; {closest(name, known_robots(models))}; a new one needs models/{name}/robot.toml"
        )
    file = TomlFile(models / name / "robot.toml")
    data = file.data
    file.check_keys(data, KEYS, required=["free_base", "home", "frames"])
    if ("urdf" in data) == ("example_robot_data" in data):
        raise file.error("urdf", "give exactly one of 'urdf' (a path) and 'example_robot_data' (a name)")
    if not isinstance(data["free_base"], bool):
        raise file.error("free_base", "expected true or false")
    if not isinstance(data.get("planar_base", False), bool):
        raise file.error("planar_base", "expected true or false")
    if data["free_base"] and data.get("planar_base", False):
        raise file.error("planar_base", "a base is free or planar, not both; set one of the two to false")
    for joint, values in data.get("joint", {}).items():
        table = f"joint.{joint}"
        file.check_keys(values, JOINT_KEYS, table=table)
        for key, value in values.items():
            file.numbers(key, value, (), table)
    for key in ("locked", "home"):
        if isinstance(data.get(key), dict):
            for joint, value in data[key].items():
                file.numbers(joint, value, (), key)
    spheres = {link: file.numbers(link, rows, (-1, 4), "spheres") for link, rows in data.get("spheres", {}).items()}
    for link, rows in spheres.items():
        if np.any(rows[:, 3] <= 0.0):
            raise file.error(link, "a sphere's radius (fourth number) must be positive", "spheres")
    feet = {frame: np.atleast_1d(size) for frame, size in data.get("feet", {}).items()}
    for frame, size in feet.items():
        if frame not in data["frames"]:
            raise file.error(frame, f"a foot stands on a named frame; {closest(frame, list(data['frames']))}", "feet")
        if len(file.numbers(frame, size, (-1,), "feet")) not in (1, 3) or np.any(size <= 0.0):
            raise file.error(frame, "a foot is a ball (its radius) or a box (three half sizes), all positive, in m", "feet")
    urdf, srdf, package_dirs = _sources(file)
    return RobotSpec(
        name=name,
        file=file,
        urdf=urdf,
        srdf=srdf,
        package_dirs=package_dirs,
        free_base=data["free_base"],
        planar_base=data.get("planar_base", False),
        home=data["home"],
        armature=float(file.numbers("armature", data.get("armature", 0.0), ())),
        gravity=file.numbers("gravity", data.get("gravity", [0.0, 0.0, -9.81]), (3,)),
        locked=dict(data.get("locked", {})),
        joint=data.get("joint", {}),
        frames=data["frames"],
        spheres=spheres,
        feet=feet,
        thrusters=[_thruster(file, name, table) for name, table in data.get("thruster", {}).items()],
    )


def _thruster(file: TomlFile, name: str, values: dict) -> Thruster:
    """One [thruster.<name>]."""
    table = f"thruster.{name}"
    file.check_keys(values, THRUSTER_KEYS, required=THRUSTER_KEYS, table=table)
    if not file.data["free_base"]:
        raise file.error(name, "a thruster needs free_base = true")
    position, axis = (file.numbers(key, values[key], (3,), table) for key in ("position", "axis"))
    if np.linalg.norm(axis) < 1e-6:
        raise file.error("axis", f"the axis of thruster '{name}' must not be zero", table)
    twist, u_lo, u_hi = (float(file.numbers(key, values[key], (), table)) for key in ("twist", "u_lo", "u_hi"))
    if u_lo >= u_hi:
        raise file.error("u_lo", f"thruster '{name}': the least thrust {u_lo:g} N is not below the largest {u_hi:g} N", table)
    return Thruster(name, values["link"], position, unit(axis), twist, u_lo, u_hi)


def _sources(file: TomlFile) -> tuple[Path, Path | None, list[str]]:
    """URDF, SRDF and mesh search path named by a robot.toml."""
    data = file.data
    if "urdf" in data:
        folder = file.path.parent
        urdf = folder / data["urdf"]
        srdf = folder / data["srdf"] if "srdf" in data else None
        package_dirs = [str(folder)]
        key = "urdf"
    else:
        from example_robot_data.robots_loader import ROBOTS, getModelPath

        key, robot = "example_robot_data", data["example_robot_data"]
        if robot not in ROBOTS:
            raise file.error(key, f"example-robot-data has no robot '{robot}'; {closest(robot, list(ROBOTS))}")
        loader = ROBOTS[robot]
        folder = Path(loader.path) / loader.urdf_subpath
        share = Path(getModelPath(str(folder / loader.urdf_filename)))
        urdf = share / folder / loader.urdf_filename
        srdf = share / loader.path / loader.srdf_subpath / loader.srdf_filename if loader.srdf_filename else None
        package_dirs = [str(share), str(share.parent), str(share.parents[1])]
    for kind, path in (("URDF", urdf), ("SRDF", srdf)):
        if path is not None and not path.is_file():
            raise file.error(key, f"no {kind} at {path}; correct the path, or install the pinned packages (make setup)")
    return urdf.resolve(), srdf, package_dirs
