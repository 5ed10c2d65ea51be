"""What the closed needle tells: noise levels and the offset between line and rail pressure."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from observer_rt.estimation.gain import NoiseLevels
from observer_rt.observer.stream.state import RING, Observer, Reason

ENOUGH_SAMPLES = 10_000  # of standstill, before measured noise replaces the configured
FLOOR = NoiseLevels(rail_pressure=0.01e6, line_pressure=0.01e6, needle_lift=0.02e-6)
_ORDER = 4  # differences: order 4 leaves the ringing of the line below the noise even at 20 kHz
_GAIN = 70.0  # sum of squares of 1 4 6 4 1
_NEXT = -56.0  # sum of products of neighbours in 1 -4 6 -4 1
_TRUSTED = 200  # squares, from which on their mean tells a spike
_SPIKE = 36.0  # times the mean square: six sigma
_MASK = RING - 1
_NUMERICAL = int(Reason.NUMERICAL)


@njit(cache=True, nogil=True)
def gather(observer: Observer, position: int) -> None:
    """Take the sample at `position` into the statistics of the standstill."""
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    if not row.resting or row.interpolated or row.bridged != 0 or memory.unsynchronised_by == _NUMERICAL:
        memory.rest_run = 0
        return
    memory.rest_run += 1
    memory.rest_count += 1
    memory.offset_sum += row.line_pressure - observer.constants.sensor.offset - row.rail_pressure
    if memory.rest_run > _ORDER:
        a = observer.ring[(position - 4) & _MASK]
        b = observer.ring[(position - 3) & _MASK]
        c = observer.ring[(position - 2) & _MASK]
        d = observer.ring[(position - 1) & _MASK]
        count = memory.difference_count
        memory.rail_squares += _square(
            a.rail_pressure,
            b.rail_pressure,
            c.rail_pressure,
            d.rail_pressure,
            row.rail_pressure,
            memory.rail_squares,
            count,
            smoothing(row.rail_share),
        )
        memory.line_squares += _square(
            a.line_pressure,
            b.line_pressure,
            c.line_pressure,
            d.line_pressure,
            row.line_pressure,
            memory.line_squares,
            count,
        )
        memory.lift_squares += _square(
            a.needle_lift,
            b.needle_lift,
            c.needle_lift,
            d.needle_lift,
            row.needle_lift,
            memory.lift_squares,
            count,
        )
        memory.difference_count += 1


@njit(cache=True, nogil=True)
def smoothing(share: float) -> float:
    """By what interpolation with this share of the later neighbour reduces the square of a fourth difference.

    To the line, which follows slowly, an interpolated pressure is as noisy as its neighbours are.
    """
    kept = 1.0 - share
    return kept * kept + share * share + 2.0 * kept * share * _NEXT / _GAIN


@njit(cache=True, nogil=True)
def _square(
    a: float, b: float, c: float, d: float, e: float, total: float, count: int, smoothed: float = 1.0
) -> float:
    """Square of the fourth difference, a spike's limited to what the `count` squares before make plausible.

    smoothed: by what interpolation reduced it.
    """
    square = (a - 4 * (b + d) + 6 * c + e) ** 2 / smoothed
    if count < _TRUSTED:
        return float(square)
    return float(min(square, _SPIKE * total / count))


@dataclass(frozen=True)
class Standstill:
    """Statistics since the start: sample count, mean of y - o - u1 (in units of p_0), measured noise.

    o is the offset of the sensor in force: what is left is not known yet.
    """

    samples: int
    offset: float
    noise: NoiseLevels | None  # None until ENOUGH_SAMPLES


def standstill_of(record: np.void, pressure_scale: float) -> Standstill:
    """Read the statistics out of an observer's memory, or a closed event's; pressure_scale p_0 [Pa]."""
    samples = int(record["rest_count"])
    offset = float(record["offset_sum"]) / samples if samples else 0.0
    count = int(record["difference_count"])
    if count < ENOUGH_SAMPLES:
        return Standstill(samples, offset, None)
    noise = NoiseLevels(
        rail_pressure=max(
            FLOOR.rail_pressure, pressure_scale * math.sqrt(float(record["rail_squares"]) / count / _GAIN)
        ),
        line_pressure=max(
            FLOOR.line_pressure, pressure_scale * math.sqrt(float(record["line_squares"]) / count / _GAIN)
        ),
        needle_lift=max(FLOOR.needle_lift, math.sqrt(float(record["lift_squares"]) / count / _GAIN)),
    )
    return Standstill(samples, offset, noise)
