"""Beliefs: what drift does to them, and back and forth between covariance and information."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.estimation.posterior import Belief, belief_from_information


def belief(seed: int, size: int = 4) -> Belief:
    random = np.random.default_rng(seed)
    root = random.normal(size=(size, size))
    return Belief(random.normal(size=size), root @ root.T + 0.1 * np.eye(size))


@given(st.integers(0, 10_000))
def test_information_and_back(seed: int) -> None:
    before = belief(seed)
    after = belief_from_information(before.mean, before.information())
    np.testing.assert_allclose(after.covariance, before.covariance, rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(after.covariance, after.covariance.T)


@given(st.integers(0, 10_000))
def test_drift_widens_and_moves_nothing(seed: int) -> None:
    before = belief(seed)
    drift = np.array([0.1, 0.0, 0.3, 0.01])
    after = before.drifted(drift)
    np.testing.assert_array_equal(after.mean, before.mean)
    np.testing.assert_allclose(after.sigma**2, before.sigma**2 + drift**2)
    away = after.covariance - before.covariance
    np.testing.assert_allclose(away, np.diag(np.diag(away)), atol=1e-12)


@pytest.mark.parametrize(
    "information",
    [np.zeros((2, 2)), np.array([[1.0, 2.0], [2.0, 1.0]]), -np.eye(2), np.full((2, 2), np.nan)],
    ids=["nothing known", "indefinite", "negative", "no number"],
)
def test_information_that_is_none_is_refused(information: NDArray[np.float64]) -> None:
    with pytest.raises(np.linalg.LinAlgError):
        belief_from_information(np.zeros(2), information)
