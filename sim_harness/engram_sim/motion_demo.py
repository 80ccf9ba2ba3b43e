"""The demo of a motion: one script, the deployed controller over LCM, and what came out of it."""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from engram.inputs import InputError
from engram.paths import relative
from engram.tasks.motion import load_motion
from engram.tasks.scene import write_shown_scene
from engram_sim import motion_report, scenarios, video, walking
from engram_sim.motion import Motion
from engram_sim.pair import Pair, Progress, plant_option, private_port, scene
from engram_sim.results import Run, read_run, wilson

MODE = "memory"  # what seeds the solver: the shifted plan, and a memory where the robot has one for the task
BESIDE = {"talos_pole": ("shift", "cold"), "talos_walk": ("shift", "cold")}  # run beside it, where a memory is asked as it goes
LOG_EVERY = 40  # plant steps between two states of the log
LOG_FULL = 10.0  # s of the log with every state
PERCENTILES = {"p50": 50.0, "p99": 99.0, "p999": 99.9, "max": 100.0}


def demo(args: argparse.Namespace, folder: Path) -> int:
    """Run the motion's script into `folder`; arguments as the parser of `engram demo` has them."""
    start = time.monotonic()
    if args.jumps is not None and args.jumps < 1:
        raise InputError("--jumps: at least one way point or episode")
    spec = load_motion(args.robot, args.task)
    script = scenarios.script(spec, args.seed, args.jumps, args.seconds)
    path = folder / f"{script.kind}.txt"
    script.write(path)
    print(f"{script.kind:<8}{script.parts} parts, seed {args.seed}: {relative(path)}")

    beside = BESIDE.get(f"{args.robot}_{args.task}", ()) if args.seconds is None else ()
    for mode in (MODE, *beside):
        if not run_mode(args, folder, mode, script, path):
            return 1
    header = {"robot": args.robot, "task": args.task, "seed": args.seed, "clock": args.clock, "site": script.site}
    return finish(folder, header, args.video, args.figures, start)


def run_mode(args: argparse.Namespace, folder: Path, mode: str, script: scenarios.Script, path: Path) -> bool:
    """One run of the script at `path` into folder/mode. False if it did not come to its end, which is said."""
    progress, outcomes = Progress(script.parts, f"{mode:<8}"[:7]), []

    def ended(part: int, parts: int, outcome: str, seconds: float) -> None:
        outcomes.append(outcome)
        progress.show(part, f"{outcomes.count('ok')}/{part} ok")

    pair = Pair(folder / mode, path, scene(args.robot, args.task), private_port(), mode, f"{args.robot}_{args.task}", script.kind)
    pair.clock, pair.controller = args.clock, args.controller
    options = [word for option in args.plant_option for word in plant_option(option)]
    pair.plant_options = ["--log-full", str(LOG_FULL), "--log-every", str(LOG_EVERY), *script.plant_options, *options]
    code = pair.run(ended)
    if "other task" in last_line(pair.folder / "controller.txt"):
        print("\ndemo: the controller refused the tasks, it was built from another task.h; build it again: make setup")
    elif code != 0:
        print(f"\ndemo: ended with exit code {code}:\n{pair.last_words()}")
    return code == 0


def finish(folder: Path, header: dict[str, Any], seconds: float, figures_folder: Path, start: float | None = None) -> int:
    """Video (of `seconds`, 0: none), report, summary and figures of the run in `folder`. Exit code 0: all parts are ok."""
    run = read_run(MODE, folder / MODE)
    spec = load_motion(header["robot"], header["task"])
    if not parts(run):
        raise InputError(f"{relative(folder)}: no part of the script has ended; nothing to report")
    motion = Motion(run, spec.robot, header["site"])
    for part in parts(run):
        part.update(walking.measure(motion, part))
    names = BESIDE.get(f"{header['robot']}_{header['task']}", ())
    beside = [read_run(mode, folder / mode) for mode in names if (folder / mode / "results.json").is_file()]
    drawn = folder / "demo.mp4"
    if seconds > 0:
        clips = choose(run, seconds, whole=bool(beside))
        video.draw(
            [run, *beside],
            [clip_line(*clip) + "".join(panel(other, clip) for other in beside) for clip in clips],
            write_shown_scene(spec),
            drawn,
            header["site"],
            title="" if beside else f"{spec.robot.name} {spec.name}",
        )
        video.still(drawn, folder / "demo.png", min(2.0, seconds / 2.0))
    summary = header | summarize(run)
    if beside:
        summary["beside"] = {other.mode: sum(part["success"] for part in parts(other)) / len(parts(other)) for other in beside}
    if start is not None:
        summary["wall_s"] = round(time.monotonic() - start, 1)
    (folder / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    figures_folder.mkdir(parents=True, exist_ok=True)
    name = subject(header["robot"], header["task"])
    records = json.dumps(figures(name, run, summary), indent=1) + "\n"
    (figures_folder / f"demo_{name.replace('.', '_')}.json").write_text(records, encoding="utf-8")
    page = motion_report.write(folder, motion, parts(run), summary, drawn if drawn.is_file() else None)
    print_summary(summary, run)
    print(f"said    {last_line(run.folder / 'controller.txt')}")
    print(f"report  {relative(page)}")
    if drawn.is_file():
        print(f"video   {relative(drawn)}")
    print(f"log     {relative(run.log)}   (engram replay, lcm-logplayer)")
    return 0 if summary["successes"] == summary["parts"] else 1


def last_line(path: Path) -> str:
    """How the controller ended: its tally of cycles, rungs and troubles."""
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []
    return lines[-1] if lines else "nothing"


def parts(run: Run) -> list[dict[str, Any]]:
    """Episodes or way points that came to their end, named."""
    if "episodes" in run.plant:
        return [part for part in run.plant["episodes"] if part["t_end_s"] > 0.0]
    return [{"name": f"way_point_{jump['jump']}", **jump} for jump in run.finished()]


def summarize(run: Run) -> dict[str, Any]:
    """Shares, extremes and times of a run."""
    done = parts(run)
    good = sum(part["success"] for part in done)
    low, high = wilson(good, len(done))
    row: dict[str, Any] = {
        "parts": len(done),
        "successes": good,
        "success": good / len(done),
        "success_low": low,
        "success_high": high,
    }
    row["torque_share_max"] = max(part["torque_share"] for part in done)
    row["sim_s"] = run.plant["sim_seconds"]
    for key in ("com_drift_m", "com_height_rms_m", "com_rms_m", "landing_max_m"):
        values = [part[key] for part in done if key in part]
        if values:
            row[f"{key}_max"] = max(values)
    steps = [part for part in done if part.get("steps")]
    if steps:
        row["steps"] = sum(part["steps"] for part in steps)
        row["landing_mean_m"] = sum(part["steps"] * part["landing_mean_m"] for part in steps) / row["steps"]
    arrivals = [part["arrival_s"] for part in done if part.get("arrival_s", -1.0) >= 0.0]
    if arrivals:
        row["arrival_median_s"] = float(np.median(arrivals))
    for phase in ("query", "linearize", "backward", "rollout", "total"):
        values = run.timing.get(f"{phase}_us", np.array([]))
        if len(values):
            row[f"{phase}_us"] = {kind: float(np.percentile(values, q)) for kind, q in PERCENTILES.items()} | {"n": len(values)}
    return row


def subject(robot: str, task: str) -> str:
    """What figures are named after: the robot, and its task if it has others that are shown."""
    return f"{robot}.{task}" if task in ("walk", "pole") else robot


def figures(name: str, run: Run, summary: dict[str, Any]) -> list[dict[str, Any]]:
    """Records demo.<name>.<what>; what was not measured is absent."""
    records = []

    def add(what: str, value: float | None, unit: str, n: int) -> None:
        if value is not None:
            records.append({"id": f"demo.{name}.{what}", "value": value, "unit": unit, "n": n})

    n = summary["parts"]
    add("success", summary["success"], "1", n)
    add("torque_share_max", summary["torque_share_max"], "1", n)
    add("com_drift_m", summary.get("com_drift_m_max"), "m", 1)
    add("com_height_rms_m", summary.get("com_height_rms_m_max"), "m", 1)
    add("steps", summary.get("steps"), "1", n)
    add("landing_mean_m", summary.get("landing_mean_m"), "m", summary.get("steps", 0))
    add("landing_max_m", summary.get("landing_max_m_max"), "m", summary.get("steps", 0))
    add("com_rms_m", summary.get("com_rms_m_max"), "m", n)
    add("arrival_s", summary.get("arrival_median_s"), "s", summary["successes"])
    for part in parts(run):
        if "pace" in part:
            add(f"pace.{part['name']}", part["pace"][0], "m/s", 1)
    for mode, success in summary.get("beside", {}).items():
        add(f"success.{mode}", success, "1", n)
    for phase in ("linearize", "backward", "rollout", "total"):
        times = summary.get(f"{phase}_us", {})
        for kind in PERCENTILES:
            add(f"cycle_us.{kind}" if phase == "total" else f"{phase}_us.{kind}", times.get(kind), "us", times.get("n", 0))
    return records


def choose(run: Run, seconds: float, whole: bool = False) -> list[tuple[str, float, float, str]]:
    """Title, begin, end (s) and outcome of clips of about `seconds` in all; failed parts come first; `whole`: to their ends."""
    done = sorted(parts(run), key=lambda part: part["success"])
    kinds: dict[str, dict[str, Any]] = {}
    for part in done:  # one of each kind: pushes differ by heading only
        kinds.setdefault(part["name"].partition("_at_")[0] if "episodes" in run.plant else part["name"], part)
    chosen, total = [], 0.0
    longest = np.inf if whole else max(4.0, seconds / max(1, min(len(kinds), 8)))
    for name, part in kinds.items():
        end = min(part["t_end_s"], part["t_start_s"] + longest)
        if total >= seconds:
            break
        total += end - part["t_start_s"]
        outcome = "" if end < part["t_end_s"] else "ok" if part["success"] else part["reason"].replace("+", ", ")
        chosen.append((name.replace("_", " "), part["t_start_s"], end, outcome))
    return sorted(chosen, key=lambda clip: clip[1])


def clip_line(title: str, begin: float, end: float, outcome: str) -> str:
    """One line of a clips file of engram-render."""
    return f"{end - begin + video.AFTER:.3f};{title};{begin:.3f};{end:.3f};{outcome}"


def panel(run: Run, clip: tuple[str, float, float, str]) -> str:
    """The same part in another mode, for a panel beside; where the robot fell, it was over earlier."""
    title, begin, end, said = clip
    part = next(part for part in parts(run) if part["name"].replace("_", " ") == title)
    outcome = "ok" if part["success"] else part["reason"].replace("+", ", ")
    over = min(part["t_start_s"] + end - begin, part["t_end_s"])
    return f";{part['t_start_s']:.3f};{over:.3f};{outcome if said else ''}"


def print_summary(summary: dict[str, Any], run: Run) -> None:
    """The run on one screen."""
    print(f"\n{summary['robot']} {summary['task']}, seed {summary['seed']}, {summary['sim_s']:.0f} s of plant time")
    for row in motion_report.table(parts(run)):
        print("  ".join(cell.ljust(width) for cell, width in zip(row, (28, 16, 10, 10, 30))).rstrip())
    times = summary.get("total_us")
    if times:
        spread = ", ".join(f"{kind} {1e-3 * times[kind]:.2f}" for kind in PERCENTILES)
        print(f"\nCPU time of a cycle (ms): {spread}; {times['n']} cycles")
    torque = f"largest torque {100 * summary['torque_share_max']:.1f} % of its limit"
    beside = "".join(f"; {mode} {100 * share:.0f} %" for mode, share in summary.get("beside", {}).items())
    print(f"{summary['successes']} of {summary['parts']} ok{beside}, {torque}\n")
