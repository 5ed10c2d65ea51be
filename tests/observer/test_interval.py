"""The interval of an injected volume against the distribution it claims."""

import numpy as np
import pytest

from observer_rt.config import load_injector
from observer_rt.estimation.gain import GainSchedule, NoiseLevels
from observer_rt.observer.interval import MODEL_SHARE, MODEL_VOLUME, volume_interval
from observer_rt.observer.learning import Outcome, Verdict, no_knowledge

SIZE = 13
INTERVAL = 1e-5
VOLUME = 60e-9  # m3
P_0 = load_injector().scaling.pressure


def outcome(estimate: np.ndarray, covariance: np.ndarray) -> Outcome:
    knowledge = no_knowledge(NoiseLevels(0.1e6, 0.15e6, 0.4e-6), P_0)
    return Outcome(
        verdict=Verdict.ADOPTED,
        knowledge=knowledge,
        schedule=GainSchedule(np.zeros((2, 3)), 1.0),
        findings=(),
        estimate=estimate,
        covariance=covariance,
        carried=np.zeros(SIZE),
        rate_slopes=np.zeros((0, SIZE)),
    )


def test_without_doubt_about_the_parameters_the_systematic_part_remains() -> None:
    low, high = volume_interval(
        VOLUME, np.zeros((100, SIZE)), INTERVAL, outcome(np.zeros(SIZE), np.zeros((SIZE, SIZE)))
    )
    sigma = np.hypot(MODEL_SHARE * VOLUME, MODEL_VOLUME)
    assert (low, high) == pytest.approx((VOLUME - 1.96 * sigma, VOLUME + 1.96 * sigma))


def test_width_and_centre_follow_from_the_parameters() -> None:
    """By drawing parameters and integrating the rates they give."""
    random = np.random.default_rng(3)
    slopes = random.normal(scale=5e-6, size=(120, SIZE))
    root = 0.01 * random.normal(size=(SIZE, SIZE))
    estimate = 0.02 * random.normal(size=SIZE)
    draws = estimate + random.normal(size=(20_000, SIZE)) @ root.T
    volumes = VOLUME + np.trapezoid(slopes @ draws.T, dx=INTERVAL, axis=0)
    low, high = volume_interval(VOLUME, slopes, INTERVAL, outcome(estimate, root @ root.T))
    systematic = np.hypot(MODEL_SHARE * VOLUME, MODEL_VOLUME)
    assert 0.5 * (low + high) == pytest.approx(volumes.mean(), abs=0.02 * volumes.std())
    assert (high - low) / (2 * 1.96) == pytest.approx(np.hypot(volumes.std(), systematic), rel=0.02)
