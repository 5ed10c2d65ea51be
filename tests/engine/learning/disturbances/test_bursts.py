"""Bursts of noise on the line pressure: found by fourth differences, and only they."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.core.learning.outliers import LENGTH
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.disturbances.masks import RECURS, OutlierSearch, Sigmas, bursts_of

NOISE, COUNT, FIRST = 0.0015, 1400, 50  # of p_0, samples
SIGMAS = Sigmas(1.1 * NOISE, NOISE)
AT = slice(500, 700)


def swinging() -> NDArray[np.float64]:
    """A line pressure that swings by a tenth at 1.3 kHz."""
    return np.asarray(1.0 + 0.1 * np.sin(2.0 * np.pi * np.arange(COUNT) / 77.0), np.float64)


def noisy(seed: int, burst: float = 0.0, at: slice = AT) -> NDArray[np.float64]:
    random = np.random.default_rng(seed)
    sigmas = np.full(COUNT, NOISE)
    sigmas[at] = np.hypot(NOISE, burst)
    return np.asarray(swinging() + random.normal(size=COUNT) * sigmas, np.float64)


@pytest.mark.parametrize("seed", range(20))
def test_noise_at_its_level_has_none(seed: int) -> None:
    assert bursts_of(noisy(seed), NOISE) == []


@pytest.mark.parametrize("burst", [3.0, 10.0])
def test_burst_is_found_to_a_few_samples(burst: float) -> None:
    for seed in range(10):
        (result,) = bursts_of(noisy(seed, burst * NOISE), NOISE)
        assert abs(result.start - AT.start) < LENGTH // 2
        assert abs(result.end - AT.stop) < LENGTH // 2


def test_neither_a_spike_nor_a_step_is_one() -> None:
    y = noisy(1)
    y[300] += 100.0 * NOISE
    y[900:] += 100.0 * NOISE
    assert bursts_of(y, NOISE) == []


def test_noise_that_is_louder_all_the_time_is_none() -> None:
    assert bursts_of(noisy(2, 5.0 * NOISE, slice(0, COUNT)), NOISE) == []


def test_burst_is_masked_but_not_what_comes_with_every_event() -> None:
    search = OutlierSearch()
    shut = np.ones(COUNT, np.bool_)
    masked = []
    for seed in range(RECURS + 1):
        y = noisy(seed, 5.0 * NOISE)
        window = Window(np.column_stack([np.ones(COUNT), np.zeros(COUNT)]), y, shut, np.zeros(4), 100)
        mask = search.masked(window, y - swinging(), SIGMAS, FIRST)
        masked.append(mask is not None and mask[AT].mean() > 0.8)
        search = search.after(window, y - swinging(), SIGMAS, FIRST)
    assert masked == [True] * (RECURS - 1) + [False] * 2
