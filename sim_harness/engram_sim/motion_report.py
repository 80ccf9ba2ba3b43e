"""report.html of the demo of a motion: one file without scripts, the video beside it."""

import html
import os
import platform
from pathlib import Path
from typing import Any

import numpy as np

from engram.paths import relative
from engram_sim import plots
from engram_sim.motion import Motion
from engram_sim.report import CLOCK, CSS, html_table, ladder

PHASES = ("query", "linearize", "backward", "rollout", "total")


def measures(part: dict[str, Any]) -> str:
    """What an episode or way point was judged by."""
    told = []
    if "com_drift_m" in part:
        told.append(f"centre of mass drifts {1e3 * part['com_drift_m']:.3f} mm")
    if "com_height_rms_m" in part:
        told.append(f"height error {1e3 * part['com_height_rms_m']:.1f} mm rms")
    if "pace" in part:
        told.append(f"mean {part['pace'][0]:.3f}, {part['pace'][1]:.3f} m/s, {part['pace'][2]:.3f} rad/s")
    if part.get("steps"):
        mean, most = 1e3 * part["landing_mean_m"], 1e3 * part["landing_max_m"]
        told.append(f"{part['steps']} steps, landing error {mean:.1f} mm, at most {most:.1f} mm")
        told.append(f"centre of mass {1e3 * part['com_rms_m']:.1f} mm rms off its reference")
    if "arrival_s" in part:
        told.append(f"arrives after {part['arrival_s']:.2f} s" if part["arrival_s"] >= 0.0 else "never there")
    if part.get("to_reach", 0) > 1:
        told.append(f"{part['reached']} of {part['to_reach']} targets reached, at most {1e3 * part['reach_error_m']:.1f} mm off")
    if "limit" in part["reason"] and part.get("joint_excess", 0.0) > 0.0:
        told.append(f"a joint {1e3 * part['joint_excess']:.1f} mrad beyond its limit")
    if "tilt_max_rad" in part:
        told.append(f"tilts {np.degrees(part['tilt_max_rad']):.1f} deg")
    return ", ".join(told)


def table(done: list[dict[str, Any]]) -> list[list[str]]:
    """Heading and one row per part."""
    rows = [["part", "outcome", "length", "torque", "measured"]]
    for part in done:
        length, torque = f"{part['t_end_s'] - part['t_start_s']:.1f} s", f"{100 * part['torque_share']:.0f} %"
        rows.append([part["name"].replace("_", " "), part["reason"].replace("+", ", "), length, torque, measures(part)])
    return rows


def times_table(summary: dict[str, Any]) -> str:
    """CPU time of a cycle by phase."""
    rows = [["phase (ms of CPU time)", "p50", "p99", "p999", "max"]]
    for phase in PHASES:
        times = summary.get(f"{phase}_us")
        if times and times["max"] > 0.0:
            rows.append([phase, *(f"{1e-3 * times[kind]:.2f}" for kind in rows[0][1:])])
    return html_table(rows) if len(rows) > 1 else ""


MODES = {"shift": "the shifted plan alone", "cold": "a cold start at every new target"}


def base_path(motion: Motion) -> str:
    """Height of the base and its way over ground, over plant time."""
    states = motion.messages["ENGRAM_STATE"]
    t = 1e-6 * states["utime"].astype(float)
    fig, ax = plots.figure(11.6, 3.0)
    labels = motion.tree.joint_name[:3] if motion.tree.formula else list("xyz")
    for axis, (label, colour) in enumerate(zip(labels, ("#e08a1e", "#7a8794", "#1769aa"))):
        ax.plot(t, states["q"][:, axis].astype(float), color=colour, linewidth=1.2, label=label)
    ylabel = "coordinates (m, rad)" if motion.tree.formula else "base (m)"
    ax.set(xlabel="plant time (s)", ylabel=ylabel, xlim=(0, t[-1] if len(t) else 1))
    plots.legend_above(ax, 3)
    return plots.svg(fig)


def write(folder: Path, motion: Motion, done: list[dict[str, Any]], summary: dict[str, Any], video: Path | None) -> Path:
    """Write report.html into `folder` and return its path."""
    robot, task = html.escape(summary["robot"]), html.escape(summary["task"])
    cards = [(f"{summary['successes']} of {summary['parts']}", "parts of the script are ok")]
    for mode, share in summary.get("beside", {}).items():
        cards.append((f"{100 * share:.0f} %", f"of the parts are ok with {MODES[mode]}"))
    if "total_us" in summary:
        cards.append((f"{1e-3 * summary['total_us']['p50']:.2f} ms", "CPU time of a cycle, median (period 10 ms)"))
    cards.append((f"{100 * summary['torque_share_max']:.0f} %", "of its limit is the largest torque"))
    if "arrival_median_s" in summary:
        cards.append((f"{summary['arrival_median_s']:.2f} s", "median time to arrive"))
    shown = f'<video src="{html.escape(video.name)}" controls loop muted preload="metadata"></video>' if video else ""
    charts = [
        (base_path(motion), "Base", "Position of the base over plant time; every part begins at its own place."),
        (plots.cycle_times([motion.run]), "Cycle time", "CPU time of a control period, all phases. Dotted: the period."),
        (plots.torques(motion), "Torque", "Commanded torque or thrust over its limit, joint by joint."),
    ]
    figures = "".join(f"<figure>{c}<figcaption><b>{t}.</b> {text}</figcaption></figure>" for c, t, text in charts if c)
    boxes = "".join(f'<div class="card"><b>{value}</b><span>{what}</span></div>' for value, what in cards)
    page = f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Engram: {robot} {task}</title><style>{CSS}</style></head><body><main>
<h1>Engram: {robot} {task}</h1>
<p class="lead">The deployed controller over LCM, seed {summary["seed"]}. {CLOCK[summary["clock"]]} at 1 kHz, planned at 100 Hz,
warm-started by its own shifted plan, and by a memory where there is one for the task.</p>
{shown}<div class="cards">{boxes}</div>
<h2>The script, part by part</h2>{html_table(table(done))}
<h2>Time</h2>{times_table(summary)}
<h2>Figures</h2><div class="grid">{figures}</div>
<h2>Fall-back ladder</h2><p>Share of cycles by what drove the torque.</p>{ladder([motion])}
<h2>Again</h2>
<p><code>make demo ROBOT={robot} TASK={task} SEED={summary["seed"]}</code></p>
<p><code>engram replay {html.escape(relative(motion.run.log))}</code></p>
<footer>{platform.system()}, {platform.machine()}, {os.cpu_count()} CPUs.</footer>
</main></body></html>
"""
    path = folder / "report.html"
    path.write_text(page, encoding="utf-8")
    return path
