"""S6.7 and S6.8: one task only (thesis B.6), and the pictures of planar arms (figures 7.10 to 7.13, B.2)."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np

from engram.engine import engine
from engram.paths import MODELS
from engram.study.report import Report
from engram.study.trains import SOLVED, Recipe, build, lowest, samples, table_of
from engram.tasks.world import read_boxes

DISCS = {  # as in codegen/offline/study_planar.cc: centre and radius [m]
    "planar3": [(0.7, 1.2, 0.3), (1.6, 0.5, 0.2), (-0.6, 1.2, 0.3), (0.9, -0.9, 0.35)],
    "planar4": [(0.9, 0.8, 0.25), (1.7, -0.6, 0.3), (-0.4, 1.5, 0.25), (0.5, -1.2, 0.3), (2.0, 0.6, 0.2)],
}
NEAR = 0.05  # [m] of the tip to its target
REACHED = 1.2  # cost of a reaching motion that begins a train: its length in metres is most of it
LEVEL = 10.0  # [deg] of tilt of a hand that is carried level
RADIUS = 0.06  # [m] of the collision spheres
LINKS = {"planar3": (1.0, 1.0, 1.0), "planar4": (0.8, 0.8, 0.8, 0.6)}  # [m], models/planar*/planar*.urdf


def run(row: str, quick: bool) -> None:
    """Both rows."""
    (single_task if row == "6.7" else planar_pictures)(Report(row, TITLES[row]), quick)


TITLES = {
    "6.7": "one task only: train, sampling and refinement together (B.6)",
    "6.8": "planar arms among discs (figures 7.10 to 7.13)",
}


def solve_once(cost: engine.StudyCost, rank: int, seed: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Refined weights, lowest cost first, their costs, and the CPU time [s] from nothing to them."""
    clock = time.process_time()
    rng = np.random.default_rng(seed)
    starts, _ = lowest(cost, rng.uniform(cost.lo, cost.hi, (100, 20, cost.d)))
    cores, _ = cost.cross([20] * cost.d, starts, rank, 4, 3, 1e-3, seed)
    train = engine.TensorTrain(table_of(cost, cores), 200)
    drawn = [train.sample(alpha, 200, seed=seed)[0] for alpha in (0.9, 0.5, 0.0)]
    best = np.concatenate([x[np.argsort(cost.evaluate(x), kind="stable")[:100]] for x in drawn])  # of every priority
    refined, c = cost.refine(best, 150)
    order = np.argsort(c, kind="stable")
    return refined[order], c[order], time.process_time() - clock


def clear(robot: str, path: np.ndarray) -> bool:
    """Does a planar arm keep off the discs along the path, by the radius of its collision spheres?"""
    at = np.linspace(0, 1, 21)[:, None]
    for q in path:
        ends = corners(robot, q)
        points = np.concatenate([a + at * (b - a) for a, b in pairwise(ends)])
        if any(np.hypot(points[:, 0] - x, points[:, 1] - y).min() < r + RADIUS for x, y, r in DISCS[robot]):
            return False
    return True


def tilt(path: np.ndarray) -> float:
    """Largest angle [deg] along a path of the Panda between the hand's x axis and the vertical, up or down; 0: it lies level."""
    up = engine.panda.frame_placement(path, "hand_tcp")[0][:, 2, 0]
    return float(np.degrees(np.arccos(np.clip(np.abs(up), 0, 1))).max())


def distinct(robot: str, ends: tuple[np.ndarray, np.ndarray], found: tuple, apart: float = 0.35) -> list[np.ndarray]:
    """Paths (points, nq) of solutions that somewhere differ by more than `apart` [rad] in some joint. A solution is free of
    collision; in three dimensions its cost says so, in the plane, where paths are metres long, the distance to the discs. The
    Panda's keeps its hand level, within LEVEL all along the path."""
    kept: list[np.ndarray] = []
    for w, c in zip(found[0], found[1], strict=True):
        path = engine.study_path(robot, *ends, w)
        if not (clear(robot, path) if robot in DISCS else c <= SOLVED and tilt(path) <= LEVEL):
            continue
        if all(np.abs(path - other).max() > apart for other in kept):
            kept.append(path)
    return kept


def single_task(report: Report, quick: bool) -> None:
    """Motions between two given postures; their shape alone is sought."""
    found: list[tuple[str, list[np.ndarray]]] = []
    cases = [("planar4", np.array([0.76, -1.32, 1.88, 0.17]), np.array([0.11, -1.93, 1.3, -0.5])),
             ("panda", *shelf_postures())]  # fmt: skip
    for robot, q0, q1 in cases:
        cost = engine.study_arm(f"{robot}.transfer", q0.tolist(), q1.tolist())
        results = [solve_once(cost, 5, seed) for seed in range(1, 3 if quick else 11)]
        paths = [distinct(robot, (q0, q1), result) for result in results]
        counts, clocks = [len(p) for p in paths], [clock for _, _, clock in results]
        level = "" if robot in DISCS else f", hand level to {max(tilt(path) for kept in paths for path in kept):.0f} deg"
        report.say(f"{robot}, d = {cost.d}{level}, rank 5, {len(results)} seeds: {min(counts)} to {max(counts)} "
                   f"distinct solutions, mean {np.mean(counts):.1f}")  # fmt: skip
        report.say(f"{robot}: CPU time {np.median(clocks):.2f} s, at most {max(clocks):.2f} s (thesis: under 5 to 7 s)")
        report.figure(f"{robot}.solutions_min", min(counts), n=len(results))
        report.figure(f"{robot}.cpu_s.max", max(clocks), "s", n=len(results))
        found.append((robot, paths[0]))
    draw_paths(report, found[0][1][:4], "planar4", "four_link")
    draw_hand(report, found[1][1], "panda_hand")
    report.close()


def draw_hand(report: Report, paths: list[np.ndarray], name: str) -> None:
    """The ways of the Panda's hand among the boxes of its world, from the side and from the front, and its tilt (figure B.3)."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    boxes = read_boxes(MODELS / "panda" / "reach" / "world.xml")
    half = np.einsum("nij,nj->ni", np.abs(boxes.R_WO), boxes.half)  # of the box around a box, along the world's axes
    fig, axes = plt.subplots(1, 3, figsize=(11, 3.4))
    for axis, (i, label) in zip(axes, ((0, "x [m]"), (1, "y [m]")), strict=False):
        for p, h in zip(boxes.p_WO, half, strict=True):
            axis.add_patch(plt.Rectangle((p[i] - h[i], p[2] - h[2]), 2 * h[i], 2 * h[2], color="0.5", alpha=0.25))
        for path in paths:
            p_WH = engine.panda.frame_placement(path, "hand_tcp")[1]
            axis.plot(p_WH[:, i], p_WH[:, 2], ".-")
            axis.plot(p_WH[[0, -1], i], p_WH[[0, -1], 2], "o", color="red", ms=5)
        axis.set_xlabel(label)
        axis.set_ylabel("z [m]")
        axis.set_aspect("equal")
    for path in paths:
        axes[2].plot([tilt(q[None]) for q in path], ".-")
    axes[2].set_xlabel("point of the path")
    axes[2].set_ylabel("tilt [deg]")
    axes[2].set_ylim(0, 90)
    fig.tight_layout()
    fig.savefig(report.picture(name), dpi=90)
    plt.close(fig)


def shelf_postures() -> tuple[np.ndarray, np.ndarray]:
    """Two postures of the Panda with the hand in either compartment of the shelf."""
    cost = engine.study_arm("panda.ik")
    rng, ends = np.random.default_rng(67), []
    for target in ((0.6, -0.15, 0.22), (0.6, 0.15, 0.58)):
        x = rng.uniform(cost.lo, cost.hi, (200, cost.d))
        x[:, :3] = target
        refined, c = cost.refine(x, 200)
        ends.append(refined[c <= 0.01, 3:])  # level to 3 degrees
    # of all pairs the closest: a motion that a few weights can shape
    gap = np.abs(ends[0][:, None] - ends[1][None]).max(axis=2)
    i, j = np.unravel_index(gap.argmin(), gap.shape)
    return ends[0][i], ends[1][j]


def corners(robot: str, q: np.ndarray) -> np.ndarray:
    """Joints and tip of a planar arm, (n + 1, 2) [m]."""
    angle, links = np.cumsum(q), np.array(LINKS[robot])
    steps = links[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def axes_with_discs(axis, robot: str) -> None:
    """The world of a planar arm."""
    import matplotlib.pyplot as plt

    for x, y, r in DISCS[robot]:
        axis.add_patch(plt.Circle((x, y), r, color="0.75"))
    axis.plot(0, 0, "o", color="gold", ms=9)
    axis.set_aspect("equal")
    axis.set_xlim(-1.5, 3.1)
    axis.set_ylim(-1.7, 3.0)


def draw_paths(report: Report, paths: list[np.ndarray], robot: str, name: str, targets: list[np.ndarray] = ()) -> None:
    """One panel for each path: the arm along it, the tip's way."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    if not paths:
        return
    fig, axes = plt.subplots(1, len(paths), figsize=(3.2 * len(paths), 3.2), squeeze=False)
    for i, (axis, path) in enumerate(zip(axes[0], paths, strict=True)):
        axes_with_discs(axis, robot)
        for t, q in enumerate(path):
            ends = t in (0, len(path) - 1)
            axis.plot(*corners(robot, q).T, "-", color="darkgreen" if ends else "yellowgreen", lw=2 if ends else 0.8)
        axis.plot(*np.array([corners(robot, q)[-1] for q in path]).T, ":", color="black", lw=1)
        if len(targets):
            axis.plot(*targets[i], "o", color="red", ms=5)
    fig.tight_layout()
    fig.savefig(report.picture(name), dpi=90)
    plt.close(fig)


def planar_pictures(report: Report, quick: bool) -> None:
    """Unrefined samples of inverse kinematics (figures 7.10, 7.11), reaching motions (7.13)."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    cost = engine.study_arm("planar3.ik")

    def draw(rng: np.random.Generator, count: int) -> np.ndarray:
        return rng.uniform(cost.lo[:2], cost.hi[:2], (count, 2))

    rng = np.random.default_rng(68)
    test = draw(rng, 100)
    built = build(cost, Recipe(points=(60, 80), rank=24, seeds=2, evaluations=100), draw, draw(rng, 100))
    reached = {}
    for alpha, count in ((1.0, 1), (0.8, 50)):
        start, c = lowest(cost, samples(built.train, cost, test, alpha, count))
        reached[alpha] = float(np.mean(cost.refine(start, 100)[1] <= SOLVED))
        share = f"{100 * reached[alpha]:.0f} % solved refined"
        report.say(f"3 links, alpha {alpha:g}, best of {count}: mean cost {np.mean(c):.2f}, {share}")
        report.figure(f"planar3.success.n{count}", reached[alpha], n=len(test))
    fig, axes = plt.subplots(2, 4, figsize=(12, 6))
    for column, task in enumerate(test[:4]):
        for row, (alpha, count, keep) in enumerate(((1.0, 1, 1), (0.8, 50, 10))):
            axis = axes[row, column]
            axes_with_discs(axis, "planar3")
            x = samples(built.train, cost, task[None], alpha, count)[0]
            for q in x[np.argsort(cost.evaluate(x))[:keep], 2:]:
                axis.plot(*corners("planar3", q).T, "-", color="green", alpha=0.6)
            axis.plot(*task, "o", color="red", ms=5)
            axis.set_title(f"best {keep} of {count}, alpha {alpha:g}, unrefined", fontsize=8)
    fig.tight_layout()
    fig.savefig(report.picture("inverse_kinematics"), dpi=90)
    plt.close(fig)

    cost = engine.study_arm("planar3.reach")
    recipe = Recipe(points=(30, 24), rank=16, seeds=1 if quick else 3, starts=1000, start_cost=REACHED, evaluations=150)
    built = build(cost, recipe, draw, draw(rng, 50))
    start, _ = lowest(cost, samples(built.train, cost, test[:50], 0.9, 10))
    refined, _ = cost.refine(start, 150)
    home, solved = np.zeros(3), 0.0
    for x in refined:
        at_target = np.linalg.norm(corners("planar3", x[2:5])[-1] - x[:2]) < NEAR
        solved += (at_target and clear("planar3", engine.study_path("planar3", home, x[2:5], x[5:]))) / len(refined)
    report.say(f"3 links, reaching, d = {cost.d}: {100 * solved:.0f} % of 50 tasks reached without collision, best of 10 samples")
    report.figure("planar3.reach.success.n10", solved, n=50)
    paths = [engine.study_path("planar3", home, x[2:5], x[5:]) for x in start[:4]]
    draw_paths(report, paths, "planar3", "reaching", [x[:2] for x in start[:4]])
    report.close()
