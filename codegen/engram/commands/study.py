"""Make a row of the thesis again: its table beside ours, its picture, and the figures."""

import argparse
import os

ROWS = {
    "3.1": "steps",
    "3.2": "steps",
    "3.3": "steps",
    "3.4": "steps",
    "6.1": "functions",
    "6.2": "ur10",
    "6.3": "panda",
    "6.4": "panda",
    "6.5": "panda",
    "6.6": "sampling",
    "6.7": "arms",
    "6.8": "arms",
    "7.1": "pole",
    "9.1": "step_curves",
    "9.2": "step_choice",
    "9.3": "step_active",
}

EXAMPLES = """examples:
  engram study 6.3              inverse kinematics of the Panda, table 7.1; build/figures/study.6.3.json
  engram study 6                all rows of chapter 7
  engram study 3.2              Talos' steps, warm against cold, table 4.2; asks for `engram data talos step` before
  engram study 6.3 --quick      a short form, to see that it works
Also: make study S=6.3, make study S=6 QUICK=1.
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram study`."""
    parser = subparsers.add_parser("study", help=__doc__, description=__doc__, epilog=EXAMPLES)
    parser.add_argument("rows", nargs="+", help=f"rows of the mission: {', '.join(ROWS)}; 3 or 6 for all of a chapter's")
    parser.add_argument("--quick", action="store_true", help="fewer seeds, tasks and samples: seconds")
    return parser


def matching(chapter: str) -> list[str]:
    """Rows of a chapter that is asked for by its number alone."""
    return [row for row in ROWS if row.startswith(f"{chapter}.")]


def run(args: argparse.Namespace) -> int:
    """Run the rows in order."""
    import importlib

    from threadpoolctl import threadpool_limits

    from engram.inputs import InputError, closest

    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):  # of processes that a study starts
        os.environ.setdefault(name, "1")
    rows = [row for asked in args.rows for row in (matching(asked) or [asked])]
    for row in rows:
        if row not in ROWS:
            raise InputError(f"no study '{row}'; {closest(row, list(ROWS))}")
    with threadpool_limits(
        1
    ):  # numpy is loaded: its matrix products would start threads of their own, for matrices this small in vain
        for row in rows:
            importlib.import_module(f"engram.study.{ROWS[row]}").run(row, args.quick)
    return 0
