"""LCM event logs as numpy arrays. The layout of a message is read from its definition in controller/io/lcm/."""

import mmap
import re
import struct
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np

from engram.inputs import InputError
from engram.paths import ROOT, relative

DEFINITIONS = ROOT / "controller" / "io" / "lcm"
CHANNELS = {
    "ENGRAM_STATE": "state_t",
    "ENGRAM_TASK": "task_t",
    "ENGRAM_CYCLE": "cycle_t",
    "ENGRAM_COMMAND": "command_t",
}
SYNC = 0xEDA1DA01  # first word of every event
HEADER = struct.Struct(">IqqII")  # sync, event number, time stamp (us), length of channel, length of data
KINDS = {"int64_t": ">i8", "int32_t": ">i4", "int16_t": ">i2", "int8_t": "i1", "double": ">f8", "float": ">f4", "boolean": "i1"}


@cache
def layout(message: str) -> np.dtype:
    """The encoded form of a message of fixed size: fingerprint, then the fields in big-endian order."""
    text = re.sub(r"//.*", "", (DEFINITIONS / f"{message}.lcm").read_text(encoding="utf-8"))
    fields = [("fingerprint", ">u8")]
    for kind, name, sizes in re.findall(r"(\w+)\s+(\w+)((?:\[\d+\])*)\s*;", text.partition("{")[2]):
        shape = tuple(int(n) for n in re.findall(r"\d+", sizes))
        fields.append((name, KINDS[kind], shape) if shape else (name, KINDS[kind]))
    return np.dtype(fields)


def events(path: Path) -> Iterator[tuple[int, str, bytes]]:
    """Time stamp (us), channel and payload of every whole event of a log. Raises InputError if it cannot be read."""
    try:
        with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            at = 0
            while at + HEADER.size <= len(data):
                sync, _, utime, channel_size, size = HEADER.unpack_from(data, at)
                end = at + HEADER.size + channel_size + size
                if sync != SYNC or end > len(data):
                    return  # cut short: what came before is good
                start = at + HEADER.size + channel_size
                yield utime, data[at + HEADER.size : start].decode(), data[start:end]
                at = end
    except (OSError, ValueError) as error:
        raise InputError(f"{relative(path)}: cannot be read as an LCM log ({error}); give a log of engram-plant") from None


def read(path: Path, channels: list[str]) -> dict[str, np.ndarray]:
    """All messages of some channels, in order, as one structured array per channel. Messages of a wrong size are left out."""
    payloads: dict[str, list[bytes]] = {channel: [] for channel in channels}
    sizes = {channel: layout(CHANNELS[channel]).itemsize for channel in channels}
    for _, channel, data in events(path):
        if channel in payloads and len(data) == sizes[channel]:
            payloads[channel].append(data)
    return {channel: np.frombuffer(b"".join(found), layout(CHANNELS[channel])) for channel, found in payloads.items()}
