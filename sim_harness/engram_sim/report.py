"""report.html of a demo: one file without scripts, the video beside it."""

import html
import os
import platform
from pathlib import Path
from typing import Any

from engram.paths import relative
from engram_sim import plots
from engram_sim.motion import Motion
from engram_sim.results import Run, enumerators

CSS = """
:root { --ink: #1f2933; --soft: #52606d; --line: #e4e7eb; --accent: #1769aa; --page: #f7f8fa; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--ink); font: 16px/1.55 system-ui, -apple-system, "Segoe UI", sans-serif; }
main { max-width: 1180px; margin: 0 auto; padding: 2.2rem 1.2rem 4rem; }
h1 { font-size: 1.9rem; margin: 0; letter-spacing: -0.02em; }
h2 { font-size: 1.15rem; margin: 2.6rem 0 0.8rem; }
p.lead { color: var(--soft); margin: 0.3rem 0 1.4rem; }
video { width: 100%; border-radius: 10px; background: #000; display: block; }
.cards { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fit, minmax(210px, 1fr)); margin: 1.4rem 0; }
.card, figure, .table { background: #fff; border: 1px solid var(--line); border-radius: 10px; }
.card { padding: 0.9rem 1.1rem; }
.card b { display: block; font-size: 1.7rem; letter-spacing: -0.02em; color: var(--accent); }
.card span { color: var(--soft); font-size: 0.88rem; }
.grid { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fit, minmax(430px, 1fr)); }
figure { margin: 0; padding: 0.9rem 1rem 0.7rem; }
figure svg { width: 100%; height: auto; display: block; }
figcaption { font-size: 0.88rem; color: var(--soft); margin-top: 0.3rem; }
figcaption b { color: var(--ink); }
.table { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: 0.94rem; }
th, td { padding: 0.5rem 0.9rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; }
th:first-child, td:first-child { text-align: left; }
th { color: var(--soft); font-weight: 600; font-size: 0.84rem; }
tr:last-child td { border-bottom: 0; }
tr.first td { font-weight: 600; background: #f0f6fb; }
.swatch { display: inline-block; width: 0.75em; height: 0.75em; border-radius: 3px; margin-right: 0.5em; }
code { background: #eef1f4; padding: 0.1em 0.35em; border-radius: 4px; font-size: 0.9em; }
details { margin-top: 1rem; } summary { cursor: pointer; color: var(--accent); }
footer { margin-top: 3rem; color: var(--soft); font-size: 0.85rem; }
"""

CLOCK = {"lockstep": "Simulated in lock step", "wall": "Simulated in real time"}
MODES_TEXT = """<b>memory</b>: remembered motions, straight lines and the shifted plan compete, the lowest merit seeds the solver.
<b>line</b>: straight lines to an inverse kinematics solution, and the shifted plan. <b>shift</b>: the shifted plan only.
<b>cold</b>: at a jump stand still, else the shifted plan."""
VIDEO = """Parts of the run, all modes on the same tasks: the first jumps as they came, then jumps that tell the modes apart.
Orange: planned path of the hand. Blue: its way so far. Axes: the target."""
SUBOPTIMALITY = """Distance of the merit at a jump from the best known solution of the same problem, after each iteration of FDDP.
Median; band: quartiles."""
HAND_ERROR = """Median distance of hand and target; band: 10th to 90th percentile with memory; dotted: tolerance.
A jump that has ended keeps its last value."""


def number(value: float | None, form: str = ".2f", scale: float = 1.0, unit: str = "") -> str:
    """A figure, or a dash for what was not measured."""
    return "–" if value is None else f"{scale * value:{form}}{unit}"


def suboptimality_text(value: float | None) -> str:
    """Relative figure with two digits."""
    return "–" if value is None else f"{value:.2g}" if value < 100 else f"{value:.0f}"


# heading, text of a row
COLUMNS = [
    ("success", lambda r: number(r.get("success"), ".1f", 100, " %")),
    ("95 % interval", lambda r: f"{number(r.get('success_low'), '.1f', 100)} – {number(r.get('success_high'), '.1f', 100)}"),
    ("late", lambda r: str(r["late"])),
    ("contact", lambda r: str(r["contact"])),
    ("limit", lambda r: str(r["limit"])),
    ("arrival, median", lambda r: number(r.get("arrival_median_s"), ".2f", 1, " s")),
    ("subopt. after 1", lambda r: suboptimality_text(r.get("subopt1"))),
    ("after 3", lambda r: suboptimality_text(r.get("subopt3"))),
    ("cycle p50", lambda r: number(r.get("cycle_us", {}).get("p50"), ".2f", 1e-3, " ms")),
    ("p99", lambda r: number(r.get("cycle_us", {}).get("p99"), ".2f", 1e-3, " ms")),
    ("max", lambda r: number(r.get("cycle_us", {}).get("max"), ".1f", 1e-3, " ms")),
    ("query share", lambda r: number(r.get("query_share"), ".1f", 100, " %")),
]


def table(summary: dict[str, Any]) -> list[list[str]]:
    """Heading and one row per mode, as texts; columns that nothing was measured for are left out."""
    rows = [["mode", *(heading for heading, _ in COLUMNS)]]
    rows += [[mode, *(text(row) for _, text in COLUMNS)] for mode, row in summary["modes"].items()]
    kept = [0] + [c for c in range(1, len(rows[0])) if any(row[c] != "–" for row in rows[1:])]
    return [[row[c] for c in kept] for row in rows]


GUESSES_TEXT = (
    "Guesses of the mode memory, by who proposes them: the share of jumps at which one of them had the lowest merit and seeded "
    "the solver, and the CPU time of a cycle that it takes to ask for them, decoding included."
)


def guess_table(summary: dict[str, Any]) -> list[list[str]]:
    """Heading and one row per kind of guess in the mode memory; the heading alone if there is nothing to tell."""
    row = summary["modes"].get("memory", {})
    won, asked = row.get("won", {}), row.get("asked_us", {})
    rows = [["guesses", "won", "asked p50", "p99"]]
    for kind in sorted(won.keys() | asked.keys(), key=lambda kind: (-won.get(kind, 0.0), kind)):
        us = asked.get(kind, {})
        rows.append(
            [kind, number(won.get(kind, 0.0), ".1f", 100, " %"), *(number(us.get(p), ".0f", 1, " us") for p in ("p50", "p99"))]
        )
    return rows


def html_table(rows: list[list[str]], swatches: bool = False) -> str:
    """A table; with `swatches` the first column carries the mode's colour and the first row is set off."""
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in rows[0])
    body = []
    for i, row in enumerate(rows[1:]):
        cells = [html.escape(cell) for cell in row]
        if swatches:
            cells[0] = f'<span class="swatch" style="background:{plots.COLOUR.get(row[0], plots.INK)}"></span>{cells[0]}'
        mark = ' class="first"' if swatches and i == 0 else ""
        body.append(f"<tr{mark}>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    return f'<div class="table"><table><tr>{head}</tr>{"".join(body)}</table></div>'


def failures(runs: list[Run], limit: int = 40) -> str:
    """Every failed jump of the first mode, with what the plant saw."""
    run, statuses = runs[0], enumerators("engram_status")
    rows = [["jump", "plant time", "reason", "contact", "hand at the end", "controller's statuses"]]
    for jump in run.finished():
        if jump["success"]:
            continue
        said = ", ".join(f"{statuses[int(s)] if int(s) < len(statuses) else s} {n} ms" for s, n in jump["statuses"].items())
        contact = f"{jump['contact']} at {jump['contact_time_s']:.2f} s" if jump["contact"] else "–"
        where = f"{1e3 * jump['position_error_m']:.0f} mm, {jump['rotation_error_rad']:.2f} rad"
        rows.append([str(jump["jump"]), f"{jump['t_start_s']:.2f} s", jump["reason"].replace("+", ", "), contact, where, said])
    if len(rows) == 1:
        return f"<p>No jump of <b>{run.mode}</b> failed.</p>"
    more = f"<p>{len(rows) - 1 - limit} more are in results.json.</p>" if len(rows) - 1 > limit else ""
    return (
        f"<details><summary>{len(rows) - 1} failed jumps of {run.mode}</summary>{html_table(rows[: limit + 1])}{more}</details>"
    )


def ladder(motions: list[Motion]) -> str:
    """Share of cycles on each rung of the fall-back ladder; a thinned log has too many that answer a jump: they are left out."""
    rungs = enumerators("engram_rung")
    rows = [["mode", *rungs]]
    for motion in motions:
        rung = motion.later_cycles()["rung"]
        if len(rung):
            rows.append([motion.run.mode, *(f"{100.0 * (rung == i).mean():.2f} %" for i in range(len(rungs)))])
    return html_table(rows, swatches=True) if len(rows) > 1 else ""


def cards(summary: dict[str, Any]) -> str:
    """The run in a few large figures."""
    modes = summary["modes"]
    first = next(iter(modes.values()))
    shown = [(number(first.get("success"), ".1f", 100, " %"), f"of {first['jumps']} jumps succeed with {next(iter(modes))}")]
    others = {mode: row["success"] for mode, row in list(modes.items())[1:] if "success" in row}
    if others:
        best = max(others, key=others.get)
        shown.append((number(others[best], ".1f", 100, " %"), f"with the best other start ({best})"))
    if "arrival_median_s" in first:
        shown.append((number(first["arrival_median_s"], ".2f", 1, " s"), "median time to arrive"))
    if "cycle_us" in first:
        shown.append((number(first["cycle_us"]["p50"], ".2f", 1e-3, " ms"), "CPU time of a cycle, median (period 10 ms)"))
    return (
        '<div class="cards">'
        + "".join(f'<div class="card"><b>{value}</b><span>{what}</span></div>' for value, what in shown)
        + "</div>"
    )


def write(
    folder: Path, runs: list[Run], motions: list[Motion], summary: dict[str, Any], curves: dict[str, Any], video: Path | None
) -> Path:
    """Write report.html into `folder` and return its path. `curves`: suboptimality over iterations by mode, may be empty."""
    window, tolerance = summary["window_s"], summary["tolerance_m"]
    first = motions[0]
    # figure, title, caption
    charts = [
        (plots.success(runs), "Success", "Hand within tolerance in time and held there, no contact, limits kept."),
        (
            plots.arrivals(runs, window),
            "Arrival",
            "How soon successful jumps arrive; each curve ends at its mode's success rate.",
        ),
        (plots.suboptimality(curves) if curves else None, "Cost over iterations", SUBOPTIMALITY),
        (plots.hand_error(motions, window, tolerance), "Hand error", HAND_ERROR),
        (plots.candidates(first), "Merit by candidate", f"What each kind of guess was worth at jumps in mode {first.run.mode}."),
        (plots.winners(motions), "Winners", "Which guess seeded the solver at jumps."),
        (plots.cycle_times(runs), "Cycle time", "CPU time of a control period, all phases. Dotted: the period."),
        (plots.phases(first), "Phases", f"Where the CPU time goes in mode {first.run.mode}."),
        (plots.torques(first), "Torque", f"Commanded torque over its limit in mode {first.run.mode}."),
    ]
    figures = "".join(
        f"<figure>{chart}<figcaption><b>{title}.</b> {text}</figcaption></figure>" for chart, title, text in charts if chart
    )
    robot, task = html.escape(summary["robot"]), html.escape(summary["task"])
    shown = ""
    if video:
        name = html.escape(video.stem)
        shown = f'<video src="{name}.mp4" poster="{name}.png" controls loop muted preload="metadata"></video><p>{VIDEO}</p>'
    moves = [
        f"{mode} {1e3 * row['move_error_mean_m']:.1f} mm" for mode, row in summary["modes"].items() if "move_error_mean_m" in row
    ]
    moving = f"<p>While the target moves, the hand is on average this far from it: {', '.join(moves)}.</p>" if moves else ""
    kinds = guess_table(summary)
    guesses = f"<h2>Who proposes</h2>{html_table(kinds)}<p>{GUESSES_TEXT}</p>" if len(kinds) > 1 else ""
    page = f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>Engram: {robot} {task}</title><style>{CSS}</style></head><body><main>
<h1>Engram: {robot} {task}</h1>
<p class="lead">{summary["jumps"]} jumps of the target, seed {summary["seed"]}, the same series for every mode.
{CLOCK[summary["clock"]]} at 1 kHz, planned at 100 Hz.</p>
{shown}{cards(summary)}
<h2>Memory on, memory off</h2>
{html_table(table(summary), swatches=True)}
<p>{MODES_TEXT}</p>
{moving}{failures(runs)}
{guesses}
<h2>Figures</h2><div class="grid">{figures}</div>
<h2>Fall-back ladder</h2><p>Share of cycles, but those that answer a jump, by what drove the torque.</p>{ladder(motions)}
<h2>Again</h2>
<p><code>engram demo --robot {robot} --task {task} --seed {summary["seed"]} --jumps {summary["jumps"]}</code></p>
<p><code>engram replay {html.escape(relative(runs[0].log))}</code></p>
<footer>{platform.system()}, {platform.machine()}, {os.cpu_count()} CPUs; the whole demo took {summary["wall_s"]:.0f} s.</footer>
</main></body></html>
"""
    path = folder / "report.html"
    path.write_text(page, encoding="utf-8")
    return path
