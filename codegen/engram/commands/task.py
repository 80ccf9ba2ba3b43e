"""Write a task's constants for the controller (task.h) and its scenes for MuJoCo."""

import argparse
from pathlib import Path

from engram.paths import BUILD, MODELS, TABLES, relative, write_changed

EXAMPLES = """examples:
  engram task panda reach             constants of models/panda/reach/, and a scene with collision geoms only
  engram task talos stand             of a motion: its own tables become constants
  engram task panda reach --meshes    also build/scene/panda_reach.xml, which shows the robot's meshes
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram task`."""
    parser = subparsers.add_parser("task", help=__doc__, description=__doc__, epilog=EXAMPLES)
    parser.add_argument("robot", help="folder of models/ that holds a robot.toml")
    parser.add_argument("task", help="folder of models/<robot>/ that holds a task.toml and a world.xml")
    parser.add_argument("--meshes", action="store_true", help="also write the meshes and the scene that shows them")
    parser.add_argument("--models", type=Path, default=MODELS, help="where robots are described (default: models/)")
    parser.add_argument("--tables", type=Path, default=TABLES, help="where to write (default: tables/)")
    parser.add_argument("--build", type=Path, default=BUILD, help="where to write meshes and the shown scene (default: build/)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Write task.h and scene.xml; with --meshes also the scene that shows the robot's meshes."""
    from engram.robots.emit_mjcf import robot_mjcf
    from engram.tasks.emit_header import task_header
    from engram.tasks.motion import MotionSpec, load_motion
    from engram.tasks.scene import scene_mjcf, write_shown_scene
    from engram.tasks.spec import load_task, open_task

    load = {"reach": load_task, "motion": load_motion}[open_task(args.robot, args.task, args.models).data["kind"]]
    spec = load(args.robot, args.task, args.models)
    world = args.models / args.robot / args.task / "world.xml"
    folder = args.tables / f"{args.robot}_{args.task}"
    folder.mkdir(parents=True, exist_ok=True)
    write_changed(folder / "task.h", task_header(spec))
    robot_xml = args.tables / args.robot / "robot.xml"
    if isinstance(spec, MotionSpec) and spec.has_spheres:  # the robot of this task touches with more than its own
        robot_xml = folder / "robot.xml"
        write_changed(robot_xml, robot_mjcf(spec.guarded, digest=spec.robot.digest))
    scene = scene_mjcf(spec, robot_xml, world, folder)
    write_changed(folder / "scene.xml", scene)
    sizes = f"vector {len(spec.vector_name)}  boxes {len(spec.boxes.name)}"
    print(f"task:   {relative(folder)}/task.h scene.xml  {sizes}  digest {spec.digest:016x}")
    if args.meshes:
        print(f"task:   {relative(write_shown_scene(spec, args.models, args.build))}")
    return 0
