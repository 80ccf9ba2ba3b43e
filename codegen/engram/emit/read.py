"""Tables back from files: the same arrays that the controller links, for `engram table` and tests."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engram.emit.arrays import C_TYPES, Array, digest
from engram.inputs import InputError, read_text
from engram.paths import relative

MEND = "run 'make tables'"
ARRAY = re.compile(r"static const (\w+) \w+_v\d+_(\w+)\[(\d+)\] = \{\n(.*?),\n\};", re.DOTALL)
BLOB = re.compile(r"extern const (\w+) (\w+_v\d+_(\w+))\[(\d+)\]")
TYPES = {c_type: np.dtype(name).newbyteorder("<") for name, c_type in C_TYPES.items()}


@dataclass
class TableFile:
    """One generated table as found on disk."""

    name: str
    kind: str
    digest: int  # as written in the C file
    robot_digest: int
    task_digest: int
    arrays: list[Array]
    inputs: list[tuple[str, str]]  # name and unit of each
    entry: dict  # its entry of the manifest

    @property
    def data_digest(self) -> int:
        """Digest of the arrays that were read."""
        return digest(self.arrays)


def read_manifest(folder: Path) -> dict:
    """MANIFEST.json of a table folder."""
    path = folder / "MANIFEST.json"
    text = read_text(path, MEND)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        raise InputError(f"{relative(path)}: not valid JSON ({error}); {MEND}") from None


def parsed(c_type: str, literals: list[str]) -> np.ndarray:
    """Numbers of an array from its C text."""
    if c_type == "float":
        return np.array([float.fromhex(literal.rstrip("f")) for literal in literals], np.float32)
    numbers = [int(literal, 0) for literal in literals]
    return np.array(numbers, np.int8) if c_type == "int8_t" else np.array(numbers, np.uint16).view(np.float16)


def read_table(folder: Path, entry: dict) -> TableFile:
    """The table of one manifest entry."""
    path = folder / f"{entry['name']}.c"
    source = read_text(path, MEND)

    def number(key: str) -> int:
        found = re.search(rf"\.{key} = 0x([0-9a-f]+)u", source)
        if not found:
            raise InputError(f"{relative(path)}: field '.{key}' is missing; {MEND}")
        return int(found.group(1), 16)

    values: dict[str, np.ndarray] = {}
    for c_type, name, count, body in ARRAY.findall(source):
        values[name] = parsed(c_type, body.replace(",", " ").split())
        if len(values[name]) != int(count):
            raise InputError(f"{relative(path)}: array '{name}' holds {len(values[name])} numbers, not {count}; {MEND}")
    for c_type, stem, name, count in BLOB.findall(source):
        blob, size = folder / f"{stem}.bin", int(count) * TYPES[c_type].itemsize
        if not blob.is_file() or blob.stat().st_size != size:
            raise InputError(f"{relative(blob)}: missing or not {size} bytes long; {MEND}")
        values[name] = np.fromfile(blob, TYPES[c_type], int(count))
    order = re.findall(r'^ +\{"(\w+)", \w+, \d+\},$', source, re.MULTILINE)
    if sorted(order) != sorted(values):
        raise InputError(f"{relative(path)}: its list of arrays does not match its arrays; {MEND}")
    arrays = [Array(name, "", values[name].reshape(1, -1)) for name in order]

    def strings(key: str) -> list[str]:
        found = re.search(rf"\.{key} = \(const char\* const\[\]\)\{{(.*)\}},", source)
        return re.findall(r'"((?:[^"\\]|\\.)*)"', found.group(1)) if found else []

    inputs = list(zip(strings("input_name"), strings("input_unit"), strict=True))
    digests = (number(key) for key in ("digest", "robot_digest", "task_digest"))
    return TableFile(entry["name"], entry["kind"], *digests, arrays, inputs, entry)


def read_folder(folder: Path) -> tuple[dict, list[TableFile]]:
    """Manifest and tables of a folder; raises InputError where a file is missing or cannot be read."""
    manifest = read_manifest(folder)
    return manifest, [read_table(folder, entry) for entry in manifest["tables"]]


def faults(folder: Path) -> list[str]:
    """What is wrong with a table folder, one sentence each: files against the manifest, data against their digests."""
    manifest, tables = read_folder(folder)
    found = []
    for name, facts in manifest["files"].items():
        path = folder / name
        if not path.is_file():
            found.append(f"{relative(path)} is missing")
        elif hashlib.sha256(path.read_bytes()).hexdigest() != facts["sha256"]:
            found.append(f"{relative(path)} differs from the manifest")
    for table in tables:
        if table.data_digest != table.digest:
            found.append(f"{table.name}: the data's digest is 0x{table.data_digest:016x}, expected 0x{table.digest:016x}")
        for key, value in (("robot_digest", table.robot_digest), ("task_digest", table.task_digest)):
            if f"0x{value:016x}" != manifest[key]:
                found.append(f"{table.name}: {key} is 0x{value:016x}, the manifest says {manifest[key]}")
    return found
