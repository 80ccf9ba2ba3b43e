"""The report's figures, each as an SVG text."""

import io
import re

import matplotlib
import numpy as np

from engram_sim.motion import Motion
from engram_sim.results import MODES, Run, enumerators, wilson

matplotlib.use("Agg")
from matplotlib import pyplot as plt

INK, FAINT = "#1f2933", "#d5dbe1"
COLOUR = {"memory": "#1769aa", "line": "#e08a1e", "shift": "#7a8794", "cold": "#c0392b"}
CANDIDATE_COLOUR = ["#7a8794", "#1769aa", "#53b3cb", "#e08a1e", "#c0392b", "#8e6bbf"]
STYLE = {
    "font.family": "DejaVu Sans", "font.size": 10, "text.color": INK, "axes.labelcolor": INK, "axes.edgecolor": "#9aa5b1",
    "xtick.color": INK, "ytick.color": INK, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True,
    "grid.color": FAINT, "grid.linewidth": 0.6, "axes.axisbelow": True, "legend.frameon": False, "svg.hashsalt": "engram",
    "figure.constrained_layout.use": True,
}  # fmt: skip


def figure(width: float = 5.6, height: float = 3.2):
    """A figure in the report's style."""
    plt.rcParams.update(STYLE)
    return plt.subplots(figsize=(width, height))


def svg(fig) -> str:
    """The figure as an SVG element for a page; the same figure gives the same text."""
    text = io.StringIO()
    fig.savefig(text, format="svg", metadata={"Date": None}, transparent=True)
    plt.close(fig)
    return re.sub(r"^.*?(?=<svg)|<metadata>.*?</metadata>", "", text.getvalue(), flags=re.S)


def legend_above(ax, columns: int = 4) -> None:
    """A legend that hides no curve."""
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=columns)


def success(runs: list[Run]) -> str:
    """Share of successful jumps with its 95 % Wilson interval."""
    fig, ax = figure(5.6, 0.55 * len(runs) + 0.9)
    for y, run in enumerate(reversed(runs)):
        jumps = run.finished()
        good = sum(jump["success"] for jump in jumps)
        low, high = wilson(good, len(jumps))
        share = good / max(len(jumps), 1)
        ax.barh(y, 100 * share, color=COLOUR.get(run.mode, INK), height=0.6)
        ax.plot([100 * low, 100 * high], [y, y], color=INK, linewidth=1.4, marker="|", markersize=7)
        ax.text(103, y, f"{100 * share:.1f} %", va="center", fontweight="bold")
    ax.set_yticks(range(len(runs)), [run.mode for run in reversed(runs)])
    ax.set_xlim(0, 100)
    ax.set_xlabel("successful jumps (%), bar: 95 % interval")
    ax.grid(axis="y", visible=False)
    return svg(fig)


def arrivals(runs: list[Run], window: float) -> str:
    """Share of jumps that have arrived (and succeed) within a time."""
    fig, ax = figure()
    for run in runs:
        jumps = run.finished()
        times = np.sort([jump["arrival_s"] for jump in jumps if jump["success"]])
        share = 100.0 * np.arange(1, len(times) + 1) / max(len(jumps), 1)
        x, y = np.concatenate([[0], times, [window]]), np.concatenate([[0], share, share[-1:] if len(share) else [0]])
        ax.step(x, y, where="post", color=COLOUR.get(run.mode, INK), linewidth=2, label=run.mode)
    ax.set(xlim=(0, window), ylim=(0, 100), xlabel="time since the jump (s)", ylabel="jumps arrived (%)")
    legend_above(ax)
    return svg(fig)


def hand_error(motions: list[Motion], window: float, tolerance: float) -> str:
    """Median distance of hand and target over the time since a jump; band: 10th to 90th percentile of memory."""
    fig, ax = figure()
    times = np.arange(0.0, window, 0.05)
    for motion in motions:
        errors = motion.error_over_time(times)
        if not len(errors):
            continue
        # a jump that has ended keeps its last error, or the curve would show only those under way
        last = np.where(np.isnan(errors), -np.inf, np.arange(len(times))).argmax(axis=1)
        ended = np.isnan(errors)
        errors = np.where(ended, errors[np.arange(len(errors)), last][:, None], errors)
        colour = COLOUR.get(motion.run.mode, INK)
        low, middle, high = np.maximum(1e3 * np.nanpercentile(errors, [10, 50, 90], axis=0), 0.1)
        ax.plot(times, middle, color=colour, linewidth=2, label=motion.run.mode)
        if motion.run.mode == "memory":
            ax.fill_between(times, low, high, color=colour, alpha=0.15, linewidth=0)
    ax.axhline(1e3 * tolerance, color=INK, linewidth=0.8, linestyle=":")
    ax.set(yscale="log", xlim=(0, window), xlabel="time since the jump (s)", ylabel="hand to target (mm)")
    legend_above(ax)
    return svg(fig)


def suboptimality(curves: dict[str, np.ndarray]) -> str:
    """Median suboptimality over iterations at jumps; `curves[mode]`: (jumps, iterations + 1)."""
    fig, ax = figure()
    floor = 1e-4
    for mode, values in curves.items():
        middle = np.maximum(np.nanmedian(values, axis=0), floor)
        low, high = np.maximum(np.nanpercentile(values, [25, 75], axis=0), floor)
        k = np.arange(len(middle))
        ax.plot(k, middle, color=COLOUR.get(mode, INK), linewidth=2, marker="o", markersize=3.5, label=mode)
        ax.fill_between(k, low, high, color=COLOUR.get(mode, INK), alpha=0.12, linewidth=0)
    ax.set(yscale="log", xlabel="iterations after the jump", ylabel="suboptimality (merit - J*) / J*")
    legend_above(ax)
    return svg(fig)


def candidates(motion: Motion) -> str | None:
    """Merit of each kind of candidate at jumps, over the winner's."""
    cycles = motion.jump_cycles()
    names = enumerators("engram_candidate")
    ratios: dict[int, list[float]] = {}
    for cycle in cycles:
        n = int(cycle["ncandidates"])
        kinds, merits = cycle["candidate"][:n], cycle["merit"][:n].astype(float)
        good = np.isfinite(merits)
        if not good.any() or merits[good].min() <= 0:
            continue
        for kind in np.unique(kinds[good]):
            ratios.setdefault(int(kind), []).append(merits[good & (kinds == kind)].min() / merits[good].min())
    if not ratios:
        return None
    fig, ax = figure()
    kinds = sorted(ratios)
    boxes = ax.boxplot(
        [ratios[kind] for kind in kinds], patch_artist=True, showfliers=False, widths=0.55, medianprops={"color": INK}
    )
    for box, kind in zip(boxes["boxes"], kinds):
        box.set(facecolor=CANDIDATE_COLOUR[kind % len(CANDIDATE_COLOUR)], alpha=0.75, linewidth=0.8)
    ax.set_xticks(range(1, len(kinds) + 1), [names[kind] if kind < len(names) else str(kind) for kind in kinds])
    ax.set(yscale="log", ylabel="merit over the winner's (best of its kind)")
    ax.grid(axis="x", visible=False)
    return svg(fig)


def winners(motions: list[Motion]) -> str | None:
    """Which candidate seeded the solver at jumps, by mode."""
    names = enumerators("engram_candidate")
    fig, ax = figure(5.6, 0.55 * len(motions) + 1.2)
    shown = set()
    for y, motion in enumerate(reversed(motions)):
        winner = motion.jump_cycles()["winner"]
        left = 0.0
        for kind, count in zip(*np.unique(winner, return_counts=True)):
            share = 100.0 * count / len(winner)
            label = (names[kind] if 0 <= kind < len(names) else str(kind)) if kind not in shown else None
            ax.barh(y, share, left=left, height=0.6, color=CANDIDATE_COLOUR[kind % len(CANDIDATE_COLOUR)], label=label)
            shown.add(kind)
            left += share
    if not shown:
        plt.close(fig)
        return None
    ax.set_yticks(range(len(motions)), [motion.run.mode for motion in reversed(motions)])
    ax.set(xlim=(0, 100), xlabel="winner at jumps (%)")
    ax.grid(axis="y", visible=False)
    legend_above(ax, len(shown))
    return svg(fig)


def cycle_times(runs: list[Run], period_us: float = 1e4) -> str | None:
    """Histogram of the CPU time of a cycle."""
    timed = [run for run in runs if len(run.timing.get("total_us", [])) and run.timing["total_us"].max() > 0]
    if not timed:
        return None
    fig, ax = figure()
    bins = np.geomspace(50, 1e5, 90)
    for run in timed:
        total = np.clip(run.timing["total_us"], bins[0], bins[-1])
        weights = np.full(len(total), 100.0 / len(total))
        ax.hist(
            1e-3 * total,
            1e-3 * bins,
            weights=weights,
            histtype="step",
            linewidth=1.8,
            color=COLOUR.get(run.mode, INK),
            label=run.mode,
        )
    ax.axvline(1e-3 * period_us, color=INK, linewidth=0.8, linestyle=":")
    ax.text(1e-3 * period_us, ax.get_ylim()[1], " period", va="top", fontsize=9)
    ax.set(xscale="log", yscale="log", xlabel="CPU time of a cycle (ms)", ylabel="cycles (%)")
    legend_above(ax)
    return svg(fig)


def phases(motion: Motion) -> str | None:
    """Where the CPU time of a cycle goes: means of ordinary cycles and of those that answer a jump."""
    timing = motion.run.timing
    if not len(timing.get("total_us", [])) or timing["total_us"].max() <= 0:
        return None
    names = ["query", "candidates", "linearize", "backward", "rollout"]
    jumped = np.isin(timing["utime"], motion.jump_cycles()["utime"].astype(float))
    fig, ax = figure(5.6, 1.9)
    rows = [(label, mask) for label, mask in (("at a jump", jumped), ("ordinary", ~jumped)) if mask.any()]
    for y, (_, mask) in enumerate(reversed(rows)):
        left = 0.0
        parts = [float(timing[f"{name}_us"][mask].mean()) for name in names]
        parts.append(max(0.0, float(timing["total_us"][mask].mean()) - sum(parts)))
        for i, part in enumerate(parts):
            label = [*names, "other"][i] if y == 0 else None
            ax.barh(y, 1e-3 * part, left=1e-3 * left, height=0.6, color=[*CANDIDATE_COLOUR[1:], FAINT][i], label=label)
            left += part
    ax.set_yticks(range(len(rows)), [label for label, _ in reversed(rows)])
    ax.set_xlabel("mean CPU time of a cycle (ms)")
    ax.grid(axis="y", visible=False)
    legend_above(ax, 3)
    return svg(fig)


def torques(motion: Motion) -> str | None:
    """|tau| over its limit, joint by joint: median, 99th percentile, maximum."""
    shares = 100.0 * motion.torque_shares()
    if not len(shares):
        return None
    fig, ax = figure()
    x = np.arange(shares.shape[1])
    colour = COLOUR.get(motion.run.mode, INK)
    for percentile, alpha, label in ((100, 0.25, "maximum"), (99, 0.5, "99th percentile"), (50, 1.0, "median")):
        ax.bar(x, np.percentile(shares, percentile, axis=0), color=colour, alpha=alpha, width=0.6, label=label)
    ax.axhline(100, color=INK, linewidth=0.8, linestyle=":")
    ax.set_xticks(x, [str(i + 1) for i in x])
    ax.set(xlabel="joint", ylabel="torque over its limit (%)", ylim=(0, 105))
    ax.grid(axis="x", visible=False)
    legend_above(ax, 3)
    return svg(fig)


def order(runs: list[Run]) -> list[Run]:
    """Runs in the order of MODES."""
    return sorted(runs, key=lambda run: MODES.index(run.mode) if run.mode in MODES else len(MODES))
