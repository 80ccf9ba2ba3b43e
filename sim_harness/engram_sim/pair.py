"""Plant and controller as two processes that talk over LCM."""

import json
import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from engram.inputs import InputError
from engram.paths import BUILD, TABLES, relative

FIRST_PORT, PORTS = 20000, 20000
PART_LINE = re.compile(r"(?:jump|episode) (\d+)/(\d+) (\S+) ([\d.]+) s")
STOP_TIME = 5.0  # s that a controller has to end after SIGTERM


def lcm_url(port: int) -> str:
    """LCM on one port of this machine: nothing leaves it, and large messages fit the buffer."""
    return f"udpm://239.255.76.67:{port}?ttl=0&recv_buf_size=4000000"


def private_port(k: int = 0) -> int:
    """A port that other runs on this machine do not use: derived from the process id. 0 <= k < 8."""
    return FIRST_PORT + (8 * os.getpid() + k) % PORTS


def program(name: str) -> Path:
    """A program of the build (ENGRAM_BUILD names another build folder than build/). Raises InputError."""
    path = Path(os.environ.get("ENGRAM_BUILD", BUILD)).resolve() / "bin" / name
    if not path.is_file():
        raise InputError(f"{relative(path)} is not there; build it: make setup")
    return path


def scene(robot: str, task: str) -> Path:
    """The MJCF scene that the plant simulates."""
    return TABLES / f"{robot}_{task}" / "scene.xml"


def plant_option(text: str) -> list[str]:
    """noise-v=0.01 -> --noise-v 0.01"""
    name, equal, value = text.partition("=")
    if not equal:
        raise InputError(f"--plant-option {text}: the form is OPTION=VALUE; `engram-plant --help` lists the options")
    return [f"--{name.lstrip('-')}", value]


@dataclass
class Pair:
    """One run: how plant and controller are called and where they write.

    Files of `folder`: run.lcm, results.json, timing.csv, jumps.csv, what they said (plant.txt, controller.txt) and how they were
    called (pair.json).
    """

    folder: Path
    script: Path
    scene: Path
    port: int
    mode: str = "memory"
    model: str = "panda_reach"
    kind: str = "series"  # of the script: series or scenario
    controller: Path | None = None  # default: engram-controller of the build
    controller_options: list[str] = field(default_factory=list)
    plant_options: list[str] = field(default_factory=list)
    clock: str = "lockstep"

    def run(self, progress: Callable[[int, int, str, float], None] | None = None) -> int:
        """Run to the end; the exit code of the plant. `progress(part, parts, outcome, seconds)` hears of each jump or episode."""
        self.folder.mkdir(parents=True, exist_ok=True)
        url = lcm_url(self.port)
        controller_call = [str(self.controller or program("engram-controller")), "--lcm-url", url, "--clock", self.clock]
        controller_call += [
            "--model",
            self.model,
            "--memory",
            self.mode,
            "--jumps",
            str(self.folder / "jumps.csv"),
            *self.controller_options,
        ]
        plant_call = [str(program("engram-plant")), "--lcm-url", url, "--clock", self.clock, "--scene", str(self.scene)]
        plant_call += [f"--{self.kind}", str(self.script), "--log", str(self.folder / "run.lcm")]
        plant_call += ["--results", str(self.folder / "results.json"), "--timing", str(self.folder / "timing.csv")]
        plant_call += self.plant_options
        calls = {"controller": controller_call, "plant": plant_call}
        (self.folder / "pair.json").write_text(json.dumps(calls, indent=1) + "\n", encoding="utf-8")

        with open(self.folder / "controller.txt", "w") as said, open(self.folder / "plant.txt", "w") as plant_said:
            try:
                controller = subprocess.Popen(controller_call, stdout=said, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
            except OSError as error:
                raise InputError(
                    f"{controller_call[0]}: cannot be started ({error.strerror}); give a program to --controller"
                ) from None
            plant = subprocess.Popen(plant_call, stdout=subprocess.PIPE, stderr=plant_said, stdin=subprocess.DEVNULL, text=True)
            try:
                for line in plant.stdout:
                    found = PART_LINE.match(line)
                    if found and progress:
                        progress(int(found[1]), int(found[2]), found[3], float(found[4]))
                return plant.wait()
            finally:
                stop(plant)
                stop(controller)

    def last_words(self) -> str:
        """What the two said at last, for an error message."""
        words = []
        for name in ("plant", "controller"):
            path = self.folder / f"{name}.txt"
            lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []
            words += [f"  {name}: {line}" for line in lines[-3:]]
        return "\n".join(words)


def stop(process: subprocess.Popen) -> None:
    """End a process: politely, then for good."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(STOP_TIME)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class Progress:
    """One line on a terminal that is rewritten, or a line now and then in a file."""

    def __init__(self, total: int, what: str, every: float = 15.0):
        self.total, self.what, self.start = total, what, time.monotonic()
        self.terminal = os.isatty(1)
        self.every, self.last = (0.1 if self.terminal else every), 0.0

    def show(self, done: int, note: str = "") -> None:
        """Show `done` of `total`; not more often than it helps."""
        now = time.monotonic()
        if done < self.total and now - self.last < self.every:
            return
        self.last, spent = now, now - self.start
        left = spent / done * (self.total - done) if done else 0.0
        bar = "#" * round(24 * done / self.total)
        text = f"{self.what}  [{bar:<24}] {done}/{self.total}  {spent:.0f} s, {left:.0f} s left  {note}"
        if self.terminal:
            print(
                "\r" + text[: shutil.get_terminal_size().columns - 1].ljust(shutil.get_terminal_size().columns - 1),
                end="",
                flush=True,
            )
        else:
            print(text, flush=True)
        if done == self.total and self.terminal:
            print()
