"""What a study prints and leaves behind: rows beside the thesis', figures in build/figures/study.<row>.json, pictures."""

from __future__ import annotations

import json
import math
from pathlib import Path

from engram.paths import BUILD, relative


def wilson(share: float, n: int) -> tuple[float, float]:
    """95 % interval of a share of n trials."""
    z, middle = 1.959964, share + 1.959964**2 / (2 * n)
    half = z * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    scale = 1 + z * z / n
    return (middle - half) / scale, (middle + half) / scale


class Report:
    """Collects figures of one row and prints as it goes."""

    def __init__(self, row: str, title: str):
        self.row, self.figures = row, []
        print(f"\n=== S{row}  {title}", flush=True)

    def say(self, text: str = "") -> None:
        """A line of the report."""
        print(f"{self.row}:  {text}" if text else "", flush=True)

    def figure(self, what: str, value: float, unit: str = "1", n: int = 0, **more: float) -> None:
        """A figure study.<row>.<what>; a name that begins with bench. stands for itself."""
        key = what if what.startswith("bench.") else f"study.{self.row}.{what}"
        self.figures.append({"id": key, "value": value, "unit": unit, "n": n, **more})

    def picture(self, name: str) -> Path:
        """Where a picture goes."""
        folder = BUILD / "study"
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{self.row}_{name}.png"
        self.say(f"picture: {relative(path)}")
        return path

    def close(self) -> None:
        """Write the figures."""
        folder = BUILD / "figures"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"study.{self.row}.json").write_text(json.dumps(self.figures, indent=1) + "\n", encoding="utf-8")
