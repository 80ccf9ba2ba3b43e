"""Write a robot's constants for the controller (robot.h) and its MuJoCo model (robot.xml) from its URDF."""

import argparse
from pathlib import Path

from engram.paths import BUILD, MODELS, TABLES, relative

EXAMPLES = """examples:
  engram robot panda            constants and MuJoCo model of models/panda/robot.toml
  engram robot panda talos      several robots
  engram robot panda --meshes   also the visual meshes, into build/meshes/panda/
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram robot`."""
    parser = subparsers.add_parser("robot", help=__doc__, description=__doc__, epilog=EXAMPLES)
    parser.add_argument("names", nargs="+", metavar="robot", help="folder of models/ that holds a robot.toml")
    parser.add_argument("--meshes", action="store_true", help="also write the visual meshes as OBJ (for rendering)")
    parser.add_argument("--models", type=Path, default=MODELS, help="where robots are described (default: models/)")
    parser.add_argument("--tables", type=Path, default=TABLES, help="where to write (default: tables/)")
    parser.add_argument("--build", type=Path, default=BUILD, help="where to write meshes (default: build/)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Write robot.h and robot.xml of every named robot; with --meshes also OBJ files and the MuJoCo model that shows them."""
    from engram.robots.emit_header import robot_header
    from engram.robots.emit_mjcf import robot_mjcf
    from engram.robots.spec import read_spec
    from engram.robots.tree import build

    specs = [read_spec(name, args.models) for name in args.names]
    for spec in specs:
        tree = build(spec)
        folder = args.tables / tree.name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "robot.h").write_text(robot_header(tree), encoding="utf-8")
        (folder / "robot.xml").write_text(robot_mjcf(tree), encoding="utf-8")
        print(
            f"robot:  {relative(folder)}/robot.h robot.xml  nq {tree.nq}  nv {tree.nv}  nu {tree.nu}  digest {tree.digest:016x}"
        )
        if args.meshes:
            print(f"robot:  {write_meshes(spec, tree, args.build)}")
    return 0


def write_meshes(spec, tree, build_folder: Path) -> str:
    """Write <build>/meshes/<robot>/*.obj and <build>/scene/<robot>.xml, which shows them. Returns what was done."""
    from engram.robots.emit_mjcf import robot_mjcf
    from engram.robots.visuals import load_visuals, obj_text

    meshes, scene = build_folder / "meshes" / tree.name, build_folder / "scene"
    meshes.mkdir(parents=True, exist_ok=True)
    scene.mkdir(parents=True, exist_ok=True)
    visuals = load_visuals(spec, tree)
    drawn = [visual for visual in visuals if visual.kind == "mesh"]
    for visual in drawn:
        (meshes / f"{visual.name}.obj").write_text(obj_text(visual), encoding="utf-8")
    (scene / f"{tree.name}.xml").write_text(robot_mjcf(tree, visuals, f"../meshes/{tree.name}/"), encoding="utf-8")
    faces = sum(len(visual.triangles) for visual in drawn)
    return f"{relative(scene)}/{tree.name}.xml  {len(drawn)} meshes, {faces} triangles in {relative(meshes)}/"
