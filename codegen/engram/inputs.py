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
            raise InputError(f"{relative(self.path)}: not valid TOML: {error}") from None

    def line(self, key: str, table: str = "") -> int:
        """First line (from 1) that sets `key` or opens the table of that name, within `table` if given; 0 if absent."""
        pattern = re.compile(rf'^\s*(\[+\s*)?([\w.\-"]+\.)?"?{re.escape(key)}"?\s*(=|\]|\.)')
        lines = self.text.splitlines()
        heads = [n for n, text in enumerate(lines) if text.lstrip().startswith("[")] + [len(lines)]
        for head, end in itertools.pairwise(heads):
            if table and lines[head].split("#")[0].replace('"', "").strip(" \t[]") == table:
                found = next((n for n in range(head + 1, end) if pattern.match(lines[n])), head)
                return found + 1
        return next((n for n, text in enumerate(lines, 1) if pattern.match(text)), 0)

    def error(self, key: str, what: str, table: str = "") -> InputError:
        """The error to raise about `key` (of `table`)."""
        line = self.line(key, table)
        return InputError(f"{relative(self.path)}{f':{line}' if line else ''}: {key}: {what}")

    def check_keys(self, values: dict[str, Any], known: list[str], required: list[str] = (), table: str = "") -> None:
        """Refuse unknown keys among `values` and the absence of required ones."""
        for key in values:
            if key not in known:
                raise self.error(key, f"unknown key; {closest(key, known)}", table)
        for key in required:
            if key not in values:
                where = f":{self.line('', table)}: [{table}]" if table else ""
                raise InputError(f"{relative(self.path)}{where}: key '{key}' is missing; add it")

    def numbers(self, key: str, value: Any, shape: tuple[int, ...], table: str = "") -> np.ndarray:
        """`value` as an array of finite floats of the given shape (-1: any length)."""
        try:
            array = np.array(value, dtype=float)
        except (TypeError, ValueError):
            raise self.error(key, f"expected numbers, found {value!r}", table) from None
        fits = array.ndim == len(shape) and all(s in (-1, n) for s, n in zip(shape, array.shape))
        if not fits:
            raise self.error(key, f"expected numbers of shape {shape}, found shape {array.shape}", table)
        if not np.all(np.isfinite(array)):
            raise self.error(key, "every number must be finite", table)
        return array
