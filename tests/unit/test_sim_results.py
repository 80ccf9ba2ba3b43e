"""Statistics, CSV and log layouts of the harness."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from engram.inputs import InputError
from engram_sim import eventlog
from engram_sim.demo import run_folder
from engram_sim.results import enumerators, figures, figures_name, read_csv, read_run, wilson
from engram_sim.suboptimality import ITERATIONS, read_jumps, suboptimality


def test_wilson_interval_by_hand() -> None:
    # 8 of 10, z = 1.96: centre (0.8 + 0.19208) / 1.38416, half width 1.96 / 1.38416 sqrt(0.016 + 0.0096040)
    low, high = wilson(8, 10, 1.96)
    assert low == pytest.approx(0.716738 - 0.226578, abs=1e-5) and high == pytest.approx(0.716738 + 0.226578, abs=1e-5)


def test_wilson_interval_at_the_ends() -> None:
    assert wilson(0, 0) == (0.0, 1.0)
    assert wilson(0, 20)[0] == 0.0 and 0.1 < wilson(0, 20)[1] < 0.2
    assert wilson(20, 20)[1] == pytest.approx(1.0) and 0.8 < wilson(20, 20)[0] < 0.9


def test_enumerators_follow_the_header() -> None:
    assert enumerators("engram_status")[:3] == ["converged", "iterating", "deadline"]
    assert enumerators("engram_rung") == ["plan", "shifted", "hold", "damping", "off"]
    assert enumerators("engram_candidate") == ["shifted", "knn", "gpr", "gmr", "line", "cold", "tt", "mlp"]
    assert enumerators("engram_nonsense") == []


def test_layout_is_the_encoding_of_lcm() -> None:
    """Sizes by hand: 8 bytes of fingerprint, then the fields without padding."""
    assert eventlog.layout("state_t").itemsize == 8 + 3 * 8 + 2 * 4 + 2 * 64 * 8
    assert eventlog.layout("command_t").itemsize == 8 + 3 * 8 + 2 * 4 + 64 * 8
    assert eventlog.layout("cycle_t").fields["path"][0].shape == (64, 3)
    assert eventlog.layout("task_t").fields["jump"][1] == 32


def test_csv_without_its_last_line(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("utime,total_us\n1,2.5\n2,3.5\n3")
    assert read_csv(path)["total_us"].tolist() == [2.5, 3.5]
    path.write_text("utime,total_us\n")
    assert read_csv(path)["total_us"].tolist() == []
    assert read_csv(tmp_path / "missing.csv") == {}


def test_jumps_csv(tmp_path: Path) -> None:
    path = tmp_path / "jumps.csv"
    path.write_text(
        "jump,utime,winner,x0_0,x0_1,task_0,merits\n1,10,knn,0.5,0,2,9,3,1\n2,20,line,1,0,4,8\n0,0,cold,0,0,0,0\n3,30,line,1,"
    )
    first, second = read_jumps(path)
    assert (first.jump, first.winner, first.x0.tolist(), first.task.tolist()) == (1, "knn", [0.5, 0.0], [2.0])
    assert first.merits.tolist() == [9, 3, 1] and second.merits.tolist() == [8]


def test_suboptimality_is_relative_to_the_best() -> None:
    values = suboptimality(np.array([9.0, 3.0, 1.5]), 1.0)
    assert values[:3].tolist() == [8.0, 2.0, 0.5] and len(values) == ITERATIONS + 1
    assert set(values[3:].tolist()) == {0.5}  # converged early: keeps its last value
    assert suboptimality(np.array([9.0, 3.0]), 4.0)[1] == 0.0  # better than every reference solve


def plant_results(jumps: list[dict]) -> str:
    return json.dumps({"jumps": jumps, "log": {"truncated": False}})


def jump(success: bool, reason: str = "ok", arrival: float = 1.0) -> dict:
    return {
        "jump": 1,
        "t_start_s": 0.0,
        "t_end_s": 2.0,
        "success": success,
        "reason": reason,
        "arrival_s": arrival,
        "statuses": {},
    }


def test_summary_counts_and_times(tmp_path: Path) -> None:
    jumps = [jump(True), jump(True, arrival=2.0), jump(False, "late+contact", -1.0), jump(False, "limit", 0.7)]
    (tmp_path / "results.json").write_text(plant_results(jumps))
    (tmp_path / "timing.csv").write_text("utime,seq,query_us,total_us\n0,1,10,100\n1,2,0,100\n")
    (tmp_path / "jumps.csv").write_text("jump,utime,winner,merits\n1,0,knn,3\n2,9,gmr,2,1\n3,9,knn,2\n4,9,knn,2\n0,0,cold,0\n5,")
    run = read_run("memory", tmp_path)
    row = run.summary()
    assert row["won"] == {"gmr": 0.25, "knn": 0.75}
    assert (row["jumps"], row["successes"], row["late"], row["contact"], row["limit"]) == (4, 2, 1, 1, 1)
    assert row["success"] == 0.5 and row["arrival_median_s"] == 1.5 and row["query_share"] == 0.05
    records = {record["id"]: record for record in figures("panda", [run])}
    other = [record["id"] for record in figures("panda", [run], 7)]
    assert figures_name(1) == "demo.json" and figures_name(7) == "demo-seed7.json"
    assert other == [name.replace("demo.panda.", "demo.panda.seed7.") for name in records]
    assert records["demo.panda.success.memory"]["value"] == 0.5 and records["demo.panda.success.memory"]["n"] == 4
    assert records["demo.panda.cycle_us.max"]["value"] == 100.0
    assert records["demo.panda.won.gmr"]["value"] == 0.25
    assert "demo.panda.subopt1.memory" not in records  # not measured: absent


def test_missing_results_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="interrupted"):
        read_run("memory", tmp_path)


def test_runs_of_the_same_second_have_folders_of_their_own(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        folders = list(pool.map(lambda _: run_folder(None, tmp_path / "runs"), range(24)))
    assert len(set(folders)) == len(folders) and all(folder.is_dir() for folder in folders)
    assert (tmp_path / "runs" / "latest").resolve() in folders
    assert sorted(path.name for path in (tmp_path / "runs").iterdir() if path.name.startswith(".")) == []
