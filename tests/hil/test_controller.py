"""engram-controller as a process on the network: it answers, keeps others out, ends cleanly, and says what went wrong."""

from __future__ import annotations

import csv
import itertools
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from engram_sim.pair import lcm_url, private_port, program, stop

ports = itertools.count()
HOME = [0.0, -0.785398, 0.0, -2.356194, 0.0, 1.570796, 0.785398]  # rad
TARGET = [0.30, 0.15, 0.45, 1.0, 0.0, 0.0, 0.0]  # m; quaternion x y z w


class Plant:
    """A robot that stands still, and everything that was said on the network."""

    def __init__(self, folder: Path, build: Path) -> None:
        sys.path.insert(0, str(build / "lcm"))
        import engram_msg
        import lcm

        self.msg = engram_msg
        self.folder = folder
        self.url = lcm_url(private_port() + 4096 + 8 * next(ports) % 4096)
        self.lcm = lcm.LCM(self.url)
        self.lcm.subscribe("ENGRAM_COMMAND", lambda _, data: self.commands.append(data))
        self.lcm.subscribe("ENGRAM_CYCLE", lambda _, data: self.cycles.append(engram_msg.cycle_t.decode(data)))
        self.commands: list[bytes] = []
        self.cycles: list = []
        self.children: list[subprocess.Popen] = []
        self.robot_digest, self.task_digest = digests()

    def controller(self, *options: object) -> subprocess.Popen:
        """Start a controller; what it says goes to a pipe."""
        call = [str(program("engram-controller")), "--lcm-url", self.url, *map(str, options)]
        child = subprocess.Popen(call, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True)
        self.children.append(child)
        return child

    def ready(self, *options: object) -> subprocess.Popen:
        """Start a controller and wait until it serves."""
        child = self.controller(*options)
        line = child.stdout.readline()
        assert "ready" in line, line
        return child

    def state(self, seq: int, utime: int | None = None, q: list[float] = HOME) -> None:
        m = self.msg.state_t()
        m.utime, m.seq, m.robot_digest, m.nq, m.nv = 1000 * seq if utime is None else utime, seq, self.robot_digest, 7, 7
        m.q[:7], m.v[:7] = q, [0.0] * 7
        self.lcm.publish("ENGRAM_STATE", m.encode())

    def task(self, seq: int = 1, jump: int = 1) -> None:
        m = self.msg.task_t()
        m.utime, m.seq, m.task_digest, m.jump, m.n = 0, seq, self.task_digest, jump, 7
        m.value[:7] = TARGET
        self.lcm.publish("ENGRAM_TASK", m.encode())

    def listen(self, seconds: float, until: int | None = None) -> None:
        """Take messages for a while, or until there are as many commands."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0 and (until is None or len(self.commands) < until):
            self.lcm.handle_timeout(max(1, int(1000 * left)))

    def ask(self, seq: int, **keywords) -> bytes:
        """Send a state and return the command that answers it."""
        n = len(self.commands)
        self.state(seq, **keywords)
        self.listen(5.0, n + 1)
        assert len(self.commands) == n + 1, f"state {seq} was not answered"
        return self.commands[-1]


def digests() -> tuple[int, int]:
    """Digests of robot and task as signed 64-bit numbers."""
    tables = Path(__file__).parents[2] / "tables"
    found = []
    for header in ("panda/robot.h", "panda_reach/task.h"):
        digest = int(re.search(r"digest = (0x[0-9a-f]+)", (tables / header).read_text()).group(1), 16)
        found.append(digest - (1 << 64) if digest >> 63 else digest)
    return found[0], found[1]


@pytest.fixture
def plant(tmp_path: Path, build: Path) -> Iterator[Plant]:
    plant = Plant(tmp_path, build)
    yield plant
    for child in plant.children:
        stop(child)


def end(child: subprocess.Popen, sig: int = signal.SIGINT) -> str:
    """End a controller; its exit code must be 0. Returns what it said since it was ready."""
    child.send_signal(sig)
    said, _ = child.communicate(timeout=10)
    assert child.returncode == 0, said
    return said


def test_help_and_version_tell(build: Path) -> None:
    said = subprocess.run([program("engram-controller"), "--help"], capture_output=True, text=True, check=True).stdout
    header = (build.parent / "controller/engram.h").read_text(encoding="utf-8")
    models = re.findall(r"extern const engram_model engram_(\w+);", header)
    assert "panda_reach" in models and "talos_stand" in models
    for word in ("--clock", "--memory", "lockstep", "ENGRAM_STATE", "Exit codes", *models):
        assert word in said
    version = subprocess.run([program("engram-controller"), "--version"], capture_output=True, text=True, check=True).stdout
    assert re.fullmatch(r"engram-controller \d+\.\d+\.\d+\n", version)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--memory", "all"], "memory, line, shift or cold"),
        (["--clock", "sun"], "lockstep or wall"),
        (["--model", "r2d2_fly"], "--model r2d2_fly: this binary holds no such model, but: panda_reach"),
        (["--iterations", "many"], "not a count"),
        (["--iterations", "0"], "must be 1 to 50"),
        (["--budget", "-1"], "budget_us"),
        (["--delay", "soon"], "not a count of us"),
        (["--delay", "60000"], "delay_us must be 0 to 50000"),
        (["--nonsense"], "--nonsense"),
        (["state"], "unexpected argument: state"),
        (["--timing", "/nowhere/t.csv"], "cannot write /nowhere/t.csv"),
    ],
)
def test_wrong_usage_gets_one_clear_line(options: list[str], word: str) -> None:
    done = subprocess.run([program("engram-controller"), *options], capture_output=True, text=True, timeout=10)
    assert done.returncode == 64
    assert word in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_no_network_says_what_to_do() -> None:
    call = [program("engram-controller"), "--lcm-url", "nonsense://"]
    done = subprocess.run(call, capture_output=True, text=True, timeout=10)
    assert done.returncode == 2
    assert "ip route add 239.255.76.67/32 dev lo" in done.stderr


def test_answers_states_and_ends_with_a_summary(plant: Plant) -> None:
    child = plant.ready()
    for seq in range(1, 41):
        command = plant.msg.command_t.decode(plant.ask(seq))
        assert (command.seq, command.utime, command.nu) == (seq, 1000 * seq, 7)
        if seq == 12:
            plant.task()
    assert len(plant.cycles) == 4
    assert plant.cycles[-1].jump == 1
    said = end(child)
    assert "40 states, 4 cycles" in said
    assert "no trouble" in said


def test_repeats_and_noise(plant: Plant) -> None:
    child = plant.ready()
    first = plant.ask(7)
    assert plant.ask(7) == first
    n = len(plant.commands)
    for channel in ("ENGRAM_STATE", "ENGRAM_TASK"):
        for data in (b"", b"short", bytes(1144), first):
            plant.lcm.publish(channel, data)
    plant.state(3)
    plant.listen(0.3)
    assert len(plant.commands) == n  # nothing of it was answered
    plant.ask(8)
    said = end(child)
    for word in ("1 duplicates", "1 out of order", "foreign", "wrong size"):
        assert word in said
    assert said.count("truncated") == 1  # said once, counted thereafter


def test_a_second_controller_leaves(plant: Plant) -> None:
    child = plant.ready()
    plant.ask(1)
    second = plant.controller()
    seq = 1
    while second.poll() is None and seq < 2000:
        seq += 1
        plant.ask(seq)  # exactly one answer each
    assert second.wait() == 3
    assert "another controller serves" in second.stdout.read()
    plant.ask(seq + 1)
    end(child)


def test_killed_and_started_again_it_takes_over(plant: Plant) -> None:
    child = plant.ready()
    for seq in range(1, 31):
        plant.ask(seq)
    child.kill()
    child.wait()
    again = plant.ready()
    plant.task()
    for seq in range(31, 62):
        plant.ask(seq)
    assert plant.cycles[-1].jump == 1
    assert "31 states" in end(again, signal.SIGTERM)


def test_a_silent_plant_is_waited_for(plant: Plant) -> None:
    child = plant.ready()
    plant.ask(1)
    time.sleep(1.3)
    plant.ask(2)
    assert "waiting for the plant" in end(child)


def test_side_files(plant: Plant) -> None:
    timing, jumps = plant.folder / "timing.csv", plant.folder / "jumps.csv"
    child = plant.ready("--timing", timing, "--jumps", jumps)
    plant.ask(1)
    plant.task()
    for seq in range(2, 60):
        plant.ask(seq)
    end(child)
    rows = list(csv.DictReader(timing.open()))
    assert [int(row["seq"]) for row in rows] == list(range(1, 7))
    assert float(rows[-1]["total_us"]) > 0.0
    header, row = csv.reader(jumps.open())
    assert row[:1] == ["1"]
    assert [float(x) for x in row[header.index("task_0") : header.index("merits")]] == TARGET
    assert float(row[-1]) < float(row[header.index("merits")])  # the iterations lowered the merit


def test_a_full_disk_does_not_stop_the_robot(plant: Plant) -> None:
    child = plant.ready("--timing", "/dev/full")
    for seq in range(1, 9001):  # until the buffer of the file overflows
        plant.state(seq)
        plant.listen(5.0, seq)
    assert len(plant.commands) == 9000
    said = end(child)
    assert said.count("disk full?") == 1
    assert "1 file errors" in said


def test_wall_clock(plant: Plant) -> None:
    child = plant.ready("--clock", "wall")
    plant.task()
    start = time.monotonic()
    for seq in range(1, 501):
        plant.state(seq)
        plant.listen(max(0.0, start + 1e-3 * seq - time.monotonic()))
    plant.listen(0.3)
    assert len(plant.commands) > 400  # a busy machine may lose some
    assert len(plant.cycles) > 10
    assert plant.cycles[-1].jump == 1
    said = end(child)
    assert "CPU per cycle" in said
