"""scripts/figures.py: records in, tables in documents out."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="module")
def figures(root: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("figures", root / "scripts/figures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def write(folder: Path, name: str, *records: dict) -> None:
    (folder / name).write_text(json.dumps(list(records)), encoding="utf-8")


def test_a_block_is_replaced_by_the_records_of_its_prefix(figures: ModuleType, tmp_path: Path) -> None:
    write(tmp_path, "demo.json", {"id": "demo.success.memory", "value": 0.985, "unit": "1", "n": 300},
          {"id": "bench.solve1", "value": 123.4, "unit": "us", "peer": 500.0, "ratio": 4.05, "gate": True})  # fmt: skip
    text = "before\n<!-- figures: demo. -->\nold\n<!-- end -->\nafter\n"
    new = figures.filled(text, figures.read_figures(tmp_path))
    assert "| `demo.success.memory` | 98.5 % |  | 300 |" in new
    assert "bench" not in new
    assert "old" not in new
    assert new.startswith("before\n")
    assert new.endswith("after\n")
    assert figures.filled(new, figures.read_figures(tmp_path)) == new


def test_what_was_not_measured_keeps_what_the_document_has(figures: ModuleType) -> None:
    text = "<!-- figures: demo. -->\nkept\n<!-- end -->\n"
    assert figures.filled(text, {}) == text


def test_a_record_without_a_unit_is_refused(figures: ModuleType, tmp_path: Path) -> None:
    write(tmp_path, "a.json", {"id": "x", "value": 1})
    with pytest.raises(ValueError, match="unit"):
        figures.read_figures(tmp_path)


def test_two_values_of_one_figure_are_refused(figures: ModuleType, tmp_path: Path) -> None:
    write(tmp_path, "a.json", {"id": "x", "value": 1, "unit": "us"})
    write(tmp_path, "b.json", {"id": "x", "value": 2, "unit": "us"})
    with pytest.raises(ValueError, match="another value"):
        figures.read_figures(tmp_path)


@pytest.mark.parametrize(("value", "text"), [(0.123456, "0.123"), (12345.0, "12 345"), (1234.5, "1234"), (7, "7"), (None, "")])
def test_numbers_are_short(figures: ModuleType, value: float | None, text: str) -> None:
    assert figures.number(value) == text
