"""Tasks: the header says what task.toml and world.xml say, targets are what they promise, wrong input gets one message."""

import re
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from engram.cli import main
from engram.inputs import InputError
from engram.paths import MODELS, ROOT
from engram.robots.tree import q_to_pin
from engram.tasks.emit_header import task_header
from engram.tasks.motion import load_motion
from engram.tasks.reach import ReachSampler, draw_pose, sample_target, task_vector
from engram.tasks.scene import scene_mjcf
from engram.tasks.spec import load_task
from engram.tasks.world import Boxes, read_boxes


@pytest.fixture(scope="module")
def spec():
    return load_task("panda", "reach")


@pytest.fixture(scope="module")
def sampler(spec) -> ReachSampler:
    return ReachSampler(spec)


@pytest.fixture(scope="module")
def samples(sampler):
    rng = np.random.default_rng(3)
    return [sampler.sample(rng) for _ in range(40)]


@pytest.fixture()
def models(tmp_path) -> Path:
    """A models/ folder with the Panda and its reach task, free to be spoilt."""
    shutil.copytree(MODELS / "panda", tmp_path / "models" / "panda")
    return tmp_path / "models"


def spoil(models: Path, old: str, new: str, file: str = "task.toml") -> None:
    path = models / "panda" / "reach" / file
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def test_committed_files_are_what_the_command_writes(spec):
    folder = ROOT / "tables" / "panda_reach"
    scene = scene_mjcf(spec, ROOT / "tables/panda/robot.xml", MODELS / "panda/reach/world.xml", folder)
    assert (folder / "task.h").read_text(encoding="utf-8") == task_header(spec)
    assert (folder / "scene.xml").read_text(encoding="utf-8") == scene


MOTIONS = ["talos stand", "anymal trot", "hector fly", "pendulum swing", "unicycle park", "bicopter fly"]


@pytest.mark.parametrize("robot, task", [tuple(motion.split()) for motion in MOTIONS])
def test_committed_files_of_motions_are_what_the_command_writes(robot, task):
    motion, folder = load_motion(robot, task), ROOT / "tables" / f"{robot}_{task}"
    scene = scene_mjcf(motion, ROOT / f"tables/{robot}/robot.xml", MODELS / robot / task / "world.xml", folder)
    assert (folder / "task.h").read_text(encoding="utf-8") == task_header(motion)
    assert (folder / "scene.xml").read_text(encoding="utf-8") == scene


def test_tables_of_a_motion_become_constants(tmp_path):
    shutil.copytree(MODELS / "hector", tmp_path / "hector")
    path = tmp_path / "hector" / "fly" / "task.toml"
    before = load_motion("hector", "fly", tmp_path)
    path.write_text(path.read_text(encoding="utf-8") + "\n[extra]\nposition = 2.0\nvelocity = [1.0, 0.5]\n", encoding="utf-8")
    motion = load_motion("hector", "fly", tmp_path)
    assert motion.digest != before.digest
    text = task_header(motion)
    assert "static constexpr double extra_position = 0x1p+1;  // 2\n" in text
    assert "static constexpr double extra_velocity[2] = {0x1p+0, 0x1p-1};  // 1, 0.5\n" in text


WRONG_MOTION = {
    "number outside a table": ("[horizon]", "gain = 1.0\n\n[horizon]", r"gain: a motion's own numbers stand in tables"),
    "word for a number": ("position = 0.05", 'position = "near"', r"task\.toml:\d+: position: expected numbers"),
    "unknown kind": ('kind = "motion"', 'kind = "motoin"', r"kind: must be one of reach, motion"),
    "no horizon": ("[horizon]", "[horizons]", r"key 'horizon' is missing"),
}


@pytest.mark.parametrize("old, new, message", WRONG_MOTION.values(), ids=WRONG_MOTION.keys())
def test_wrong_motion_gives_one_message(tmp_path, capfd, old, new, message):
    shutil.copytree(MODELS / "hector", tmp_path / "hector")
    path = tmp_path / "hector" / "fly" / "task.toml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    assert main(["task", "hector", "fly", "--models", str(tmp_path), "--tables", str(tmp_path / "tables")]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and re.search(message, error), error


def test_a_motion_is_not_sampled():
    with pytest.raises(InputError, match="only reach tasks are sampled"):
        load_task("talos", "stand")


def test_boxes_are_those_of_the_world(spec):
    assert spec.boxes.name[0] == "table" and "floor" not in spec.boxes.name
    assert len(spec.boxes.name) == 8
    text = task_header(spec)
    assert f"nbox = {len(spec.boxes.name)}" in text and '"shelf_middle"' in text


def test_distance_to_a_turned_box_by_hand():
    """A box of half sizes 1, 2, 3 turned by 90 degrees about z, centre at (10, 0, 0)."""
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    box = Boxes(["b"], np.array([[10.0, 0.0, 0.0]]), turn[None], np.array([[1.0, 2.0, 3.0]]))
    points = np.array([[13.0, 0.0, 0.0], [10.0, 1.5, 0.0], [10.0, 0.0, 0.0], [13.0, 5.0, 3.0]])
    expected = [1.0, 0.5, -1.0, np.hypot(1.0, 4.0)]
    assert np.allclose(box.distance(points)[:, 0], expected, atol=1e-15)


def test_samples_are_reached_and_clear(spec, sampler, samples):
    tree, data = spec.robot, spec.robot.model.createData()
    for p_WT, R_WT, q in samples:
        pin.framesForwardKinematics(tree.model, data, q_to_pin(tree, q))
        hand = data.oMf[tree.model.getFrameId("panda_hand_tcp")]
        assert np.linalg.norm(hand.translation - p_WT) < 1e-5
        assert np.linalg.norm(pin.log3(R_WT.T @ hand.rotation)) < 1e-5
        assert np.all(q >= tree.q_lo + spec.margins["joint"]) and np.all(q <= tree.q_hi - spec.margins["joint"])
        assert sampler.clearance(q) >= spec.clearance


def test_samples_lie_in_the_range_of_the_task_vector(spec, samples):
    lo, hi = spec.vector_range.T
    for p_WT, R_WT, _ in samples:
        value = task_vector(p_WT, R_WT)
        assert np.all(value >= lo) and np.all(value <= hi)
        assert np.linalg.norm(value[3:]) == pytest.approx(1.0, abs=1e-12) and value[6] >= 0.0
        assert np.allclose(pin.Quaternion(value[3:]).toRotationMatrix(), R_WT, atol=1e-12)


def test_the_same_seed_gives_the_same_targets(samples):
    rng = np.random.default_rng(3)
    for p_WT, R_WT, _ in samples[:3]:
        p, R = sample_target(rng)
        assert np.array_equal(p, p_WT) and np.array_equal(R, R_WT)


def test_every_region_is_drawn(spec, samples):
    def region(p_WT):
        return next(r.name for r in spec.regions if np.all(p_WT >= r.lo) and np.all(p_WT <= r.hi))

    seen = Counter(region(p_WT) for p_WT, _, _ in samples)
    assert set(seen) == {r.name for r in spec.regions}
    assert sum(r.share for r in spec.regions if "compartment" in r.name) == 0.5


def test_flip_turns_about_the_approach_and_mirror_keeps_it_right_handed(spec):
    from dataclasses import replace

    region = replace(spec.regions[0], tilt=0.0, mirror=True)
    poses = [draw_pose(region, np.random.default_rng(seed)) for seed in range(40)]
    assert all(np.linalg.det(R) == pytest.approx(1.0) for _, R in poses)
    assert {round(float(R[1, 1])) for _, R in poses} == {-1, 1}
    assert all(np.allclose(R[:, 2], [1.0, 0.0, 0.0]) for _, R in poses)


def test_digest_follows_world_weights_and_robot(models):
    seen = {load_task("panda", "reach", models).digest}
    spoil(models, "collision = 0.03", "collision = 0.031")
    seen.add(load_task("panda", "reach", models).digest)
    spoil(models, 'pos="0.32 0 -0.03"', 'pos="0.32 0 -0.031"', "world.xml")
    seen.add(load_task("panda", "reach", models).digest)
    robot = models / "panda" / "robot.toml"
    robot.write_text(robot.read_text(encoding="utf-8").replace("armature = 0.0", "armature = 0.01"), encoding="utf-8")
    seen.add(load_task("panda", "reach", models).digest)
    assert len(seen) == 4


WRONG = {
    "unknown section": ("[horizon]", "[horizons]", r"horizons: unknown key; did you mean 'horizon'"),
    "unknown weight": ("posture = 0.02", "postur = 0.02", r"task\.toml:\d+: postur: unknown key; did you mean 'posture'"),
    "missing weight": ("torque = 2e-3", "", r"key 'torque' is missing"),
    "negative weight": ("velocity = 0.05", "velocity = -0.05", r"velocity: must not be negative"),
    "half a knot": ("knots = 50", "knots = 49.5", r"knots: expected a positive whole number"),
    "no time": ("dt = 0.04", "dt = 0.0", r"dt: expected a positive time"),
    "crossed range": ('"m", 0.15, 0.80', '"m", 0.85, 0.80', r"lowest < highest"),
    "unknown frame": ('frame = "hand_tcp"', 'frame = "hand_tpc"', r"has no frame 'hand_tpc'; did you mean 'hand_tcp'"),
    "shares": ("share = 0.25", "share = 0.35", r"must sum to 1, they sum to 1\.1"),
    "region upside down": ("lo = [0.52, -0.24, 0.17]", "lo = [0.82, -0.24, 0.17]", r"a lower corner lies above"),
    "axes parallel": ("z = [1.0, 0.0, 0.0]", "z = [0.0, 1.0, 0.0]", r"y and z must not be parallel"),
}


@pytest.mark.parametrize("old, new, message", WRONG.values(), ids=WRONG.keys())
def test_wrong_task_toml_gives_one_message(models, capfd, old, new, message):
    spoil(models, old, new)
    assert run(models) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and re.search(message, error), error
    assert not (models.parent / "tables").exists()


WRONG_WORLD = {
    "broken XML": ("</mujoco>", "", r"not valid XML"),
    "box without a name": ('name="shelf_top" ', "", r"a box geom has no name"),
    "box without a size": ('size="0.12 0.10 0.12"', 'size="0.12 0.10"', r"box 'box': size must be 3 numbers"),
    "flat box": ('size="0.12 0.10 0.12"', 'size="0.12 0.10 0"', r"half sizes must be positive"),
    "turned by euler": ('name="box"', 'name="box" euler="0 0 1"', r"orient it by quat"),
    "box in a body": ("<worldbody>", '<worldbody><body><geom name="b"/></body>', r"put obstacles into the worldbody"),
    "too many boxes": ("</worldbody>", '<geom name="b" type="box" size="1 1 1"/></worldbody>', r"9 boxes, at most 8"),
}


@pytest.mark.parametrize("old, new, message", WRONG_WORLD.values(), ids=WRONG_WORLD.keys())
def test_wrong_world_gives_one_message(models, capfd, old, new, message):
    spoil(models, old, new, "world.xml")
    assert run(models) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and re.search(message, error), error


def test_a_box_may_be_turned_by_a_quaternion(models):
    spoil(models, 'name="box"', 'name="box" quat="0.7071067811865476 0 0 0.7071067811865476"', "world.xml")
    boxes = read_boxes(models / "panda" / "reach" / "world.xml")
    R_WO = boxes.R_WO[boxes.name.index("box")]
    assert np.allclose(R_WO, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


def test_unreachable_region_is_named(models):
    spoil(models, "clearance = 0.05", "clearance = 5.0")
    sampler = ReachSampler(load_task("panda", "reach", models))
    sampler.solve = lambda *_: None  # what a thousand searches would find
    with pytest.raises(InputError, match="no pose is in reach; move it or ask for less clearance"):
        sampler.sample(np.random.default_rng(0))


def test_shown_scene_includes_what_was_written(models):
    assert run(models, "--meshes") == 0
    path = models.parent / "build" / "scene" / "panda_reach.xml"
    includes = re.findall(r'include file="(.*?)"', path.read_text(encoding="utf-8"))
    assert len(includes) == 2 and all((path.parent / include).is_file() for include in includes)


def test_unknown_names_are_answered(models, capsys):
    assert main(["task", "panda", "rech", "--models", str(models)]) == 2
    assert "unknown task 'rech' of robot 'panda'; did you mean 'reach'?" in capsys.readouterr().err


def run(models: Path, *options: str) -> int:
    out = models.parent
    folders = ["--models", str(models), "--tables", str(out / "tables"), "--build", str(out / "build")]
    return main(["task", "panda", "reach", *folders, *options])
