"""Prove what a robot on legs can do: closed loops in MuJoCo by the compiled controller, and their figures.

Every run is one process of build/bin/engram-trial (`ninja -C build engram-trial`), in lock step and reproducible. Prints each
figure beside what is asked for, and writes them to build/figures/prove_<robot>.json.
"""

import argparse
import importlib

from engram.inputs import InputError
from engram.prove import walk

EPILOG = """examples:
  engram prove talos                    60 s of standing, squats, pushes, the largest pushes (some 5 minutes)
  engram prove talos --task walk        20 walks of 20 steps under each disturbance (some 10 minutes)
  engram prove talos --task walk --case free push10
  engram prove anymal --seed 7          60 s of standing and trotting, pushes at random phases
  engram prove talos --quick            a few seconds of each
  engram prove talos --cycles 200000    the same, and the times of so many control periods, each run another one
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram prove`."""
    parser = subparsers.add_parser("prove", help=__doc__.partition("\n")[0], description=__doc__, epilog=EPILOG)
    parser.add_argument("robot", choices=["talos", "anymal"], help="which robot")
    parser.add_argument("--task", choices=["walk"], help="walk: Talos walks, disturbed and undisturbed (default: all else)")
    parser.add_argument(
        "--case", nargs="+", default=[], choices=[case.name for case in walk.CASES], help="of --task walk (default: all)"
    )
    parser.add_argument("--walks", type=int, default=20, help="of --task walk, in each case (default: 20; --quick: 2)")
    parser.add_argument("--seed", type=int, default=1, help="of headings, phases and sides (default: 1)")
    parser.add_argument("--quick", action="store_true", help="a few seconds of each")
    parser.add_argument(
        "--cycles",
        type=int,
        help="control periods to time, in runs that are all different (default: 100000; --quick: those that ran)",
    )
    parser.add_argument("--jobs", type=int, default=1, help="runs side by side; times are clean with 1 (default: 1)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Exit code 0: all that is asked holds. 1: something does not. Raises InputError."""
    if args.robot != "talos" and args.task:
        raise InputError(f"{args.robot} does not walk: leave --task away, or `engram prove talos --task walk`")
    if args.walks < 1:
        raise InputError("--walks: at least 1")
    if args.task:
        report = walk.prove(args.seed, 2 if args.quick else args.walks, args.case, args.jobs)
    else:
        cycles = args.cycles if args.cycles is not None else 0 if args.quick else 100_000
        report = importlib.import_module(f"engram.prove.{args.robot}").prove(args.seed, args.quick, cycles, args.jobs)
    report.write()
    print(f"  build/figures/{report.file}.json; {report.failed} of {len(report.figures)} figures miss what is asked")
    return 1 if report.failed else 0
