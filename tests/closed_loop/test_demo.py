"""engram demo end to end: a short series, every file it promises, and figures that agree with one another."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from engram.cli import main
from engram_sim.pair import program

JUMPS, MODES = 3, ["memory", "cold"]


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a finished demo."""
    folder = tmp_path_factory.mktemp("demo") / "run"
    call = ["demo", "--jumps", str(JUMPS), "--modes", ",".join(MODES), "--out", str(folder), "--video", "2", "--seed", "11"]
    call += ["--figures", str(folder.parent)]  # build/figures belongs to the user's demo
    assert main(call) == 0
    return folder


def test_files(demo: Path) -> None:
    for name in ("series.txt", "summary.json", "report.html", "demo.mp4", "demo.png"):
        assert (demo / name).stat().st_size > 0, name
    for mode in MODES:
        for name in ("run.lcm", "results.json", "timing.csv", "jumps.csv", "pair.json"):
            assert (demo / mode / name).stat().st_size > 0, name
    assert (demo.parent / "latest").resolve() == demo


def test_summary_agrees_with_results(demo: Path) -> None:
    summary = json.loads((demo / "summary.json").read_text())
    assert (summary["robot"], summary["task"], summary["seed"], summary["jumps"]) == ("panda", "reach", 11, JUMPS)
    assert list(summary["modes"]) == MODES
    for mode in MODES:
        jumps = json.loads((demo / mode / "results.json").read_text())["jumps"]
        row = summary["modes"][mode]
        assert row["jumps"] == len(jumps) == JUMPS and row["successes"] == sum(jump["success"] for jump in jumps)
        assert 0.0 <= row["success_low"] <= row["success"] <= row["success_high"] <= 1.0
        assert 0.0 < row["cycle_us"]["p50"] <= row["cycle_us"]["p99"] <= row["cycle_us"]["max"]
        assert row["subopt1"] >= row["subopt3"] >= 0.0


def test_report_stands_alone(demo: Path) -> None:
    page = (demo / "report.html").read_text()
    assert page.count("<svg") >= 6 and 'src="demo.mp4"' in page
    # nothing is fetched: no script, no address but the name spaces of SVG
    assert "<script" not in page and "http" not in page.replace("http://www.w3.org", "")
    assert all(mode in page for mode in MODES)


def test_replay_gives_the_same_messages(demo: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(["replay", str(demo / "memory" / "run.lcm"), "--limit", "2"]) == 0
    assert "are the same, byte for byte" in capsys.readouterr().out


def test_two_demos_of_a_seed_log_the_same_bytes(demo: Path, tmp_path: Path) -> None:
    call = ["demo", "--jumps", str(JUMPS), "--modes", "memory", "--out", str(tmp_path / "again"), "--video", "0", "--seed", "11"]
    call += ["--figures", str(tmp_path)]
    assert main(call) == 0
    assert (tmp_path / "again/memory/run.lcm").read_bytes() == (demo / "memory/run.lcm").read_bytes()


def test_report_and_video_again(demo: Path) -> None:
    before = json.loads((demo / "summary.json").read_text())
    assert main(["report", str(demo), "--figures", str(demo.parent)]) == 0
    assert json.loads((demo / "summary.json").read_text()) == before
    assert main(["render", str(demo), "--modes", "memory", "--seconds", "1", "--out", str(demo / "again.mp4")]) == 0
    assert (demo / "again.mp4").stat().st_size > 0


def test_mode_that_cannot_run_is_told(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """A controller that ends at once: the plant's message comes through, the demo says so by its exit code."""
    folder = tmp_path / "run"
    call = ["demo", "--jumps", "1", "--modes", "memory", "--out", str(folder), "--video", "0", "--controller", "/bin/false"]
    assert main([*call, "--plant-option", "give-up=0.5"]) == 1
    assert "no command on ENGRAM_COMMAND" in capfd.readouterr().out


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--modes", "memroy"], "unknown mode 'memroy'"),
        (["--robot", "pandora"], "unknown robot 'pandora'"),
        (["--jumps", "0"], "at least one jump"),
        (["--plant-option", "latency"], "the form is OPTION=VALUE"),
        (["--controller", "/nowhere/controller"], "cannot be started"),
    ],
)
def test_wrong_input_is_told(options: list[str], word: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert program("engram-plant")
    assert main(["demo", "--jumps", "1", "--modes", "memory", "--out", str(tmp_path / "run"), "--video", "0", *options]) == 2
    assert word in capsys.readouterr().err


def test_folder_without_a_run_is_told(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(["report", str(tmp_path), "--figures", str(tmp_path)]) == 2
    assert "give the folder of a demo" in capsys.readouterr().err
