"""models/<robot>/robot.toml: which URDF, what is kept of it, and what the URDF does not say."""

import re
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
    "formula",
    "control",
]
JOINT_KEYS = ["armature", "q_lo", "q_hi", "v_max", "u_max", "u_lo"]
PLANAR_BASE = ["base_x", "base_y", "base_yaw"]  # its joints: m, m, rad; world axes, then about the vertical
FORMULAS = ["pendulum", "unicycle", "bicopter"]  # controller/ocp/ocp_systems.h, sim_harness/sim_formula.cc
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
class Control:
    """An input of a formula (units are the formula's)."""

    name: str
    u_lo: float
    u_hi: float


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
    formula: str  # one of FORMULAS that moves the robot; empty: rigid-body dynamics
    controls: list[Control]  # of the formula, instead of joint motors

    @property
    def source(self) -> str:
        """The key that names the URDF: what to point at where the URDF is wrong."""
        return "urdf" if "urdf" in self.file.data else "example_robot_data"


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
    for key in ("free_base", "planar_base"):
        if not isinstance(data.get(key, False), bool):
            raise file.error(key, f"expected true or false, found {data[key]!r}; write one of the two, without quotes")
    if data["free_base"] and data.get("planar_base", False):
        raise file.error("planar_base", "a base is free or planar, not both; set one of the two to false")
    for joint in file.table("joint"):
        table, values = f"joint.{joint}", file.table(joint, "joint")
        file.check_keys(values, JOINT_KEYS, table=table)
        for key, value in values.items():
            file.numbers(key, value, (), table, 0.0 if key in ("armature", "v_max", "u_max") else -np.inf)
    if not isinstance(data["home"], str | dict):
        raise file.error("home", f"expected a posture, found {data['home']!r}; write the SRDF's name of one, or joint = value")
    for key in ("locked", "home"):
        if not isinstance(data.get(key), str) or key == "locked":
            for joint, value in file.table(key).items():
                file.numbers(joint, value, (), key)
    for frame, link in file.table("frames").items():
        file.words(frame, link, "frames")
        if not re.fullmatch(r"[a-z][a-z0-9]*(_[a-z0-9]+)*", frame):
            raise file.error(frame, "this name cannot be one in code; write it in lower case, words joined by single _", "frames")
    spheres = {link: file.numbers(link, rows, (-1, 4), "spheres") for link, rows in file.table("spheres").items()}
    for link, rows in spheres.items():
        if np.any(rows[:, 3] <= 0.0):
            raise file.error(link, "a sphere's radius (fourth number) must be positive; write it in m", "spheres")
    feet = {}
    for frame, size in file.table("feet").items():
        if frame not in data["frames"]:
            raise file.error(frame, f"a foot stands on a named frame; {closest(frame, list(data['frames']))}", "feet")
        feet[frame] = file.numbers(frame, size if isinstance(size, list) else [size], (-1,), "feet")
        if len(feet[frame]) not in (1, 3) or np.any(feet[frame] <= 0.0):
            what = "a foot is a ball or a box; write its radius, or three half sizes, all positive, in m"
            raise file.error(frame, what, "feet")
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
        armature=float(file.numbers("armature", data.get("armature", 0.0), (), least=0.0)),
        gravity=file.numbers("gravity", data.get("gravity", [0.0, 0.0, -9.81]), (3,)),
        locked=dict(file.table("locked")),
        joint=file.table("joint"),
        frames=data["frames"],
        spheres=spheres,
        feet=feet,
        thrusters=[_thruster(file, name) for name in file.table("thruster")],
        formula=_formula(file),
        controls=[_control(file, name) for name in file.table("control")],
    )


def _formula(file: TomlFile) -> str:
    """The formula that moves the robot, or an empty text."""
    formula = file.words("formula", file.data["formula"]) if "formula" in file.data else ""
    if formula and formula not in FORMULAS:
        raise file.error("formula", f"there is no formula '{formula}'; {closest(formula, FORMULAS)}")
    if formula and (file.data["free_base"] or "thruster" in file.data):
        raise file.error(
            "formula", "a formula has neither a free base nor thrusters; write free_base = false, and its [control.*]"
        )
    if bool(formula) != bool(file.table("control")):
        key = "formula" if formula else "control"
        raise file.error(key, "a formula has controls, and only a formula; write formula = ... and its [control.*], or neither")
    return formula


def _control(file: TomlFile, name: str) -> Control:
    """One [control.<name>]."""
    table, values = f"control.{name}", file.table(name, "control")
    file.check_keys(values, ["u_lo", "u_hi"], required=["u_lo", "u_hi"], table=table)
    u_lo, u_hi = (float(file.numbers(key, values[key], (), table)) for key in ("u_lo", "u_hi"))
    if u_lo >= u_hi:
        raise file.error("u_lo", f"the least control {u_lo:g} is not below the largest {u_hi:g}; exchange or mend them", table)
    return Control(name, u_lo, u_hi)


def _thruster(file: TomlFile, name: str) -> Thruster:
    """One [thruster.<name>]."""
    table, values = f"thruster.{name}", file.table(name, "thruster")
    file.check_keys(values, THRUSTER_KEYS, required=THRUSTER_KEYS, table=table)
    if not file.data["free_base"]:
        raise file.error(name, "a thruster needs a base that is free; write free_base = true, or delete the thruster", "thruster")
    position, axis = (file.numbers(key, values[key], (3,), table) for key in ("position", "axis"))
    if np.linalg.norm(axis) < 1e-6:
        raise file.error(
            "axis", f"the axis of thruster '{name}' must not be zero; write the direction of its force, in link axes", table
        )
    twist, u_lo, u_hi = (float(file.numbers(key, values[key], (), table)) for key in ("twist", "u_lo", "u_hi"))
    if u_lo >= u_hi:
        what = f"thruster '{name}': the least thrust {u_lo:g} N is not below the largest {u_hi:g} N; exchange or mend them"
        raise file.error("u_lo", what, table)
    return Thruster(name, file.words("link", values["link"], table), position, unit(axis), twist, u_lo, u_hi)


def _sources(file: TomlFile) -> tuple[Path, Path | None, list[str]]:
    """URDF, SRDF and mesh search path named by a robot.toml."""
    data = file.data
    for key in SOURCE_KEYS:
        if key in data:
            file.words(key, data[key])
    if "urdf" in data:
        folder = file.path.parent
        urdf = folder / data["urdf"]
        srdf = folder / data["srdf"] if "srdf" in data else None
        package_dirs = [str(folder)]
    else:
        from example_robot_data.robots_loader import ROBOTS, getModelPath

        robot = data["example_robot_data"]
        if "srdf" in data:
            raise file.error("srdf", "the robots of example-robot-data bring their own; delete this key")
        if robot not in ROBOTS:
            raise file.error("example_robot_data", f"example-robot-data has no robot '{robot}'; {closest(robot, list(ROBOTS))}")
        loader = ROBOTS[robot]
        folder = Path(loader.path) / loader.urdf_subpath
        share = Path(getModelPath(str(folder / loader.urdf_filename)))
        urdf = share / folder / loader.urdf_filename
        srdf = share / loader.path / loader.srdf_subpath / loader.srdf_filename if loader.srdf_filename else None
        package_dirs = [str(share), str(share.parent), str(share.parents[1])]
    for kind, path in (("urdf", urdf), ("srdf", srdf)):
        if path is not None and not path.is_file():
            key = kind if kind in data else "example_robot_data"
            raise file.error(key, f"no {kind.upper()} at {path}; correct the path, or install the pinned packages (make setup)")
    return urdf.resolve(), srdf, package_dirs
