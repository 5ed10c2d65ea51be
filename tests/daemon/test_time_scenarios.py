"""Skew, drift, jitter, loss, reordering, restarts: valid results are right, and faults are reported."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.mapping.timing import LINE_SLOPE
from observer_rt.engine.stream.state import State
from tests.daemon import time_scenarios
from tests.daemon.time_frames import Clock, Outcome, merged, observe, send, write_time_bench

# An injection counts as wrong from 3 % of mass or 3 mm3/ms on; the scenarios allow less.


@pytest.mark.slow
@pytest.mark.parametrize("scenario", time_scenarios.SCENARIOS, ids=lambda scenario: scenario.name)
def test_nothing_wrong_is_marked_valid(scenario: time_scenarios.Scenario, tmp_path: Path) -> None:
    outcome = time_scenarios.run(scenario, tmp_path)
    figures = time_scenarios.Figures.of(outcome)
    assert figures.volume_error < scenario.volume_error
    assert figures.rmse < scenario.rmse
    assert figures.sample_error < scenario.sample_error
    assert outcome.core.state == scenario.last
    shown = outcome.states(time_scenarios.DISTURBED - 0.01, np.inf)
    assert shown <= scenario.shown | {time_scenarios.GOOD} | time_scenarios.NOT_SHARP
    if scenario.last in (time_scenarios.GOOD, time_scenarios.LEARNED):
        assert outcome.valid[-1]
        assert figures.valid >= 3
    elif scenario.last in (time_scenarios.TIME_BASE, time_scenarios.INADEQUATE):
        assert not outcome.valid[outcome.times > time_scenarios.DISTURBED + 0.1].any()
    else:
        assert scenario.last == time_scenarios.STALE
        assert outcome.times[-1] < time_scenarios.DISTURBED + 0.01  # nothing is published of what is not known


def from_two(folder: Path, signals: dict[str, str], other: Clock) -> Outcome:
    """Of line pressure by the clock of the grid, rail pressure and lift by another."""
    frames = merged(send("Line", time_scenarios.GRID), send("RailLift", other))
    return observe(write_time_bench(folder, time_scenarios.RATE, signals), frames, time_scenarios.GRID)


def test_skew_that_nobody_tells_of_is_seen_in_the_error(tmp_path: Path) -> None:
    """So that the above can fail: three samples between two devices that share an index spoil the rates."""
    injections = from_two(tmp_path, time_scenarios.ONE_BASE, Clock(time_scenarios.RATE, 150e-6)).injections()
    assert max(injection.rmse for injection in injections) > 2 * time_scenarios.SCENARIOS[0].rmse


@pytest.fixture(scope="module")
def two_bases(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    return from_two(tmp_path_factory.mktemp("two"), time_scenarios.TWO_BASES, time_scenarios.OTHER)


def test_times_are_told(two_bases: Outcome) -> None:
    line, other = sorted(two_bases.core.timing, key=lambda timing: timing.name)
    assert (line.name, other.name) == ("Line", "RailLift")
    assert other.drift - line.drift == pytest.approx(50e-6, abs=1e-6)
    assert other.jitter.greatest < 20e-6
    assert line.unknown == 0.0
    assert 0.0 <= other.unknown < 2e-6
    assert pytest.approx(0.125e12) == LINE_SLOPE
    assert "ppm" in other.as_text()


def test_first_second_of_two_bases_is_not_valid(two_bases: Outcome) -> None:
    assert not two_bases.valid[two_bases.times < 0.8].any()
    assert {state for state, _ in two_bases.states(0.0, 0.75)} <= {State.STARTING, State.DEGRADED}
