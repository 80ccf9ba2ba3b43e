"""Builds and runs every test, rung by rung, and closes with one line: `N passed, N failed`.

The ladder: reference, golden, closed_loop, hil, unit, fuzz (C++ by ctest, Python by pytest). Unit and fuzz run in the
background, beside the other rungs: their C++ tests are compiled first, with AddressSanitizer and UndefinedBehaviorSanitizer. A
rung with fewer tests than tests/floor.txt says fails: tests must not vanish.

    scripts/test.py                    everything
    scripts/test.py unit golden        some rungs
    scripts/test.py --raise-floor      everything, then write the present counts to tests/floor.txt
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from concurrent.futures import ThreadPoolExecutor
from dataclasses import astuple, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
REPORTS = BUILD / "reports"
FLOOR = ROOT / "tests" / "floor.txt"
RUNGS = ("reference", "golden", "closed_loop", "hil", "unit", "fuzz")
BACKGROUND = ("unit", "fuzz")  # their programs are in build/asan/
TIMEOUT_S = 300  # of one test program: a hang fails, the ladder goes on


@dataclass
class Count:
    """Outcome of tests."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    seconds: float = 0.0

    def __add__(self, other: Count) -> Count:
        return Count(*(mine + theirs for mine, theirs in zip(astuple(self), astuple(other), strict=True)))

    @property
    def ran(self) -> int:
        """Tests that gave a verdict."""
        return self.passed + self.failed

    def add_junit(self, path: Path) -> None:
        """Adds the test cases of a JUnit file (GoogleTest or pytest)."""
        for case in ElementTree.parse(path).getroot().iter("testcase"):
            if case.find("failure") is not None or case.find("error") is not None:
                self.failed += 1
            elif case.find("skipped") is not None or case.get("status") == "notrun":
                self.skipped += 1
            else:
                self.passed += 1


def run_ctest(rung: str) -> Count:
    """Runs the GoogleTest programs of tests/<rung>/; a program that dies without a report is one failure."""
    start, count = time.monotonic(), Count()
    reports = REPORTS / rung
    summary = reports / "ctest.xml"
    background = rung in BACKGROUND
    build = BUILD / "asan" if background else BUILD
    front = ["nice"] if background else []
    jobs = os.cpu_count() or 1 if background else 1  # others are several processes that wait for one another
    env = os.environ | {"GTEST_OUTPUT": f"xml:{reports}/gtest/", "UBSAN_OPTIONS": "print_stacktrace=1"}
    subprocess.run(
        [*front, "ctest", "--test-dir", build, "-L", f"^{rung}$", "-j", str(jobs), "--timeout", str(TIMEOUT_S),
         "--output-on-failure", "--no-tests=ignore", "--quiet", "--output-junit", summary],
        env=env, check=False, stdin=subprocess.DEVNULL)  # fmt: skip
    for file in sorted((reports / "gtest").glob("*.xml")):
        count.add_junit(file)
    programs = list(ElementTree.parse(summary).getroot().iter("testcase")) if summary.exists() else []
    for program in programs:
        name = program.get("name")
        if program.get("status") == "fail":
            print(f"failed: {name}\n{program.findtext('system-out') or ''}"[-6000:], flush=True)
        report = reports / "gtest" / f"{name}.xml"
        reported_failure = report.exists() and int(ElementTree.parse(report).getroot().get("failures", "0")) > 0
        if program.get("status") == "fail" and not reported_failure:
            count.failed += 1
        elif program.get("status") != "fail" and not report.exists():
            count.passed += 1
    count.seconds = time.monotonic() - start
    return count


def run_pytest(rung: str) -> Count:
    """Runs tests/<rung>/test_*.py, if there are any; a run that ends without a report is one failure."""
    start, count = time.monotonic(), Count()
    folder = ROOT / "tests" / rung
    if not any(folder.glob("**/test_*.py")):
        return count
    report = REPORTS / rung / "pytest.xml"
    front, said = (["nice"], subprocess.PIPE) if rung in BACKGROUND else ([], None)
    command = [*front, sys.executable, "-m", "pytest", "-q", "--tb=short", "--no-header", f"--junitxml={report}", folder]
    run = subprocess.run(command, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=said, text=True, check=False)
    if run.returncode and said:
        print(run.stdout, end="", flush=True)
    if report.exists():
        count.add_junit(report)
    if run.returncode not in (0, 5) and not count.failed:
        count.failed = 1
    count.seconds = time.monotonic() - start
    return count


def run_sanitized(rungs: list[str]) -> dict[str, Count]:
    """Compiles the programs of the rungs in the background, and runs them; a build that stops is one failure of each rung."""
    command, pipe = ["nice", ROOT / "scripts" / "setup.sh", "sanitized"], subprocess.PIPE
    build = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=pipe, stderr=subprocess.STDOUT, text=True, check=False)
    if build.returncode:
        print(build.stdout, flush=True)
        return {rung: Count(failed=1) for rung in rungs}
    return {rung: run_ctest(rung) for rung in rungs}


def read_floor() -> dict[str, int]:
    """Smallest number of tests of each rung."""
    lines = (line.split("#")[0].split() for line in FLOOR.read_text().splitlines())
    return {fields[0]: int(fields[1]) for fields in lines if fields}


def write_floor(counts: dict[str, Count]) -> None:
    """Keeps the present number of tests as the new floor."""
    rows = "".join(f"{rung} {count.ran}\n" for rung, count in counts.items())
    FLOOR.write_text("# Smallest number of tests on each rung; `scripts/test.py --raise-floor` writes it.\n" + rows)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rungs", nargs="*", metavar="rung", help=f"any of: {' '.join(RUNGS)}")
    parser.add_argument("--raise-floor", action="store_true", help="write the counts of this run to tests/floor.txt")
    args = parser.parse_args()
    rungs = args.rungs or list(RUNGS)
    if unknown := [rung for rung in rungs if rung not in RUNGS]:
        parser.error(f"no rung {unknown[0]}; rungs: {' '.join(RUNGS)}")

    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it; tests send it
    for rung in rungs:
        shutil.rmtree(REPORTS / rung, ignore_errors=True)
        (REPORTS / rung).mkdir(parents=True)
    counts = {}
    behind = [rung for rung in rungs if rung in BACKGROUND]
    with ThreadPoolExecutor() as pool:
        sanitized = pool.submit(run_sanitized, behind) if behind else None
        python = {rung: pool.submit(run_pytest, rung) for rung in behind}
        for rung in rungs:
            print(f"---- {rung} ----", flush=True)
            if rung in BACKGROUND:
                counts[rung] = sanitized.result()[rung] + python[rung].result()
            else:
                counts[rung] = run_ctest(rung) + run_pytest(rung)

    floor = read_floor()
    print(f"\n{'rung':<12}{'passed':>8}{'failed':>8}{'skipped':>8}{'floor':>8}{'seconds':>9}")
    vanished = 0
    for rung, count in counts.items():
        print(f"{rung:<12}{count.passed:>8}{count.failed:>8}{count.skipped:>8}{floor.get(rung, 0):>8}{count.seconds:>9.1f}")
        if count.ran < floor.get(rung, 0) and not args.raise_floor:
            print(f"  {rung}: {count.ran} tests ran, the floor is {floor[rung]}: tests must not vanish")
            vanished += 1
    passed = sum(count.passed for count in counts.values())
    failed = sum(count.failed for count in counts.values()) + vanished
    if args.raise_floor and not failed:
        write_floor(counts)
    print(f"\n{passed} passed, {failed} failed")
    return 1 if failed or not passed else 0


if __name__ == "__main__":
    sys.exit(main())
