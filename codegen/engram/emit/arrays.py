"""Arrays as the evaluators read them: float32, or stored smaller; padded to whole vectors; and their digest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LANES = 8  # TAB_LANES
FAR = 1e15  # TAB_FAR

FNV_OFFSET = 0xCBF29CE484222325
FNV_PRIME = 0x100000001B3
MASK64 = (1 << 64) - 1


def pad(n: int) -> int:
    """n rounded up to whole vectors (tab_pad)."""
    return -(-n // LANES) * LANES


TYPES = {"float32": 0, "float16": 1, "int8": 2}  # TabType
C_TYPES = {"float32": "float", "float16": "uint16_t", "int8": "int8_t"}
PLURALS = {"float32": "floats", "float16": "halves", "int8": "bytes"}


@dataclass(frozen=True)
class Array:
    """One array of a table: name, one line about its shape, and rows of one of the TYPES (2-D: a row is a line of text)."""

    name: str
    about: str
    rows: np.ndarray

    @property
    def type(self) -> str:
        """How the numbers are stored."""
        return self.rows.dtype.name

    @property
    def words(self) -> np.ndarray:
        """The bytes in memory as 32-bit words."""
        return np.frombuffer(self.rows.tobytes(), "<u4")

    @property
    def flat(self) -> np.ndarray:
        """All numbers in the order of memory."""
        return self.rows.reshape(-1)


def array(name: str, about: str, values: np.ndarray) -> Array:
    """`values` as float32 rows; refuses what is not finite, and flushes denormals, which would slow the evaluator down."""
    wide = np.atleast_2d(np.asarray(values, dtype=np.float64))
    with np.errstate(over="ignore"):
        rows = wide.astype(np.float32)
    if not np.all(np.isfinite(rows)):
        raise ValueError(f"array '{name}' holds numbers that are not finite as float32")
    rows[np.abs(rows) < np.finfo(np.float32).tiny] = 0.0
    return Array(name, about, np.ascontiguousarray(rows))


def stored(name: str, about: str, values: np.ndarray, type: str = "float32") -> tuple[Array, Array]:
    """A matrix (n, m) in the type asked for, rows padded, and the scale (pad(m)) of its columns: number = stored * scale.

    float16 and int8 scale every column to its largest number; float32 keeps the numbers (scale 1).
    """
    values = padded_rows(np.asarray(values, np.float64))
    largest = np.maximum(np.abs(values).max(axis=0), 1e-30)
    if type == "float32":
        matrix, scale = array(name, about, values), np.ones(len(largest))
    elif type == "float16":
        scale = np.float32(largest)
        rows = (values / scale).astype(np.float16)
        rows[np.abs(rows) < np.finfo(np.float16).tiny] = 0.0
        matrix = Array(name, about, rows)
    elif type == "int8":
        scale = np.float32(largest / 127)
        matrix = Array(name, about, np.rint(values / scale).astype(np.int8))
    else:
        raise ValueError(f"array '{name}': type '{type}' is none of {', '.join(TYPES)}")
    return matrix, array(f"{name}_scale", f"(pad(m)) scale of each column of {name}", scale)


def restored(matrix: Array, scale: Array) -> np.ndarray:
    """The numbers that an evaluator sees in a stored matrix, as double."""
    return matrix.rows.astype(np.float64) * scale.flat.astype(np.float64)


def padded_rows(values: np.ndarray) -> np.ndarray:
    """(n, m) -> (n, pad(m)), zeros to the right."""
    values = np.atleast_2d(values)
    return np.pad(values, ((0, 0), (0, pad(values.shape[1]) - values.shape[1])))


def blocks(samples: np.ndarray) -> np.ndarray:
    """(n, d) -> (pad(n) / 8 * d, 8): eight samples side by side, input by input; padding samples lie at FAR."""
    n, d = samples.shape
    full = np.full((pad(n), d), FAR)
    full[:n] = samples
    return full.reshape(-1, LANES, d).transpose(0, 2, 1).reshape(-1, LANES)


def unblocks(rows: np.ndarray, n: int, d: int) -> np.ndarray:
    """The inverse of `blocks`."""
    return rows.reshape(-1, d, LANES).transpose(0, 2, 1).reshape(-1, d)[:n]


def triangle(lower: np.ndarray) -> np.ndarray:
    """The lower triangle row by row, row i padded with zeros to pad(i + 1); a vector."""
    n = len(lower)
    square = np.pad(np.tril(lower), ((0, 0), (0, pad(n) - n)))
    return np.concatenate([square[i, : pad(i + 1)] for i in range(n)])


def fnv1a(words: list[int], value: int = FNV_OFFSET) -> int:
    """FNV-1a over 32-bit words."""
    for word in words:
        value = ((value ^ word) * FNV_PRIME) & MASK64
    return value


def words64(number: int) -> list[int]:
    """A 64-bit number as two words, the lower first."""
    return [number & 0xFFFFFFFF, number >> 32]


def digest(arrays: list[Array]) -> int:
    """FNV-1a over counts and 32-bit words: tab_digest of controller/tab/tab.h."""
    value = FNV_OFFSET
    for item in arrays:
        value = fnv1a([*words64(item.words.size), *item.words.tolist()], value)
    return value
