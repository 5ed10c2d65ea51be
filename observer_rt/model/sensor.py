"""The line-pressure sensor: a first-order lag, its signal recorded late, and an offset added elsewhere."""

import math
from typing import NamedTuple

from observer_rt.model.effective import SensorTerms

LAG_UNIT = 1e-4  # s, in which the lag is counted, so that all parameters are of order one


class Sensor(NamedTuple):
    """The sensor of the model in force, as samples see it, before the learned corrections.

    Sample k + late of the recorded line pressure belongs to the time `fraction` (0 to 1) of a sample before that of
    sample k of the inputs.
    """

    lag: float = 0.0  # s
    offset: float = 0.0  # in units of p_0
    late: int = 0  # samples, < 0: early
    fraction: float = 0.0  # of a sample


def sensor_of(terms: SensorTerms, pressure_scale: float, interval: float) -> Sensor:
    """A sensor at a sample interval [s]; pressure_scale p_0 [Pa]."""
    delay = terms.delay / interval
    late = math.floor(delay)
    return Sensor(terms.lag, terms.offset / pressure_scale, late, delay - late)
