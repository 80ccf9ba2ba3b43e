"""Robot pipeline: the tree and its headers from robot.toml, and one clear message for every wrong input."""

import os
import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from engram.cli import main
from engram.paths import ROOT
from engram.robots.emit_header import c_double, robot_header
from engram.robots.emit_mjcf import robot_mjcf
from engram.robots.linear3 import principal_axes, turn_to
from engram.robots.spec import known_robots, read_spec
from engram.robots.tree import FREE, PRISMATIC, REVOLUTE, build, load, q_from_pin, q_to_pin

ZOO = ROOT / "tests" / "reference" / "zoo"
THRUSTER = """[thruster.jet]
link = "base_link"
position = [0.1, 0.2, 0.3]
axis = [0.6, 0.0, 0.8]
twist = -0.1
u_lo = 0.5
u_hi = 4.0

"""


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


WRONG = {
    "unknown key": ("free_base", "fre_base", r"robot\.toml:3: fre_base: unknown key; did you mean 'free_base'\?"),
    "missing key": ("home = {", "gravity = [0, 0, -1]\n# {", r"key 'home' is missing"),
    "broken TOML": ("armature = 0.05", "armature = = 1", r"not valid TOML.*line 4"),
    "not a number": ("armature = 0.05", 'armature = "much"', r"robot\.toml:4: armature: expected numbers"),
    "not finite": ("armature = 0.05", "armature = nan", r"robot\.toml:4: armature: every number must be finite"),
    "missing URDF": ('"zoo.urdf"', '"zo.urdf"', r"robot\.toml:2: urdf: no URDF at .*zo\.urdf; correct the path"),
    "two sources": ("free_base", 'example_robot_data = "panda"\nfree_base', r"exactly one of 'urdf'"),
    "unknown joint": ("welded = 0.7", "wheld = 0.7", r"robot\.toml:8: wheld: zoo\.urdf has no such joint; did you mean"),
    "unknown frame": ('"tip_link"', '"tap_link"', r"robot\.toml:15: tip: zoo\.urdf has no frame 'tap_link'; did you mean"),
    "least force above": (
        "u_max = 20.0",
        "u_max = 20.0\nu_lo = 21.0",
        r"robot\.toml:13: u_lo: the least force 21 of joint 'slider' is above",
    ),
    "key of another table": ("armature = 0.3", 'armature = "x"', r"robot\.toml:11: armature: expected numbers"),
    "two bases": ("free_base", "planar_base = true\nfree_base", r"planar_base: a base is free or planar, not both"),
    "unknown joint key": ("u_max = 20.0", "umax = 20.0", r"robot\.toml:12: umax: unknown key; did you mean 'u_max'"),
    "home outside": ("oblique = 0.2", "oblique = 2.0", r"nominal posture 2 is outside its limits \[-0\.8, 0\.9\]"),
    "limits crossed": ("u_max = 20.0", "q_lo = 1.0", r"lower limit 1 is not below upper limit 0\.9"),
    "sphere of no size": ("0.0, 0.05]]", "0.0, 0.0]]", r"radius .* must be positive"),
    "sphere shape": ("0.0, 0.05]]", "0.05]]", r"tip_link: expected numbers of shape"),
    "frame that rests": ('wheel_rim = "rim_link"', 'wheel_rim = "universe"', r"frame 'universe' does not move"),
    "foot on no frame": ("[spheres]", "[feet]\ntop = 0.1\n\n[spheres]", r"top: a foot stands on a named frame; did you mean"),
    "flat foot": ("[spheres]", "[feet]\ntip = [0.1, 0.1, 0.0]\n\n[spheres]", r"tip: a foot is a ball .* or a box"),
    "thruster without link": ("[spheres]", THRUSTER.replace('link = "base_link"', "") + "[spheres]", r"key 'link' is missing"),
    "thruster on a limb": ("[spheres]", THRUSTER.replace("base_link", "tip_link") + "[spheres]", r"thruster 'jet' must sit on"),
    "thrust upside down": ("[spheres]", THRUSTER.replace("u_hi = 4.0", "u_hi = 0.1") + "[spheres]", r"0\.5 N is not below"),
    "thruster without axis": ("[spheres]", THRUSTER.replace("[0.6, 0.0, 0.8]", "[0, 0, 0]") + "[spheres]", r"must not be zero"),
    "posture by name": ("home = {", 'home = "stand"\n# {', r"a posture by name needs an SRDF"),
}


@pytest.mark.parametrize("old, new, message", WRONG.values(), ids=WRONG.keys())
def test_wrong_robot_toml_gives_one_message(models, capfd, old, new, message):
    spoil(models, old, new)
    assert run(models, "zoo") == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and re.search(message, error), error
    assert not (models.parent / "tables").exists()


def test_wrong_urdf_gives_one_message(models, capfd):
    (models / "zoo" / "zoo.urdf").write_text("<robot", encoding="utf-8")
    assert run(models, "zoo") == 2
    assert "Pinocchio cannot read this URDF" in capfd.readouterr().err


def test_body_without_mass_is_refused(models, capfd):
    spoil(models, 'mass value="', 'mass value="0.0" was="', "zoo.urdf")
    assert run(models, "zoo") == 2
    assert "no mass" in capfd.readouterr().err


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
