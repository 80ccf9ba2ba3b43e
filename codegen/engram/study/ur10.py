"""S6.2: all eight postures of a UR10 whose tool is upright at a point (thesis 7.5.2, figure 7.9)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engram.engine import engine
from engram.study.refiners import Refiner, bfgs, ik
from engram.study.report import Report, wilson
from engram.study.trains import Recipe, build, samples, uniform_points

EXACT = 1e-3  # cost of a posture that counts: 0.1 mm
APART = 0.3  # [rad], modulo a turn: two postures are different if some joint is
EIGHT = 8
SEARCH = 400  # uniform starts that say how many postures a point has
PRIORITY = 0.5
# A blunt density: with the scale of the other studies the train keeps five of the eight modes.
RECIPE = Recipe(points=(40, 40), rank=24, scale=0.3, enrich=16, seeds=2, starts=4000, start_cost=EXACT, evaluations=150)


def postures(refine: Refiner, starts: np.ndarray) -> np.ndarray:
    """Distinct solutions (m, 6) that the starts (count, 9) lead to."""
    refined, c = refine(starts)
    kept: list[np.ndarray] = []
    for q in refined[c < EXACT, 3:]:
        if all(np.abs((q - other + np.pi) % (2 * np.pi) - np.pi).max() > APART for other in kept):
            kept.append(q)
    return np.array(kept).reshape(-1, 6)


def with_eight(cost: engine.StudyCost, refine: Refiner, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points that are reached in eight postures, found by many uniform starts."""
    found = []
    while len(found) < count:  # about two in five are
        task = rng.uniform(cost.lo[:3], cost.hi[:3])
        if len(postures(refine, uniform_points(cost, task[None], SEARCH, rng)[0])) == EIGHT:
            found.append(task)
    return np.array(found)


def run(row: str, quick: bool) -> None:
    """Share of points whose eight postures are all found, by samples of a train and by as many uniform starts."""
    report = Report(row, "inverse kinematics, UR10 with upright tool: the eight postures (figure 7.9)")
    cost = engine.study_arm("ur10.ik")
    recipe = replace(RECIPE, seeds=1) if quick else RECIPE
    points = 10 if quick else 100
    rng = np.random.default_rng(62)
    refine, by_ik = bfgs(cost, RECIPE.evaluations), ik("ur10", cost)
    test = with_eight(cost, refine, points, rng)

    def draw(generator: np.random.Generator, count: int) -> np.ndarray:
        return generator.uniform(cost.lo[:3], cost.hi[:3], (count, 3))

    built = build(cost, recipe, draw, draw(rng, points))
    report.say(f"table {built.train.bytes} B, rank {recipe.rank}, seed {built.seed}; built in {built.cpu:.1f} s of CPU time, "
               f"{built.values} values of the density")  # fmt: skip
    report.figure("table_bytes", built.train.bytes, "B")
    report.say("thesis: 'most of the 8'")
    heads = f"{'starts':>8}{'train: all eight':>20}{'mean':>8}{'uniform: all eight':>22}{'mean':>8}"
    report.say(heads + f"{'by controller/ik: train':>26}{'uniform':>12}")
    for count in (50, 100, 300) if quick else (50, 100, 300, 600):
        starts = (samples(built.train, cost, test, PRIORITY, count), uniform_points(cost, test, count, rng))
        found = [[len(postures(how, x)) for x in points] for how in (refine, by_ik) for points in starts]
        shares = [float(np.mean(np.array(each) == EIGHT)) for each in found]
        cells = (
            f"{count:>8}{100 * shares[0]:>18.1f} %{np.mean(found[0]):>8.2f}{100 * shares[1]:>20.1f} %{np.mean(found[1]):>8.2f}"
        )
        report.say(cells + f"{100 * shares[2]:>24.1f} %{100 * shares[3]:>10.1f} %")
        report.figure(f"all_eight.n{count}", shares[0], n=points)
        report.figure(f"all_eight_uniform.n{count}", shares[1], n=points)
        report.figure(f"all_eight_ik.n{count}", shares[2], n=points)
    report.figure("all_eight", shares[0], n=points)
    low, high = wilson(shares[0], points)
    report.say(f"95 % interval of the last row over {points} points: {100 * low:.1f} .. {100 * high:.1f}")
    report.close()
