"""Rows of the table of faults: nothing wrong is valid, causes are true, the third event after is valid."""

from pathlib import Path

import pytest

from tools.benchmarks.faults.command import is_faulty, score_scenario
from tools.benchmarks.faults.daemons import Strike, strike
from tools.benchmarks.faults.live import run_live
from tools.benchmarks.faults.scenario import Task
from tools.benchmarks.faults.score import Verdict

QUICK = ["frozen_line 0", "unit_line 0.1", "killed_and_restarted 0", "wrong_crc 0"]
SLOW = [
    "learner_failing 0",
    "swapped_pressures 0",
    "drift_lift 30",
    "unavailable_rail 0",
    "step_line 4 + device_restart 0 + clipped_rail 80",
]


@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_a_fault_that_comes_and_goes(name: str) -> None:
    row = score_scenario(Task(name, 3, 0))
    assert not is_faulty(row), row
    assert row["in_time"]


@pytest.mark.slow
def test_a_lift_that_floats_is_found_within_a_tenth_of_a_millisecond() -> None:
    """Samples may be wrong before it shows, at 100 kHz: no injection is."""
    row = score_scenario(Task("floating_lift 30", 3, 0))
    assert row["wrong_samples"] <= 10
    assert (row["wrong_summaries"], row["crash"]) == (0, "")
    assert row["in_time"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hum_50_hz_line 0.2", "held_line 0.2", "late_lift 10 stated", "noise 3"])
def test_what_is_small_and_always_there(name: str) -> None:
    assert score_scenario(Task(name, 1, 0))["verdict"] is Verdict.RIGHT


@pytest.mark.slow
@pytest.mark.parametrize("how", Strike)
def test_what_was_due_is_on_disk_after(how: Strike, tmp_path: Path) -> None:
    row = strike(how, tmp_path / "struck", 1)
    assert (row["lost"], row["what"]) == (0, [])
    assert row["said"] > 0


@pytest.mark.slow
@pytest.mark.vcan
def test_faults_of_a_daemon_on_a_bus(tmp_path: Path) -> None:
    assert [row for row in run_live(4, 3, tmp_path) if row["is_wrong"] or row["crash"]] == []
