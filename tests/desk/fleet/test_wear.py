"""Wear over days: what all recordings say together, and dates of limits whose intervals hold as often as they say."""

import math

import numpy as np
import pytest

from observer_rt.desk.fleet.wear import FEWEST, SURE, Course, Crossing, Limit, Signal, course_of
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


@pytest.mark.slow
def test_the_interval_of_a_date_holds_it_as_often_as_it_says() -> None:
    random = np.random.default_rng(5)
    holds, is_closed = [], []
    for _ in range(400):
        days, wear = a_truth(random)
        place = np.sort(np.append(random.uniform(0.0, SPAN, random.integers(4, 30)), [0.0, SPAN]))
        sigma = np.full(place.size, 10.0 ** random.uniform(-2.5, -1.8))
        course = course_of(place, np.interp(place, days, wear) + random.normal(0.0, sigma), sigma)
        size = float(course.level[-1]) * random.uniform(1.05, 1.8)
        crossing = course.crossing(Limit("nozzle", size))
        assert crossing is not None
        beyond = np.flatnonzero((days >= SPAN) & (math.copysign(1.0, size) * (wear - size) >= 0.0))
        truth = days[beyond[0]] if beyond.size else math.inf
        holds.append(crossing.low - SPAN / 128.0 <= truth <= crossing.high)
        is_closed.append(math.isfinite(crossing.high))
    assert np.sum(is_closed) > 100
    assert 0.92 <= np.mean(np.array(holds)[is_closed]) <= 0.98
    assert np.mean(holds) >= 0.95  # open ones hold 97.5 %


def straight(rate: float, recordings: int = 12) -> Signal:
    return rate * np.linspace(0.0, 110.0, recordings)


def reached(wear: Signal, limit: str) -> Crossing | None:
    days = np.linspace(0.0, 110.0, wear.size)
    return course_of(days, wear, np.full(wear.size, 0.002)).crossing(Limit.read(limit))


@pytest.mark.parametrize("sign", ["", "-"])
def test_steady_wear_reaches_the_limit_when_it_should(sign: str) -> None:
    crossing = reached(straight(float(f"{sign}0.002")), f"nozzle={sign}30%")
    assert crossing is not None
    assert crossing.low < 150.0 < crossing.high < 165.0
    assert crossing.middle == pytest.approx(150.0, abs=4.0)
    assert not crossing.is_reached


@pytest.mark.parametrize("limit", ["nozzle=90%", "nozzle=-30%"])
def test_a_limit_too_far_ahead_or_the_other_way_is_not_before_some_day(limit: str) -> None:
    crossing = reached(straight(0.002), limit)
    assert crossing == Crossing(220.0, math.inf, math.inf)  # as far ahead as the recordings reach back


def test_a_limit_that_was_passed_has_its_day() -> None:
    assert reached(straight(0.004), "nozzle=0.25") == Crossing(70.0, 70.0, 70.0, is_reached=True)


def test_few_recordings_have_no_date() -> None:
    assert reached(straight(0.002, FEWEST - 1), "nozzle=30%") is None
    assert reached(straight(0.002, FEWEST), "nozzle=30%") is not None


@pytest.mark.parametrize("text", ["nozzle", "nozzle=0", "lift=30%", "nozzle=much", "nozzle=30%%"])
def test_another_text_than_a_limit_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(UserError, match="nozzle=30%"):
        Limit.read(text)


def daily(value: Signal, sigma: Signal) -> Course:
    return course_of(np.arange(value.size, dtype=float), value, sigma)


def test_the_band_holds_wear_that_drifts_and_is_narrower_than_single_recordings() -> None:
    random = np.random.default_rng(1)
    inside, widths = [], []
    for _ in range(60):
        truth = np.cumsum(random.normal(0.0, 0.004, 40))
        sigma = np.full(40, 0.01)
        course = daily(truth + random.normal(0.0, sigma), sigma)
        inside.append(np.abs(course.level - truth) <= SURE * course.level_sigma)
        widths.append(course.level_sigma.mean() / 0.01)
    assert 0.88 < np.mean(inside) < 0.99
    assert np.mean(widths) < 0.8


@pytest.mark.parametrize("rate", [0.002, -0.002])
def test_the_rate_has_the_sign_of_the_change(rate: float) -> None:
    days = np.array([0.0, 3.0, 11.0, 12.0, 30.0, 41.0, 60.0])
    course = course_of(days, rate * days, np.full(7, 0.002))
    assert course.rate == pytest.approx(rate, abs=SURE * course.rate_sigma)
    assert course.rate_sigma < 0.25 * abs(rate)


@pytest.mark.parametrize("value", [[0.1] * 5, [0.0, 0.1, 0.1, 0.3, 0.2]])
def test_recordings_without_noise_or_on_one_day_do_no_harm(value: list[float]) -> None:
    course = course_of(np.array([0.0, 1.0, 1.0, 2.0, 2.0]), np.array(value), np.zeros(5))
    assert course.level[0] == pytest.approx(value[0], abs=1e-3)
    assert course.level[3] == pytest.approx(0.5 * (value[3] + value[4]), abs=1e-3)
    assert daily(np.array([0.1]), np.array([0.01])).level == pytest.approx([0.1], abs=1e-6)
