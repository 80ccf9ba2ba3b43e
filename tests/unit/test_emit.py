"""Writing tables: same bytes, exact numbers, blobs, manifest, and every kind of damage found."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from engram.cli import main
from engram.emit import Knn, Logit, read_folder, write_tables
from engram.emit.arrays import Array, array, blocks, pad, restored, stored, triangle, unblocks
from engram.emit.kinds import KINDS
from engram.emit.read import faults
from engram.emit.write import c_float
from engram.inputs import InputError

NAME = "toy_task"
ROOT = Path(__file__).resolve().parents[2]


def tables(n: int = 30, m: int = 5) -> list:
    rng = np.random.default_rng(0)
    domain = dict(inputs=[("a", "m"), ("b", "rad")], lo=-np.ones(2), hi=np.ones(2), held_out_error=0.1, held_out_text="[m] on 7")
    return [
        Knn(x=rng.uniform(-1, 1, (n, 2)), scale=np.array([1.0, 0.3]), value=rng.normal(size=(n, m)), **domain),
        Logit(weight=np.array([1.5, -2.0]), bias=0.25, **domain),
    ]


def write(folder: Path, **sizes: int) -> dict:
    return write_tables(
        folder, NAME, tables(**sizes), robot_digest=1, task_digest=2, data_digest="d", provenance="engram fit toy"
    )


@pytest.mark.parametrize(
    "value", [0.0, -0.0, 1.0, 0.1, -3.75, 1e-38, 1.17549435e-38, 3.4028235e38, 1e-45, float(np.float32(2) ** -149)]
)
def test_a_literal_restores_every_bit(value: float) -> None:
    text = c_float(value)
    back = np.float32(float.fromhex(text.rstrip("f")))
    assert text.endswith("f") and back.tobytes() == np.float32(value).tobytes()


def test_random_literals_restore_every_bit() -> None:
    bits = np.random.default_rng(1).integers(0, 2**32, 5000, dtype=np.uint32).view(np.float32)
    for value in bits[np.isfinite(bits)]:
        assert np.float32(float.fromhex(c_float(value).rstrip("f"))).tobytes() == value.tobytes()


def test_not_finite_is_refused_and_denormals_are_flushed() -> None:
    for bad in (np.nan, np.inf, 1e39):
        with pytest.raises(ValueError, match="'x' holds numbers that are not finite"):
            array("x", "", np.array([1.0, bad]))
    assert array("x", "", np.array([1e-40, -1e-40, 1e-37])).flat.tolist() == [0.0, 0.0, np.float32(1e-37)]


def test_layouts() -> None:
    x = np.arange(22.0).reshape(11, 2)
    rows = blocks(x)
    assert rows.shape == (4, 8) and rows[0, 3] == x[3, 0] and rows[1, 3] == x[3, 1] and rows[2, 2] == x[10, 0]
    assert np.array_equal(unblocks(rows, 11, 2), x) and np.all(rows[2:, 3:] == 1e15)
    lower = np.tril(np.ones((9, 9)))
    assert triangle(lower).size == 8 * 8 + 16 and triangle(lower).sum() == 45 and pad(9) == 16


@pytest.mark.parametrize(("type", "loss"), [("float32", 2.0**-24), ("float16", 2.0**-11), ("int8", 0.5 / 127)])
def test_a_stored_matrix_loses_what_its_type_must(type: str, loss: float) -> None:
    values = np.random.default_rng(2).normal(size=(30, 11)) * np.geomspace(1e-6, 1e6, 11)
    matrix, scale = stored("w", "", values, type)
    back = restored(matrix, scale)[:, :11]
    # relative to the largest number of a column; scale and product are float32
    assert np.all(np.abs(back - values) <= (loss + 2.0**-22) * np.abs(values).max(axis=0))
    assert matrix.type == type and matrix.words.size == {"float32": 480, "float16": 240, "int8": 120}[type]
    assert not stored("w", "", np.zeros((2, 3)), type)[0].rows.any()


@dataclass(kw_only=True)
class Typed(Logit):
    """A table with an array of every type, as no evaluator has it."""

    rows: int

    def own_arrays(self) -> list[Array]:
        values = np.random.default_rng(3).normal(size=(self.rows, 8))
        return [a for type in ("float16", "int8") for a in stored(type, "", values, type)]


@pytest.mark.parametrize("rows", [3, 20_000])  # as C text, as blobs
def test_stored_arrays_are_read_back(tmp_path: Path, rows: int) -> None:
    logit = tables()[1]
    table = Typed(weight=logit.weight, bias=0, rows=rows, inputs=logit.inputs, lo=logit.lo, hi=logit.hi, held_out_error=0,
                  held_out_text="")  # fmt: skip
    write_tables(tmp_path, NAME, [table], robot_digest=1, task_digest=2, data_digest="", provenance="")
    assert faults(tmp_path) == []
    (found,) = read_folder(tmp_path)[1]
    for a, b in zip(found.arrays, table.arrays(), strict=True):
        assert (a.name, a.type) == (b.name, b.type) and np.array_equal(a.flat, b.flat)


def test_kinds_and_schemas_are_those_of_the_evaluators() -> None:
    tab = ROOT / "controller" / "tab"
    kinds = dict(
        re.findall(r"(kTab\w+) = (\d+)", re.search(r"typedef enum TabKind \{(.*?)\}", (tab / "tab.h").read_text(), re.S)[1])
    )
    assert {name: str(number) for name, (number, _) in KINDS.items()} == kinds
    for name, (_, schema) in KINDS.items():
        kind = name.removeprefix("kTab").lower()
        assert f"enum {{ TAB_{kind.upper()}_SCHEMA = {schema} }};" in (tab / f"tab_{kind}.h").read_text()


def test_same_tables_same_bytes(tmp_path: Path) -> None:
    first, second = write(tmp_path / "a"), write(tmp_path / "b")
    assert first == second
    for name in [*first["files"], "MANIFEST.json"]:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_an_unchanged_file_is_left_alone(tmp_path: Path) -> None:
    write(tmp_path)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("*.[ch]")}
    write(tmp_path)
    assert before and all(path.stat().st_mtime_ns == stamp for path, stamp in before.items())


def test_large_arrays_become_blobs_and_vanish_when_no_longer_needed(tmp_path: Path) -> None:
    manifest = write(tmp_path, n=20_000)
    entry = manifest["tables"][0]
    assert f"{NAME}_knn_v1_value.bin" in entry["files"] and f"{NAME}_knn_v1.S" in entry["files"]
    assert (tmp_path / f"{NAME}_knn_v1_value.bin").stat().st_size == 4 * 20_000 * 8
    assert faults(tmp_path) == []
    write(tmp_path, n=10)
    assert list(tmp_path.glob("*.bin")) == [] and list(tmp_path.glob("*.S")) == []


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    write(tmp_path, n=20_000)
    _, found = read_folder(tmp_path)
    for table, source in zip(found, tables(n=20_000)):
        assert table.data_digest == table.digest and (table.robot_digest, table.task_digest) == (1, 2)
        for a, b in zip(table.arrays, source.arrays()):
            assert a.name == b.name and np.array_equal(a.flat, b.flat)


def test_damage_is_found(tmp_path: Path) -> None:
    write(tmp_path, n=20_000)
    blob = tmp_path / f"{NAME}_knn_v1_x.bin"
    whole = bytearray(blob.read_bytes())
    whole[100] ^= 1
    blob.write_bytes(whole)
    assert any("differs from the manifest" in fault for fault in faults(tmp_path))
    assert any("the data's digest is" in fault for fault in faults(tmp_path))
    blob.write_bytes(whole[:-4])
    with pytest.raises(InputError, match="missing or not .* bytes long; run 'make tables'"):
        faults(tmp_path)
    write(tmp_path)
    source = tmp_path / f"{NAME}_logit_v1.c"
    source.write_text(source.read_text().replace(".robot_digest = 0x0000000000000001u", ".robot_digest = 0x0000000000000007u"))
    assert any("robot_digest is 0x0000000000000007" in fault for fault in faults(tmp_path))
    source.unlink()
    with pytest.raises(InputError, match="cannot be read"):
        faults(tmp_path)


def test_wrong_shapes_and_double_names_are_refused(tmp_path: Path) -> None:
    knn, logit = tables()
    logit.lo = np.zeros(3)
    with pytest.raises(ValueError, match="logit: 'lo' has shape"):
        logit.arrays()
    with pytest.raises(ValueError, match="two tables would be called 'toy_task_knn_v1'"):
        write_tables(tmp_path, NAME, [knn, knn], robot_digest=0, task_digest=0, data_digest="", provenance="")


def engram(*args: object) -> int:
    """Exit code of `engram <args>`."""
    return main([str(arg) for arg in args])


def test_table_info_and_check(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    write(tmp_path)
    assert engram("table", "info", tmp_path) == 0
    text = capsys.readouterr().out
    assert f"{NAME}_knn_v1" in text and "held-out error 0.1 [m] on 7" in text and "engram fit toy" in text
    assert engram("table", "info", tmp_path, "knn") == 0
    text = capsys.readouterr().out
    assert (
        "input b                     -1 .. 1           rad" in text and "array value              240 float32, 960 bytes" in text
    )
    assert engram("table", "info", tmp_path, "knm") == 2
    assert "holds no table 'knm'; did you mean 'knn'" in capsys.readouterr().err
    assert engram("table", "check", tmp_path) == 0
    source = tmp_path / f"{NAME}_logit_v1.c"
    source.write_text(source.read_text().replace(c_float(1.5), c_float(1.25)))
    assert engram("table", "check", tmp_path) == 1
    text = capsys.readouterr().out
    assert "differs from the manifest" in text and "the data's digest is" in text and "run 'make tables'" in text


def test_table_diff_names_what_changed(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    write(tmp_path / "a")
    write(tmp_path / "b")
    assert engram("table", "diff", tmp_path / "a", tmp_path / "b") == 0
    knn, _ = tables()
    knn.value[3, 2] += 0.5
    write_tables(tmp_path / "b", NAME, [knn], robot_digest=1, task_digest=2, data_digest="d", provenance="engram fit toy")
    capsys.readouterr()
    assert engram("table", "diff", tmp_path / "a", tmp_path / "b") == 1
    text = capsys.readouterr().out
    assert "knn_v1.value: 1 of 240 differ, by at most 0.5" in text and "logit_v1: only in" in text


def test_table_without_a_folder_names_the_mend(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert engram("table", "info", tmp_path / "nowhere") == 2
    assert "holds no MANIFEST.json" in capsys.readouterr().err


def test_committed_tables_are_whole(capsys: pytest.CaptureFixture) -> None:
    assert engram("table", "check") == 0, capsys.readouterr().out
