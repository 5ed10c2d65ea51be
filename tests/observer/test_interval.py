"""The interval of an injected volume against the distribution it claims."""

import numpy as np
import pytest

from observer_rt.observer.interval import MODEL_SHARE, MODEL_VOLUME, volume_interval

SIZE = 13
INTERVAL = 1e-5
RATE = 50e-6 * np.sin(np.linspace(0.0, np.pi, 121)) ** 2  # m3/s
VOLUME = 50e-6 * 120 * INTERVAL / 2  # m3, the mean of a squared sine is 1/2


def test_without_doubt_about_the_parameters_the_systematic_part_remains() -> None:
    random = np.random.default_rng(1)
    slopes = random.normal(size=(RATE.size, SIZE))
    low, high = volume_interval(RATE, slopes, np.zeros((SIZE, SIZE)), INTERVAL)
    sigma = np.hypot(MODEL_SHARE * VOLUME, MODEL_VOLUME)
    assert (low, high) == pytest.approx((VOLUME - 1.96 * sigma, VOLUME + 1.96 * sigma))


def test_width_follows_from_the_parameters() -> None:
    """By drawing parameters and integrating the rates they give."""
    random = np.random.default_rng(3)
    slopes = random.normal(scale=5e-6, size=(RATE.size, SIZE))
    root = 0.2 * random.normal(size=(SIZE, SIZE))
    draws = random.normal(size=(20_000, SIZE)) @ root.T
    volumes = np.trapezoid(RATE[:, None] + slopes @ draws.T, dx=INTERVAL, axis=0)
    low, high = volume_interval(RATE, slopes, root @ root.T, INTERVAL)
    systematic = np.hypot(MODEL_SHARE * VOLUME, MODEL_VOLUME)
    assert volumes.std() > 3 * systematic
    assert 0.5 * (low + high) == pytest.approx(VOLUME)
    assert (high - low) / (2 * 1.96) == pytest.approx(np.hypot(volumes.std(), systematic), rel=0.02)
