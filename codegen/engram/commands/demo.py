"""Run the deployed controller against a simulated robot over LCM: log, video, report, summary."""

import argparse
from pathlib import Path

from engram.paths import BUILD

EXAMPLES = """examples:
  engram demo                                 300 jumps of the Panda in each mode, into runs/<time>/
  engram demo --seed 7 --jumps 60             another, shorter series
  engram demo --robot talos                   Talos stands, squats and takes pushes
  engram demo --robot hector --jumps 10       a quadrotor visits ten way points in the wind
  engram demo --modes memory --clock wall     real time instead of lock step
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram demo`."""
    parser = subparsers.add_parser("demo", help=__doc__, description=__doc__, epilog=EXAMPLES)
    parser.add_argument("--robot", default="panda", help="robot to run (default: panda)")
    parser.add_argument("--task", help="task to run (default: stand, or the first by name)")
    parser.add_argument("--seed", type=int, default=1, help="of the task series; none repeats the training data (default: 1)")
    parser.add_argument("--jumps", type=int, help="jumps, way points or episodes (default: 300 jumps, or all)")
    parser.add_argument("--seconds", type=float, help="Talos at the pole: one episode of this length, with memory alone")
    parser.add_argument(
        "--modes", default="memory,line,shift,cold", help="what may seed the solver (default: memory,line,shift,cold)"
    )
    parser.add_argument("--jobs", type=int, default=2, help="modes run side by side (default: 2)")
    parser.add_argument(
        "--clock", choices=["lockstep", "wall"], default="lockstep", help="reproducible, or real time (default: lockstep)"
    )
    parser.add_argument("--out", type=Path, help="folder to write (default: runs/<time>/)")
    parser.add_argument(
        "--log-full", type=float, default=10.0, help="s of the log with every state, for `engram replay` (default: 10)"
    )
    parser.add_argument("--video", type=float, default=20.0, help="s of video; 0: none (default: 20)")
    parser.add_argument(
        "--plant-option", action="append", default=[], metavar="OPTION=VALUE", help="for engram-plant, e.g. noise-v=0.01"
    )
    parser.add_argument(
        "--figures",
        type=Path,
        default=BUILD / "figures",
        help="where demo.json goes; of another seed: demo-seed<n>.json (default: build/figures/)",
    )
    parser.add_argument("--controller", type=Path, help="program to run (default: engram-controller of the build)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Exit code 0: every mode ran to its end. 1: at least one did not."""
    from engram_sim.demo import demo

    return demo(args)
