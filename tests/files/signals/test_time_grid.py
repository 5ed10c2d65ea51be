"""Even time grids: which are accepted, which rate printed stamps stand for; what else a recording refuses."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from observer_rt.files.signals.recording import Recording, TimeGrid, UnevenTime
from observer_rt.foundation.errors import UserError
from tests.plants.arrays import Array

IN_PARTS = pytest.mark.parametrize("at_once", [1 << 30, 4096])


def taken(time: Array, at_once: int = 1 << 30) -> tuple[TimeGrid, UnevenTime | None]:
    """The grid of a time column given in parts, and where it is uneven."""
    grid = TimeGrid()
    for first in range(0, time.size, at_once):
        if (uneven := grid.take(time[first : first + at_once])) is not None:
            return grid, uneven
    return grid, grid.end()


def uneven(time: Array, at_once: int = 1 << 30) -> UnevenTime:
    result = taken(time, at_once)[1]
    assert result is not None
    return result


def rate_of(time: Array) -> float:
    return taken(time)[0].sample_rate


def printed(rate: float, samples: int, decimals: int, start: float = 0.0) -> Array:
    return np.round(start + np.arange(samples) / rate, decimals)


@IN_PARTS
@pytest.mark.parametrize("rate", [1e3, 8e3, 20e3, 30e3, 44.1e3, 48e3, 50e3, 96e3, 100e3, 48828.125])
@pytest.mark.parametrize("decimals", [6, 7, 9, 15])
def test_rate_is_exact_behind_rounded_stamps(rate: float, decimals: int, at_once: int) -> None:
    grid, wrong = taken(printed(rate, 100_000, decimals, start=12.5), at_once)
    assert wrong is None
    assert grid.sample_rate == rate


def test_rate_or_period_is_the_roundest_that_fits() -> None:
    assert rate_of(np.arange(1000, dtype=np.float64) * 3e-6) == 1 / 3e-6
    assert rate_of(np.array([0.0, 33e-6, 67e-6, 100e-6])) == 30e3


@given(rate=st.floats(1e3, 1e6), start=st.floats(-1e3, 1e3), samples=st.integers(2, 500))
def test_unrounded_stamps_give_their_rate(rate: float, start: float, samples: int) -> None:
    time: Array = start + np.arange(samples, dtype=np.float64) / rate
    resolution = np.spacing(np.abs(time).max())
    assert rate_of(time) == pytest.approx(rate, rel=20 * resolution / (time[-1] - time[0]) + 1e-14)


@given(row=st.integers(1, 98), jump=st.integers(1, 1000) | st.floats(-1e6, -2.0), at_once=st.sampled_from((5, 100)))
@example(row=99, jump=-2.0, at_once=100)
@example(row=40, jump=-1.0, at_once=100)
def test_a_gap_or_a_step_back_is_found_where_it_is(row: int, jump: float, at_once: int) -> None:
    stamps = np.arange(100.0)
    stamps[row:] += jump
    result = uneven(stamps / 1e5, at_once)
    assert result.row == row
    assert ("gap" if jump > 0.0 else "steps back" if jump < -1.0 else "repeats") in result.problem


@IN_PARTS
def test_a_clock_that_changes_its_pace_slowly_is_found(at_once: int) -> None:
    result = uneven(np.cumsum(np.where(np.arange(10_000) < 5_000, 1.0e-5, 1.001e-5)), at_once)
    assert "samples off an even grid" in result.problem
    assert result.row == pytest.approx(5_000, abs=1024)


@IN_PARTS
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_stamp_that_is_no_number_is_found(bad: float, at_once: int) -> None:
    time = np.arange(10_000) / 1e5
    time[7007] = bad
    assert uneven(time, at_once).row == 7007


EVEN = np.arange(100) / 20e3
INFINITE = np.where(np.arange(100) == 5, np.inf, 1.0)


@pytest.mark.parametrize(
    ("time", "lift", "line", "said"),
    [
        (EVEN, np.ones(99), np.ones(100), "x.mf4, needle_lift: 99 samples, but the time has 100"),
        (EVEN, np.ones(100), INFINITE, "x.mf4, sample 5: line_pressure is infinite"),
        (EVEN + (np.arange(100) >= 50), np.ones(100), np.ones(100), "x.mf4, sample 50: gap in time"),
    ],
)
def test_what_a_recording_refuses(time: Array, lift: Array, line: Array, said: str) -> None:
    with pytest.raises(UserError, match=said):
        Recording(time, np.ones(100), lift, line, path=Path("x.mf4"))
