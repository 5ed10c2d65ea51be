"""Skew, drift, jitter, loss, reordering, restarts: valid results are right, and faults are reported."""

from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.alignment import LINE_SLOPE
from observer_rt.engine.stream.state import State
from tests.daemon.time_frames import Clock, Outcome, merged, observe, send, write_time_bench
from tests.daemon.time_scenarios import (
    DISTURBED,
    GOOD,
    GRID,
    INADEQUATE,
    LEARNED,
    NOT_SHARP,
    ONE_BASE,
    OTHER,
    RATE,
    SCENARIOS,
    STALE,
    TIME_BASE,
    TWO_BASES,
    Figures,
    Scenario,
    run,
)

# An injection counts as wrong from 3 % of mass or 3 mm3/ms on; the scenarios allow less.


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda scenario: scenario.name)
def test_nothing_wrong_is_marked_valid(scenario: Scenario, tmp_path: Path) -> None:
    outcome = run(scenario, tmp_path)
    figures = Figures.of(outcome)
    assert figures.volume_error < scenario.volume_error
    assert figures.rmse < scenario.rmse
    assert figures.sample_error < scenario.sample_error
    assert outcome.core.state == scenario.last
    shown = outcome.states(DISTURBED - 0.01, np.inf)
    assert shown <= scenario.shown | {GOOD} | NOT_SHARP
    if scenario.last in (GOOD, LEARNED):
        assert outcome.valid[-1]
        assert figures.valid >= 3
    elif scenario.last in (TIME_BASE, INADEQUATE):
        assert not outcome.valid[outcome.times > DISTURBED + 0.1].any()
    else:
        assert scenario.last == STALE
        assert outcome.times[-1] < DISTURBED + 0.01  # nothing is published of what is not known


def from_two(folder: Path, signals: dict[str, str], other: Clock) -> Outcome:
    """Of line pressure by the clock of the grid, rail pressure and lift by another."""
    frames = merged(send("Line", GRID), send("RailLift", other))
    return observe(write_time_bench(folder, RATE, signals), frames, GRID)


def test_skew_that_nobody_tells_of_is_seen_in_the_error(tmp_path: Path) -> None:
    """So that the above can fail: three samples between two devices that share an index spoil the rates."""
    late = Clock(RATE, 150e-6)
    injections = from_two(tmp_path, ONE_BASE, late).injections()
    assert max(injection.rmse for injection in injections) > 2 * SCENARIOS[0].rmse


@pytest.fixture(scope="module")
def two_bases(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    return from_two(tmp_path_factory.mktemp("two"), TWO_BASES, OTHER)


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
