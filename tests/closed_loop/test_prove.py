"""`engram prove`: what it counts as a fall, a step, a drift, and that it says so."""

from __future__ import annotations

import json

import numpy as np
import pytest

from engram.inputs import InputError
from engram.prove import anymal, talos, walk
from engram.prove.report import Report
from engram.prove.trial import COLUMNS, Series, Trial, more_periods, run_trial


def series(trial: Trial, n: int, **columns: np.ndarray) -> Series:
    """A run of n periods upright and still, but for what is given."""
    found = {name: np.zeros((n, width) if width > 1 else n) for name, width in COLUMNS}
    found["time"] = 0.01 * np.arange(n)
    found["up"] = np.ones(n)
    return Series(trial, found | columns)


def test_what_counts_as_standing() -> None:
    trial = Trial("talos_stand", 3.0)
    assert series(trial, 300).stays
    assert not series(trial, 250).stands  # cut short: fallen
    assert not series(trial, 300, up=np.linspace(1.0, 0.5, 300)).stands
    assert not series(trial, 300, cost=np.full(300, np.nan)).stands
    stepped = series(trial, 300, slip=np.full(300, 0.021))
    assert stepped.stands and not stepped.stays


def test_drift_error_and_velocity_of_known_motions() -> None:
    time = 0.01 * np.arange(600)
    com = np.zeros((600, 3))
    com[:, 0] = np.where(time > 2.5, 1e-3 * (time - 2.5), 0.0)
    assert talos.drift(series(Trial("talos_stand", 6.0), 600, com=com)) == pytest.approx(3.49e-3, abs=1e-5)
    com[:, 2] = 0.9 - 0.1 * (1.0 - np.cos(np.pi * np.maximum(0.0, time - 0.11)))
    assert talos.squat_error(series(Trial("talos_stand", 6.0), 600, com=com)) < 1e-12
    com[:, :2] = 0.3 * time[:, None] * [0.0, 1.0]  # along +y, which is forward at 90 degrees
    assert anymal.velocity(series(Trial("anymal_trot", 6.0, 90.0), 600, com=com)) == pytest.approx([0.3, 0.0], abs=1e-12)


def test_landings_tracking_and_falls_of_a_known_walk(capsys) -> None:
    """The left foot swings twice; it lands 3 mm and 4 mm from where it was to."""
    trial = Trial("talos_walk", 6.0)
    swing, foot, foothold, com = np.zeros(600), np.zeros((600, 16)), np.zeros((600, 16)), np.zeros((600, 3))
    for first, error in ((100, 3e-3), (200, 4e-3)):
        swing[first : first + 50] = 1
        foothold[first : first + 50, 0] = 1.0
        foot[first + 50 : first + 70, 0] = 1.0 + error
    com[:, 1] = 5e-3
    run = series(trial, 600, swing=swing, foot=foot, foothold=foothold, com=com)
    assert walk.landings(run) == pytest.approx([3e-3, 4e-3])
    assert walk.com_error(run) == pytest.approx(5e-3)
    assert not walk.falls(run)
    fallen = series(trial, 400, up=np.linspace(1.0, 0.7, 400))
    assert walk.falls(fallen)
    assert walk.falls(series(trial, 600, com_velocity=np.full((600, 3), 0.1)))  # walks on
    timed = np.full(600, 900.0)
    report = Report("talos.walk")
    walk.judge(report, walk.CASES[0], [series(trial, 600, swing=swing, foot=foot, foothold=foothold, total_us=timed), fallen])
    figures = {name.removeprefix("prove.talos.walk.free."): value for name, value, _, _ in report.figures}
    assert (figures["falls"], figures["steps"]) == (1, 2)
    assert figures["landing.max"] == pytest.approx(4.0)
    assert report.failed == 2  # one fell, and the other has made two steps
    assert "1 of  2" in capsys.readouterr().out


def test_a_push_too_strong_is_seen(build) -> None:
    fallen = run_trial(talos.pushed(90.0, (1.0, 0.0), 60.0))  # twice the capture-point limit
    assert not fallen.stands
    assert fallen["torque"].max() <= 1.0


def test_wrong_arguments_are_named(build) -> None:
    with pytest.raises(InputError, match="task refused: bad task"):
        run_trial(Trial("talos_stand", 1.0, 0.0, ((0.1, (-2.0, 0.0, 0.0)),)))
    with pytest.raises(InputError, match="usage"):
        run_trial(Trial("talos_fly", 1.0))


@pytest.mark.parametrize("errand", [talos.errand, anymal.errand])
def test_periods_to_time_are_of_different_runs(errand) -> None:
    draw, other = np.random.default_rng(3), np.random.default_rng(3)
    trials = [errand(draw) for _ in range(20)]
    assert len(set(trials)) == 20 and trials == [errand(other) for _ in range(20)]
    assert all(len(trial.tasks) > 3 and max(at for at, _ in trial.tasks) < trial.seconds for trial in trials)
    assert sum(len(trial.pushes) for trial in trials) > 20


def test_no_more_runs_than_periods_are_missing(monkeypatch) -> None:
    monkeypatch.setattr("engram.prove.trial.run_trials", lambda trials, jobs, title: trials)
    draw = np.random.default_rng(3)
    have = [series(Trial("anymal_trot", 3.0), 300)]
    assert len(more_periods(12300, have, lambda: anymal.errand(draw), 1)) == 2
    assert more_periods(300, have, lambda: anymal.errand(draw), 1) == []


def test_a_report_says_what_misses(capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("engram.learn.figures.BUILD", tmp_path)
    report = Report("talos")
    report.add("good", 1.0, "m", 3, "< 2", True)
    report.add("bad", 3.0, "m", 3, "< 2", False)
    report.write()
    assert report.failed == 1
    assert "FAILS: < 2" in capsys.readouterr().out
    records = json.loads((tmp_path / "figures" / "prove_talos.json").read_text())
    assert [record["id"] for record in records] == ["prove.talos.good", "prove.talos.bad"]
