"""Beliefs: what drift, change, measurements and a held parameter do to them, and how far off their mean then is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.engine.estimation.belief import Belief, held_at, prior_belief

HELD, DRAWS = 2, 15_000


def belief(seed: int, size: int = 4) -> Belief:
    random = np.random.default_rng(seed)
    root = random.normal(size=(size, size))
    return prior_belief(random.normal(size=size), root @ root.T + 0.1 * np.eye(size))


@given(st.integers(0, 10_000), st.integers(1, 20))
def test_an_error_is_what_is_left_of_it_and_of_the_noise(seed: int, size: int) -> None:
    before, slopes = belief(seed, size).drifted(np.ones(size)), np.random.default_rng(seed).random((9, size))
    information = slopes.T @ slopes
    after = before.updated(information, information @ np.ones(size))
    kept = after.covariance @ np.linalg.inv(before.covariance)
    error = kept @ before.error_covariance @ kept.T + after.covariance @ information @ after.covariance
    np.testing.assert_allclose(after.error_covariance, error, rtol=1e-9, atol=1e-9 * np.abs(error).max())
    for matrix in (after.covariance, after.error_covariance):
        np.testing.assert_array_equal(matrix, matrix.T)


@given(st.integers(0, 10_000))
def test_measurements_are_weighed_with_the_belief(seed: int) -> None:
    """By least squares on the prior and the measurements together; without drift the error is as believed."""
    random = np.random.default_rng(seed)
    before, slopes, measured = belief(seed), random.normal(size=(9, 4)), random.normal(size=9)
    after = before.updated(slopes.T @ slopes, slopes.T @ measured)
    root = np.linalg.cholesky(np.linalg.inv(before.covariance)).T
    rows = np.vstack([root, slopes])
    expected = np.linalg.lstsq(rows, np.append(root @ before.mean, measured), rcond=None)[0]
    np.testing.assert_allclose(after.mean, expected, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(after.covariance, np.linalg.inv(rows.T @ rows), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(after.error_covariance, after.covariance, rtol=1e-6, atol=1e-9)


@given(st.integers(0, 10_000))
def test_drift_widens_and_moves_nothing_and_a_change_that_showed_is_an_error(seed: int) -> None:
    before, change = belief(seed), np.array([0.1, 0.0, 0.3, 0.01])
    by, error = np.diag(change**2), before.error_covariance
    for after, expected in ((before.drifted(change), error), (before.widened(change), error + by)):
        np.testing.assert_array_equal(after.mean, before.mean)
        np.testing.assert_allclose(after.covariance, before.covariance + by)
        np.testing.assert_allclose(after.error_covariance, expected)


@pytest.mark.parametrize(
    "information",
    [np.array([[1.0, 9.0], [9.0, 1.0]]), -2 * np.eye(2), -np.eye(2), np.full((2, 2), np.nan)],
    ids=["indefinite", "negative", "nothing left", "no number"],
)
def test_information_that_is_none_is_refused(information: NDArray[np.float64]) -> None:
    with pytest.raises(np.linalg.LinAlgError):
        prior_belief(np.zeros(2), np.eye(2)).updated(information, np.zeros(2))


def test_the_error_after_an_event_is_what_is_said_of_it() -> None:
    """Truths are drawn from the belief; the held column of each is measured by somebody else."""
    random, before = np.random.default_rng(4), belief(3, size=3)
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
    before, noise = belief(3, size=3), 0.2
    own, measured = before.covariance[HELD, HELD], before.mean[HELD] + 1.5
    variance = own * noise / (own + noise)
    value = variance * (before.mean[HELD] / own + measured / noise)
    exact = -0.5 * (measured - before.mean[HELD]) ** 2 / (own + noise) - 0.5 * np.log((own + noise) / noise)
    held = -0.5 * (measured - value) ** 2 / noise
    assert held + held_at(before, HELD, value, variance).log == pytest.approx(exact)
