"""Velocity of wear that moves on: followed beside theta, from beliefs before and after events.

An augmented Kalman filter: theta moves by the velocity, which changes little; no further run of the model is needed.
A random walk without it lags half a percent behind a drift.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief, symmetric
from observer_rt.engine.estimation.scalars import Parameter
from observer_rt.engine.learning.account import constants as c

Matrix = NDArray[np.float64]
FLOWS = (int(Parameter.NOZZLE_BIAS), int(Parameter.SEAT_BIAS))  # columns of theta that may move on


@dataclass(frozen=True, eq=False)
class Velocity:
    """Change an event of the two biases: mean (2,), its covariance with theta (m, 2), and its own (2, 2)."""

    mean: Matrix
    across: Matrix
    covariance: Matrix


@dataclass(frozen=True, eq=False)
class Moving:
    """Belief about theta one event later, and about its velocity then."""

    belief: Belief
    velocity: Velocity

    def after(self, learned: Belief) -> Velocity:
        """The velocity, when `learned` is believed of theta after the event."""
        before, velocity = self.belief, self.velocity
        gain = velocity.across.T @ before.information
        taught = before.covariance - learned.covariance
        return Velocity(
            velocity.mean + gain @ (learned.mean - before.mean),
            learned.covariance @ gain.T,
            symmetric(velocity.covariance - gain @ taught @ gain.T),
        )


def moving(belief: Belief, drift: Matrix, velocity: Velocity | None) -> Moving:
    """Moves a belief on by one event; drift: usual standard deviations (m,); velocity: None, where it begins."""
    usual = drift[list(FLOWS)]
    if velocity is None:
        velocity = Velocity(np.zeros(2), np.zeros((drift.size, 2)), np.diag((c.SPEED * usual) ** 2))
    else:
        turned = velocity.covariance + np.diag((c.TURNS * usual) ** 2)
        velocity = Velocity(velocity.mean, velocity.across, turned)
    flows = list(FLOWS)
    mean, across, moved = belief.mean.copy(), velocity.across.copy(), np.zeros_like(belief.covariance)
    mean[flows] += velocity.mean
    across[flows] += 0.5 * velocity.covariance
    moved[flows] = across.T
    moved[:, flows] += across
    across[flows] += 0.5 * velocity.covariance
    belief = Belief(mean, belief.covariance + moved, belief.error_covariance + moved)
    return Moving(belief, Velocity(velocity.mean, across, velocity.covariance))
