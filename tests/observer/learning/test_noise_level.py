"""Levels of noise that changes: followed at once, and left alone where nothing changed."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.observer.learning.noise_level import RecentLevel

SIGMA = 0.0015
REST = 700  # samples of an event


def event(random: np.random.Generator, level: float) -> list[NDArray[np.float64]]:
    """An event's stretches of rest, with a slow motion under the noise."""
    motion = 0.01 * np.sin(np.arange(REST) / 80.0)
    return [motion + level * SIGMA * random.normal(size=REST)]


@pytest.mark.parametrize("seed", range(20))
def test_a_level_that_stays_is_that_of_the_whole_standstill(seed: int) -> None:
    random, level = np.random.default_rng(seed), RecentLevel()
    assert [level.after(event(random, 1.0), SIGMA) for _ in range(30)] == [SIGMA] * 30


@pytest.mark.parametrize("louder", [3.0, 2.0, 0.5])
def test_a_level_that_changes_is_followed_at_once(louder: float) -> None:
    random, level = np.random.default_rng(1), RecentLevel()
    for _ in range(10):
        level.after(event(random, 1.0), SIGMA)
    for _ in range(10):
        assert level.after(event(random, louder), SIGMA) == pytest.approx(louder * SIGMA, rel=0.15)
    for _ in range(3):
        assert level.after(event(random, 1.0), SIGMA) == SIGMA


def test_a_spike_is_no_noise() -> None:
    random, level = np.random.default_rng(2), RecentLevel()
    (values,) = event(random, 1.0)
    values[300] += 50.0 * SIGMA
    assert level.after([values], SIGMA) == SIGMA


def test_without_rest_nothing_changes() -> None:
    assert RecentLevel().after([], SIGMA) == SIGMA
    assert RecentLevel().after([np.zeros(3)], SIGMA) == SIGMA
