"""The deployed controller against the simulated Panda when something goes wrong on either side."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from engram_sim import eventlog
from engram_sim.pair import lcm_url, private_port, program, scene, stop
from engram_sim.series import write_reach

JUMPS = 2
NO_CONTROLLER = 4  # exit code of engram-plant
ports = count()


class Bench:
    """Controller and plant of one test, on a port of their own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.url = lcm_url(private_port(4) + 8 * next(ports) % 4096)
        self.children: list[subprocess.Popen] = []
        self.series = folder / "series.txt"
        write_reach(self.series, "panda", "reach", 5, JUMPS, move_every=0)

    def start(self, name: str, *options: object) -> subprocess.Popen:
        call = [str(program(name)), "--lcm-url", self.url, *map(str, options)]
        child = subprocess.Popen(call, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.children.append(child)
        return child

    def controller(self, *options: object) -> subprocess.Popen:
        """Start a controller and wait until it serves."""
        child = self.start("engram-controller", *options)
        assert "ready" in child.stdout.readline()
        return child

    def plant(self, *options: object) -> subprocess.Popen:
        files = ["--log", self.folder / "run.lcm", "--results", self.folder / "results.json"]
        fixed = ["--scene", scene("panda", "reach"), "--series", self.series, "--resend-ms", 100, "--give-up", 10]
        return self.start("engram-plant", *fixed, *files, *options)

    def results(self) -> dict:
        return json.loads((self.folder / "results.json").read_text())


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    bench = Bench(tmp_path)
    yield bench
    for child in bench.children:
        child.send_signal(signal.SIGCONT)
        stop(child)


def finish(plant: subprocess.Popen, code: int = 0) -> str:
    """Wait for a plant; what it said on stderr."""
    _, said = plant.communicate(timeout=60)
    assert plant.returncode == code, said
    return said


def wait_for_jump(plant: subprocess.Popen) -> None:
    """Until the first jump has ended: the robot is on its way to the second target."""
    assert plant.stdout.readline().startswith("jump 1/")


def test_killed_controller_is_replaced_in_mid_jump(bench: Bench) -> None:
    first = bench.controller()
    plant = bench.plant()
    wait_for_jump(plant)
    first.kill()
    first.wait()
    second = bench.controller()
    finish(plant)
    results = bench.results()
    assert results["resends"] > 0 and len(results["jumps"]) == JUMPS
    # the new one was told the task again: it planned for jump 2
    cycles = eventlog.read(bench.folder / "run.lcm", ["ENGRAM_CYCLE"])["ENGRAM_CYCLE"]
    assert cycles["jump"][-1] == JUMPS and second.poll() is None


def test_killed_plant_is_replaced_and_the_same_controller_goes_on(bench: Bench) -> None:
    controller = bench.controller()
    plant = bench.plant()
    wait_for_jump(plant)
    plant.kill()
    plant.wait()
    finish(bench.plant("--log", bench.folder / "again.lcm"))
    assert controller.poll() is None and len(bench.results()["jumps"]) == JUMPS
    # like with a fresh controller, to the byte: nothing of the first plant was kept but the count of cycles
    stop(controller)
    bench.controller()
    finish(bench.plant("--log", bench.folder / "fresh.lcm"))
    again, fresh = (
        eventlog.read(bench.folder / name, ["ENGRAM_COMMAND"])["ENGRAM_COMMAND"] for name in ("again.lcm", "fresh.lcm")
    )
    assert np.array_equal(again, fresh)


def test_paused_plant_on_the_wall_clock_goes_on(bench: Bench) -> None:
    controller = bench.controller("--clock", "wall")
    plant = bench.plant("--clock", "wall", "--stale-ms", "200", "--duration", "3")
    time.sleep(1.0)
    plant.send_signal(signal.SIGSTOP)
    time.sleep(0.7)
    plant.send_signal(signal.SIGCONT)
    finish(plant)
    assert controller.poll() is None and bench.results()["steps"] > 2900


def test_noise_latency_and_pushes_are_survived_and_reproducible(bench: Bench) -> None:
    faults = [
        "--noise-q",
        1e-4,
        "--noise-v",
        1e-2,
        "--latency",
        2,
        "--random-push-period",
        0.5,
        "--random-push-force",
        20,
        "--seed",
        3,
    ]
    logs = []
    for name in ("a.lcm", "b.lcm"):
        controller = bench.controller()
        finish(bench.plant(*faults, "--log", bench.folder / name))
        stop(controller)
        logs.append((bench.folder / name).read_bytes())
        assert len(bench.results()["jumps"]) == JUMPS
        assert all(jump["torque_share"] <= 1.0 + 1e-9 for jump in bench.results()["jumps"])  # clamped: rounding at most
    assert logs[0] == logs[1]


def test_robot_of_another_digest_gets_no_command(bench: Bench) -> None:
    controller = bench.controller()
    said = finish(bench.plant("--robot-digest", "0x123", "--give-up", "1"), NO_CONTROLLER)
    assert "no command on ENGRAM_COMMAND" in said
    controller.send_signal(signal.SIGINT)
    assert "another robot" in controller.communicate(timeout=10)[1]


def test_task_of_another_digest_is_not_taken(bench: Bench) -> None:
    text = bench.series.read_text().splitlines()
    bench.series.write_text("\n".join("task_digest 0x123" if line.startswith("task_digest") else line for line in text) + "\n")
    controller = bench.controller()
    finish(bench.plant())
    assert [jump["reason"] for jump in bench.results()["jumps"]] == ["late"] * JUMPS  # it holds where it stands, touches nothing
    controller.send_signal(signal.SIGINT)
    assert "task of another kind" in controller.communicate(timeout=10)[1]


def test_second_controller_leaves_the_robot_to_the_first(bench: Bench) -> None:
    bench.controller()
    plant = bench.plant()
    second = bench.start("engram-controller")
    assert second.wait(10) == 3 and "another controller serves" in second.stderr.read()
    finish(plant)
    assert bench.results()["refused"]["second_answer"] == 0


def test_wall_clock_run_keeps_time(bench: Bench) -> None:
    bench.controller("--clock", "wall")
    finish(bench.plant("--clock", "wall", "--stale-ms", "200", "--duration", "2"))
    results = bench.results()
    assert results["wall_seconds"] >= 2.0
    commands = eventlog.read(bench.folder / "run.lcm", ["ENGRAM_COMMAND"])["ENGRAM_COMMAND"]
    assert len(commands) > 1000  # half of the steps at least, however busy the machine
