"""Draw the video of a run again from its logs."""

import argparse
from pathlib import Path

EPILOG = """examples:
  engram render runs/latest --seconds 60
  engram render runs/latest --modes memory

For a time range of any log: build/bin/engram-render --help
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram render`."""
    parser = subparsers.add_parser("render", help=__doc__, description=__doc__, epilog=EPILOG)
    parser.add_argument("folder", type=Path, help="folder of a demo")
    parser.add_argument("--seconds", type=float, default=30.0, help="length of the video (default: 30)")
    parser.add_argument("--modes", help="modes to show side by side (default: all of the run)")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: 2)")
    parser.add_argument("--out", type=Path, help="file to write (default: <run>/demo.mp4)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Draw the video."""
    from engram_sim.demo import render_again

    return render_again(args.folder, args.seconds, args.modes, args.jobs, args.out)
