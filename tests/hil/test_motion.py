"""Plant and deployed controller of robots that fly, and of formulas: a scenario, way points, and every mismatch told."""

from __future__ import annotations

import json
import signal
import subprocess
from pathlib import Path

import pytest
from conftest import Arena

from engram.tasks.motion import load_motion
from engram_sim.pair import program, scene
from engram_sim.scenarios import header, script

SCENE = scene("hector", "fly")
BAD_INPUT, NO_CONTROLLER = 2, 4
HOVER = ["episode hover 2", "state 0 0 1 0 0 0 1", "task 0 0 0 1 0", "push 0.5 0.1 root_joint 2 0 0", "upright 0.5 0.7"]


@pytest.fixture(scope="module")
def spec():
    return load_motion("hector", "fly")


def controller(arena: Arena, *options: str) -> subprocess.Popen:
    """The deployed controller, serving; ended by the arena."""
    call = [str(program("engram-controller")), "--lcm-url", arena.url, *options]
    child = subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True)
    arena.children.append(child)
    assert "ready" in child.stdout.readline()
    return child


def said(child: subprocess.Popen) -> str:
    child.send_signal(signal.SIGINT)
    return child.communicate(timeout=10)[0]


def write(arena: Arena, lines: list[str]) -> Path:
    path = arena.folder / "script.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def plant(arena: Arena, kind: str, path: Path, *options: str | Path) -> subprocess.CompletedProcess:
    call = [program("engram-plant"), "--scene", SCENE, f"--{kind}", path, "--lcm-url", arena.url, "--give-up", "1"]
    call += ["--results", arena.folder / "results.json", *options]
    return subprocess.run(list(map(str, call)), capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL)


def test_a_scenario_is_run_and_judged(arena: Arena, spec) -> None:
    controller(arena, "--model", "hector_fly")
    tilted = ["episode tipped 1", "state 0 0 1 0.5 0 0 0.8660254037844386", "task 0 0 0 1 0", "upright 0.5 0.7"]
    done = plant(arena, "scenario", write(arena, [*header(spec, "scenario", 1), *HOVER, *tilted]))
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "episode 1/2 ok 2.00 s hover"
    hover, tipped = json.loads((arena.folder / "results.json").read_text())["episodes"]
    assert hover["success"] and hover["torque_share"] <= 1.0 and 0.0 < hover["tilt_max_rad"] < 0.7
    assert not tipped["success"] and tipped["reason"] == "fall" and tipped["t_end_s"] == tipped["t_start_s"]


@pytest.mark.parametrize("engine", ["mujoco", "cvode"])
def test_way_points_are_reached_in_gusts(arena: Arena, spec, engine: str) -> None:
    controller(arena, "--model", "hector_fly")
    way = script(spec, 3, 3)
    path = arena.folder / "way.txt"
    way.write(path)
    done = plant(arena, "series", path, *way.plant_options, "--engine", engine)
    assert done.returncode == 0, done.stderr
    jumps = json.loads((arena.folder / "results.json").read_text())["jumps"]
    assert len(jumps) == 3 and all(jump["success"] and jump["torque_share"] <= 1.0 for jump in jumps)


@pytest.mark.parametrize(("robot", "task", "parts"), [("pendulum", "swing", 1), ("unicycle", "park", 1), ("bicopter", "fly", 2)])
def test_a_formula_is_driven_to_its_goals(arena: Arena, robot: str, task: str, parts: int) -> None:
    """Swing-up and hold, parking, way points in gusts: the deployed controller, the CVODE plant."""
    controller(arena, "--model", f"{robot}_{task}")
    way = script(load_motion(robot, task), 3, parts)
    path = arena.folder / "way.txt"
    way.write(path)
    done = plant(arena, "series", path, *way.plant_options, "--scene", scene(robot, task))
    assert done.returncode == 0, done.stderr
    jumps = json.loads((arena.folder / "results.json").read_text())["jumps"]
    assert len(jumps) == parts and all(jump["success"] and jump["torque_share"] <= 1.0 for jump in jumps)


def test_a_formula_is_not_left_to_mujoco(arena: Arena) -> None:
    done = plant(arena, "scenario", write(arena, HOVER), "--scene", scene("pendulum", "swing"))
    assert done.returncode == BAD_INPUT and "moved by the formula 'pendulum', not by MuJoCo; add --engine cvode" in done.stderr


def test_the_same_seed_gives_the_same_script(spec, tmp_path: Path) -> None:
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        script(spec, seed, 4).write(tmp_path / name)
    a, b, c = ((tmp_path / name).read_bytes() for name in "abc")
    assert a == b != c


WRONG = {
    "no file": (None, "cannot read the scenario"),
    "a series": (["engram_series 1"], ":1: a scenario starts with `engram_scenario 1`"),
    "a misspelt key": (["engram_scenario 1", *HOVER, "uprigth 1 1"], ":7: unknown key `uprigth`"),
    "another robot": (["engram_scenario 1", "robot_digest 0x1", *HOVER], "of different robots (digests differ)"),
    "no episode": (["engram_scenario 1"], "holds no episode"),
}


@pytest.mark.parametrize(("lines", "word"), WRONG.values(), ids=WRONG.keys())
def test_a_wrong_scenario_is_told(arena: Arena, lines: list[str] | None, word: str) -> None:
    done = plant(arena, "scenario", Path("/nowhere") if lines is None else write(arena, lines))
    assert done.returncode == BAD_INPUT
    assert word in done.stderr and done.stderr.count("\n") == 1


def test_a_missing_scene_is_told(arena: Arena, spec) -> None:
    done = plant(arena, "scenario", write(arena, [*header(spec, "scenario", 1), *HOVER]), "--scene", "/nowhere.xml")
    assert done.returncode == BAD_INPUT and "cannot read the scene '/nowhere.xml'" in done.stderr


def test_a_controller_of_another_robot_says_so(arena: Arena, spec) -> None:
    other = controller(arena, "--model", "panda_reach")
    done = plant(arena, "scenario", write(arena, [*header(spec, "scenario", 1), *HOVER]))
    assert done.returncode == NO_CONTROLLER and "no command on ENGRAM_COMMAND" in done.stderr
    assert "another robot" in said(other)


def test_a_task_of_another_world_is_refused_and_the_craft_hovers(arena: Arena, spec) -> None:
    serving = controller(arena, "--model", "hector_fly")
    lines = [line.replace(f"task_digest 0x{spec.digest:016x}", "task_digest 0x7") for line in header(spec, "scenario", 1)]
    done = plant(arena, "scenario", write(arena, [*lines, *HOVER]))
    assert done.returncode == 0 and done.stdout.startswith("episode 1/1 ok")
    assert "task of another kind" in said(serving)
