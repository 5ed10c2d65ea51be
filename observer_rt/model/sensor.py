"""The line-pressure sensor: a first-order lag, its signal recorded late, and an offset added elsewhere."""

import math
from typing import NamedTuple

from observer_rt.foundation.compiled import compiled, inner
from observer_rt.model.effective import SensorTerms

LAG_UNIT = 1e-4  # s, in which the lag is counted, so that all parameters are of order one


class Sensor(NamedTuple):
    """The sensor of the model in force, as samples see it; what is learned of it comes on top.

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


@inner
def recorded(indicated_before: float, indicated: float, fraction: float) -> float:
    """What is recorded of a signal a `fraction` of a sample late, linear between samples; also of its slopes."""
    return indicated - fraction * (indicated - indicated_before)


@compiled
def recorded_mean(
    indicated_before: float, indicated: float, pressure_mean: float, lag_share: float, fraction: float
) -> float:
    """As `recorded`, of the mean over a sample interval instead of the value at its end; also of its slopes.

    pressure_mean: of the pressure; lag_share: lag over interval. The mean of a lagged signal is exactly that of the
    pressure less lag/T times its rise; a `fraction` of a sample earlier, as of the parabola through all three.
    """
    rise = indicated - indicated_before
    mean = pressure_mean - lag_share * rise
    bend = 3.0 * rise - 6.0 * (mean - indicated_before)
    return mean - fraction * rise + fraction * fraction * bend


@compiled
def lagged(
    indicated: float, pressure_start: float, pressure_end: float, interval: float, lag: float
) -> float:
    """What a sensor with time constant `lag` [s] indicates an interval [s] later; exact for a linear pressure."""
    if lag < 1e-3 * interval:
        return pressure_end - lag / interval * (pressure_end - pressure_start)
    decay = math.exp(-interval / lag)
    ramp = 1.0 - lag / interval * (1.0 - decay)
    return decay * indicated + (1.0 - decay) * pressure_start + ramp * (pressure_end - pressure_start)


@compiled
def lagged_slopes(
    indicated: float, pressure_start: float, pressure_end: float, interval: float, lag: float
) -> tuple[float, float, float, float]:
    """Derivatives of `lagged` with respect to indicated, pressure_start, pressure_end and lag [1/s]."""
    rise = pressure_end - pressure_start
    if lag < 1e-3 * interval:
        share = lag / interval
        return 0.0, share, 1.0 - share, -rise / interval
    decay = math.exp(-interval / lag)
    ramp = 1.0 - lag / interval * (1.0 - decay)
    decay_slope = decay * interval / (lag * lag)
    ramp_slope = -(1.0 - decay) / interval + lag / interval * decay_slope
    return (
        decay,
        1.0 - decay - ramp,
        ramp,
        (indicated - pressure_start) * decay_slope + rise * ramp_slope,
    )
