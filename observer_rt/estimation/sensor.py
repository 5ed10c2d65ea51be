"""The line-pressure sensor: a first-order lag, and an offset added elsewhere."""

import math

from numba import njit

LAG_UNIT = 1e-4  # s, in which the lag is counted, so that all parameters are of order one


@njit(cache=True, nogil=True)
def lagged(
    indicated: float, pressure_start: float, pressure_end: float, interval: float, lag: float
) -> float:
    """What a sensor with time constant `lag` [s] indicates an interval [s] later; exact for a linear pressure."""
    if lag < 1e-3 * interval:
        return pressure_end - lag / interval * (pressure_end - pressure_start)
    decay = math.exp(-interval / lag)
    ramp = 1.0 - lag / interval * (1.0 - decay)
    return decay * indicated + (1.0 - decay) * pressure_start + ramp * (pressure_end - pressure_start)


@njit(cache=True, nogil=True)
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
