"""Fit the memory of a robot and task to its solved motions and write the tables the controller links."""

import argparse
from dataclasses import replace
from pathlib import Path

from engram.paths import BUILD, TABLES, relative

EXAMPLES = """examples:
  engram data panda reach     first: the solved motions, build/data/panda_reach.npz
  engram fit panda reach      tables/panda_reach/*.c, *.S, *.bin, tables.h, MANIFEST.json
  engram fit panda reach --out /tmp/tables && engram table diff panda_reach /tmp/tables/panda_reach
  engram fit panda reach --contest 0       no contest: neighbours, mixture, train and regression, as good as they may be
The same data give the same bytes: the process restarts itself with pinned instruction sets and one thread.

The contest trains every learner (k-NN, regression, train, mixtures, networks) and solves held-out tasks from the best of its
guesses, beside controls: standing still, straight lines, random postures, nearest neighbours in as many bytes as it takes.
Which learners the controller asks, beside neighbours, regression and lines, is what succeeds most often together.
  success    arrives clear of obstacles within 50 iterations      subopt1, subopt3   median excess cost after 1 and 3 iterations
  modes      distinct postures among its answers                  query us           one query of its table, median
"""
LIMIT = 2_000_000  # bytes of all files of a memory
HELD_OUT = 10  # every tenth motion is kept out of the tables, to measure their errors and to calibrate the trust
TRIALS = 150  # of them, tasks on which guesses are tried
GOAL_CHOICES = 60  # of goals, by the memory as a metric
CONTEST = 100  # of them, tasks on which the learners compete


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram fit`."""
    parser = subparsers.add_parser("fit", help=__doc__, description=__doc__, epilog=EXAMPLES)
    parser.add_argument("robot", help="folder of models/ that holds a robot.toml")
    parser.add_argument("task", help="folder of models/<robot>/ that holds a task.toml")
    parser.add_argument("--data", type=Path, help="solved motions (default: build/data/<robot>_<task>.npz)")
    parser.add_argument("--out", type=Path, default=TABLES, help="where the tables' folder is (default: tables/)")
    parser.add_argument(
        "--trials", type=int, default=TRIALS, help=f"held-out tasks on which guesses are tried (default: {TRIALS})"
    )
    parser.add_argument(
        "--contest",
        type=int,
        default=CONTEST,
        help=f"held-out tasks on which all learners compete (default: {CONTEST}; 0: no contest)",
    )
    parser.add_argument(
        "--trainer",
        choices=("own", "torch"),
        default="own",
        help="of the networks in the contest: scikit-learn and our own descent, or PyTorch (scripts/setup.sh torch)",
    )
    return parser


def run(args: argparse.Namespace) -> int:
    """Fit, calibrate, write; prints the held-out errors and leaves them in build/figures/fit.json."""
    from engram.learn.reproducible import restart_pinned

    restart_pinned()
    from engram import pytorch
    from engram.emit import write_tables
    from engram.engine import engine
    from engram.inputs import InputError
    from engram.learn.contenders import Settings as LearnerSettings
    from engram.learn.contest import hold_contest
    from engram.learn.dataset import load_motions
    from engram.learn.figures import write_figures
    from engram.learn.memory import Ensemble, Settings, deployed, fit_memory
    from engram.learn.train import Settings as TrainSettings
    from engram.learn.train import fit_train
    from engram.learn.trials import decoding_loss, metric_regret, try_guesses
    from engram.learn.trust import fit_trust
    from engram.tasks.spec import load_task

    if (args.robot, args.task) == ("talos", "step"):
        from engram.learn.step_fit import fit_and_write

        fit_and_write(args.data or BUILD / "data" / "talos_step.npz", args.out)
        return 0
    if args.trainer == "torch" and not pytorch.available():
        raise InputError(pytorch.MISSING)
    if args.trials < 10:
        raise InputError("--trials must be at least 10")
    spec = load_task(args.robot, args.task)
    name = f"{args.robot}_{args.task}"
    source = load_motions(args.data or BUILD / "data" / f"{name}.npz", spec, HELD_OUT)
    motions = source.motions
    print(f"fit:    {len(motions.x)} motions, {int(motions.held_out.sum())} of them held out")

    def progress(text: str) -> None:
        print(f"fit:    {text}", flush=True)

    memory = fit_memory(motions, getattr(engine, args.robot), Settings(), progress)
    memory = replace(memory, train=fit_train(args.robot, motions, TrainSettings(), progress))
    names = ()
    if args.contest > 0:
        verdict = hold_contest(spec, memory, source, args.contest, LIMIT, LearnerSettings(trainer=args.trainer), progress)
        print("\n".join(f"fit:    {line}" for line in verdict.lines))
        write_figures("contest", [(f"contest.{key}", *figure) for key, *figure in verdict.figures])
        names, memory = verdict.names, replace(memory, ensemble=verdict.ensemble)
    else:
        memory = replace(memory, ensemble=Ensemble(8, (memory.mixture,), 4, True))
    progress("trust: trying guesses on held-out tasks")
    trust, trust_report = fit_trust(try_guesses(spec, memory, source, args.trials))
    tables, macro = deployed(name, memory, trust)
    manifest = write_tables(
        args.out / name,
        name,
        tables,
        robot_digest=spec.robot.digest,
        task_digest=spec.digest,
        data_digest=source.digest,
        provenance=f"engram fit {args.robot} {args.task}; {source.made_from}; {len(motions.x)} motions"
        + (f"; ensemble {', '.join(names)}" if names else ""),
        macros={f"{name.upper()}_MEMORY": macro},
    )
    size = sum(file["bytes"] for file in manifest["files"].values())
    report = [*memory.report, *decoding_loss(spec, memory, source), *trust_report, ("bytes", float(size), "byte")]
    counted = [(*line, int(motions.held_out.sum())) for line in report]
    counted += [(*line, GOAL_CHOICES) for line in metric_regret(spec, memory, source, GOAL_CHOICES)]
    for key, value, unit, _ in counted:
        print(f"fit:    {key:<28} {value:.4g} {unit}")
    write_figures("fit", [(f"fit.{name}.{key}", value, unit, n) for key, value, unit, n in counted])
    print(f"fit:    {relative(args.out / name)}: {len(manifest['files'])} files")
    if size > LIMIT:
        raise InputError(f"the tables take {size} bytes, the limit is {LIMIT}: fit fewer motions or coefficients")
    return 0
