"""Moments that are off by chance make a steep pressure noisy; what a model does not know there does not."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.noise import TimeJitter

SIGMA = 0.15
SAMPLES = 1300
FIRST = 50
TIME = np.arange(SAMPLES, dtype=np.float64)


def swing(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """A line pressure that rings from sample 100 on, as steep as 15 SIGMA a sample."""
    return np.where(time < 100, 0.0, 90.0 * np.exp(-(time - 100) / 600) * np.sin(0.025 * (time - 100)))


def window_of(output: NDArray[np.float64]) -> Window:
    remaining = TIME < 100
    return Window(np.zeros((SAMPLES, 2)), output, remaining, np.zeros(4), opening=100)


def known_after(events: int, jitter: float, unknown: NDArray[np.float64] | float = 0.0, seed: int = 3) -> TimeJitter:
    """After events whose moments are off by so many samples; unknown: what the model leaves (n,)."""
    random = np.random.default_rng(seed)
    result = TimeJitter()
    for _ in range(events):
        noise = random.normal(0.0, SIGMA, SAMPLES) + unknown
        shifted = swing(TIME + random.normal(0.0, jitter, SAMPLES)) if jitter else swing(TIME)
        result = result.after(window_of(shifted + noise), shifted + noise - swing(TIME), SIGMA, FIRST)
    return result


@pytest.mark.parametrize("jitter", [0.2, 0.3, 0.4])
def test_levels_are_those_of_the_jitter(jitter: float) -> None:
    levels = known_after(8, jitter).levels(window_of(swing(TIME)), SIGMA)
    assert levels is not None
    slope = np.gradient(swing(TIME)) / SIGMA
    expected = np.sqrt(1.0 + (jitter * slope) ** 2)
    assert np.abs(levels[:80] - 1.0).max() < 0.05
    assert np.abs(levels[130:1290] / expected[130:1290] - 1.0).max() < 0.15


@pytest.mark.parametrize("seed", range(20))
def test_white_noise_has_none(seed: int) -> None:
    result = known_after(6, 0.0, seed=seed)
    assert not result.is_known
    assert result.levels(window_of(swing(TIME)), SIGMA) is None
    assert result.loudest(window_of(swing(TIME)), SIGMA) == 1.0


def test_what_a_model_leaves_where_it_is_steep_is_none() -> None:
    """A line pressure recorded a whole sample late, and one whose ringing is another one."""
    late = swing(TIME - 1.0) - swing(TIME)
    assert not known_after(10, 0.0, late).is_known
    assert not known_after(10, 0.0, 0.02 * swing(1.02 * TIME)).is_known


def test_it_is_known_after_some_events_and_forgotten_when_it_is_over() -> None:
    random = np.random.default_rng(5)
    result = TimeJitter()
    are_known = []
    for event in range(40):
        off = random.normal(0.0, 0.2, SAMPLES) if event < 10 else np.zeros(SAMPLES)
        y = swing(TIME + off) + random.normal(0.0, SIGMA, SAMPLES)
        result = result.after(window_of(y), y - swing(TIME), SIGMA, FIRST)
        are_known.append(result.is_known)
    assert np.count_nonzero(np.diff(are_known)) == 2
    assert are_known.index(True) < 8
    assert not result.is_known


def test_masked_samples_tell_nothing() -> None:
    random = np.random.default_rng(6)
    result = TimeJitter()
    masked = np.zeros(SAMPLES, np.bool_)
    masked[100:900] = True
    for _ in range(10):
        y = swing(TIME) + random.normal(0.0, SIGMA, SAMPLES)
        y[100:900] += random.normal(0.0, SIGMA, 800)
        result = result.after(window_of(y)._replace(masked=masked), y - swing(TIME), SIGMA, FIRST)
    assert not result.is_known
