"""Write report.html and summary.json of a run again from its logs."""

import argparse
from pathlib import Path

from engram.paths import BUILD


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram report`."""
    parser = subparsers.add_parser("report", help=__doc__, description=__doc__, epilog="example:\n  engram report runs/latest")
    parser.add_argument("folder", type=Path, help="folder of a demo")
    parser.add_argument(
        "--figures",
        type=Path,
        default=BUILD / "figures",
        help="where demo.json goes; of another seed: demo-seed<n>.json (default: build/figures/)",
    )
    return parser


def run(args: argparse.Namespace) -> int:
    """Write the report."""
    from engram_sim.demo import report_again

    return report_again(args.folder, args.figures)
