"""The line-pressure sensor at standstill: its offset in a recording, and its gain by several."""

from collections.abc import Sequence

import numpy as np

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.accuracy import StatedAccuracy

OFFSET_SIGMA = 2.5 * MEGAPASCAL  # standard deviation of the sensor's offset
DRIFT_SIGMA = 0.05 * MEGAPASCAL  # standard deviation by which it differs from recording to recording


def standstill(measurement: Measurement) -> tuple[float, float]:
    """Means of line minus rail pressure, and of rail pressure, before the injections [Pa]."""
    recording = measurement.recording
    shut = [slice(event.start, event.openings[0].first) for event in measurement.events]
    pressures = recording.line_pressure, recording.rail_pressure
    line, rail = (float(np.mean([np.mean(pressure[part]) for part in shut])) for pressure in pressures)
    return line - rail, rail


def sensor_gain(recordings: Sequence[Measurement], calibration: StatedAccuracy) -> float:
    """The gain g of y = (1 + g) p_L + o by standstill at the pressures of all recordings; 0 for exact sensors.

    A fit cannot find it: with one pressure in each recording the offsets would absorb it, and falsify the level.
    """
    if calibration.gain == 0.0:
        return 0.0
    offsets, pressures = np.array([standstill(one) for one in recordings]).T
    by = np.column_stack((np.ones_like(pressures), pressures))
    information = by.T @ by / DRIFT_SIGMA**2 + np.diag([OFFSET_SIGMA**-2, calibration.gain**-2])
    return float(np.linalg.solve(information, by.T @ offsets / DRIFT_SIGMA**2)[1])
