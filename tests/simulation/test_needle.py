"""Needle strokes against delays, speeds and stop in closed form."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.foundation.errors import UserError
from observer_rt.simulation.schedule import (
    CORNER_ROUNDING,
    Shot,
    Stroke,
    lift_of_stroke,
    make_schedule,
    stroke,
    strokes,
)

NOMINAL = load_injector()
START = 0.15


def placed(duration: float, rail_pressure: float = 100e6, offset: float = 0.0) -> Stroke:
    found = stroke(Shot(duration, offset), START, rail_pressure, NOMINAL)
    assert found is not None
    return found


def lift(times: NDArray[np.float64], s: Stroke) -> NDArray[np.float64]:
    return np.array([lift_of_stroke(time, s) for time in times])


@pytest.mark.parametrize("rail_pressure", [40e6, 100e6, 160e6])
def test_full_stroke_keeps_delays_and_speeds(rail_pressure: float) -> None:
    s = placed(1.9e-3, rail_pressure, offset=-1e-3)
    energized = START - 1e-3
    rise = 0.3e-3 / (0.80 * (rail_pressure / 100e6) ** 0.4)
    fall = 0.3e-3 / (0.90 * (rail_pressure / 100e6) ** 0.3)
    assert s.opening == pytest.approx(energized + 0.32e-3, abs=1e-12)
    assert s.top - s.opening == pytest.approx(rise, rel=1e-9)
    assert s.closing == pytest.approx(energized + 1.9e-3 + 0.27e-3, abs=1e-12)
    assert s.closed - s.closing == pytest.approx(fall, rel=1e-9)


def test_plateau_is_the_stop() -> None:
    s = placed(1.9e-3)
    plateau = np.linspace(s.top + CORNER_ROUNDING / 2, s.closing - CORNER_ROUNDING / 2, 50)
    np.testing.assert_allclose(lift(plateau, s), 0.3e-3, rtol=1e-9)


def test_ballistic_stroke_turns_before_the_stop() -> None:
    s = placed(0.25e-3)
    rise = 0.25e-3 + 0.27e-3 - 0.32e-3
    assert s.top == s.closing
    assert s.peak_lift == pytest.approx(0.8 * rise, rel=1e-6)
    assert s.peak_lift < 0.3e-3
    assert s.closed - s.opening == pytest.approx(rise + 0.8 * rise / 0.9, rel=1e-6)
    highest = lift(np.linspace(s.opening, s.closed, 2001), s).max()
    assert 0.9 * s.peak_lift < highest < s.peak_lift  # rounded


@pytest.mark.parametrize("duration", [0.01e-3, 0.049e-3])
def test_energizing_shorter_than_the_delays_allow_lifts_nothing(duration: float) -> None:
    assert stroke(Shot(duration), START, 100e6, NOMINAL) is None


@given(duration=st.floats(0.06e-3, 3e-3), rail_pressure=st.floats(20e6, 200e6), share=st.floats(-0.1, 1.1))
def test_rounded_lift_is_the_mean_of_the_straight_one(
    duration: float, rail_pressure: float, share: float
) -> None:
    s = placed(duration, rail_pressure)
    time = s.opening + share * (s.closed - s.opening)
    window = time + CORNER_ROUNDING * (np.arange(2000) + 0.5 - 1000) / 2000
    straight = np.interp(
        window, [s.opening, s.top, s.closing, s.closed], [0.0, s.peak_lift, s.peak_lift, 0.0]
    )
    assert lift_of_stroke(time, s) == pytest.approx(straight.mean(), abs=1e-11)


@pytest.mark.parametrize("duration", [0.2e-3, 0.6e-3, 1.9e-3])
def test_rounding_keeps_the_area_and_the_speeds(duration: float) -> None:
    s = placed(duration)
    times = np.linspace(s.opening - 1e-4, s.closed + 1e-4, 40_001)
    values = lift(times, s)
    straight = s.peak_lift * ((s.closing - s.top) + (s.top - s.opening) / 2 + (s.closed - s.closing) / 2)
    assert np.trapezoid(values, times) == pytest.approx(straight, rel=1e-6)
    speeds = np.diff(values) / np.diff(times)
    assert speeds.max() == pytest.approx(0.8, rel=1e-3)
    assert speeds.min() == pytest.approx(-0.9, rel=1e-3)


def test_lift_is_exactly_zero_outside_the_stroke() -> None:
    s = placed(1.0e-3)
    outside = np.array([0.0, s.opening - CORNER_ROUNDING / 2, s.closed + CORNER_ROUNDING / 2, 10.0])
    assert not lift(outside, s).any()


def test_strokes_are_in_order() -> None:
    schedule = make_schedule([60e6, 140e6], 4, 0.02, shots=[Shot(1e-3), Shot(0.3e-3, -2e-3)])
    found = strokes(schedule, NOMINAL)
    assert len(found) == 8
    assert all(a.closed < b.opening for a, b in pairwise(found))


def test_needle_that_has_no_time_to_close_between_shots() -> None:
    schedule = make_schedule([100e6], 1, 0.02, shots=[Shot(1e-3), Shot(0.3e-3, 1.1e-3)])
    with pytest.raises(UserError, match="--shots: the needle has not closed"):
        strokes(schedule, NOMINAL)


def test_needle_that_has_no_time_to_close_between_events() -> None:
    schedule = make_schedule([100e6], 2, 1.2e-3, [1.1e-3])
    with pytest.raises(UserError, match="--period: the needle has not closed"):
        strokes(schedule, NOMINAL)


def test_the_remedy_is_enough() -> None:
    shots = [Shot(1e-3), Shot(0.3e-3, 1.1e-3)]
    with pytest.raises(UserError) as raised:
        strokes(make_schedule([100e6], 1, 0.02, shots=shots), NOMINAL)
    later = float(raised.value.remedy.split("at least ")[1].split(" ms")[0]) * 1e-3
    shots[1] = Shot(0.3e-3, 1.1e-3 + later + 1e-6)
    assert len(strokes(make_schedule([100e6], 1, 0.02, shots=shots), NOMINAL)) == 2
