"""Beliefs: what drift, change and measurements do to them, and how far their mean then is from the truth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief, prior_belief


def belief(seed: int, size: int = 4) -> Belief:
    random = np.random.default_rng(seed)
    root = random.normal(size=(size, size))
    return prior_belief(random.normal(size=size), root @ root.T + 0.1 * np.eye(size))


@given(st.integers(0, 10_000))
def test_measurements_that_say_nothing_change_nothing(seed: int) -> None:
    before = belief(seed)
    after = before.updated(np.zeros((4, 4)), np.zeros(4))
    np.testing.assert_allclose(after.mean, before.mean, rtol=1e-6, atol=1e-9)
    for matrix in (after.covariance, after.error_covariance):
        np.testing.assert_allclose(matrix, before.covariance, rtol=1e-6, atol=1e-9)
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


def test_error_of_parameters_that_stand_still() -> None:
    """Against 20,000 filters that allow for a drift which never comes: they are better than they believe."""
    random = np.random.default_rng(1)
    prior = prior_belief(np.zeros(2), np.array([[1.0, 0.3], [0.3, 0.5]]))
    truth = random.multivariate_normal(prior.mean, prior.covariance, size=20_000)
    beliefs, means = prior, np.zeros_like(truth)
    for _ in range(30):
        slopes = random.normal(size=(3, 2))
        information = slopes.T @ slopes
        noise = random.normal(size=(len(truth), 3))
        drifted = beliefs.drifted(np.array([0.3, 0.2]))
        beliefs = drifted.updated(information, np.zeros(2))
        vectors = means @ drifted.information + (truth @ slopes.T + noise) @ slopes
        means = vectors @ beliefs.covariance
    result = np.cov((means - truth).T)
    np.testing.assert_allclose(beliefs.error_covariance, result, rtol=0.03, atol=0.03 * result.max())
    assert np.all(np.diag(result) < 0.8 * np.diag(beliefs.covariance))


@given(st.integers(0, 10_000))
def test_drift_widens_and_moves_nothing(seed: int) -> None:
    before = belief(seed)
    drift = np.array([0.1, 0.0, 0.3, 0.01])
    after = before.drifted(drift)
    np.testing.assert_array_equal(after.mean, before.mean)
    np.testing.assert_allclose(after.sigma**2, before.sigma**2 + drift**2)
    np.testing.assert_array_equal(after.error_covariance, before.error_covariance)
    away = after.covariance - before.covariance
    np.testing.assert_allclose(away, np.diag(np.diag(away)), atol=1e-12)


def test_a_change_that_showed_is_an_error_of_the_mean() -> None:
    before = belief(3)
    after = before.widened(np.array([0.1, 0.0, 0.3, 0.01]))
    for wider, matrix in (
        (after.covariance, before.covariance),
        (after.error_covariance, before.error_covariance),
    ):
        np.testing.assert_allclose(wider - matrix, np.diag([0.01, 0.0, 0.09, 1e-4]), atol=1e-12)


@pytest.mark.parametrize(
    "information",
    [np.array([[1.0, 9.0], [9.0, 1.0]]), -2 * np.eye(2), -np.eye(2), np.full((2, 2), np.nan)],
    ids=["indefinite", "negative", "nothing left", "no number"],
)
def test_information_that_is_none_is_refused(information: NDArray[np.float64]) -> None:
    with pytest.raises(np.linalg.LinAlgError):
        prior_belief(np.zeros(2), np.eye(2)).updated(information, np.zeros(2))
