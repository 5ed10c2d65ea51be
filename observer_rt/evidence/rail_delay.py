"""A rail pressure as it was before its channel delayed it."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.evidence.measurement import Measurement

MOVING = 0.5  # of the noise: by so much the rail moves in events where its delay can be seen at all


def without_delay(measurement: Measurement, delay: float) -> NDArray[np.float64]:
    """Rail pressure [Pa] (n,) recorded `delay` [s] late.

    A rail at rest is returned as it is: to move its noise is to draw another noise, which some delay always likes.
    """
    rail = measurement.recording.rail_pressure
    if delay == 0.0 or not _moves(measurement):
        return rail
    sample = np.arange(rail.size)
    return np.asarray(np.interp(sample + delay / measurement.interval, sample, rail))


def _moves(measurement: Measurement) -> bool:
    """Whether the rail pressure moves within events."""
    rail, noise = measurement.recording.rail_pressure, measurement.noise.rail_pressure
    variance = np.mean([np.var(rail[event.start : event.end]) for event in measurement.events])
    return bool(variance > (1.0 + MOVING**2) * noise**2)
