"""Prints the figures of build/figures/*.json, and writes them into the documents: no figure is typed by hand.

A document asks for figures by a pair of marks; what stands between them is replaced:

    <!-- figures: demo.panda. -->
    <!-- end -->

    scripts/figures.py            print every figure there is
    scripts/figures.py --write    update README.md and docs/*.md from the figures there are
    scripts/figures.py --check    exit 1 if a document is not up to date
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
FIGURES = ROOT / "build" / "figures"
BLOCK = re.compile(r"(<!-- figures: (?P<prefixes>[^>]*?) -->\n).*?(<!-- end -->)", re.DOTALL)
KEYS = ("id", "value", "unit", "n", "peer", "ratio", "gate")

Record = dict[str, Any]


def read_figures(folder: Path = FIGURES) -> dict[str, Record]:
    """Records of all files in `folder`, by id.

    Raises ValueError if a record lacks its id, value or unit, or if two files disagree about one id.
    """
    records: dict[str, Record] = {}
    for path in sorted(folder.glob("*.json")):
        for record in json.loads(path.read_text(encoding="utf-8")):
            if missing := {"id", "value", "unit"} - record.keys():
                raise ValueError(f"{path}: a record lacks {', '.join(sorted(missing))}: {record}")
            if records.get(record["id"], record) != record:
                raise ValueError(f"{path}: {record['id']} is already given by another file, with another value")
            records[record["id"]] = record
    return records


def number(value: float | None, share: bool = False) -> str:
    """A value as people read it: shares in per cent, the rest with three digits."""
    if value is None:
        return ""
    if share:
        return f"{100 * value:.1f} %"
    if isinstance(value, int) or (abs(value) >= 1000 and value.is_integer()):
        return f"{int(value):,}".replace(",", " ")
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def table(records: list[Record]) -> str:
    """A Markdown table of records; columns that no record fills are left out."""
    columns = [key for key in KEYS if key != "gate" and any(record.get(key) is not None for record in records)]
    heads = {"id": "figure", "value": "value", "unit": "unit", "n": "trials", "peer": "peer", "ratio": "peer / ours"}
    rows = ["| " + " | ".join(heads[key] for key in columns) + " |", "|" + "---|" * len(columns)]
    for record in records:
        share = ".success" in record["id"]
        cells = {
            "id": f"`{record['id']}`",
            "value": number(record["value"], share),
            "unit": "" if record["unit"] == "1" else record["unit"],
            "n": number(record.get("n")),
            "peer": number(record.get("peer"), share),
            "ratio": number(record.get("ratio")),
        }
        rows.append("| " + " | ".join(cells[key] for key in columns) + " |")
    return "\n".join(rows)


def chosen(records: dict[str, Record], prefixes: str) -> list[Record]:
    """Records whose id starts with one of the prefixes, in the order of the prefixes, then of the ids."""
    return [records[name] for prefix in prefixes.split() for name in sorted(records) if name.startswith(prefix)]


def filled(text: str, records: dict[str, Record]) -> str:
    """`text` with every block replaced; a block without any record keeps what it has."""

    def replace(match: re.Match[str]) -> str:
        rows = chosen(records, match["prefixes"])
        return match.group(1) + table(rows) + "\n" + match.group(3) if rows else match.group(0)

    return BLOCK.sub(replace, text)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="update README.md and docs/*.md")
    parser.add_argument("--check", action="store_true", help="exit 1 if a document is not up to date")
    args = parser.parse_args()
    try:
        records = read_figures()
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    if not records:
        print(f"no figures in {FIGURES.relative_to(ROOT)}: make demo, make bench and make test write them")
        return 0
    if not (args.write or args.check):
        print(table([records[name] for name in sorted(records)]))
        return 0
    old = 0
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        text = path.read_text(encoding="utf-8")
        if (new := filled(text, records)) != text:
            old += 1
            print(f"{'updated' if args.write else 'not up to date'}: {path.relative_to(ROOT)}")
            if args.write:
                path.write_text(new, encoding="utf-8")
    return 1 if args.check and old else 0


if __name__ == "__main__":
    sys.exit(main())
