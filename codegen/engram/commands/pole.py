"""Learn the way around the pole: record guided runs of Talos, fit the memory, write its tables."""

import argparse
import subprocess
from pathlib import Path

from engram.paths import BUILD, TABLES, relative

RUNS, SEED = 110, 101

EXAMPLES = """examples:
  engram pole                      110 guided runs, tables/talos_pole/*.c, *.S, *.bin, tables.h, MANIFEST.json
  engram pole --runs 20 --out /tmp/tables
  engram pole --recording runs.bin       learn from runs that were recorded before
A change of models/talos/pole/ asks for new tables: engram task talos pole, build, engram pole, build. docs/pole.md
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram pole`."""
    parser = subparsers.add_parser("pole", help=__doc__, description=__doc__, epilog=EXAMPLES)
    parser.add_argument("--runs", type=int, default=RUNS, help=f"guided runs (default: {RUNS})")
    parser.add_argument("--seed", type=int, default=SEED, help=f"of their targets (default: {SEED})")
    parser.add_argument("--recording", type=Path, help="runs recorded before, instead of new ones")
    parser.add_argument("--out", type=Path, default=TABLES, help="where the tables' folder is (default: tables/)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Record, cut, fit, write."""
    from engram.learn.reproducible import restart_pinned

    restart_pinned()
    from engram.inputs import InputError
    from engram.learn.pole import cut, fit, read_recording
    from engram.tasks.motion import load_motion

    if args.runs < 10 or args.seed < 0:
        raise InputError("--runs must be at least 10, --seed at least 0")
    spec = load_motion("talos", "pole")
    recording = args.recording or record(args.runs, args.seed)
    if not recording.is_file():
        raise InputError(f"no recording {recording}; leave --recording out and the runs are made anew")
    samples, lost = cut(spec, read_recording(recording, spec))
    source = f"{len(set(samples.run))} runs guided around the pole, {lost} left out that did not arrive"
    manifest = fit(spec, samples, args.out / "talos_pole", f"engram pole; task {spec.digest:016x} seed {args.seed}; {source}")
    print(f"pole:   {len(samples.run)} samples of {source}")
    for table in manifest["tables"]:
        print(f"pole:   {table['name']}  {table['bytes']} bytes  {table['held_out_error']:.4f} {table['held_out_text']}")
    print(f"pole:   {relative(args.out / 'talos_pole')}: build again, so that the controller links them")
    return 0


def record(runs: int, seed: int) -> Path:
    """Guided runs into build/data/talos_pole.bin. Raises InputError."""
    from engram.inputs import InputError

    program, path = BUILD / "bin" / "engram-pole", BUILD / "data" / "talos_pole.bin"
    if not program.is_file():
        raise InputError(f"no {relative(program)}; build it: TARGETS=engram-pole scripts/setup.sh")
    path.parent.mkdir(parents=True, exist_ok=True)
    command = [program, f"motions={runs}", f"seed={seed}", "guide=1", f"record={path}"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=BUILD.parent)
    done = 0
    for line in process.stdout:
        done += line.startswith("motion")
        print(f"\rpole:   run {done} of {runs}", end="", flush=True)
    print()
    if process.wait() != 0:
        raise InputError(f"{relative(program)} failed; its message stands above")
    return path
