"""engram-plant against a stand-in controller: what it promises when all is well, and when it is not."""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
import threading
import time
from pathlib import Path

import lcm
import numpy as np
import pytest
from conftest import ARM, JUMPS, SERIES, Arena

from engram_sim import eventlog
from engram_sim.pair import program

BAD_INPUT, LOG_TRUNCATED, NO_CONTROLLER, DIVERGED, USAGE, STOPPED = 2, 3, 4, 5, 64, 130  # exit codes of engram-plant


def run_log(arena: Arena, name: str, *options: str, controller_options: tuple[str, ...] = ()) -> bytes:
    """The log of one run with a fresh controller."""
    controller = arena.controller(*controller_options)
    log = arena.folder / name
    done = arena.plant("--log", log, *options)
    assert done.returncode == 0, done.stderr
    controller.terminate()
    controller.wait()
    return log.read_bytes()


def test_lock_step_repeats_byte_for_byte(arena: Arena) -> None:
    assert run_log(arena, "a.lcm") == run_log(arena, "b.lcm")


def test_every_jump_succeeds_and_is_recorded(arena: Arena) -> None:
    arena.controller()
    assert arena.plant().returncode == 0
    jumps = arena.results()["jumps"]
    assert [jump["jump"] for jump in jumps] == [1, 2, 3] and [jump["episode"] for jump in jumps] == [1, 1, 2]
    assert all(jump["success"] and jump["reason"] == "ok" for jump in jumps)
    # a jump ends once the hold is over: the plant goes on early
    assert all(jump["t_end_s"] - jump["t_start_s"] == pytest.approx(jump["arrival_s"] + 0.3, abs=0.0011) for jump in jumps)
    # two poses 10 ms apart, 10 ms before the first and 10 ms for the last
    assert jumps[1]["move"]["duration_steps"] == 29 and jumps[1]["move"]["max_error_m"] < 0.02


def test_log_holds_every_message_in_order(arena: Arena) -> None:
    run_log(arena, "run.lcm")
    log = eventlog.read(arena.folder / "run.lcm", list(eventlog.CHANNELS))
    states, commands, tasks = log["ENGRAM_STATE"], log["ENGRAM_COMMAND"], log["ENGRAM_TASK"]
    assert len(states) == len(commands) == arena.results()["steps"]
    assert np.all(np.diff(states["utime"]) == 1000) and np.array_equal(states["utime"], commands["utime"])
    # an episode begins like a plant that restarts: seq 1, and its task comes with the second state
    assert np.flatnonzero(states["seq"] == 1).size == 2
    assert tasks["jump"].tolist() == [1, 2, 2, 2, 3] and tasks["seq"].tolist() == [1, 2, 3, 4, 5]
    restart = states["utime"][states["seq"] == 1][1]
    assert tasks["utime"][-1] == restart + 1000
    stamps = [stamp for stamp, _, _ in eventlog.events(arena.folder / "run.lcm")]
    assert stamps == sorted(stamps)


def test_log_is_read_by_lcm(arena: Arena) -> None:
    run_log(arena, "run.lcm")
    ours = list(eventlog.events(arena.folder / "run.lcm"))
    theirs = [(event.timestamp, event.channel, event.data) for event in lcm.EventLog(str(arena.folder / "run.lcm"), "r")]
    assert ours == theirs and len(ours) > 1000


def test_log_is_played_by_lcm_logplayer(arena: Arena) -> None:
    run_log(arena, "run.lcm", "--log-full", "0.1")
    net, heard = lcm.LCM(arena.url), []
    net.subscribe(".*", lambda channel, data: heard.append((channel, data))).set_queue_capacity(0)  # 0: no bound
    player = subprocess.Popen(["lcm-logplayer", "--speed", "10", "--lcm-url", arena.url, arena.folder / "run.lcm"])
    while net.handle_timeout(500) > 0:
        pass
    assert player.wait() == 0
    written = [(channel, data) for _, channel, data in eventlog.events(arena.folder / "run.lcm")]
    assert [message for message in heard if message[0] in eventlog.CHANNELS] == written and len(written) > 500


def test_thinned_log_keeps_each_nth_state_with_its_cycle_and_the_first_cycle_of_a_jump(arena: Arena) -> None:
    run_log(arena, "run.lcm", "--log-full", "0.1", "--log-every", "20")
    log = eventlog.read(arena.folder / "run.lcm", list(eventlog.CHANNELS))
    states = log["ENGRAM_STATE"]
    later = states[states["utime"] >= 100_000]
    assert np.all((later["seq"] - 1) % 20 == 0) and np.array_equal(states["seq"][:100], np.arange(1, 101))
    assert np.array_equal(log["ENGRAM_COMMAND"]["utime"], states["utime"])
    cycles = log["ENGRAM_CYCLE"]
    assert len(log["ENGRAM_TASK"]) == 5 and np.isin(later["utime"], cycles["utime"]).all()
    extra = cycles[~np.isin(cycles["utime"], states["utime"])]
    assert len(np.unique(cycles["jump"])) == 1 + JUMPS and len(extra) <= JUMPS
    assert np.array_equal(np.unique(extra["jump"]), extra["jump"])


def test_dead_controller_ends_the_run_with_one_message(arena: Arena) -> None:
    done = arena.plant("--give-up", "0.5")
    assert done.returncode == NO_CONTROLLER
    assert done.stderr.count("\n") == 1 and "start engram-controller" in done.stderr


def test_killed_and_restarted_controller_is_taken_back(arena: Arena) -> None:
    first = arena.controller("--die-after-ms", "700")

    def restart() -> None:
        first.wait()
        arena.controller()

    helper = threading.Thread(target=restart)
    helper.start()
    done = arena.plant()
    helper.join()
    assert done.returncode == 0, done.stderr
    assert first.returncode == -9 and arena.results()["resends"] > 0
    assert [jump["success"] for jump in arena.results()["jumps"]] == [True] * JUMPS


def test_garbage_on_every_channel_changes_nothing(arena: Arena) -> None:
    clean = run_log(arena, "clean.lcm")
    stop = threading.Event()
    command, cycle = eventlog.layout("command_t"), eventlog.layout("cycle_t")
    good = next(data for _, channel, data in eventlog.events(arena.folder / "clean.lcm") if channel == "ENGRAM_COMMAND")
    never_sent = np.frombuffer(good, command).copy()
    never_sent["seq"], never_sent["utime"] = 2**40, 2**50
    garbage = [
        b"",
        b"x",
        good[:-1],
        good + b"x",
        b"\0" * command.itemsize,
        good[8:] + good[:8],
        never_sent.tobytes(),
        b"\xff" * cycle.itemsize,
    ]

    def shout() -> None:
        net = lcm.LCM(arena.url)
        while not stop.is_set():
            for data in garbage:
                for channel in ("ENGRAM_COMMAND", "ENGRAM_CYCLE", "ENGRAM_TIMING"):
                    net.publish(channel, data)
            time.sleep(0.002)

    noise = threading.Thread(target=shout)
    noise.start()
    try:
        shouted_at = run_log(arena, "shouted.lcm")
    finally:
        stop.set()
        noise.join()
    assert shouted_at == clean
    assert arena.results()["refused"]["malformed"] > 0


@pytest.mark.parametrize(
    ("kind", "counter", "word"),
    [("1", "not_finite", "not finite"), ("2", "foreign_robot", "another robot")],
    ids=["nan", "foreign"],
)
def test_wrong_commands_are_refused_and_said_once(arena: Arena, kind: str, counter: str, word: str) -> None:
    arena.controller("--misbehave", kind)
    done = arena.plant("--give-up", "0.5")
    assert done.returncode == NO_CONTROLLER
    assert arena.results()["refused"][counter] > 0
    assert done.stderr.count(word) == 1


def test_second_controller_is_noticed(arena: Arena) -> None:
    arena.controller()
    arena.controller()
    done = arena.plant()
    assert done.returncode == 0
    assert arena.results()["refused"]["second_answer"] > 100 and done.stderr.count("stop the second controller") == 1


def test_full_disk_cuts_the_log_not_the_run(arena: Arena) -> None:
    size = 300_000

    def small_disk() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    arena.controller()
    done = arena.plant(preexec_fn=small_disk)
    assert done.returncode == LOG_TRUNCATED
    assert done.stderr.count("run.lcm") == 1 and "File too large" in done.stderr
    results = arena.results()
    assert results["log"]["truncated"] and len(results["jumps"]) == JUMPS
    assert len(list(eventlog.events(arena.folder / "run.lcm"))) > 50  # what fitted is good


def test_device_full_is_told(arena: Arena) -> None:
    arena.controller()
    done = arena.plant("--log", "/dev/full")
    assert done.returncode == LOG_TRUNCATED and "No space left on device" in done.stderr
    done = arena.plant("--results", "/dev/full")
    assert done.returncode == LOG_TRUNCATED and "disk is full" in done.stderr


def test_no_multicast_route_is_told_with_the_mend(arena: Arena) -> None:
    unshare = [shutil.which("unshare"), "-Urn"]
    if unshare[0] is None or subprocess.run([*unshare, "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("this user may not make a network namespace")
    done = subprocess.run([*unshare, *arena.plant_call()], capture_output=True, text=True, timeout=30)
    assert done.returncode == BAD_INPUT
    assert "ip route add 239.255.76.67/32 dev lo" in done.stderr


def replaced(old: str, new: str) -> str:
    assert old in SERIES
    return SERIES.replace(old, new)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", ":1: a series starts with"),
        (replaced("engram_series 1", "engram_series 2"), ":1: a series starts with"),
        (replaced("window 3", "window -3"), ":5: `window` needs"),
        (replaced("window 3", "windwo 3"), ":5: unknown key `windwo`"),
        (replaced("tolerance 0.01 0.1", "tolerance 0.01"), ":7: `tolerance` needs"),
        (replaced("tolerance 0.01 0.1", "tolerance 0.01 nan"), ":7: not a finite number"),
        (replaced("episode 0 -0.785", "episode -0.785"), ":8: `episode` needs nq = 7"),
        (replaced("jump 0.45 -0.10 0.40 1 0 0 0", "jump 0.45 -0.10 0.40 1 1 0 0"), ":9: the quaternion"),
        (replaced("hand hand_tcp", "hand foot"), "no site named 'foot'"),
        ("engram_series 1\njump 0 0 0 0 0 0 1 0\n", ":2: `jump` before the first `episode`"),
        ("engram_series 1\nhand hand_tcp\n", "holds no jump"),
    ],
)
def test_wrong_series_is_told_with_its_line(arena: Arena, text: str, word: str) -> None:
    path = arena.folder / "wrong.txt"
    path.write_text(text)
    done = arena.plant("--series", path)
    assert done.returncode == BAD_INPUT
    assert word in done.stderr and done.stderr.count("\n") == 1


def test_wrong_scene_is_told(arena: Arena) -> None:
    empty, geared = arena.folder / "empty.xml", arena.folder / "geared.xml"
    empty.write_text("<mujoco><worldbody>")
    geared.write_text(ARM.read_text().replace('<motor joint="joint3"/>', '<motor joint="joint3" gear="2"/>'))
    cases = [(Path("/nowhere.xml"), "cannot read"), (empty, "not a valid MJCF"), (geared, "actuator 2")]
    for scene, word in cases:
        done = arena.plant("--scene", scene)
        assert done.returncode == BAD_INPUT
        assert word in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "code", "word"),
    [
        (["--nonsense", "1"], USAGE, "unknown option '--nonsense'"),
        (["--duration"], USAGE, "a value is missing"),
        (["--duration", "long"], USAGE, "not a number"),
        (["--clock", "sundial"], BAD_INPUT, "--clock takes lockstep or wall"),
        (["--engine", "steam"], BAD_INPUT, "--engine takes mujoco or cvode"),
        (["--engine", "cvode"], BAD_INPUT, "simulates one free body on thrusters"),
        (["--scenario", "any.txt"], BAD_INPUT, "give --series or --scenario, not both"),
        (["--scenario", "any.txt", "--series", ""], BAD_INPUT, "a scenario needs a robot with a free base"),
        (["--log", "/nowhere/run.lcm"], BAD_INPUT, "cannot write the log"),
        (["--push", "1,link9,0,0,1,1"], BAD_INPUT, "no body 'link9'"),
        (["--push", "1,link3,0,0,1"], BAD_INPUT, "the form is t,body,fx,fy,fz,duration"),
        (["--lcm-url", "carrier-pigeon://"], BAD_INPUT, "malformed URL"),
    ],
)
def test_wrong_options_are_told(arena: Arena, options: list[str], code: int, word: str) -> None:
    done = arena.plant(*options)
    assert done.returncode == code and word in done.stderr


def test_faults_follow_their_seed(arena: Arena) -> None:
    faults = [
        "--noise-q",
        "0.0005",
        "--noise-v",
        "0.005",
        "--latency",
        "2",
        "--random-push-period",
        "0.3",
        "--random-push-force",
        "20",
    ]
    a = run_log(arena, "a.lcm", *faults, "--seed", "5")
    b = run_log(arena, "b.lcm", *faults, "--seed", "5")
    c = run_log(arena, "c.lcm", *faults, "--seed", "6")
    assert a == b and a != c


def test_noise_has_the_deviation_asked_for(arena: Arena) -> None:
    run_log(arena, "noisy.lcm", "--noise-v", "0.01", "--duration", "0.8", "--series", "")
    v = eventlog.read(arena.folder / "noisy.lcm", ["ENGRAM_STATE"])["ENGRAM_STATE"]["v"][:, :7].astype(float)
    # the arm is held at rest: white noise, sqrt(2) larger in differences of neighbours
    deviation = np.std(np.diff(v, axis=0)) / np.sqrt(2.0)
    assert deviation == pytest.approx(0.01, rel=0.05)  # 5600 draws: the standard error is 1 %


def test_push_pushes(arena: Arena) -> None:
    run_log(arena, "calm.lcm", "--duration", "0.5")
    run_log(arena, "pushed.lcm", "--duration", "0.5", "--push", "0.2,link7,0,40,0,0.1")
    calm, pushed = (
        eventlog.read(arena.folder / name, ["ENGRAM_STATE"])["ENGRAM_STATE"]["v"].astype(float)
        for name in ("calm.lcm", "pushed.lcm")
    )
    assert np.array_equal(calm[:200], pushed[:200])
    assert np.abs(calm[300] - pushed[300]).max() > 0.1


def test_latency_holds_against_gravity_first(arena: Arena) -> None:
    """With the arm at rest and commands that come 40 ms late, the plant holds it meanwhile."""
    run_log(arena, "late.lcm", "--latency", "40", "--duration", "0.04", "--series", "")
    v = eventlog.read(arena.folder / "late.lcm", ["ENGRAM_STATE"])["ENGRAM_STATE"]["v"].astype(float)
    assert np.abs(v).max() < 1e-9  # exact but for rounding: tau = bias cancels it


def test_wall_clock_waits_for_a_controller_and_brakes_when_it_dies(arena: Arena) -> None:
    done = arena.plant("--clock", "wall", "--give-up", "0.3")
    assert done.returncode == NO_CONTROLLER and done.stderr.count("\n") == 1
    arena.controller("--die-after-ms", "300")
    start = time.monotonic()
    done = arena.plant("--clock", "wall", "--duration", "1.5", "--stale-ms", "100")
    assert done.returncode == 0 and time.monotonic() - start > 1.5
    assert arena.results()["stale_steps"] > 900 and done.stderr.count("braked") == 1
    v = eventlog.read(arena.folder / "run.lcm", ["ENGRAM_STATE"])["ENGRAM_STATE"]["v"].astype(float)
    assert np.isfinite(v).all() and np.abs(v[-1]).max() < 5.0  # sinks, damped, and does not whirl


def test_divergence_is_told(arena: Arena) -> None:
    unlimited = arena.folder / "unlimited.xml"
    unlimited.write_text(ARM.read_text().replace('<motor ctrllimited="true" ctrlrange="-87 87"/>', ""))
    arena.controller("--misbehave", "3")
    done = arena.plant("--scene", unlimited)
    assert done.returncode == DIVERGED and "the simulation diverged at t = 0.0" in done.stderr


def test_stopped_by_a_signal_it_leaves_whole_files(arena: Arena) -> None:
    arena.controller()
    plant = subprocess.Popen(arena.plant_call("--clock", "wall", "--stale-ms", "500"))
    time.sleep(1.0)
    plant.terminate()
    assert plant.wait(10) == STOPPED
    steps = arena.results()["steps"]
    assert steps > 100
    assert len(eventlog.read(arena.folder / "run.lcm", ["ENGRAM_STATE"])["ENGRAM_STATE"]) == steps


def test_wall_clock_follows_a_controller(arena: Arena) -> None:
    arena.controller()
    done = arena.plant("--clock", "wall", "--stale-ms", "500")  # a shared machine does not keep 1 kHz
    assert done.returncode == 0
    assert [jump["success"] for jump in arena.results()["jumps"]] == [True] * JUMPS


def test_help_names_every_option(arena: Arena) -> None:
    for name in ("engram-plant", "engram-render"):
        done = subprocess.run([program(name), "--help"], capture_output=True, text=True, check=True)
        assert "--scene" in done.stdout and len(done.stdout.splitlines()) > 10


def test_results_are_json_even_without_a_series(arena: Arena) -> None:
    arena.controller()
    call = [
        program("engram-plant"),
        "--scene",
        ARM,
        "--lcm-url",
        arena.url,
        "--duration",
        "0.1",
        "--results",
        arena.folder / "r.json",
    ]
    assert subprocess.run(call, timeout=30).returncode == 0
    results = json.loads((arena.folder / "r.json").read_text())
    assert results["jumps"] == [] and results["steps"] > 90
