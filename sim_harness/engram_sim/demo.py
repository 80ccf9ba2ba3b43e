"""The demo: one task series, several modes of the controller, and what came out of it."""

import argparse
import itertools
import json
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from engram.inputs import InputError, closest
from engram.paths import BUILD, ROOT, relative
from engram.robots.spec import known_robots
from engram.tasks.scene import write_shown_scene
from engram.tasks.spec import known_tasks, load_task, open_task
from engram_sim import motion_demo, report, suboptimality, video
from engram_sim.motion import Motion
from engram_sim.pair import Pair, Progress, plant_option, private_port, scene
from engram_sim.results import MODES, Run, figures, figures_name, read_run, read_runs
from engram_sim.series import write_reach

JUMPS = 300  # of a series, unless told otherwise
LOG_EVERY = 40  # plant steps between two states (and cycles) of the log: 25 a second, as many as the video shows
LOG_TRUNCATED = 3  # exit code of engram-plant: all done, but the disk was full
SLOWEST_FIRST = ("memory", "cold", "shift", "line")  # so that no long run is left alone at the end


def demo(args: argparse.Namespace) -> int:
    """Run `engram demo`; arguments as its parser has them."""
    if args.robot not in known_robots():
        raise InputError(f"unknown robot '{args.robot}'; {closest(args.robot, known_robots())}")
    if not known_tasks(args.robot):
        raise InputError(f"robot '{args.robot}' has no task; write models/{args.robot}/<task>/task.toml")
    args.task = args.task or ("stand" if "stand" in known_tasks(args.robot) else known_tasks(args.robot)[0])
    if open_task(args.robot, args.task).data["kind"] == "reach":
        return reach_demo(args)
    return motion_demo.demo(args, run_folder(args.out))


def run_folder(out: Path | None, runs: Path = ROOT / "runs") -> Path:
    """The folder of a new run: `out`, or one of the date in `runs`. `latest` beside it then shows to it."""
    if out:
        folder = out.resolve()
        folder.mkdir(parents=True, exist_ok=True)
    else:
        folder = new_folder(runs / time.strftime("%Y-%m-%d-%H%M%S"))
    point_latest(folder)
    return folder


def new_folder(wanted: Path) -> Path:
    """`wanted`, made now; `wanted`-2, -3, ... if another run began in the same second."""
    wanted.parent.mkdir(parents=True, exist_ok=True)
    for n in itertools.count(1):
        folder = wanted if n == 1 else wanted.with_name(f"{wanted.name}-{n}")
        try:
            folder.mkdir()
            return folder
        except FileExistsError:
            continue


def reach_demo(args: argparse.Namespace) -> int:
    """A series of targets in several modes of the controller."""
    start = time.monotonic()
    args.jumps = JUMPS if args.jumps is None else args.jumps
    modes = [mode.strip() for mode in args.modes.split(",") if mode.strip()]
    if unknown := [mode for mode in modes if mode not in MODES]:
        raise InputError(f"--modes: unknown mode '{unknown[0]}'; known: {', '.join(MODES)}")
    if args.jumps < 1 or not modes:
        raise InputError("--jumps and --modes: at least one jump and one mode")
    folder = run_folder(args.out)
    series = folder / "series.txt"
    moving = write_reach(series, args.robot, args.task, args.seed, args.jumps)
    print(f"series  {args.jumps} jumps, {moving} moving targets, seed {args.seed}: {relative(series)}")
    spec = load_task(args.robot, args.task)
    header = {"robot": args.robot, "task": args.task, "seed": args.seed, "jumps": args.jumps, "clock": args.clock}
    header |= {"video_s": args.video, "window_s": spec.success["time"], "tolerance_m": spec.success["position"]}
    write_summary(folder, header)  # enough for `engram report`, should this process be stopped

    codes = run_modes(args, modes, folder, series)
    done = [mode for mode in MODES if mode in modes and codes[mode] in (0, LOG_TRUNCATED)]
    if not done:
        print("demo: no mode has run to its end; the reasons are above")
        return 1

    runs = [read_run(mode, folder / mode) for mode in done]
    drawn = None
    if args.video > 0:
        drawn = video.render(runs, write_shown_scene(spec), folder / "demo.mp4", spec.frame, args.video, args.jobs)
    finish(folder, runs, header, drawn, time.monotonic() - start, args.figures)
    return 0 if len(done) == len(modes) and all(code == 0 for code in codes.values()) else 1


def run_modes(args: argparse.Namespace, modes: list[str], folder: Path, series: Path) -> dict[str, int]:
    """Run all modes, `args.jobs` at a time; the exit code of each mode's plant."""
    options = [word for option in args.plant_option for word in plant_option(option)]
    progress = Progress(len(modes) * args.jumps, "run   ")
    ended: dict[str, list[bool]] = {mode: [] for mode in modes}

    def run_mode(mode: str) -> int:
        def jumped(jump: int, jumps: int, outcome: str, seconds: float) -> None:
            ended[mode].append(outcome == "ok")
            note = "  ".join(f"{name} {sum(good)}/{len(good)}" for name, good in ended.items() if good)
            progress.show(sum(map(len, ended.values())), note)

        pair = Pair(folder / mode, series, scene(args.robot, args.task), private_port(MODES.index(mode)), mode, clock=args.clock)
        pair.model = f"{args.robot}_{args.task}"
        pair.controller = args.controller
        pair.plant_options = ["--log-full", str(args.log_full), "--log-every", str(LOG_EVERY), *options]
        code = pair.run(jumped)
        if code != 0:
            print(f"\ndemo: {mode} ended with exit code {code}:\n{pair.last_words()}")
        return code

    order = [mode for mode in SLOWEST_FIRST if mode in modes]
    with ThreadPoolExecutor(max(1, args.jobs)) as pool:
        return dict(zip(order, pool.map(run_mode, order)))


def point_latest(folder: Path) -> None:
    """Let runs/latest show to `folder`, if it lies beside it. In one step: another demo may do the same at this moment."""
    latest = folder.parent / "latest"
    if latest.exists() and not latest.is_symlink():
        return
    own = folder.parent / f".latest-{folder.name}"
    os.symlink(folder.name, own)
    own.replace(latest)


def finish(
    folder: Path, runs: list[Run], header: dict[str, Any], drawn: Path | None, seconds: float, figures_folder: Path
) -> None:
    """Write summary.json, report.html and the figures; print the summary."""
    curves = suboptimality.curves(runs, header["robot"], header["task"])
    for run in runs:
        if run.mode in curves:
            run.suboptimality = {k: curves[run.mode][:, k] for k in (1, 3)}
    summary = header | {"wall_s": round(seconds, 1), "modes": {run.mode: run.summary() for run in runs}}
    write_summary(folder, summary)
    records = figures(header["robot"], runs, header["seed"])
    figures_folder.mkdir(parents=True, exist_ok=True)
    (figures_folder / figures_name(header["seed"])).write_text(json.dumps(records, indent=1) + "\n", encoding="utf-8")

    spec = load_task(header["robot"], header["task"])
    motions = [Motion(run, spec.robot, spec.frame) for run in runs]
    page = report.write(folder, runs, motions, summary, curves, drawn)
    if drawn:
        video.still(drawn, folder / "demo.png", video.telling_second(runs, header["video_s"]))
    print_summary(summary)
    print(f"report  {relative(page)}")
    if drawn:
        print(f"video   {relative(drawn)}")
    megabytes = sum(run.plant["log"]["bytes"] for run in runs) / 1e6
    print(f"log     {relative(runs[0].log)}   (engram replay, lcm-logplayer; {megabytes:.0f} MB in all modes)")
    for run in runs:
        if run.plant["log"]["truncated"]:
            print(f"demo: the log of {run.mode} is cut short: the disk was full")


def write_summary(folder: Path, summary: dict[str, Any]) -> None:
    """summary.json of a demo."""
    (folder / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")


def print_summary(summary: dict[str, Any]) -> None:
    """The tables of the report on the terminal."""
    print(f"\n{summary['robot']} {summary['task']}, {summary['jumps']} jumps, seed {summary['seed']}, {summary['wall_s']:.0f} s")
    for rows in (report.table(summary), report.guess_table(summary)):
        if len(rows) == 1:
            continue
        widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]))]
        for row in rows:
            print("  ".join([row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:]))]))
        print()


def read_summary(folder: Path) -> dict[str, Any]:
    """summary.json of a demo. Raises InputError."""
    try:
        return json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise InputError(f"{relative(folder)}/summary.json: cannot be read ({error}); give the folder of a demo") from None


def is_motion(header: dict[str, Any]) -> bool:
    """Whether the summary is that of a motion's demo."""
    return open_task(header["robot"], header["task"]).data["kind"] == "motion"


def report_again(folder: Path, figures_folder: Path) -> int:
    """Write the report of a finished demo again."""
    folder = folder.resolve()
    header = read_summary(folder)
    if is_motion(header):
        return motion_demo.finish(folder, header, 0.0, figures_folder)
    drawn = folder / "demo.mp4"
    finish(folder, read_runs(folder), header, drawn if drawn.is_file() else None, header.get("wall_s", 0.0), figures_folder)
    return 0


def render_again(folder: Path, seconds: float, modes: str | None, jobs: int, out: Path | None) -> int:
    """Draw the video of a finished demo again."""
    folder = folder.resolve()
    header = read_summary(folder)
    if is_motion(header):
        return motion_demo.finish(folder, header, seconds, BUILD / "figures")
    wanted = modes.split(",") if modes else list(MODES)
    runs = [run for run in read_runs(folder) if run.mode in wanted]
    if not runs:
        raise InputError(f"--modes {modes}: the run has none of them")
    spec = load_task(header["robot"], header["task"])
    path = video.render(runs, write_shown_scene(spec), out or folder / "demo.mp4", spec.frame, seconds, jobs)
    print(f"video   {relative(path)}" if path else "render: no jump was finished by all modes; nothing to show")
    return 0 if path else 1
