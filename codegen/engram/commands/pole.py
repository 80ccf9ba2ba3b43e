"""Learn the way around the pole: record guided runs of Talos, fit the memory, write its tables."""

import argparse
import os
from pathlib import Path

from engram.paths import BUILD, TABLES, relative

RUNS, SEED = 330, 101
SHARD = 10  # runs of one process

EXAMPLES = """examples:
  engram pole                      330 guided runs (5 min on two cores), tables/talos_pole/
  engram pole --runs 20 --out /tmp/tables
  engram pole --recording runs.bin       learn from runs that were recorded before
After a change of models/talos/pole/: engram task talos pole; TARGETS=engram-pole scripts/setup.sh; engram pole; scripts/setup.sh.
docs/pole.md
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
    """Guided runs into build/data/talos_pole.bin, on all cores; resumes what was stopped. Raises InputError."""
    from concurrent.futures import ThreadPoolExecutor

    from tqdm import tqdm

    from engram.data.pole_runs import run_shard, shards_folder

    folder = shards_folder(BUILD / "data" / "talos_pole")

    def shard(first: int) -> Path:
        many = min(SHARD, runs - first)
        path = folder / f"{seed}_{first}_{many}.bin"
        if not path.is_file():
            part = path.with_suffix(".part")
            run_shard(first, many, seed, "guide=1", f"record={part}")
            part.replace(path)
        return path

    firsts = range(0, runs, SHARD)
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        shards = list(tqdm(pool.map(shard, firsts), total=len(firsts), desc=f"pole:   {runs} runs", unit="shard"))
    path = BUILD / "data" / "talos_pole.bin"
    path.write_bytes(b"".join(each.read_bytes() for each in shards))
    return path
