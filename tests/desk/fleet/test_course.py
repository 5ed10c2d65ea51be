"""The course of wear: what all recordings of an injector say together of level and rate."""

import numpy as np
import pytest

from observer_rt.desk.fleet.course import SURE, Course, Signal, smoothed
from observer_rt.desk.fleet.forecast import Limit, crossing


def daily(value: Signal, sigma: Signal) -> Course:
    return smoothed(np.arange(value.size, dtype=float), value, sigma)


def test_the_band_holds_what_drifts_and_is_narrower_than_single_sightings() -> None:
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


def test_what_stays_is_known_ever_better() -> None:
    random = np.random.default_rng(2)
    sigma = np.full(100, 0.01)
    course = daily(0.2 + random.normal(0.0, sigma), sigma)
    assert course.level[-1] == pytest.approx(0.2, abs=0.006)
    assert course.level_sigma[-1] < 0.005
    assert abs(course.slope) < SURE * course.slope_sigma < 0.002


@pytest.mark.parametrize("rate", [0.002, -0.002])
def test_the_rate_has_the_sign_of_the_change(rate: float) -> None:
    place = np.array([0.0, 3.0, 11.0, 12.0, 30.0, 41.0, 60.0])
    course = smoothed(place, rate * place, np.full(7, 0.002))
    assert course.slope == pytest.approx(rate, abs=SURE * course.slope_sigma)
    assert course.slope_sigma < 0.25 * abs(rate)


@pytest.mark.parametrize("sightings", [0, 1, 2])
def test_few_sightings_are_taken_as_they_are(sightings: int) -> None:
    course = daily(np.full(sightings, 0.1), np.full(sightings, 0.01))
    assert course.level.tolist() == pytest.approx([0.1] * sightings)


def test_two_sightings_that_differ_are_no_quantity_that_stands_still() -> None:
    course = daily(np.array([0.02, 0.04]), np.full(2, 0.002))
    assert course.level == pytest.approx([0.02, 0.04], abs=0.004)


def test_the_unit_of_places_does_not_matter() -> None:
    value, sigma = np.array([0.0, 0.01, 0.03, 0.03, 0.06]), np.full(5, 0.005)
    days = np.array([0.0, 10.0, 11.0, 25.0, 40.0])
    by_day, by_second = smoothed(days, value, sigma), smoothed(86400.0 * days, value, sigma)
    assert by_second.level == pytest.approx(by_day.level, rel=1e-9)
    assert 86400.0 * by_second.slope == pytest.approx(by_day.slope, rel=1e-9)


@pytest.mark.parametrize("value", [[0.1, 0.1, 0.1, 0.1, 0.1], [0.0, 0.1, 0.1, 0.3, 0.2]])
def test_sightings_without_noise_or_at_one_place_do_no_harm(value: list[float]) -> None:
    course = smoothed(np.array([0.0, 1.0, 1.0, 2.0, 2.0]), np.array(value), np.zeros(5))
    assert course.level[0] == pytest.approx(value[0], abs=1e-3)
    assert course.level[3] == pytest.approx(0.5 * (value[3] + value[4]), abs=1e-3)
    assert crossing(course, Limit("nozzle", 0.5)) is not None
