"""The velocity of wear, against a Kalman filter of theta and velocity together."""

import numpy as np

from observer_rt.engine.estimation.belief import prior_belief
from observer_rt.engine.estimation.scalars import SCALARS, Parameter
from observer_rt.engine.learning.constants import SPEED, TURNS
from observer_rt.engine.learning.hypotheses import drift_of

WIDTH = SCALARS.width
FLOWS = [int(Parameter.NOZZLE_BIAS), int(Parameter.SEAT_BIAS)]
DRIFT = SCALARS.drift(1e8)
SIGMA = 0.004  # of a flow, by one event


def test_it_is_that_of_the_filter_of_both() -> None:
    """By events that measure both flows."""
    random = np.random.default_rng(2)
    belief, velocity = prior_belief(np.zeros(WIDTH), 1e-4 * np.eye(WIDTH)), None
    mean, covariance = np.zeros(4), np.diag([1e-4, 1e-4, *(SPEED * DRIFT[FLOWS]) ** 2])
    step = np.eye(4)
    step[:2, 2:] = np.eye(2)
    turning = np.diag([0.0, 0.0, *(TURNS * DRIFT[FLOWS]) ** 2])
    information, vector = np.zeros((WIDTH, WIDTH)), np.zeros(WIDTH)
    information[FLOWS, FLOWS] = SIGMA**-2
    for number in range(8):
        flows = 0.003 * number + random.normal(0.0, SIGMA, 2)
        moved = drift_of(belief, DRIFT, velocity)
        vector[FLOWS] = flows / SIGMA**2
        belief = moved.belief.updated(information, vector)
        velocity = moved.after(belief)
        covariance = step @ (covariance + (turning if number else 0.0)) @ step.T
        mean = step @ mean
        gain = covariance[:, :2] @ np.linalg.inv(covariance[:2, :2] + SIGMA**2 * np.eye(2))
        mean = mean + gain @ (flows - mean[:2])
        covariance = covariance - gain @ covariance[:2]
        np.testing.assert_allclose(belief.mean[FLOWS], mean[:2], atol=1e-9)
        np.testing.assert_allclose(velocity.mean, mean[2:], atol=1e-9)
        np.testing.assert_allclose(velocity.covariance, covariance[2:, 2:], atol=1e-12)
