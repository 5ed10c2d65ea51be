"""Wear that moves on is told from wear that stands still."""

import numpy as np
import pytest

from observer_rt.engine.estimation.scalars import PARAMETERS, SCALARS, Parameter
from observer_rt.engine.learning.trend import Trend

USUAL = SCALARS.drift(1e8)
EVENTS = 2000


def test_wear_at_rest_is_hardly_ever_taken_to_move() -> None:
    random = np.random.default_rng(3)
    trend = Trend()
    moving = []
    for _ in range(EVENTS):
        trend = trend.after(random.normal(size=PARAMETERS))
        moving.append(trend.extra(USUAL).any())
    assert np.mean(moving) < 0.08  # a false alarm lasts ten events


@pytest.mark.parametrize("column", [Parameter.NOZZLE_BIAS, Parameter.SEAT_BIAS])
@pytest.mark.parametrize("pull", [-2.0, 2.0])
def test_small_contradictions_of_the_same_sign_add_up(column: Parameter, pull: float) -> None:
    random = np.random.default_rng(4)
    trend = Trend()
    for _ in range(8):
        scores = 0.5 * random.normal(size=PARAMETERS)
        scores[column] += pull
        trend = trend.after(scores)
    extra = trend.extra(USUAL)
    assert np.flatnonzero(extra).tolist() == [column]
    assert extra[column] > USUAL[column]


def test_a_trend_that_ended_is_forgotten() -> None:
    trend = Trend()
    for _ in range(8):
        trend = trend.after(np.full(PARAMETERS, 2.0))
    for _ in range(20):
        trend = trend.after(np.zeros(PARAMETERS))
    assert not trend.extra(USUAL).any()
