"""PyTorch, an optional extra: reference of the evaluators and peer of their times.

PyPI's wheel takes gigabytes, Debian's package python3-torch half of one: `scripts/setup.sh torch`. It belongs to the system's
Python, not to this environment, so it answers from a process of its own (pytorch_worker.py).
"""

from __future__ import annotations

import contextlib
import io
import subprocess
from functools import cache
from pathlib import Path

import numpy as np

from engram.inputs import InputError

PYTHON = Path("/usr/bin/python3")  # whose modules Debian's packages are
WORKER = Path(__file__).with_name("pytorch_worker.py")
MISSING = "PyTorch is not installed; scripts/setup.sh torch installs it (121 MB to fetch)"
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


@cache
def available() -> bool:
    """Is PyTorch there? Half a second, once."""
    found = "import importlib.util as u, sys; sys.exit(not (u.find_spec('torch') and u.find_spec('numpy')))"
    return PYTHON.exists() and subprocess.run([PYTHON, "-I", "-c", found]).returncode == 0


class PyTorch:
    """The process, as a context. Raises InputError if PyTorch is missing."""

    def __init__(self) -> None:
        if not available():
            raise InputError(MISSING)
        self.process = subprocess.Popen([PYTHON, "-I", WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=ONE_THREAD)

    def __enter__(self) -> PyTorch:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait()

    def ask(self, question: str, **arrays: object) -> dict[str, np.ndarray]:
        """The answer of the worker's function of that name. Raises RuntimeError if the worker dies; it has said why on stderr."""
        packed = io.BytesIO()
        np.savez(packed, question=question, **arrays)
        answer = b""
        try:
            self.process.stdin.write(packed.tell().to_bytes(8, "little") + packed.getbuffer())
            self.process.stdin.flush()
            answer = self.process.stdout.read(int.from_bytes(self.process.stdout.read(8), "little"))
        except BrokenPipeError:
            pass
        if not answer:
            raise RuntimeError(f"PyTorch's process left at '{question}' with exit code {self.process.wait()}")
        with np.load(io.BytesIO(answer)) as found:
            return dict(found)

    def load_train(self, cores: list[np.ndarray]) -> None:
        """The train that `sample` and `log_probability` are about."""
        self.ask("load_train", **{f"core_0_{k}": core for k, core in enumerate(cores)})

    def load_networks(self, network) -> None:
        """The engram.learn.network.Network that `predict` and `predict_one_by_one` are about."""
        layers = {
            f"{name}_{i}_{k}": np.asarray(array, float)
            for name, members in (("weight", network.weights), ("bias", network.biases))
            for i, member in enumerate(members)
            for k, array in enumerate(member)
        }
        self.ask("load_networks", center=network.center, width=network.width, modes=network.modes, **layers)


def optional() -> contextlib.AbstractContextManager[PyTorch | None]:
    """The process, or None if PyTorch is missing."""
    return PyTorch() if available() else contextlib.nullcontext()
