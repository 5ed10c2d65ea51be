"""Gain of the line-pressure sensor over the rail's, from all recordings at rest together, taken out before a fit.

With one pressure a recording the offsets of the recordings would absorb it, and the level with it; with several no
model explains it.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.fit.cross_validation import MeasuredMasses, standstill
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.accuracy import StatedAccuracy

OFFSET = 2.5 * MEGAPASCAL  # standard deviation of the sensor's offset
DRIFT = 0.05 * MEGAPASCAL  # and of what it differs by from recording to recording


def sensor_gain(recordings: Sequence[Measurement], calibration: StatedAccuracy) -> float:
    """The gain g of y = (1 + g) p_L + o by rest at the pressures of the recordings; 0 of sensors without any."""
    if calibration.gain == 0.0:
        return 0.0
    offsets, pressures = np.array([standstill(one) for one in recordings]).T
    by = np.column_stack((np.ones_like(pressures), pressures))
    information = by.T @ by / DRIFT**2 + np.diag([OFFSET**-2, calibration.gain**-2])
    return float(np.linalg.solve(information, by.T @ offsets / DRIFT**2)[1])


def without_gain(recordings: Sequence[Measurement], gain: float, level: float) -> list[Measurement]:
    """Recordings in the rail sensor's units; level: factor from flows in these to measured ones."""
    result = []
    for measurement in recordings:
        recording, rate = measurement.recording, measurement.recording.injection_rate
        changed = replace(
            recording,
            line_pressure=recording.line_pressure / (1.0 + gain),
            injection_rate=None if rate is None else rate / level,
        )
        result.append(replace(measurement, recording=changed))
    return result


def masses_without(weighed: Mapping[int, MeasuredMasses], level: float) -> dict[int, MeasuredMasses]:
    """Measured masses in the same units."""

    def of(mass: tuple[float, float]) -> tuple[float, float]:
        return mass[0] / level, mass[1] / level

    return {
        number: MeasuredMasses(
            {first: of(mass) for first, mass in one.single.items()},
            None if one.mean is None else of(one.mean),
        )
        for number, one in weighed.items()
    }


def own_accuracy(weighed: Sequence[MeasuredMasses]) -> float:
    """Share by which measured masses are known, all of them alike: what one of them is."""
    masses = [mass for one in weighed for mass in (*one.single.values(), one.mean) if mass is not None]
    return float(np.median([sigma / mass for mass, sigma in masses])) if masses else math.nan
