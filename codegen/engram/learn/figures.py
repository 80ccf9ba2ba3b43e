"""Figures of a command, as docs/figures.md describes them."""

import json

from engram.paths import BUILD


def write_figures(command: str, figures: list[tuple[str, float, str, int]]) -> None:
    """Write build/figures/<command>.json from (id, value, unit, n)."""
    folder = BUILD / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    records = [{"id": key, "value": value, "unit": unit, "n": n} for key, value, unit, n in figures]
    (folder / f"{command}.json").write_text(json.dumps(records, indent=1) + "\n", encoding="utf-8")
