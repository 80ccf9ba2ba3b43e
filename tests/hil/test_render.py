"""engram-render: a log becomes a video."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import ARM, Arena

from engram_sim.pair import program

WIDTH, HEIGHT = 320, 240


@pytest.fixture
def log(arena: Arena) -> Path:
    """A short run."""
    arena.controller()
    assert arena.plant("--duration", "0.6").returncode == 0
    return arena.folder / "run.lcm"


def render(*options: str | Path) -> subprocess.CompletedProcess:
    call = [program("engram-render"), "--scene", ARM, "--width", str(WIDTH), "--height", str(HEIGHT), *options]
    return subprocess.run([str(word) for word in call], capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL)


def frames(video: Path) -> np.ndarray:
    """Pixels (frames, height, width, 3) of a video."""
    call = ["ffmpeg", "-loglevel", "error", "-i", str(video), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = subprocess.run(call, capture_output=True, check=True, stdin=subprocess.DEVNULL).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, HEIGHT, WIDTH, 3)


def test_video_shows_the_robot_moving(log: Path) -> None:
    out = log.with_name("v.mp4")
    done = render("--panel", f"one={log}", "--out", out, "--from", "0.1", "--to", "0.6")
    assert done.returncode == 0, done.stderr
    probe = ["ffprobe", "-v", "error", "-show_entries", "stream=codec_name,width,height,avg_frame_rate", "-of", "json", str(out)]
    stream = json.loads(subprocess.run(probe, capture_output=True, check=True).stdout)["streams"][0]
    assert (stream["codec_name"], stream["width"], stream["height"]) == ("h264", WIDTH, HEIGHT)
    pictures = frames(out).astype(float)
    assert len(pictures) == 12 and "frame 12/12" in done.stdout  # 0.5 s at 25 frames per second
    assert pictures.std() > 10  # not one grey
    assert np.abs(pictures[-1] - pictures[0]).max() > 50  # the arm is elsewhere


def test_clips_hold_a_panel_that_has_ended_and_show_outcomes(log: Path) -> None:
    clips, out = log.with_name("clips.txt"), log.with_name("v.mp4")
    clips.write_text("0.6;jump 1;0.1;0.6;late;0.1;0.2;ok 0.10 s\n")
    done = render("--panel", f"left={log}", "--panel", f"right={log}", "--out", out, "--clips", clips)
    assert done.returncode == 0, done.stderr
    pictures = frames(out).astype(float)
    left, right = pictures[:, 20:, : WIDTH // 2], pictures[:, 20:, WIDTH // 2 :]
    moved = [np.abs(side[14] - side[8]).mean() for side in (left, right)]
    assert moved[0] > 10 * moved[1]  # the right panel stands; the coder leaves a little noise


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--panel", "a=/nowhere.lcm", "--out", "v.mp4"], "cannot read the log '/nowhere.lcm'"),
        (["--panel", "nowhere.lcm", "--out", "v.mp4"], "--panel takes TITLE=LOG"),
        (["--panel", "a=x", "--out", "v.mp4", "--clips", "/nowhere.txt"], "cannot read the clips"),
        (["--out", "v.mp4"], "are needed"),
    ],
)
def test_wrong_input_is_told(options: list[str], word: str) -> None:
    done = render(*options)
    assert done.returncode == 2 and word in done.stderr and done.stderr.count("\n") == 1


def test_unwritable_video_is_told(log: Path) -> None:
    done = render("--panel", f"a={log}", "--out", "/nowhere/v.mp4", "--from", "0.1", "--to", "0.6")
    assert done.returncode == 2 and "ffmpeg" in done.stderr
