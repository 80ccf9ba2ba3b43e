"""Write a robot's constants for the controller (robot.h) and its MuJoCo model (robot.xml) from its URDF."""

import argparse
from pathlib import Path

from engram.paths import BUILD, MODELS, TABLES, relative, write_changed

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
    from engram.robots.shown import write_shown
    from engram.robots.spec import read_spec
    from engram.robots.tree import build

    specs = [read_spec(name, args.models) for name in args.names]
    for spec in specs:
        tree = build(spec)
        folder = args.tables / tree.name
        folder.mkdir(parents=True, exist_ok=True)
        write_changed(folder / "robot.h", robot_header(tree))
        write_changed(folder / "robot.xml", robot_mjcf(tree))
        print(
            f"robot:  {relative(folder)}/robot.h robot.xml  nq {tree.nq}  nv {tree.nv}  nu {tree.nu}  digest {tree.digest:016x}"
        )
        if args.meshes:
            write_shown(spec, tree, args.build)
    return 0
