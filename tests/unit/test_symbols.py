"""What the controller's archives need from outside: arithmetic and memcpy, no allocator, no exceptions, no I/O, no threads."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ALLOWED = re.compile(
    r"(mem(cpy|set|move|cmp)|f(max|min|abs|ma|mod)|sqrt|sincos|sin|cos|tan|a(sin|cos|tan|tan2)|exp|expm1|log|log1p|pow|cbrt|floor|ceil|"
    r"round|hypot|ldexp|frexp|modf|trunc)f?|_GLOBAL_OFFSET_TABLE_|__stack_chk_fail"
)
# Each must be told apart from what is allowed: the check is worth nothing if it lets these pass.
FORBIDDEN = (
    "malloc free _Znwm _ZdlPv __cxa_throw __gxx_personality_v0 _Unwind_Resume printf fwrite "
    "puts abort __assert_fail pthread_mutex_lock __cxa_guard_acquire _ZSt20__throw_length_errorPKc"
).split()
MODELS = ["panda_reach", "talos_stand", "talos_walk", "talos_pole", "anymal_trot", "hector_fly"]
MODELS += ["pendulum_swing", "unicycle_park", "bicopter_fly"]
ARCHIVES = [*(f"controller/libengram_{name}.a" for name in MODELS), "controller/tab/libengram_tab.a"]


def symbols(files: list[Path], kind: str) -> set[str]:
    """Undefined ("U") or defined symbols of objects or archives."""
    out = subprocess.run(["nm", *files], capture_output=True, text=True, check=True).stdout
    found = re.findall(r"^(?:[0-9a-f]+)?\s+([A-Za-z]) (\S+)$", out, re.M)
    return {name for letter, name in found if (letter in "Uw") == (kind == "U")}


def table_archives(build: Path) -> list[Path]:
    """The archives of generated tables."""
    return sorted(build.glob("tables/libengram_tables_*.a"))


def test_undefined_symbols(build: Path) -> None:
    """Everything undefined is another part of the controller or plain arithmetic."""
    files = [build / name for name in ARCHIVES] + table_archives(build)
    outside = symbols(files, "U") - symbols(files, "T")
    assert sorted(name for name in outside if not ALLOWED.fullmatch(name)) == []
    assert "memcpy" in outside  # the list is not empty by mistake


@pytest.mark.parametrize("name", FORBIDDEN)
def test_the_check_can_fail(name: str) -> None:
    """No forbidden name passes for an allowed one."""
    assert not ALLOWED.fullmatch(name)


def test_a_planted_new_is_found(tmp_path: Path) -> None:
    """The same look at an object that allocates finds it."""
    source = tmp_path / "planted.cc"
    source.write_text("int* planted() { return new int(1); }\n")
    subprocess.run(["c++", "-c", source, "-o", tmp_path / "planted.o"], check=True)
    assert "_Znwm" in symbols([tmp_path / "planted.o"], "U")


def test_no_mutable_data(build: Path) -> None:
    """The controller and its tables have no global state: nothing in .data or .bss."""
    files = [build / name for name in ARCHIVES] + table_archives(build)
    out = subprocess.run(["nm", *files], capture_output=True, text=True, check=True).stdout
    mutable = re.findall(r"^[0-9a-f]+ ([bBdDC]) (\S+)$", out, re.M)
    # a constant struct that holds pointers lies in .data.rel.ro, which nm shows as "d" or "D": read-only after relocation
    sections = subprocess.run(["objdump", "-t", *files], capture_output=True, text=True, check=True).stdout
    relocated = set(re.findall(r"\.data\.rel\.ro\S*\s+[0-9a-f]+\s+(?:\.hidden )?(\S+)$", sections, re.M))
    assert [name for _, name in mutable if name not in relocated] == []
