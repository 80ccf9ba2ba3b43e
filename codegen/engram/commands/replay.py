"""Run the controller again on a log and compare its messages byte for byte."""

import argparse
from pathlib import Path

EXAMPLES = """examples:
  engram replay runs/latest/memory/run.lcm
  engram replay some.lcm --memory shift --limit 5
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram replay`."""
    parser = subparsers.add_parser("replay", help=__doc__, description=__doc__, epilog=EXAMPLES)
    parser.add_argument(
        "log", type=Path, help="LCM log of engram-plant in lock step; repeated up to the first state that is missing"
    )
    parser.add_argument(
        "--memory", help="mode of the controller (default: as in the run, see pair.json beside the log; else memory)"
    )
    parser.add_argument(
        "--controller", type=Path, help="program to run (default: as in the run; else engram-controller of the build)"
    )
    parser.add_argument("--limit", type=float, help="s of plant time to repeat (default: all)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Exit code 0: the same messages. 1: another message, or no answer."""
    from engram_sim.replay import replay

    return replay(args.log, args.memory, args.controller, args.limit)
