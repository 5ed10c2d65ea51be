"""Openings in a measured lift."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.identification.likelihood.openings import find_openings

NOISE = 0.4e-6


def _lift(*strokes: tuple[int, int], samples: int = 1000) -> NDArray[np.float64]:
    """Strokes (first sample off the seat, last) with flanks of 8 um a sample, at most 300 um."""
    k = np.arange(samples, dtype=np.float64)
    lift = np.zeros(samples)
    for opening, closed in strokes:
        lift = np.maximum(lift, np.minimum(np.minimum(8e-6 * (k - opening), 8e-6 * (closed - k)), 300e-6))
    return lift


def _noisy(lift: NDArray[np.float64], seed: int = 3) -> NDArray[np.float64]:
    return lift + NOISE * np.random.default_rng(seed).normal(size=lift.size)


def test_every_stroke_is_found_with_its_flanks() -> None:
    found = find_openings(_noisy(_lift((100, 300), (500, 540))), NOISE)
    assert len(found) == 2
    for opening, (first, closed) in zip(found, ((100, 300), (500, 540)), strict=True):
        assert opening.first in (first, first + 1)
        assert opening.last in (closed - 1, closed)
        for ramp, distance in (
            (opening.rising, opening.first - first),
            (opening.falling, closed - opening.last),
        ):
            assert ramp.slope == pytest.approx(8e-6, rel=0.05)
            assert ramp.lift == pytest.approx(8e-6 * distance, abs=3 * NOISE)


def test_noise_alone_is_no_opening() -> None:
    assert find_openings(_noisy(np.zeros(200_000)), NOISE) == []


def test_openings_cut_off_by_the_ends_are_left_out() -> None:
    lift = _lift((-50, 100), (400, 600), (900, 1200))
    found = find_openings(_noisy(lift), NOISE)
    assert [opening.first for opening in found] in ([400], [401])


def test_missing_samples_are_shut() -> None:
    lift = _noisy(_lift((100, 300)))
    lift[600:700] = np.nan
    assert len(find_openings(lift, NOISE)) == 1
