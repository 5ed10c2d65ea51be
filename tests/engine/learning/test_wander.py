"""Wander of masses from point to point: seen where there is any, and only there."""

import math

import numpy as np
import pytest

from observer_rt.engine.learning.account import Scatter, Wander
from observer_rt.engine.learning.learned_range import EventPoint

POINTS = (EventPoint(0.5, math.log(1e-3), 0.9), EventPoint(1.6, math.log(1e-3), 0.9))
KNOWN = 0.002  # sigma of a mass, by all else


def after(spread: float, events: int = 30, is_moving: bool = True, seed: int = 1) -> Wander:
    """Belief after events whose masses wander by so much from one to the next."""
    random = np.random.default_rng(seed)
    wander = Wander().at(POINTS[0])
    for number in range(1, events):
        moved = random.normal(0.0, math.hypot(KNOWN, math.sqrt(2.0) * spread))
        wander = wander.after(float(moved), KNOWN**2, POINTS[number % 2 if is_moving else 0])
    return wander


def test_where_there_is_none_intervals_stay() -> None:
    assert after(0.0).widened(KNOWN**2) == pytest.approx(KNOWN, rel=0.03)


@pytest.mark.parametrize("spread", [0.005, 0.02])
def test_it_is_found(spread: float) -> None:
    result = [after(spread, seed=seed).widened(KNOWN**2) for seed in range(10)]
    assert np.median(result) == pytest.approx(math.hypot(KNOWN, spread), rel=0.3)


def test_at_one_point_it_is_not_seen() -> None:
    still = after(0.0, is_moving=False)
    assert still.widened(KNOWN**2) == pytest.approx(Wander().widened(KNOWN**2), rel=0.05)


def test_one_real_change_is_none() -> None:
    wander = after(0.0).after(0.15, KNOWN**2, POINTS[0])
    assert wander.widened(KNOWN**2) < 0.004


def test_events_that_scatter_widen_what_is_believed() -> None:
    usual, odd = Scatter(), Scatter()
    for _ in range(20):
        usual, odd = usual.after(0.9), odd.after(3.0)
    assert usual.factor == 1.0
    assert odd.factor == pytest.approx(3.0, rel=0.25)
