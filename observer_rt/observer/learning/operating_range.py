"""Adds variance away from the operating points learned at, by a Gaussian process."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from observer_rt.estimation.predictor import Window

REMEMBERED = 16  # points; the oldest is forgotten
# Distances over which what is wrong with a model changes: of rail pressure [p_0], of the logarithm of the time the
# needle is open, and of the widest seat area.
REACH = (0.4, 0.7, 0.4)
EVENT_SHARE = 0.3  # variance, of what one event tells of its own point, over that between distant points
UNSEEN = 2e-3  # of a rate: standard deviation of what a learned model still gets wrong at a point far from all seen


class EventPoint(NamedTuple):
    """An event's: rail pressure [p_0] at its opening, logarithm of the time [s] open, widest normalised area."""

    rail_pressure: float
    open_time: float
    area: float


def operating_point(window: Window, interval: float) -> EventPoint:
    """That of an event; interval of its samples [s]."""
    area = window.inputs[:, 1]
    samples = max(int(np.count_nonzero(area > 0.0)), 1)
    return EventPoint(
        float(window.inputs[window.opening, 0]), math.log(samples * interval), float(np.max(area))
    )


def unfamiliarity(point: EventPoint, learned_at: Sequence[EventPoint]) -> float:
    """Share 0 .. 1 of a model's error at a point that events elsewhere leave open, 1 with none.

    By a Gaussian process of unit variance, whose covariance falls off with the squared distance over `REACH`:
    Rasmussen, Williams, Gaussian Processes for Machine Learning, equation (2.26).
    """
    if not learned_at:
        return 1.0
    points = np.array([*learned_at, point]) / REACH
    covariance = np.exp(-0.5 * np.sum((points[:, None, :] - points[None, :, :]) ** 2, axis=2))
    among, across = covariance[:-1, :-1], covariance[:-1, -1]
    told = across @ np.linalg.solve(among + EVENT_SHARE * np.eye(len(learned_at)), across)
    return math.sqrt(max(1.0 - float(told), 0.0))


def remembered(learned_at: Sequence[EventPoint], point: EventPoint) -> tuple[EventPoint, ...]:
    """The points with one more, the newest last."""
    return (*learned_at, point)[-REMEMBERED:]
