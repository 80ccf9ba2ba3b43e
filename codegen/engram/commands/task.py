"""Write a task's constants for the controller (task.h) and its scene for MuJoCo."""

import argparse
from pathlib import Path

from engram.paths import MODELS, TABLES, relative

EXAMPLES = """examples:
  engram task panda reach       constants and scene of models/panda/reach/
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram task`."""
    parser = subparsers.add_parser("task", help=__doc__, description=__doc__, epilog=EXAMPLES)
    parser.add_argument("robot", help="folder of models/ that holds a robot.toml")
    parser.add_argument("task", help="folder of models/<robot>/ that holds a task.toml and a world.xml")
    parser.add_argument("--models", type=Path, default=MODELS, help="where robots are described (default: models/)")
    parser.add_argument("--tables", type=Path, default=TABLES, help="where to write (default: tables/)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Write task.h."""
    from engram.tasks.emit_header import task_header
    from engram.tasks.spec import load_task

    spec = load_task(args.robot, args.task, args.models)
    folder = args.tables / f"{args.robot}_{args.task}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "task.h").write_text(task_header(spec), encoding="utf-8")
    print(f"task:   {relative(folder)}/task.h  task vector {len(spec.vector_name)}  boxes {len(spec.boxes.name)}  digest {spec.digest:016x}")
    return 0
