"""Wear over days: a straight line and the date of a limit, with intervals that hold as often as they say."""

import math

import numpy as np
import pytest

from observer_rt.desk.fleet.trend import FEWEST, Limit, Signal, WearLine
from observer_rt.foundation.errors import UserError

DAYS, LAST = np.array([0.0, 3.0, 11.0, 12.0, 30.0, 41.0, 60.0, 75.0, 90.0, 110.0]), 110.0


def line(level: float, rate: float, half: float = 0.004) -> WearLine:
    return WearLine.of(DAYS, level + rate * DAYS, np.full(DAYS.size, half))


@pytest.mark.parametrize("rate", [0.002, -0.002])
def test_a_known_line_is_found_and_a_bad_recording_counts_less(rate: float) -> None:
    value, half = 0.01 + rate * DAYS, np.full(DAYS.size, 0.004)
    value[4], half[4] = 0.5, 2.0
    result = WearLine.of(DAYS, value, half)
    assert result.coefficients == pytest.approx([rate, 0.01], abs=1e-5)


def test_intervals_hold_the_truth_as_often_as_they_say_when_values_scatter_beyond_theirs() -> None:
    random = np.random.default_rng(5)
    holds, dates = [], []
    for _ in range(1500):
        rate, sigma = random.uniform(0.001, 0.003), random.uniform(0.002, 0.01, DAYS.size)
        value = rate * DAYS + random.normal(0.0, np.hypot(sigma, 0.015))
        result = WearLine.of(DAYS, value, 1.96 * sigma)
        level, half = result.at(DAYS[-1:])
        slope_half = math.sqrt(result.spread[0, 0])
        holds.append(
            [abs(level[0] - rate * LAST) <= half[0], abs(result.coefficients[0] - rate) <= slope_half]
        )
        low, _, high = result.reaches(Limit("nozzle", 1.3 * rate * LAST))
        dates.append(low <= 1.3 * LAST <= high)
    assert np.mean(holds, axis=0) == pytest.approx([0.95, 0.95], abs=0.025)
    assert np.mean(dates) == pytest.approx(0.95, abs=0.025)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_steady_wear_reaches_the_limit_when_it_should(sign: float) -> None:
    low, middle, high = line(0.0, sign * 0.002).reaches(Limit("nozzle", sign * 0.3))
    assert 140.0 < low < 150.0 < high < 160.0
    assert middle == pytest.approx(150.0, abs=0.2)


@pytest.mark.parametrize("size", [0.9, -0.3])
def test_a_limit_too_far_ahead_or_the_other_way_is_not_before_some_day(size: float) -> None:
    assert line(0.0, 0.002).reaches(Limit("nozzle", size)) == (2.0 * LAST, math.inf, math.inf)


def test_a_limit_that_was_passed_has_its_day() -> None:
    low, middle, high = line(0.0, 0.004).reaches(Limit("nozzle", 0.25))
    assert 60.0 < low < 62.5 < high < 65.0
    assert middle == pytest.approx(62.5, abs=0.3)


@pytest.mark.parametrize("value", [[0.1] * FEWEST, [0.0, 0.1, 0.1, 0.3]])
def test_recordings_without_noise_do_no_harm(value: list[float]) -> None:
    days: Signal = np.arange(float(FEWEST))
    level, half = WearLine.of(days, np.array(value), np.zeros(FEWEST)).at(days)
    assert level == pytest.approx(np.polyval(np.polyfit(days, value, 1), days))
    assert np.isfinite(half).all()


@pytest.mark.parametrize(
    ("text", "limit"), [("nozzle=30%", Limit("nozzle", 0.3)), (" seat=-.2 ", Limit("seat", -0.2))]
)
def test_a_limit_is_read(text: str, limit: Limit) -> None:
    assert Limit.read(text) == limit


@pytest.mark.parametrize("text", ["nozzle", "nozzle=0", "lift=30%", "nozzle=much", "nozzle=30%%"])
def test_another_text_than_a_limit_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(UserError, match="nozzle=30%"):
        Limit.read(text)
