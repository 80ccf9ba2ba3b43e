"""engram replay: the same messages again, or one line on what differs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import ARM, Arena

from engram.cli import main
from engram_sim import eventlog
from engram_sim.pair import program


@pytest.fixture
def log(arena: Arena) -> Path:
    """A short run, and beside it how its controller was called."""
    arena.controller()
    assert arena.plant("--duration", "0.6").returncode == 0
    call = [
        str(program("engram-standin")),
        "--lcm-url",
        "elsewhere",
        "--scene",
        str(ARM),
        "--clock",
        "lockstep",
        "--memory",
        "memory",
    ]
    (arena.folder / "pair.json").write_text(json.dumps({"controller": [*call, "--jumps", "nowhere.csv"]}))
    return arena.folder / "run.lcm"


def test_same_controller_gives_the_same_messages(log: Path, capsys: pytest.CaptureFixture) -> None:
    assert main(["replay", str(log)]) == 0
    assert "601 commands and 61 cycles of 0.6 s are the same" in capsys.readouterr().out


def test_another_command_is_told(log: Path, capsys: pytest.CaptureFixture) -> None:
    data = bytearray(log.read_bytes())
    command = eventlog.layout("command_t")
    for count, (_, channel, payload) in enumerate(eventlog.events(log)):
        if channel == "ENGRAM_COMMAND" and count > 300:
            at = data.index(payload) + command.fields["tau"][1]
            data[at + 7] ^= 1  # the last bit of the first torque
            break
    log.write_bytes(data)
    assert main(["replay", str(log)]) == 1
    assert "fields tau, torques by up to" in capsys.readouterr().out


def test_thinned_log_is_repeated_up_to_its_first_gap(arena: Arena, log: Path, capsys: pytest.CaptureFixture) -> None:
    arena.close()
    arena.controller()
    assert arena.plant("--duration", "0.6", "--log-full", "0.25").returncode == 0
    assert main(["replay", str(log)]) == 0
    assert "251 commands" in capsys.readouterr().out


def test_log_that_is_none_is_told(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    for name, content in (("empty.lcm", b""), ("text.lcm", b"no log at all" * 100)):
        path = tmp_path / name
        path.write_bytes(content)
        assert main(["replay", str(path)]) == 2
        assert str(path) in capsys.readouterr().err
    assert main(["replay", str(tmp_path / "missing.lcm")]) == 2
