"""Runs a controller on the states and tasks of a log, and compares what it answers, byte for byte."""

import json
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

import lcm
import numpy as np

from engram.inputs import InputError
from engram.paths import relative
from engram_sim import eventlog
from engram_sim.pair import Progress, lcm_url, private_port, program, stop

GIVE_UP = 10.0  # s without an answer
RESEND = 0.5  # s
SETTLE = 0.2  # s for the messages that come after the last command


@dataclass
class Step:
    """One state of a log with what came before it and what the controller answered."""

    utime: int  # us
    tasks: list[bytes]
    state: bytes
    command: bytes | None = None
    cycles: list[bytes] = field(default_factory=list)


def read_steps(path: Path, limit: float | None) -> list[Step]:
    """The unbroken part of a log: every state, from the first up to the first gap, up to `limit` s."""
    state, command = eventlog.layout("state_t"), eventlog.layout("command_t")
    steps: list[Step] = []
    tasks: list[bytes] = []
    previous = 0
    for utime, channel, data in eventlog.events(path):
        if limit is not None and utime > 1e6 * limit:
            break
        if channel == "ENGRAM_TASK":
            tasks.append(data)
        elif channel == "ENGRAM_STATE" and len(data) == state.itemsize:
            seq = int(np.frombuffer(data, state)[0]["seq"])
            if seq not in (1, previous + 1):
                break
            previous = seq
            steps.append(Step(utime, tasks, data))
            tasks = []
        elif channel == "ENGRAM_COMMAND" and steps and len(data) == command.itemsize:
            if int(np.frombuffer(data, command)[0]["seq"]) == previous:
                steps[-1].command = data
        elif channel == "ENGRAM_CYCLE" and steps:
            steps[-1].cycles.append(data)
    if not steps:
        raise InputError(f"{relative(path)}: holds no state; give a log of engram-plant")
    return steps


def controller_call(path: Path, url: str, mode: str | None, controller: Path | None) -> list[str]:
    """How to call the controller at `url`: as pair.json beside the log tells, without side files; `mode` and `controller` win."""
    try:
        recorded = json.loads((path.parent / "pair.json").read_text(encoding="utf-8"))["controller"]
    except (OSError, ValueError, KeyError):
        recorded = ["", "--clock", "lockstep", "--memory", "memory"]
    options = dict(zip(recorded[1::2], recorded[2::2]))
    options.pop("--jumps", None)
    options["--lcm-url"] = url
    if mode is not None:
        options["--memory"] = mode
    name = str(controller or recorded[0] or program("engram-controller"))
    return [name, *(word for option in options.items() for word in option)]


class Client:
    """The plant's side of LCM, without a plant."""

    def __init__(self, url: str):
        try:
            self.lcm = lcm.LCM(url)
        except RuntimeError:
            mend = "as root: ip link set lo up; ip route add 239.255.76.67/32 dev lo"
            raise InputError(f"cannot open LCM at '{url}': no multicast route; {mend}") from None
        self.command = eventlog.layout("command_t")
        self.answer: bytes | None = None
        self.wanted = (0, 0)  # utime, seq
        self.cycles: list[bytes] = []
        self.subscriptions = [
            self.lcm.subscribe("ENGRAM_COMMAND", self.on_command),
            self.lcm.subscribe("ENGRAM_CYCLE", lambda _, data: self.cycles.append(data)),
        ]
        self.subscriptions[0].set_queue_capacity(1000)
        self.subscriptions[1].set_queue_capacity(1000)

    def on_command(self, _: str, data: bytes) -> None:
        if len(data) == self.command.itemsize:
            message = np.frombuffer(data, self.command)[0]
            if (int(message["utime"]), int(message["seq"])) == self.wanted:
                self.answer = data

    def ask(self, step: Step) -> bytes | None:
        """Publish a step's tasks and state; the command that answers it, or None if none comes."""
        message = np.frombuffer(step.state, eventlog.layout("state_t"))[0]
        self.wanted, self.answer = (int(message["utime"]), int(message["seq"])), None
        start = sent = time.monotonic()
        self.publish(step)
        while self.answer is None:
            self.lcm.handle_timeout(100)
            now = time.monotonic()
            if now - start > GIVE_UP:
                return None
            if self.answer is None and now - sent > RESEND:
                self.publish(step)
                sent = now
        return self.answer

    def publish(self, step: Step) -> None:
        for task in step.tasks:
            self.lcm.publish("ENGRAM_TASK", task)
        self.lcm.publish("ENGRAM_STATE", step.state)


def replay(path: Path, mode: str | None, controller: Path | None, limit: float | None) -> int:
    """Repeat `path`; 0 if every command and cycle is the same byte for byte, 1 if not. Says what differs. Raises InputError."""
    steps = read_steps(path, limit)
    url = lcm_url(private_port(7))
    call = controller_call(path, url, mode, controller)
    client = Client(url)
    process = subprocess.Popen(call, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    progress = Progress(len(steps), "replay")
    try:
        for n, step in enumerate(steps, 1):
            answer = client.ask(step)
            if answer is None:
                print(
                    f"\nreplay: no answer to the state of t = {1e-6 * step.utime:.3f} s for {GIVE_UP:.0f} s; see its last words"
                )
                return 1
            if step.command is not None and answer != step.command:
                print(f"\nreplay: {difference(step, answer)}")
                return 1
            progress.show(n, f"t = {1e-6 * step.utime:.2f} s")
        end = time.monotonic() + SETTLE
        while time.monotonic() < end:
            client.lcm.handle_timeout(50)
    finally:
        stop(process)
    recorded_cycles = [cycle for step in steps for cycle in step.cycles]
    n = min(len(recorded_cycles), len(client.cycles))
    if sorted(recorded_cycles[:n]) != sorted(client.cycles[:n]) or abs(len(recorded_cycles) - len(client.cycles)) > 1:
        print(
            f"replay: the commands are the same, the cycles are not ({len(recorded_cycles)} recorded, {len(client.cycles)} now)"
        )
        return 1
    compared = sum(step.command is not None for step in steps)
    seconds = 1e-6 * (steps[-1].utime - steps[0].utime)
    print(f"replay: {compared} commands and {n} cycles of {seconds:.1f} s are the same, byte for byte")
    return 0


def difference(step: Step, answer: bytes) -> str:
    """One line on where two commands differ."""
    layout = eventlog.layout("command_t")
    was, now = (np.frombuffer(data, layout)[0] for data in (step.command, answer))
    names = [name for name in layout.names if not np.array_equal(was[name], now[name])]
    what = f"fields {', '.join(names)}"
    if "tau" in names:
        what += f", torques by up to {np.abs(was['tau'] - now['tau']).max():.3g} N m"
    return f"the command for t = {1e-6 * step.utime:.3f} s is another: {what}"
