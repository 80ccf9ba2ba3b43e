"""Robot pipeline: the tree and its headers from robot.toml, and one clear message for every wrong input."""

import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from engram.cli import main
from engram.inputs import InputError
from engram.paths import ROOT
from engram.robots.emit_header import c_double, robot_header
from engram.robots.emit_mjcf import robot_mjcf
from engram.robots.linear3 import principal_axes, turn_to
from engram.robots.spec import known_robots, read_spec
from engram.robots.tree import FREE, PRISMATIC, REVOLUTE, build, check, load, q_from_pin, q_to_pin

ZOO = ROOT / "tests" / "reference" / "zoo"
THRUSTER = """[thruster.jet]
link = "base_link"
position = [0.1, 0.2, 0.3]
axis = [0.6, 0.0, 0.8]
twist = -0.1
u_lo = 0.5
u_hi = 4.0

"""
TORQUE = "control.torque = { u_lo = -5.0, u_hi = 5.0 }\n"
TEXT = (ZOO / "robot.toml").read_text(encoding="utf-8")
JOINTS = re.findall(r'joint name="(\w+)" type="(?!fixed)', (ZOO / "zoo.urdf").read_text(encoding="utf-8"))


def thruster(old: str, new: str) -> str:
    """A spoilt thruster, before the spheres."""
    assert old in THRUSTER
    return THRUSTER.replace(old, new) + "[spheres]"


def formula(name: str, control: str) -> str:
    """A robot that a formula moves."""
    return f'formula = "{name}"\nfree_base = false\n{control}'


@pytest.fixture()
def models(tmp_path) -> Path:
    """A models/ folder that holds the zoo robot, free to be spoilt."""
    shutil.copytree(ZOO, tmp_path / "models" / "zoo")
    return tmp_path / "models"


def spoil(models: Path, old: str, new: str, file: str = "robot.toml") -> None:
    path = models / "zoo" / file
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def run(models: Path, *names: str) -> int:
    out = models.parent
    return main(["robot", *names, "--models", str(models), "--tables", str(out / "tables"), "--build", str(out / "build")])


@pytest.mark.parametrize("axis", [*np.eye(3), *-np.eye(3), [1, 2, -1], [-0.2, 0.1, 0.5]])
def test_turn_puts_z_on_the_axis(axis):
    axis = np.array(axis) / np.linalg.norm(axis)
    R = turn_to(axis)
    assert np.array_equal(R[:, 2], axis)
    assert np.allclose(R.T @ R, np.eye(3), atol=1e-15) and np.linalg.det(R) > 0.0
    if np.count_nonzero(axis) == 1:
        assert set(np.unique(np.abs(R))) == {0.0, 1.0}  # a permutation: no rounding


@pytest.mark.parametrize("seed", range(20))
def test_principal_axes_give_the_inertia_back(seed):
    square = np.random.default_rng(seed).standard_normal((3, 3))
    inertia = square @ square.T if seed else np.diag([3.0, 1.0, 2.0])
    moments, R = principal_axes(inertia)
    assert np.allclose(R @ np.diag(moments) @ R.T, inertia, atol=1e-14 * np.abs(inertia).max())
    assert np.allclose(moments, np.linalg.eigvalsh(inertia), atol=1e-14 * np.abs(inertia).max())
    assert np.allclose(R.T @ R, np.eye(3), atol=1e-14) and np.linalg.det(R) > 0.0


def test_turned_tree_moves_as_the_urdf():
    """Forward kinematics by R_PJ, p_PJ and rotations about z alone put every body where Pinocchio does."""
    tree = build(read_spec("zoo", ZOO.parent))
    assert set(tree.kind) == {FREE, REVOLUTE, PRISMATIC} and tree.continuous.sum() == 2
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.5, 0.5, tree.nq)
    q[3:7] = [0.5, -0.5, 0.5, 0.5]
    data = tree.model.createData()
    pin.forwardKinematics(tree.model, data, q_to_pin(tree, q))
    world = []
    for i in range(tree.nj):
        joint = pin.SE3(tree.R_PJ[i], tree.p_PJ[i])
        part = q[tree.iq[i] :]
        if tree.kind[i] == FREE:
            joint = joint * pin.XYZQUATToSE3(part[:7])
        elif tree.kind[i] == REVOLUTE:
            joint = joint * pin.SE3(pin.exp3(np.array([0.0, 0.0, part[0]])), np.zeros(3))
        else:
            joint = joint * pin.SE3(np.eye(3), np.array([0.0, 0.0, part[0]]))
        world.append(joint if tree.parent[i] < 0 else world[tree.parent[i]] * joint)
        turned = data.oMi[i + 1] * pin.SE3(tree.R_turn[i], np.zeros(3))
        assert turned.isApprox(world[i], 1e-13)


def test_configuration_maps_both_ways():
    tree = build(read_spec("zoo", ZOO.parent))
    q = tree.q_home.copy()
    assert q[tree.iq[tree.joint_name.index("wheel")]] == pytest.approx(3.0, abs=1e-15)
    assert len(q_to_pin(tree, q)) == tree.nq + 2  # cosine and sine of two continuous joints
    assert np.allclose(q_from_pin(tree, q_to_pin(tree, q)), q, atol=1e-15)


def test_settings_of_robot_toml_arrive():
    tree = build(read_spec("zoo", ZOO.parent))
    slider, oblique = (tree.iv[tree.joint_name.index(name)] for name in ("slider", "oblique"))
    assert "welded" not in tree.joint_name
    assert tree.armature[slider] == 0.3 and tree.armature[oblique] == 0.05 and not tree.armature[:6].any()
    assert tree.u_max[slider - 6] == 20.0 and tree.u_max[oblique - 6] == 30.0
    assert tree.frame_name == ["tip", "wheel_rim"]
    # the tip hangs on the locked joint: its sphere moved over to the wheel that carries it
    assert tree.joint_name[tree.sphere_joint[0]] == "oblique_wheel"


def test_armature_of_talos_is_that_of_its_rotors():
    """example-robot-data states rotor inertia and gear ratio; robot.toml states their product."""
    import example_robot_data

    tree = load("talos")
    assert np.allclose(tree.armature, example_robot_data.load("talos").model.armature, rtol=1e-12)
    assert (tree.nq, tree.nv, tree.nu) == (39, 38, 32)


@pytest.mark.parametrize("value", [0.1, -1.0 / 3.0, 1e8, 5e-324, 1.2345678901234567e-12, 1.0, -0.0])
def test_literals_restore_every_bit(value):
    assert float.fromhex(c_double(value)) == value


def test_numbers_that_are_not_finite_never_reach_a_table():
    with pytest.raises(ValueError, match="not finite"):
        c_double(float("nan"))


def test_thrusters_push_where_they_sit(models):
    """A thrust u along the unit axis a at p is the base wrench [a u, (p x a + twist a) u]; motors follow in their own dofs."""
    spoil(models, "[spheres]", THRUSTER + "[spheres]")
    tree = build(read_spec("zoo", models))
    assert tree.thruster_name == ["jet"] and tree.nu == tree.nv - 6 + 1
    assert tree.u_lo[0] == 0.5 and tree.u_max[0] == 4.0 and np.array_equal(tree.u_lo[1:], -tree.u_max[1:])
    p, a = np.array([0.1, 0.2, 0.3]), np.array([0.6, 0.0, 0.8])
    assert np.allclose(tree.actuation[:6, 0], [*a, *(np.cross(p, a) - 0.1 * a)], atol=1e-15)
    assert np.array_equal(tree.actuation[6:, 1:], np.eye(tree.nv - 6)) and not tree.actuation[6:, 0].any()
    motors = ElementTree.fromstring(robot_mjcf(tree)).findall("actuator/motor")
    assert motors[0].get("site") == "jet" and motors[0].get("ctrlrange") == "0.5 4.0"
    assert "static constexpr double u_lo[" in robot_header(tree)


def test_a_formula_brings_its_own_controls():
    """They take the place of joint motors: two of them for three coordinates, with their own limits."""
    tree = load("unicycle")
    assert (tree.formula, tree.nv, tree.nu, tree.control_name) == ("unicycle", 3, 2, ["speed", "turn"])
    assert list(tree.u_max) == [2.0, 4.0] and len(tree.u_lo) == 0 and list(load("bicopter").u_lo) == [0.0, 0.0]
    root = ElementTree.fromstring(robot_mjcf(tree))
    assert root.find("custom/text[@name='formula']").get("data") == "unicycle"
    assert [motor.get("ctrlrange") for motor in root.iter("motor")] == ["-2.0 2.0", "-4.0 4.0"]


def test_a_robot_without_thrusters_has_the_digest_it_always_had():
    assert load("panda").digest == 0x4B18E6738C35F0DC
    assert "u_lo" not in robot_header(load("panda"))


def test_feet_stand_on_their_frames(models):
    """A box's lower face is the frame's x-y plane; a ball is centred on the frame."""
    spoil(models, "[spheres]", "[feet]\ntip = [0.1, 0.06, 0.01]\nwheel_rim = 0.02\n\n[spheres]")
    tree = build(read_spec("zoo", models))
    geoms = {geom.get("name"): geom for geom in ElementTree.fromstring(robot_mjcf(tree)).iter("geom")}
    assert geoms["tip"].get("type") == "box" and geoms["wheel_rim"].get("size") == "0.02"
    f = tree.frame_name.index("tip")
    up = np.array([float(x) for x in geoms["tip"].get("pos").split()]) - tree.p_JF[f]
    assert np.allclose(tree.R_JF[f].T @ up, [0.0, 0.0, 0.01], atol=1e-15)
    assert tree.digest == build(read_spec("zoo", ZOO.parent)).digest  # feet concern the plant alone


@pytest.mark.parametrize("name", known_robots())
def test_committed_files_are_what_the_command_writes(name):
    tree = load(name)
    assert (ROOT / "tables" / name / "robot.h").read_text(encoding="utf-8") == robot_header(tree)
    assert (ROOT / "tables" / name / "robot.xml").read_text(encoding="utf-8") == robot_mjcf(tree)


def test_header_compiles_and_holds_the_numbers(models, tmp_path):
    """A robot without spheres and frames on a locked link still gives a header that compiles without warnings."""
    spoil(models, "tip_link = [[0.0, 0.0, 0.0, 0.05]]", "")
    assert run(models, "zoo") == 0
    tree = build(read_spec("zoo", models))
    source = tmp_path / "print.cc"
    source.write_text(
        '#include "tables/zoo/robot.h"\n#include <cstdio>\nusing R = engram::robots::Zoo;\n'
        "int main() {\n"
        '  std::printf("%d %d %d %d %d\\n", R::nj, R::nq, R::nv, R::nu, R::nsphere);\n'
        '  for (int i = 0; i < R::nj; ++i) std::printf("%a %a\\n", R::mass[i], R::R_PJ[i][5]);\n'
        "}\n"
    )
    binary = tmp_path / "print"
    eigen = subprocess.run(["pkg-config", "--cflags-only-I", "eigen3"], check=True, capture_output=True, text=True)
    includes = [f"-I{tmp_path}", f"-I{ROOT}", "-isystem", eigen.stdout.strip().removeprefix("-I")]
    flags = ["-std=c++17", "-O0", "-march=native", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([os.environ.get("CXX", "g++"), *flags, *includes, str(source), "-o", str(binary)], check=True)
    first, *rows = subprocess.run([str(binary)], check=True, capture_output=True, text=True).stdout.splitlines()
    assert first == f"{tree.nj} {tree.nq} {tree.nv} {tree.nu} 0"
    for i, row in enumerate(rows):
        assert [float.fromhex(word) for word in row.split()] == [tree.mass[i], tree.R_PJ[i][1, 2]]


def test_digest_follows_every_number(models):
    before = build(read_spec("zoo", models)).digest
    assert build(read_spec("zoo", models)).digest == before
    spoil(models, "armature = 0.3", "armature = 0.3000001")
    assert build(read_spec("zoo", models)).digest != before


def test_mjcf_keeps_what_mujoco_must_not_touch():
    root = ElementTree.fromstring(robot_mjcf(build(read_spec("zoo", ZOO.parent))))
    compiler = root.find("compiler").attrib
    assert compiler["balanceinertia"] == compiler["inertiafromgeom"] == compiler["fusestatic"] == "false"
    joints = root.findall(".//joint[@axis]")
    assert joints and {joint.get("axis") for joint in joints} == {"0 0 1"}
    assert {joint.get("damping") for joint in root.iter("joint")} - {None} == {"0"}
    names = [joint.get("name") for joint in joints]
    assert [motor.get("joint") for motor in root.iter("motor")] == names


def test_meshes_are_written_and_found(tmp_path):
    assert main(["robot", "panda", "--tables", str(tmp_path / "t"), "--build", str(tmp_path / "b"), "--meshes"]) == 0
    shown = ElementTree.parse(tmp_path / "b" / "scene" / "panda.xml").getroot()
    files = [tmp_path / "b" / "scene" / mesh.get("file") for mesh in shown.iter("mesh")]
    assert len(files) > 20 and all(file.is_file() for file in files)
    colours = {geom.get("rgba") for geom in shown.iter("geom") if geom.get("type") == "mesh"}
    assert len(colours) > 2  # the parts of the arm kept their colours


# id: (what stands there, what is put in its place, the end of the message as a pattern)
WRONG = {
    # of the file
    "unknown key": ("free_base", "fre_base", r":3: fre_base: unknown key; did you mean 'free_base'\?"),
    "missing key": ("home = {", "gravity = [0, 0, -1]\n# {", r":1: key 'home' is missing; add it"),
    "broken TOML": ("armature = 0.05", "armature = = 1", r":4: not valid TOML: .*; mend this line"),
    "TOML without its end": (
        "tip_link = [[0.0, 0.0, 0.0, 0.05]]",
        "tip_link = [[0.0",
        r":19: not valid TOML: .*; mend this line",
    ),
    # of kinds of values
    "not a number": ("armature = 0.05", 'armature = "much"', r":4: armature: expected numbers, found 'much'; write one number"),
    "a number in quotes": (
        "armature = 0.05",
        'armature = "0.05"',
        r":4: armature: expected numbers, found '0\.05'; write one number",
    ),
    "not finite": ("armature = 0.05", "armature = nan", r":4: armature: every number must be finite; write a value"),
    "negative": ("armature = 0.05", "armature = -0.05", r":4: armature: must not be below 0; mend the value"),
    "gravity of two numbers": (
        "[locked]",
        "gravity = [0, -9.81]\n[locked]",
        r":7: gravity: .* found shape \(2,\); write 3 numbers",
    ),
    "key of another table": ("armature = 0.3", 'armature = "x"', r":11: armature: expected numbers"),
    "not a table": (
        "[joint.slider]\narmature = 0.3\nu_max = 20.0",
        "[joint]\nslider = 3",
        r":11: slider: expected a table, found 3",
    ),
    "locked by a number": ("[locked]\nwelded = 0.7", "locked = 3", r":7: locked: expected a table, found 3; write \[locked\]"),
    "not a name": ('tip = "tip_link"', "tip = 3", r":15: tip: expected a name, found 3; write it in quotes"),
    "not true or false": ("free_base = true", "free_base = 1", r":3: free_base: expected true or false, found 1; write one of"),
    "planar by a word": (
        "free_base",
        'planar_base = "yes"\nfree_base',
        r":3: planar_base: expected true or false, found 'yes'; write",
    ),
    "not a posture": ("home = { oblique = 0.2, wheel = 3.0 }", "home = 0", r":5: home: expected a posture, found 0; write"),
    # of where the robot comes from
    "missing URDF": ('"zoo.urdf"', '"zo.urdf"', r":2: urdf: no URDF at .*zo\.urdf; correct the path"),
    "missing SRDF": ("free_base", 'srdf = "zoo.srdf"\nfree_base', r":3: srdf: no SRDF at .*zoo\.srdf; correct the path"),
    "path that is none": ('"zoo.urdf"', "3", r":2: urdf: expected a name, found 3; write it in quotes"),
    "two sources": ("free_base", 'example_robot_data = "panda"\nfree_base', r":2: urdf: give exactly one of 'urdf'"),
    "no source": ('urdf = "zoo.urdf"', "", r":1: urdf: give exactly one of 'urdf'"),
    "unknown robot": (
        'urdf = "zoo.urdf"',
        'example_robot_data = "pandda"',
        r":2: example_robot_data: .* no robot 'pandda'; did you",
    ),
    "SRDF given twice": (
        'urdf = "zoo.urdf"',
        'example_robot_data = "panda"\nsrdf = "panda.srdf"',
        r":3: srdf: the robots of example-robot-data bring their own; delete this key",
    ),
    "two bases": ("free_base", "planar_base = true\nfree_base", r":3: planar_base: a base is free or planar, not both; set one"),
    # of joints
    "unknown joint": ("welded = 0.7", "wheld = 0.7", r":8: wheld: zoo\.urdf has no such joint; did you mean"),
    "unknown joint of home": (
        "oblique = 0.2",
        "obliqe = 0.2",
        r":5: obliqe: zoo\.urdf has no such joint; did you mean 'oblique'",
    ),
    "unknown joint of limits": (
        "[joint.slider]",
        "[joint.slyder]",
        r":10: slyder: zoo\.urdf has no such joint; did you mean 'slider'",
    ),
    "unknown joint key": ("u_max = 20.0", "umax = 20.0", r":12: umax: unknown key; did you mean 'u_max'"),
    "settings of a locked joint": ("[joint.slider]", "[joint.welded]", r":10: welded: this joint does not move; delete it here"),
    "base in home": ("oblique = 0.2", "root_joint = 0.2", r":5: root_joint: this joint has not one coordinate; delete it here"),
    "limits of a wheel": (
        "[joint.slider]",
        "[joint.wheel]\nq_lo = 0.1\n[joint.slider]",
        r":11: q_lo: this joint turns without end; d",
    ),
    "least force above": (
        "u_max = 20.0",
        "u_max = 20.0\nu_lo = 21.0",
        r":13: u_lo: the least force 21 of joint 'slider' .* mend them",
    ),
    "home outside": (
        "oblique = 0.2",
        "oblique = 2.0",
        r":5: oblique: .* posture 2 is outside its limits \[-0\.8, 0\.9\]; choose",
    ),
    "zero outside": ("u_max = 20.0", "q_lo = 0.1", r":5: home: joint 'slider': nominal posture 0 is outside .*; choose another"),
    "limits crossed": (
        "u_max = 20.0",
        "q_lo = 1.0",
        r":12: q_lo: .* lower limit 1 is not below upper limit 0\.\d+; mend q_lo or",
    ),
    "posture by name": ("home = {", 'home = "stand"\n# {', r":5: home: a posture by name needs an SRDF; give a table"),
    "nothing moves": (
        TEXT[TEXT.index("free_base") :],
        "free_base = false\nhome = {}\n[frames]\n[locked]\n" + "".join(f"{name} = 0.0\n" for name in JOINTS),
        r":6: locked: nothing moves; leave a joint free",
    ),
    # of frames, spheres and feet
    "unknown frame": ('"tip_link"', '"tap_link"', r":15: tip: zoo\.urdf has no frame 'tap_link'; did you mean"),
    "frame that rests": (
        '"rim_link"',
        '"universe"',
        r":16: wheel_rim: frame 'universe' does not move; name one on a moving body",
    ),
    "frame that C++ cannot name": (
        'tip = "tip_link"',
        '"tip-2" = "tip_link"',
        r":15: tip-2: this name cannot be one in code; write",
    ),
    "sphere of no size": ("0.0, 0.05]]", "0.0, 0.0]]", r":19: tip_link: a sphere's radius .* must be positive; write it in m"),
    "sphere shape": ("0.0, 0.05]]", "0.05]]", r":19: tip_link: expected numbers of shape .*; write nx4 numbers"),
    "rows of two lengths": ("0.0, 0.05]]", "0.0, 0.05], [1.0]]", r":19: tip_link: expected numbers, found .*; write nx4 numbers"),
    "sphere on no link": ("tip_link = [[", "tup_link = [[", r":19: tup_link: zoo\.urdf has no frame 'tup_link'; did you mean"),
    "foot on no frame": (
        "[spheres]",
        "[feet]\ntop = 0.1\n\n[spheres]",
        r":19: top: a foot stands on a named frame; did you mean",
    ),
    "flat foot": (
        "[spheres]",
        "[feet]\ntip = [0.1, 0.1, 0.0]\n\n[spheres]",
        r":19: tip: a foot is a ball or a box; write its radius",
    ),
    "foot of words": (
        "[spheres]",
        '[feet]\ntip = "flat"\n\n[spheres]',
        r":19: tip: expected numbers, found \['flat'\]; write n numbers",
    ),
    # of thrusters
    "thruster without link": (
        "[spheres]",
        thruster('link = "base_link"\n', ""),
        r":18: \[thruster\.jet\]: key 'link' is missing; add",
    ),
    "thruster on a limb": (
        "[spheres]",
        thruster("base_link", "tip_link"),
        r":19: link: .* must sit on the base, .*; name the base's link",
    ),
    "thruster on no link": (
        "[spheres]",
        thruster("base_link", "bse_link"),
        r":19: link: zoo\.urdf has no frame 'bse_link'; did you",
    ),
    "thrust upside down": (
        "[spheres]",
        thruster("u_hi = 4.0", "u_hi = 0.1"),
        r":23: u_lo: .* 0\.5 N is not below .*; exchange or mend",
    ),
    "thruster without axis": (
        "[spheres]",
        thruster("[0.6, 0.0, 0.8]", "[0, 0, 0]"),
        r":21: axis: .* must not be zero; write the d",
    ),
    "thruster on a table": (
        TEXT[TEXT.index("free_base") :],
        "free_base = false\nhome = {}\n[frames]\n" + THRUSTER,
        r":6: jet: a thruster needs a base that is free; write free_base = true",
    ),
    # of formulas
    "unknown formula": (
        "free_base = true",
        formula("pendulun", TORQUE),
        r":3: formula: there is no formula 'pendulun'; did you mean",
    ),
    "formula that floats": (
        "home",
        'formula = "bicopter"\nhome',
        r":5: formula: a formula has neither a free base .*; write free_base",
    ),
    "formula alone": (
        "free_base = true",
        formula("bicopter", ""),
        r":3: formula: a formula has controls, and only a formula; write",
    ),
    "controls alone": (
        "free_base",
        TORQUE + "free_base",
        r":3: control: a formula has controls, and only a formula; write formula",
    ),
    "control upside down": (
        "free_base = true",
        formula("pendulum", TORQUE.replace("5.0 }", "-5.0 }")),
        r":5: u_lo: the least control -5 is not below the largest -5; exchange or mend",
    ),
    "control without limit": (
        "free_base = true",
        formula("pendulum", TORQUE.replace(", u_hi = 5.0", "")),
        r":5: \[control\.torque\]: key 'u_hi' is missing; add it",
    ),
    "too many controls": (
        "free_base = true",
        formula("bicopter", "".join(TORQUE.replace("torque", f"u{i}") for i in range(9))),
        r":5: control: more controls than the \d coordinates of zoo\.urdf; delete some",
    ),
}


@pytest.mark.parametrize("old, new, message", WRONG.values(), ids=WRONG.keys())
def test_wrong_robot_toml_gives_one_message(models, capfd, old, new, message):
    """File, line, key, and after a semicolon (or as the whole) the mend."""
    spoil(models, old, new)
    assert run(models, "zoo") == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and re.search(r"zoo/robot\.toml" + message, error), error
    assert not (models.parent / "tables").exists()


WRONG_URDF = {
    "broken": ("<robot", "<robt", r":2: urdf: Pinocchio cannot read .*zoo\.urdf \(.*\); mend that file, or name another"),
    "body without mass": (
        'mass value="',
        'mass value="0.0" was="',
        r":2: urdf: .* no mass or no inertia; lock the joint or mend",
    ),
    "joint of two ways": (
        '"slider" type="prismatic"',
        '"slider" type="planar"',
        r":2: urdf: joint 'slider' is a .* mend the URDF",
    ),
    "joint that floats": (
        '"slider" type="prismatic"',
        '"slider" type="floating"',
        r":2: urdf: joint 'slider' floats .* mend the URDF",
    ),
}


@pytest.mark.parametrize("old, new, message", WRONG_URDF.values(), ids=WRONG_URDF.keys())
def test_wrong_urdf_points_at_the_key_that_names_it(models, capfd, old, new, message):
    spoil(models, "[joint.slider]\narmature = 0.3\nu_max = 20.0", "")
    spoil(models, old, new, "zoo.urdf")
    assert run(models, "zoo") == 2
    error = capfd.readouterr().err.splitlines()[-1]  # the URDF parser may have its own say before
    assert re.search(r"zoo/robot\.toml" + message, error), error


def test_unknown_posture_of_the_srdf(models, capfd):
    spoil(models, "home = {", 'srdf = "zoo.srdf"\nhome = "stant"\n# {')
    state = '<robot name="zoo"><group_state name="stand" group="all"><joint name="oblique" value="0.1"/></group_state></robot>'
    (models / "zoo" / "zoo.srdf").write_text(state, encoding="utf-8")
    assert run(models, "zoo") == 2
    assert re.search(r"robot\.toml:6: home: zoo\.srdf has no posture 'stant'; did you mean 'stand'\?", capfd.readouterr().err)


def test_joints_out_of_order_are_refused():
    """Pinocchio sorts the joints of a URDF; a tree of another origin is told."""
    spec = read_spec("zoo", ZOO.parent)
    tree = build(spec)
    with pytest.raises(InputError, match=r"robot\.toml:2: urdf: joint '.*' is not in depth-first order; order the joints"):
        check(spec, replace(tree, parent=tree.parent[::-1].copy()))


def test_unknown_names_are_answered(models, capsys):
    assert run(models, "zooo") == 2
    assert "unknown robot 'zooo'; did you mean 'zoo'?" in capsys.readouterr().err
    assert main(["robto", "panda"]) == 2
    assert "unknown command 'robto'; did you mean 'robot'?" in capsys.readouterr().err


@pytest.mark.parametrize("argv", [["--help"], ["robot", "--help"], ["task", "--help"]])
def test_help_shows_examples(argv, capsys):
    with pytest.raises(SystemExit) as ended:
        main(argv)
    assert ended.value.code == 0
    assert "examples:\n  engram" in capsys.readouterr().out
