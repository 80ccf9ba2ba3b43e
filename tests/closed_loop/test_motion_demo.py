"""engram demo of a motion end to end: a short flight, every file it promises, and figures that agree with one another."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from engram.cli import main

POINTS = 2


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished demo; its figures lie beside it."""
    folder = tmp_path_factory.mktemp("motion") / "run"
    call = ["demo", "--robot", "hector", "--jumps", str(POINTS), "--seed", "11", "--video", "1"]
    assert main([*call, "--out", str(folder), "--figures", str(folder.parent)]) == 0
    return folder


def test_files(demo: Path) -> None:
    for name in ("series.txt", "summary.json", "report.html", "demo.mp4", "demo.png"):
        assert (demo / name).stat().st_size > 0, name
    for name in ("run.lcm", "results.json", "timing.csv", "pair.json"):
        assert (demo / "memory" / name).stat().st_size > 0, name


def test_summary_and_figures_agree_with_results(demo: Path) -> None:
    summary = json.loads((demo / "summary.json").read_text())
    jumps = json.loads((demo / "memory" / "results.json").read_text())["jumps"]
    assert (summary["robot"], summary["task"], summary["seed"], summary["parts"]) == ("hector", "fly", 11, POINTS)
    assert summary["successes"] == sum(jump["success"] for jump in jumps) == POINTS
    assert summary["torque_share_max"] == max(jump["torque_share"] for jump in jumps) <= 1.0
    times = summary["total_us"]
    assert 0.0 < times["p50"] <= times["p99"] <= times["p999"] <= times["max"]
    records = {record["id"]: record["value"] for record in json.loads((demo.parent / "demo_hector.json").read_text())}
    assert records["demo.hector.success"] == 1.0 and records["demo.hector.cycle_us.p999"] == times["p999"]


def test_report_stands_alone(demo: Path) -> None:
    page = (demo / "report.html").read_text()
    assert page.count("<svg") >= 3 and 'src="demo.mp4"' in page and "way point 2" in page
    assert "<script" not in page and "http" not in page.replace("http://www.w3.org", "")


def test_replay_gives_the_same_messages(demo: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(["replay", str(demo / "memory" / "run.lcm"), "--limit", "2"]) == 0
    assert "are the same, byte for byte" in capsys.readouterr().out


def test_report_again(demo: Path) -> None:
    before = json.loads((demo / "summary.json").read_text())
    assert main(["report", str(demo), "--figures", str(demo.parent)]) == 0
    after = json.loads((demo / "summary.json").read_text())
    assert {key: value for key, value in before.items() if key != "wall_s"} == {k: v for k, v in after.items() if k != "wall_s"}


def test_wrong_input_is_told(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    for options, word in (
        (["--robot", "hectr"], "unknown robot 'hectr'; did you mean 'hector'?"),
        (["--robot", "hector", "--task", "fyl"], "unknown task 'fyl' of robot 'hector'; did you mean 'fly'?"),
        (["--robot", "hector", "--jumps", "0"], "at least one way point"),
        (["--robot", "hector", "--plant-option", "latency"], "the form is OPTION=VALUE"),
        (["--robot", "ur10"], "robot 'ur10' has no task"),
    ):
        assert main(["demo", *options, "--out", str(tmp_path / "run")]) == 2
        assert word in capsys.readouterr().err
