"""A parameter that is held and considered: an event teaches nothing of it, and all else is unsure by it."""

import numpy as np
import pytest

from observer_rt.engine.estimation.gating import Belief, held_at, prior_belief

HELD, DRAWS = 2, 15_000


def belief() -> Belief:
    random = np.random.default_rng(3)
    root = random.normal(size=(3, 3))
    return prior_belief(np.array([0.3, -0.2, 0.1]), root @ root.T + 0.1 * np.eye(3))


def test_the_error_after_an_event_is_what_is_said_of_it() -> None:
    """Truths are drawn from the belief; the held column of each is measured by somebody else."""
    random, before = np.random.default_rng(4), belief()
    slopes = random.normal(size=(2, 3))
    truths = random.multivariate_normal(before.mean, before.covariance, DRAWS)
    own, noise = before.covariance[HELD, HELD], 0.3
    variance = own * noise / (own + noise)
    seen = truths[:, HELD] + np.sqrt(noise) * random.normal(size=DRAWS)
    values = before.mean[HELD] + own / (own + noise) * (seen - before.mean[HELD])
    errors = []
    for truth, value in zip(truths, values, strict=True):
        measured = slopes @ truth + random.normal(size=2)
        held, information = held_at(before, HELD, value, variance), slopes.T @ slopes
        after = held.considered(held.prior.updated(information, slopes.T @ measured), information)
        errors.append(after.mean - truth)
        assert after.mean[HELD] == pytest.approx(value, abs=1e-6)
    np.testing.assert_allclose(np.cov(np.array(errors).T), after.covariance, atol=0.03 * np.max(after.covariance))


def test_holding_costs_what_the_value_is_unlikely_by() -> None:
    """An event that teaches the held parameter alone is as likely, held where it lies best, as with the belief."""
    before, noise = belief(), 0.2
    own, measured = before.covariance[HELD, HELD], before.mean[HELD] + 1.5
    variance = own * noise / (own + noise)
    value = variance * (before.mean[HELD] / own + measured / noise)
    exact = -0.5 * (measured - before.mean[HELD]) ** 2 / (own + noise) - 0.5 * np.log((own + noise) / noise)
    held = -0.5 * (measured - value) ** 2 / noise
    assert held + held_at(before, HELD, value, variance).log == pytest.approx(exact)
