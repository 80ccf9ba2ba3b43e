"""Reading authored TOML files: every mistake becomes one InputError that names file, line, key and mend."""

import difflib
import itertools
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from engram.paths import relative


class InputError(Exception):
    """What the user gave is wrong. The command line prints the text and leaves with exit code 2."""


def read_text(path: Path, mend: str) -> str:
    """The text of a file the user should have; `mend` says what to do if it is not there."""
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{relative(path)}: cannot be read ({error}); {mend}") from None


def closest(word: str, known: list[str]) -> str:
    """A mend for a misspelt word: its nearest known spelling, or all known words."""
    near = difflib.get_close_matches(word, known, n=1)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(sorted(known))}"


class TomlFile:
    """A parsed TOML file that can point at the line of a key."""

    def __init__(self, path: Path, mend: str = "write it, or correct the path"):
        self.path = Path(path)
        self.text = read_text(self.path, mend)
        try:
            self.data: dict[str, Any] = tomllib.loads(self.text)
        except tomllib.TOMLDecodeError as error:
            what, _, place = str(error).rpartition(" (at ")
            number = re.match(r"line (\d+)", place)
            line = int(number[1]) if number else len(self.text.splitlines())
            what = f"not valid TOML: {what[:1].lower()}{what[1:]}; mend this line (strings in quotes, one key = value a line)"
            raise InputError(f"{relative(self.path)}:{line}: {what}") from None

    def line(self, key: str, table: str = "") -> int:
        """First line (from 1) that sets `key` or opens the table of that name, within `table` if given; 1 if absent."""
        name = rf'"?{re.escape(key)}"?'
        patterns = (rf'^\s*(\[+\s*)?([\w.\-"]+\.)?{name}\s*(=|\]|\.)', rf"^[^#]*[{{,]\s*{name}\s*=")
        lines = self.text.splitlines()
        heads = [n for n, text in enumerate(lines) if text.lstrip().startswith("[")] + [len(lines)]
        found = (n + 1 for pattern in patterns for n, text in enumerate(lines) if re.match(pattern, text))
        for head, end in itertools.pairwise(heads):
            if table and lines[head].split("#")[0].replace('"', "").strip(" \t[]") == table:
                return next((n for n in found if head + 1 < n <= end), head + 1)
        return next(found, self.line(table.rpartition(".")[2]) if table else 1)

    def error(self, key: str, what: str, table: str = "") -> InputError:
        """The error to raise about `key` (of `table`). `what` ends with the mend."""
        return InputError(f"{relative(self.path)}:{self.line(key, table)}: {key}: {what}")

    def check_keys(self, values: dict[str, Any], known: list[str], required: list[str] = (), table: str = "") -> None:
        """Refuse unknown keys among `values` and the absence of required ones."""
        for key in values:
            if key not in known:
                raise self.error(key, f"unknown key; {closest(key, known)}", table)
        for key in required:
            if key not in values:
                where = f"{self.line(key, table)}: [{table}]" if table else "1"
                raise InputError(f"{relative(self.path)}:{where}: key '{key}' is missing; add it")

    def table(self, key: str, table: str = "") -> dict[str, Any]:
        """The table `key` (of `table`), empty if absent."""
        value = self.data.get(table, {}).get(key, {}) if table else self.data.get(key, {})
        if not isinstance(value, dict):
            head = f"{table}.{key}" if table else key
            raise self.error(key, f"expected a table, found {value!r}; write [{head}] and its keys below it", table)
        return value

    def words(self, key: str, value: Any, table: str = "") -> str:
        """`value` as text that is not empty."""
        if not isinstance(value, str) or not value:
            raise self.error(key, f'expected a name, found {value!r}; write it in quotes, {key} = "..."', table)
        return value

    def numbers(self, key: str, value: Any, shape: tuple[int, ...], table: str = "", least: float = -np.inf) -> np.ndarray:
        """`value` as an array of finite floats, none below `least`, of the given shape (-1: any length)."""
        form = "x".join("n" if n < 0 else str(n) for n in shape) + " numbers" if shape else "one number"
        try:
            array = np.array(value)
        except ValueError:  # rows of different lengths
            array = np.array(None)
        if array.dtype.kind not in "iuf":
            raise self.error(key, f"expected numbers, found {value!r}; write {form}, without quotes", table)
        if not (array.ndim == len(shape) and all(s in (-1, n) for s, n in zip(shape, array.shape))):
            raise self.error(key, f"expected numbers of shape {shape}, found shape {array.shape}; write {form}", table)
        if not np.all(np.isfinite(array)):
            raise self.error(key, "every number must be finite; write a value, or delete the key", table)
        if np.any(array < least):
            raise self.error(key, f"must not be below {least:g}; mend the value", table)
        return array.astype(float)
