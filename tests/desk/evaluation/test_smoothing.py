"""Beliefs smoothed over events, against all measurements at once, and against errors drawn at random."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.desk.evaluation.smoothing import TaughtEvent, smoothed
from observer_rt.engine.estimation.gating import Belief, prior_belief

DRIFT = np.array([0.3, 0.1])
START = np.diag([4.0, 9.0])
INFORMATION = [
    np.array(rows, float)
    for rows in (
        [[5.0, 1.0], [1.0, 2.0]],
        [[1.0, 0.0], [0.0, 8.0]],
        [[3.0, -1.0], [-1.0, 2.0]],
        [[9.0, 2.0], [2.0, 4.0]],
    )
]


def filtered(seen: list[NDArray[np.float64]]) -> list[TaughtEvent]:
    """Events that each measured theta (2,) with the information of their place."""
    belief = prior_belief(np.zeros(2), START)
    events: list[TaughtEvent] = []
    for information, theta in zip(INFORMATION, seen, strict=True):
        prior = belief.drifted(DRIFT) if events else belief
        belief = prior.updated(information, information @ theta)
        events.append(TaughtEvent(prior, belief))
    return events


def jointly(seen: list[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Means (4, 2) and covariance (8, 8) of all events by one system of normal equations."""
    matrix, vector = np.zeros((8, 8)), np.zeros(8)
    matrix[:2, :2] += np.linalg.inv(START)
    for k, (information, theta) in enumerate(zip(INFORMATION, seen, strict=True)):
        here = slice(2 * k, 2 * k + 2)
        matrix[here, here] += information
        vector[here] += information @ theta
        if k:
            step = np.diag(DRIFT**-2.0)
            before = slice(2 * k - 2, 2 * k)
            matrix[before, before] += step
            matrix[here, here] += step
            matrix[before, here] -= step
            matrix[here, before] -= step
    covariance = np.asarray(np.linalg.inv(matrix), np.float64)
    return (covariance @ vector).reshape(4, 2), covariance


def test_smoothed_beliefs_are_those_of_all_measurements_at_once() -> None:
    seen = [np.array(theta) for theta in ([1.0, 2.0], [1.2, 1.7], [0.8, 2.1], [1.1, 1.9])]
    means, covariance = jointly(seen)
    for k, belief in enumerate(smoothed(filtered(seen))):
        here = slice(2 * k, 2 * k + 2)
        np.testing.assert_allclose(belief.mean, means[k], rtol=1e-10)
        np.testing.assert_allclose(belief.covariance, covariance[here, here], rtol=1e-10)


def test_error_is_that_of_parameters_that_stand_still() -> None:
    """The drift is there to forget by: the truth has none."""
    random = np.random.default_rng(5)
    roots = [np.linalg.cholesky(np.linalg.inv(information)) for information in INFORMATION]
    errors = np.empty((4000, 4, 2))
    for draw in errors:
        theta = np.linalg.cholesky(START) @ random.standard_normal(2)
        seen = [theta + root @ random.standard_normal(2) for root in roots]
        draw[:] = [belief.mean - theta for belief in smoothed(filtered(seen))]
    stated = smoothed(filtered([np.zeros(2)] * 4))
    for k, belief in enumerate(stated):
        np.testing.assert_allclose(np.cov(errors[:, k].T), belief.error_covariance, rtol=0.1, atol=2e-3)
        assert np.all(np.diag(belief.error_covariance) <= np.diag(belief.covariance) * 1.0001)


@pytest.mark.parametrize("replaced", ["narrower", "elsewhere"])
def test_a_belief_that_was_replaced_says_nothing_of_what_was_before(replaced: str) -> None:
    events = filtered([np.array([1.0, 2.0])] * 4)
    other = (
        Belief(np.array([50.0, 2.0]), START, START)
        if replaced == "elsewhere"
        else Belief(events[1].after.mean, *2 * [1e-3 * np.eye(2)])
    )
    new = [
        TaughtEvent(other, other.updated(INFORMATION[2], INFORMATION[2] @ np.array([50.0, 2.0]))),
        events[3],
    ]
    result = smoothed([*events[:2], *new])
    np.testing.assert_array_equal(result[1].mean, events[1].after.mean)
    np.testing.assert_array_equal(result[1].covariance, events[1].after.covariance)
