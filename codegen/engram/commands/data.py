"""Draw random tasks and solve them: the motions that a memory is made from."""

import argparse
import hashlib
import json
import os
import time
from pathlib import Path

from engram.paths import BUILD, relative

CHUNK = 20  # tasks in a file: what a stop may lose, per worker

EXAMPLES = """examples:
  engram data panda reach                  as many tasks as models/panda/reach/task.toml asks for
  engram data panda reach --n 200 --seed 7 another, smaller set
  engram data talos step                   steps of Talos: planned, then refined; --n of each foot
  engram data talos step --cluster tcp://10.0.0.1:8786      on the workers of a Dask cluster; the same files
A run that was stopped goes on where it was; another seed, task, solver setting or build starts anew.
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram data`."""
    parser = subparsers.add_parser("data", help=__doc__, description=__doc__, epilog=EXAMPLES)
    parser.add_argument("robot", help="folder of models/ that holds a robot.toml")
    parser.add_argument("task", help="folder of models/<robot>/ that holds a task.toml and a world.xml")
    parser.add_argument("--n", type=int, help="tasks to draw (default: memory.samples of task.toml; steps: 6000 of each foot)")
    parser.add_argument("--seed", type=int, help="of the tasks (default: memory.seed of task.toml; steps: 1)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes (default: one per core)")
    parser.add_argument("--cluster", metavar="tcp://HOST:PORT", help="scheduler of a Dask cluster that does the work instead")
    parser.add_argument("--out", type=Path, default=BUILD / "data", help="where to write (default: build/data/)")
    return parser


def run(args: argparse.Namespace) -> int:
    """Write <robot>_<task>.npz (X, xs, us, cost, seeds, arrived; failures apart) and <robot>_<task>.json (a summary)."""
    from engram.learn.reproducible import restart_pinned

    restart_pinned()
    from engram.data import step_set
    from engram.inputs import InputError
    from engram.tasks.spec import load_task

    steps = (args.robot, args.task) == ("talos", "step")
    spec = None if steps else load_task(args.robot, args.task)
    n = (step_set.SAMPLES if steps else spec.memory["samples"]) if args.n is None else args.n
    seed = (step_set.SEED if steps else spec.memory["seed"]) if args.seed is None else args.seed
    if n < 1 or seed < 0 or args.workers < 1:
        raise InputError("--n and --workers must be at least 1, --seed at least 0")
    started = time.monotonic()
    if steps:
        summary = step_set.make(n, seed, args.workers, args.out, args.cluster)
    else:
        summary = solve_all(spec, n, seed, args.workers, args.out, args.cluster)
    name = f"{args.robot}_{args.task}"
    seconds = time.monotonic() - started
    print(f"data:   {relative(args.out)}/{name}.npz  {summary['solved']} of {summary['tasks']} tasks solved in {seconds:.0f} s")
    for reason, count in summary["failed"].items():
        print(f"data:   {count} left out: {reason}")
    return 0


def solve_all(spec, n: int, seed: int, workers: int, out: Path, cluster: str | None = None) -> dict:
    """Both passes over n tasks; writes the two files and returns the summary."""
    import numpy as np

    from engram.data import chunks, reach
    from engram.engine import engine

    settings = reach.Settings()
    name = f"{spec.robot.name}_{spec.name}"
    made_from = f"task {spec.digest:016x} seed {seed} {settings}"
    arguments = (spec.robot.name, spec.name, seed, settings)
    # what another build of the solver has left is not mixed with this one's
    key = f"{made_from} engine {hashlib.sha256(Path(engine.__file__).read_bytes()).hexdigest()[:16]}"
    lines = chunks.Chunks(out / f"{name}_lines", key, n, CHUNK)
    first = chunks.run(lines, reach.make_lines, arguments, workers, "data:   lines", cluster)
    # the neighbours of a task are among all n: another n is another second pass
    neighbours = chunks.Chunks(out / f"{name}_neighbours", f"{key} n {n}", n, CHUNK)
    arrays = chunks.run(neighbours, reach.make_neighbours, (*arguments, first), workers, "data:   neighbours", cluster)

    good = arrays["outcome"] == reach.OK
    kept = {key: arrays[key][good] for key in ("X", "xs", "us", "cost", "seeds", "iterations", "arrived")}
    reasons = [reach.REASONS[outcome] for outcome in arrays["outcome"][~good]]
    failed = {"failed_X": arrays["X"][~good], "failed_seeds": arrays["seeds"][~good], "failed_reason": np.array(reasons, "U40")}
    t = spec.dt * np.arange(spec.knots + 1)
    np.savez(out / f"{name}.npz", **kept, **failed, t=t, task_digest=np.uint64(spec.digest), made_from=np.array(made_from))
    better = np.sum(good & (arrays["cost"] < first["cost"] * (1 - 1e-6)))
    summary = {
        "made_from": made_from,
        "tasks": n,
        "solved": int(good.sum()),
        "arrived_within_horizon": int(kept["arrived"].sum()),
        "failed": {reason: reasons.count(reason) for reason in sorted(set(reasons))},
        "improved_by_neighbours": int(better),
        "cost_quantiles": dict(zip(("5", "50", "95"), np.quantile(kept["cost"], (0.05, 0.5, 0.95)).tolist(), strict=True)),
        "columns_of_X": [f"q{i} (rad)" for i in range(spec.robot.nq)]
        + [f"{task} ({unit})" for task, unit in zip(spec.vector_name, spec.vector_unit, strict=True)],
    }
    (out / f"{name}.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    return summary
