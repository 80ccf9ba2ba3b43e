"""What each motion is demonstrated by, as a script for engram-plant (formats: sim_harness/sim_scenario.h, sim_series.h).

The same seed gives the same bytes. A script's parts are its episodes, or its way points.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from engram.inputs import InputError, closest
from engram.tasks.motion import MotionSpec
from engram_sim.series import HELD_OUT, numbers

YAWS = (0.0, 90.0, 180.0, 270.0)  # deg
PUSH_TIME = 0.1  # s, a push lasts
STAY = 4.0  # s, a target beside the pole stays


@dataclass
class Script:
    """A run of the plant: `kind` is its option, --series or --scenario."""

    kind: str
    lines: list[str]
    parts: int
    site: str  # of the robot, whose way the video draws
    plant_options: list[str] = field(default_factory=list)

    def write(self, path: Path) -> None:
        path.write_text("\n".join(self.lines) + "\n", encoding="utf-8")


def header(spec: MotionSpec, kind: str, seed: int) -> list[str]:
    """First lines of a script."""
    digests = [f"robot_digest 0x{spec.robot.digest:016x}", f"task_digest 0x{spec.digest:016x}"]
    return [f"engram_{kind} 1", f"# seed {seed}: {spec.robot.name} {spec.name}", *digests]


def home(spec: MotionSpec, yaw: float) -> str:
    """The nominal posture, turned about the vertical by `yaw` (deg)."""
    q, half = spec.robot.q_home.copy(), np.radians(yaw) / 2.0
    q[3:7] = [0.0, 0.0, np.sin(half), np.cos(half)]
    return f"state {numbers(q)}"


def push(t: float, body: str, impulse: float, direction: float) -> str:
    """A push of `impulse` (N s) at t (s) along `direction` (deg about the vertical, world axes)."""
    angle = np.radians(direction)
    return f"push {t!r} {PUSH_TIME!r} {body} {numbers(impulse / PUSH_TIME * np.array([np.cos(angle), np.sin(angle), 0.0]))}"


def talos_stand(spec: MotionSpec, seed: int, parts: int | None) -> Script:
    """Standing for a minute, squats, and pushes on the torso from four sides at four headings."""
    rng = np.random.default_rng([HELD_OUT, seed])
    upright = "upright 0.6 0.7"
    episodes = [
        ["episode stand 60", home(spec, 0.0), "task 0 0 0 0", upright, "drift 5 0.001"],
        ["episode squat 20", home(spec, 0.0), "task 0 0 0.2 0.5", upright, "height 2 0.01  0 0.2 0.5"],
    ]
    for yaw in YAWS:
        for side, impulse, about in (("+x", 20.0, 0.0), ("-x", 24.0, 180.0), ("+y", 28.0, 90.0), ("-y", 28.0, 270.0)):
            t = round(float(rng.uniform(1.5, 2.0)), 3)
            name = f"push_{side}_{impulse:.0f}Ns_at_{yaw:.0f}deg"
            blow = push(t, "torso_2_joint", impulse, about + yaw)
            episodes.append([f"episode {name} 6", home(spec, yaw), "task 0 0 0 0", blow, upright])
    return scenario(spec, seed, episodes[:parts], "torso")


def talos_walk(spec: MotionSpec, seed: int, parts: int | None) -> Script:
    """Walks of some 20 steps at three commands each, with turns and side steps, then a stop; the last two walks are pushed."""
    rng = np.random.default_rng([HELD_OUT, seed])
    episodes = []
    for n in range(5):
        commands = [f"task {t} {numbers(rng.uniform([-0.1, -0.06, -0.25], [0.4, 0.06, 0.25]))} 1" for t in (0.5, 5.0, 9.5)]
        blows = [
            push(round(float(t), 3), "torso_2_joint", 10.0, float(rng.uniform(0.0, 360.0)))
            for t in rng.uniform([3, 7, 11], [5, 9, 13])
        ]
        name, blows = (f"walk_{n + 1}", []) if n < 3 else (f"walk_{n + 1}_pushed_10Ns", blows)
        stand, stop = "task 0 0 0 0 0", "task 13.9 0 0 0 0"
        episodes.append([f"episode {name} 17.5", home(spec, YAWS[n % 4]), stand, *commands, stop, *blows, "upright 0.6 0.7"])
    return scenario(spec, seed, episodes[:parts], "torso", ["--log-every", "10"])


def talos_pole(spec: MotionSpec, seed: int, parts: int | None) -> Script:
    """The right hand goes to points beside the pole: to one, and then to another on the other side."""
    rng = np.random.default_rng([HELD_OUT, seed])
    radius, episodes = float(spec.constants["success_position"]), []
    for n in range(parts or 8):
        points = [beside_pole(spec, rng, side) for side in ((-1.0, 1.0), (-1.0, 1.0, -1.0))[n % 2]]
        times = [0.0, 3.0, 7.0][: len(points)]
        tasks = [f"task {t} {numbers(np.array(p))}" for t, p in zip(times, points)]
        end = times[-1] + 4.0
        asked = [f"reach {end - 0.3} {radius} right_gripper {numbers(np.array(points[-1]))}", "clear pole", "upright 0.6 0.7"]
        episodes.append([f"episode around_{n + 1} {end}", home(spec, 0.0), *tasks, *asked])
    return scenario(spec, seed, episodes, "right_gripper")


def talos_pole_whole(spec: MotionSpec, seed: int, seconds: float) -> Script:
    """The same in one episode of `seconds`: every few seconds a new point, mostly on the other side."""
    rng = np.random.default_rng([HELD_OUT, seed])
    radius, side = float(spec.constants["success_position"]), -1.0
    times, points = [0.0], [beside_pole(spec, rng, side)]
    while times[-1] + 2.0 * STAY <= seconds:
        side = -side if rng.uniform() < 0.8 else side
        times.append(times[-1] + STAY)
        points.append(beside_pole(spec, rng, side))
    tasks = [f"task {t} {numbers(np.array(p))}" for t, p in zip(times, points)]
    ends = [*times[1:], seconds]
    reaches = [f"reach {end - 0.3:.3f} {radius} right_gripper {numbers(np.array(p))}" for end, p in zip(ends, points)]
    asked = [*reaches, "clear pole", "upright 0.6 0.7"]
    return scenario(spec, seed, [[f"episode whole {seconds}", home(spec, 0.0), *tasks, *asked]], "right_gripper")


def beside_pole(spec: MotionSpec, rng: np.random.Generator, side: float) -> list[float]:
    """A random point (m, world) left (side 1) or right (-1) of the pole."""
    return [rng.uniform(0.32, 0.45), spec.boxes.p_WO[0][1] + side * rng.uniform(0.16, 0.3), rng.uniform(0.95, 1.2)]


def anymal_trot(spec: MotionSpec, seed: int, parts: int | None) -> Script:
    """Standing, trotting in place and forward for a minute, and lateral pushes at random phases of the gait."""
    rng = np.random.default_rng([HELD_OUT, seed])
    upright, settle = "upright 0.25 0.6", 3.0
    episodes = [
        ["episode stand 10", home(spec, 0.0), "task 0 0 0 0 0", upright, "drift 5 0.001"],
        ["episode trot_in_place 20", home(spec, 0.0), "task 0 0 0 0 1", upright, f"pace {settle} 0.03  0 0 0"],
    ]
    for speed in (0.3, 0.6):
        name = f"trot_{speed:.1f}"
        bound = f"pace {settle} 0.05  {speed} 0 0"
        episodes.append([f"episode {name} 60", home(spec, 0.0), f"task 0 {speed} 0 0 1", upright, bound])
    for n, impulse in enumerate([15.0] * 8):
        yaw, side = YAWS[n % 4], (90.0, 270.0)[n // 4 % 2]
        t = round(float(rng.uniform(3.0, 3.5)), 3)  # a random phase of the gait
        name = f"push_{'+y' if side == 90.0 else '-y'}_{impulse:.0f}Ns_at_{yaw:.0f}deg"
        blow = push(t, "root_joint", impulse, side + yaw)
        episodes.append([f"episode {name} 7", home(spec, yaw), "task 0 0.3 0 0 1", blow, upright])
    return scenario(spec, seed, episodes[:parts], "base")


def scenario(spec: MotionSpec, seed: int, episodes: list[list[str]], site: str, options: list[str] | None = None) -> Script:
    """A script of episodes."""
    lines = header(spec, "scenario", seed) + [line for lines in episodes for line in lines]
    return Script("scenario", lines, len(episodes), site, options or [])


def hector_fly(spec: MotionSpec, seed: int, parts: int | None) -> Script:
    """Random way points with random headings, in gusts of wind; integrated by CVODES."""
    rng = np.random.default_rng([HELD_OUT, seed])
    points = parts or 50
    success = {key: float(spec.constants[f"success_{key}"]) for key in ("position", "rotation", "time")}
    lines = header(spec, "series", seed)
    lines += [
        "hand base",
        f"window {success['time']!r}",
        "hold 0.3",
        f"tolerance {success['position']!r} {success['rotation']!r}",
    ]
    lines.append(f"episode {numbers([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])}")
    for _ in range(points):
        p, yaw = rng.uniform([-2.0, -2.0, 0.5], [2.0, 2.0, 3.0]), rng.uniform(-3.0, 3.0)
        pose = [*p, 0.0, 0.0, np.sin(yaw / 2.0), np.cos(yaw / 2.0)]
        lines.append(f"jump {numbers(pose)}  {numbers([*p, yaw])}")
    return Script("series", lines, points, "base", [*wind(3.0), "--seed", str(seed)])


def wind(force: float) -> list[str]:
    """The smooth plant, with gusts of at most `force` (N) about once a second."""
    return ["--engine", "cvode", "--gust-period", "1", "--gust-force", repr(force), "--gust-duration", "1"]


def goals(spec: MotionSpec, seed: int, site: str) -> list[str]:
    """First lines of a series of goals, with the task's own [success]."""
    success = {key: float(spec.constants[f"success_{key}"]) for key in ("position", "rotation", "time", "hold")}
    lines = [f"hand {site}", f"window {success['time']!r}", f"hold {success['hold']!r}"]
    return [*header(spec, "series", seed), *lines, f"tolerance {success['position']!r} {success['rotation']!r}"]


def goal(p: list[float], axis: int, angle: float, task: list[float]) -> str:
    """A goal at p (m), turned by `angle` (rad) about an axis of the world (0 to 2)."""
    quaternion = [np.sin(angle / 2.0) * float(axis == i) for i in range(3)] + [np.cos(angle / 2.0)]
    return f"jump {numbers(np.array([*p, *quaternion]))}  {numbers(np.array(task))}"


def pendulum_swing(spec: MotionSpec, seed: int, parts: int | None) -> Script:
    """Swing-ups from random angles at rest, each held for some seconds; in gusts of wind."""
    rng = np.random.default_rng([HELD_OUT, seed])
    lines, swings = goals(spec, seed, "tip"), parts or 20
    for _ in range(swings):
        lines += [f"episode {numbers(np.array([rng.uniform(-np.pi, np.pi)]))}", goal([0.0, 0.0, 1.0], 1, 0.0, [0.0])]
    return Script("series", lines, swings, "tip", [*wind(0.5), "--seed", str(seed)])


def unicycle_park(spec: MotionSpec, seed: int, parts: int | None) -> Script:
    """Random way points with random headings, one after the other."""
    rng = np.random.default_rng([HELD_OUT, seed])
    lines, points = [*goals(spec, seed, "base"), "episode 0 0 0"], parts or 50
    for _ in range(points):
        x, y, yaw = rng.uniform([-2.0, -2.0, -3.0], [2.0, 2.0, 3.0])
        lines.append(goal([x, y, 0.0], 2, yaw, [x, y, yaw]))
    return Script("series", lines, points, "base", ["--engine", "cvode"])


def bicopter_fly(spec: MotionSpec, seed: int, parts: int | None) -> Script:
    """Random way points in the plane, in gusts of wind."""
    rng = np.random.default_rng([HELD_OUT, seed])
    lines, points = [*goals(spec, seed, "base"), "episode 0 1 0"], parts or 50
    for _ in range(points):
        x, z = rng.uniform([-3.0, 0.5], [3.0, 3.5])
        lines.append(goal([x, 0.0, z], 1, 0.0, [x, z]))
    return Script("series", lines, points, "base", [*wind(5.0), "--seed", str(seed)])


MOTIONS: dict[str, Callable[[MotionSpec, int, int | None], Script]] = {
    "talos_stand": talos_stand,
    "talos_walk": talos_walk,
    "talos_pole": talos_pole,
    "anymal_trot": anymal_trot,
    "hector_fly": hector_fly,
    "pendulum_swing": pendulum_swing,
    "unicycle_park": unicycle_park,
    "bicopter_fly": bicopter_fly,
}


WHOLE: dict[str, Callable[[MotionSpec, int, float], Script]] = {"talos_pole": talos_pole_whole}  # in one episode of any length


def script(spec: MotionSpec, seed: int, parts: int | None, seconds: float | None = None) -> Script:
    """The script of a motion: its first `parts` parts, or all; or one episode of `seconds`. Raises InputError."""
    name = f"{spec.robot.name}_{spec.name}"
    if seconds is not None:
        if name not in WHOLE or not seconds >= 2.0 * STAY:
            raise InputError(f"--seconds: at least {2.0 * STAY:.0f}, of {', '.join(WHOLE)}; leave it out for all others")
        return WHOLE[name](spec, seed, seconds)
    if name not in MOTIONS:
        raise InputError(f"no demo is written for '{name}'; {closest(name, list(MOTIONS))}; write one in {Path(__file__).name}")
    return MOTIONS[name](spec, seed, parts)
