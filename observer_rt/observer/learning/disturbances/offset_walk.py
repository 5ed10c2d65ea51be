"""By how much the offset between line and rail pressure has moved since the event before, as standstill shows it."""

import math

import numpy as np

from observer_rt.estimation.posterior import Belief
from observer_rt.estimation.prediction_error import EventCost
from observer_rt.estimation.predictor import Window
from observer_rt.estimation.sensitivity import Parameter
from observer_rt.observer.learning.disturbances.levels import mask_of

SIGNIFICANT = 5.0  # standard deviations
_OFFSET = int(Parameter.LINE_PRESSURE_OFFSET)


def offset_move(window: Window, cost: EventCost) -> float:
    """What must be added to the offset [p_0] that an event was linearised at, by its samples at rest; 0 within noise.

    Innovations rather than pressures, for a leak lowers the line pressure at rest, too.
    """
    counts = window.resting & ~mask_of(window)
    counts[: cost.burn_in] = False
    slopes, innovations = cost.slopes[counts, _OFFSET], cost.innovations[counts]
    information = float(slopes @ slopes)
    if not information > 0.0:
        return 0.0
    move = -float(slopes @ innovations) / information
    return move if abs(move) * math.sqrt(information) > SIGNIFICANT * cost.sigma else 0.0


def moved(prior: Belief, move: float) -> Belief:
    """A belief whose offset has moved by about so much [p_0]."""
    change = np.zeros_like(prior.mean)
    change[_OFFSET] = move
    return Belief(prior.mean + change, prior.covariance, prior.error_covariance).widened(change)
