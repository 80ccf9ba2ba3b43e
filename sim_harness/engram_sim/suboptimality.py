"""How far the guess and the first iterations at a jump are from the best known solution of the same problem."""

from pathlib import Path

import numpy as np

from engram_sim.results import Run

ITERATIONS = 10  # after the guess, that are looked at


def merits(path: Path) -> dict[int, np.ndarray]:
    """jumps.csv of engram-controller: merit of the guess and after each iteration, by jump."""
    if not path.is_file():
        return {}
    header, *lines = path.read_text(encoding="utf-8").splitlines() or [""]
    first = header.split(",").index("merits") if "merits" in header.split(",") else 0
    found = {}
    for line in lines:
        words = line.split(",")
        if first and len(words) > first:
            found[int(words[0])] = np.array(words[first:], dtype=float)
    return found


def curves(runs: list[Run], robot: str, task: str) -> dict[str, np.ndarray]:
    """Suboptimality (merit - J*) / J* by mode: (jumps, ITERATIONS + 1). Empty for modes without jumps.csv."""
    return {}
