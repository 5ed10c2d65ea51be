"""The intervals of an injected volume and of a rate against the distribution they claim."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.engine.estimation.predictor import InputVariance, OpenLoop
from observer_rt.engine.learning.mass import Resimulation, corrected_rate, rate_sigma, volume_budget, volume_in

SIZE, SAMPLES = 13, 121
INTERVAL = 1e-5
RATE = 50e-6 * np.sin(np.linspace(0.0, np.pi, SAMPLES)) ** 2  # m3/s
VOLUME = 50e-6 * 120 * INTERVAL / 2  # m3, the mean of a squared sine is 1/2
WHOLE = slice(0, SAMPLES)
NOTHING = np.zeros((SIZE, SIZE))


def event(seed: int) -> Resimulation:
    random = np.random.default_rng(seed)
    run = OpenLoop(
        rate=RATE,
        slopes=random.normal(scale=5e-6, size=(SAMPLES, SIZE)),
        gradient=np.zeros((SAMPLES, 4)),
        transition=np.zeros((SAMPLES, 3, 3)),
        relaxation=np.zeros(SAMPLES),
        by_area=np.zeros(SAMPLES),
        fullness=np.zeros(SAMPLES),
    )
    exact = InputVariance(np.zeros(SAMPLES), np.zeros(SAMPLES))
    return Resimulation(run, exact, NOTHING, INTERVAL)


def test_volume_without_doubt_about_parameters_and_inputs() -> None:
    assert volume_in(event(1), WHOLE) == pytest.approx(VOLUME)
    assert volume_budget(event(1), WHOLE) == pytest.approx((0.0,) * 5)


def test_the_mean_over_explanations_moves_rate_and_volume() -> None:
    moved = replace(event(1), moved=0.02)
    assert volume_in(moved, WHOLE) == pytest.approx(1.02 * VOLUME)
    np.testing.assert_allclose(corrected_rate(moved, WHOLE), 1.02 * RATE)


def test_width_of_the_volume_follows_from_parameters_and_inputs() -> None:
    """Parameters and inputs are drawn, and the rate is integrated."""
    random = np.random.default_rng(3)
    root = 0.2 * random.normal(size=(SIZE, SIZE))
    by_inputs = 0.8e-10
    spread = event(3)
    spread = replace(spread, covariance=root @ root.T)
    spread.by_inputs.volume[-1] = by_inputs**2
    draws = random.normal(size=(20_000, SIZE)) @ root.T
    volumes = np.trapezoid(RATE[:, None] + spread.run.slopes @ draws.T, dx=INTERVAL, axis=0)
    volumes += by_inputs * random.normal(size=volumes.size)
    budget = volume_budget(spread, WHOLE)
    assert np.hypot(*budget[:2]) == budget.beyond_level == pytest.approx(volumes.std(), rel=0.02)


def test_sigma_of_the_corrected_rate_is_that_of_the_parameters() -> None:
    """Checked away from steep ramps, with input noise on top."""
    random = np.random.default_rng(5)
    root = 0.2 * random.normal(size=(SIZE, SIZE))
    spread = replace(event(5), covariance=root @ root.T)
    spread.by_inputs.rate[:] = (2e-6) ** 2
    rates = spread.run.slopes @ (root @ random.normal(size=(SIZE, 20_000)))
    rates += 2e-6 * random.normal(size=rates.shape)
    window = slice(20, 101)
    np.testing.assert_allclose(rate_sigma(spread, window), rates.std(axis=1)[window], rtol=0.03)


def test_ramps_are_less_certain_than_a_steady_rate() -> None:
    """Between samples the inputs are unknown, which matters on ramps."""
    sigma = rate_sigma(event(7), WHOLE)
    steepest, steady = np.argmax(np.gradient(RATE)), np.argmax(RATE)
    assert sigma[steady] < 1e-3 * sigma[steepest]
    assert 0.0 < sigma[steepest] < np.gradient(RATE)[steepest]
