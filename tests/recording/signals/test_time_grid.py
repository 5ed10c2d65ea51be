"""Even time grids: which are accepted, and which rate printed stamps stand for."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.recording.signals.recording import find_uneven_time, sample_rate_of


def printed(rate: float, samples: int, decimals: int, start: float = 0.0) -> NDArray[np.float64]:
    return np.round(start + np.arange(samples) / rate, decimals)


@pytest.mark.parametrize("rate", [1e3, 8e3, 20e3, 30e3, 44.1e3, 48e3, 50e3, 96e3, 100e3, 48828.125])
@pytest.mark.parametrize("decimals", [6, 7, 9, 15])
def test_rate_is_exact_behind_rounded_stamps(rate: float, decimals: int) -> None:
    time = printed(rate, 100_000, decimals, start=12.5)
    assert find_uneven_time(time) is None
    assert sample_rate_of(time) == rate


def test_rate_of_a_round_period_is_its_inverse() -> None:
    assert sample_rate_of(np.arange(1000, dtype=np.float64) * 3e-6) == 1 / 3e-6


def test_rate_of_few_coarse_stamps_is_the_roundest_that_fits() -> None:
    assert sample_rate_of(np.array([0.0, 33e-6, 67e-6, 100e-6])) == 30e3


@given(rate=st.floats(1e3, 1e6), start=st.floats(-1e3, 1e3), samples=st.integers(2, 500))
def test_unrounded_stamps_give_their_rate(rate: float, start: float, samples: int) -> None:
    time: NDArray[np.float64] = start + np.arange(samples, dtype=np.float64) / rate
    resolution = np.spacing(np.abs(time).max())
    assert sample_rate_of(time) == pytest.approx(rate, rel=20 * resolution / (time[-1] - time[0]) + 1e-14)


@given(row=st.integers(1, 98), lost=st.integers(1, 1000))
def test_a_gap_is_found_where_it_is(row: int, lost: int) -> None:
    time = np.arange(100) / 1e5
    time[row:] += lost / 1e5
    found = find_uneven_time(time)
    assert found is not None
    assert found.row == row
    assert "gap" in found.problem


@given(row=st.integers(1, 99), back=st.floats(2e-5, 10.0))
def test_a_step_back_is_found_where_it_is(row: int, back: float) -> None:
    time = np.arange(100) / 1e5
    time[row:] -= back
    found = find_uneven_time(time)
    assert found is not None
    assert found.row == row
    assert "steps back" in found.problem


def test_a_repeated_stamp_is_found() -> None:
    time = np.arange(100) / 1e5
    time[40] = time[39]
    found = find_uneven_time(time)
    assert found is not None
    assert (found.row, "repeats" in found.problem) == (40, True)


def test_a_clock_that_changes_its_pace_slowly_is_found() -> None:
    time = np.cumsum(np.where(np.arange(10_000) < 5_000, 1.0e-5, 1.001e-5))
    found = find_uneven_time(time)
    assert found is not None
    assert "samples off an even grid" in found.problem


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_stamp_that_is_no_number_is_found(bad: float) -> None:
    time = np.arange(10) / 1e5
    time[7] = bad
    found = find_uneven_time(time)
    assert found is not None
    assert found.row == 7


def test_one_sample_is_no_grid() -> None:
    assert find_uneven_time(np.array([0.0])) is not None
