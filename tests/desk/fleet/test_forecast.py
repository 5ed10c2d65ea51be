"""Dates of limits: their intervals hold as often as they say, and nothing is said of what is too far ahead."""

import math

import numpy as np
import pytest

from observer_rt.desk.fleet.course import Signal, smoothed
from observer_rt.desk.fleet.forecast import FEWEST, Crossing, Limit, crossing
from observer_rt.foundation.errors import UserError

SPAN = 200.0  # days of recordings
STEP = 0.25  # of the truth


def a_truth(random: np.random.Generator) -> tuple[Signal, Signal]:
    """Days (n,), and wear that goes on for twice as long as it is recorded: its rate wanders, it jumps a little."""
    days = np.arange(0.0, 2.0 * SPAN + STEP, STEP)
    of_rate, of_level = 10.0 ** random.uniform(-6.0, -4.0), 10.0 ** random.uniform(-4.3, -2.2)
    steps = math.sqrt(STEP) * random.standard_normal((2, days.size))
    rate = random.normal(0.0, 1e-3) + of_rate * np.cumsum(steps[0])
    return days, np.cumsum(STEP * rate + of_level * steps[1])


def test_the_interval_of_a_date_holds_it_as_often_as_it_says() -> None:
    random = np.random.default_rng(5)
    holds, is_closed = [], []
    for _ in range(800):
        days, wear = a_truth(random)
        place = np.sort(np.append(random.uniform(0.0, SPAN, random.integers(4, 30)), [0.0, SPAN]))
        sigma = np.full(place.size, 10.0 ** random.uniform(-2.5, -1.8))
        course = smoothed(place, np.interp(place, days, wear) + random.normal(0.0, sigma), sigma)
        size = float(course.level[-1]) * random.uniform(1.05, 1.8)
        found = crossing(course, Limit("nozzle", size))
        assert found is not None
        beyond = np.flatnonzero((days >= SPAN) & (math.copysign(1.0, size) * (wear - size) >= 0.0))
        truth = days[beyond[0]] if beyond.size else math.inf
        holds.append(found.low - SPAN / 128.0 <= truth <= found.high)
        is_closed.append(math.isfinite(found.high))
    assert np.sum(is_closed) > 200
    assert 0.92 <= np.mean(np.array(holds)[is_closed]) <= 0.98
    assert np.mean(holds) >= 0.95  # open ones hold 97.5 %


def straight(rate: float, recordings: int = 12) -> Signal:
    return rate * np.linspace(0.0, 110.0, recordings)


def reached(wear: Signal, limit: str) -> Crossing | None:
    days = np.linspace(0.0, 110.0, wear.size)
    return crossing(smoothed(days, wear, np.full(wear.size, 0.002)), Limit.read(limit))


@pytest.mark.parametrize("sign", ["", "-"])
def test_what_goes_on_reaches_the_limit_when_it_should(sign: str) -> None:
    found = reached(straight(float(f"{sign}0.002")), f"nozzle={sign}30%")
    assert found is not None
    assert found.low < 150.0 < found.high < 165.0
    assert found.middle == pytest.approx(150.0, abs=4.0)
    assert found.reached is found.not_before is None


@pytest.mark.parametrize("limit", ["nozzle=90%", "nozzle=-30%"])
def test_what_is_too_far_ahead_or_the_other_way_is_not_before_some_day(limit: str) -> None:
    found = reached(straight(0.002), limit)
    assert found is not None
    assert found.not_before == 220.0  # as far ahead as the recordings reach back


def test_a_limit_that_was_passed_says_where() -> None:
    found = reached(straight(0.004), "nozzle=0.25")
    assert found is not None
    assert found.reached == 70.0
    assert found.not_before is None


def test_few_recordings_say_nothing() -> None:
    assert reached(straight(0.002, FEWEST - 1), "nozzle=30%") is None
    assert reached(straight(0.002, FEWEST), "nozzle=30%") is not None


@pytest.mark.parametrize("text", ["nozzle", "nozzle=0", "lift=30%", "nozzle=much", "nozzle=30%%"])
def test_what_is_no_limit_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(UserError, match="nozzle=30%"):
        Limit.read(text)
