"""Stretches that only the model shows, and signals that only look like them."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.disturbances.masks import OutlierSearch, Sigmas, frozen_stretches

NOISE = 0.0015  # of p_0
SIGMAS = Sigmas(innovation=1.2 * NOISE, noise=NOISE)
COUNT, OPENING, FIRST = 1500, 100, 50


def truth(rail: float = 1.0) -> NDArray[np.float64]:
    """A line that swings after an injection, over the rail pressure and below it."""
    k = np.arange(COUNT) - OPENING
    swing = -0.15 * np.sin(2.0 * np.pi * k / 130.0) * np.exp(-k / 600.0)
    return rail + np.where(k > 0, swing, 0.0)


def window_of(output: NDArray[np.float64], rail: float = 1.0) -> Window:
    inputs = np.column_stack([np.full(COUNT, rail), np.zeros(COUNT)])
    return Window(inputs, output, np.zeros(COUNT, np.bool_), np.zeros(4), OPENING)


def held(start: int, samples: int, rail: float = 1.0, seed: int = 1) -> tuple[Window, NDArray[np.float64]]:
    """A window with some samples held before noise is added, and the innovations of a right model."""
    y = truth(rail)
    y[start : start + samples] = y[start]
    noise = np.random.default_rng(seed).normal(size=COUNT) * NOISE
    return window_of(y + noise, rail), y + noise - truth(rail)


def test_a_stretch_that_is_held_is_masked_with_some_samples_before_it() -> None:
    window, innovations = held(300, 20)
    mask = OutlierSearch().masked(window, innovations, SIGMAS, FIRST)
    assert mask is not None
    masked = np.flatnonzero(mask)
    assert 285 < masked[0] <= 302
    assert masked[-1] == 319
    assert masked.size == masked[-1] - masked[0] + 1


def test_noise_is_not_masked() -> None:
    for seed in range(50):
        window, innovations = held(0, 1, seed=seed)
        assert OutlierSearch().masked(window, innovations, SIGMAS, FIRST) is None


def test_what_is_masked_already_is_not_found_again() -> None:
    window, innovations = held(300, 20)
    search = OutlierSearch()
    mask = search.masked(window, innovations, SIGMAS, FIRST)
    assert mask is not None
    masked = window._replace(masked=mask)
    assert search.masked(masked, np.where(mask, 0.0, innovations), SIGMAS, FIRST) is None


@pytest.mark.parametrize(
    ("start", "length", "is_extreme", "expected"),
    [(300, 20, False, [True, True, False, False]), (int(np.argmax(truth())), 25, True, [True, False])],
)
def test_at_the_same_place_in_event_after_event_it_is_no_outlier(
    start: int, length: int, is_extreme: bool, expected: list[bool]
) -> None:
    """Where it is the event's extreme, a second time at that level it is the end of the range, or the truth."""
    search = OutlierSearch()
    for seed, is_masked in enumerate(expected):
        window, innovations = held(start, length, seed=seed)
        assert [s.is_extreme for s in frozen_stretches(window, innovations, SIGMAS, FIRST)] == [is_extreme]
        assert (search.masked(window, innovations, SIGMAS, FIRST) is not None) == is_masked
        search = search.after(window, innovations, SIGMAS, FIRST)


def test_many_stretches_speak_against_the_model() -> None:
    y = truth()
    for start in (180, 260, 340, 420):
        y[start : start + 25] = y[start]
    noise = np.random.default_rng(1).normal(size=COUNT) * NOISE
    window, innovations = window_of(y + noise), y + noise - truth()
    assert len(frozen_stretches(window, innovations, SIGMAS, FIRST)) == 4
    assert OutlierSearch().masked(window, innovations, SIGMAS, FIRST) is None


def test_two_stretches_of_half_a_millisecond_are_two() -> None:
    y = truth()
    for start in (150, 500):
        y[start : start + 50] = y[start]
    noise = np.random.default_rng(1).normal(size=COUNT) * NOISE
    left = y + noise - truth()
    for end in (200, 550):  # as x~ comes back, which was drawn to what was held
        left[end : end + 12] -= 0.5 * left[end - 1] * np.exp(-np.arange(12) / 5.0)
    assert len(frozen_stretches(window_of(y + noise), left, SIGMAS, FIRST)) == 2


def test_of_a_noise_louder_than_known_nothing_is_masked() -> None:
    """By its level as it is, not as it is believed: ten times louder it would be full of stretches."""
    random = np.random.default_rng(3)
    for _ in range(20):
        innovations = np.convolve(random.normal(size=COUNT + 3), np.ones(4), "valid") * 5.0 * SIGMAS.innovation
        window = window_of(truth() + innovations)._replace(resting=np.arange(COUNT) > COUNT // 2)
        assert OutlierSearch().masked(window, innovations, SIGMAS, FIRST) is None
