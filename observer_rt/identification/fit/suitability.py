"""Suitability of recordings for a fit: clipped signals are refused, and reasons for doubt are stated."""

from collections.abc import Sequence

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, Floats
from observer_rt.identification.likelihood.events import open_time, rail_pressure_before
from observer_rt.identification.likelihood.excerpts import POINT_DURATION, distinct
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.accuracy import StatedAccuracy

FAST_INTERVAL, SLOW_INTERVAL = 10e-6, 50e-6  # s between samples: edges of the lift lost nothing, and SLOW_SHARE
SLOW_SHARE = 0.005  # standard deviation of a mass by slow instants: on the richer plant, by every fifth sample
LEAST_WARNED_SHARE = 0.001  # of a mass
_CLIPPED_RUN = 5  # equal samples at the edge of a range that are no chance
_MOST_EQUAL = 0.2  # share of equal neighbours, up to which a signal is so noisy that a run of them is none
_FEWEST_INJECTIONS = 6  # below which intervals are wide
OFFSET_SIGMA = 2.5 * MEGAPASCAL  # standard deviation of the sensor's offset
DRIFT_SIGMA = 0.05 * MEGAPASCAL  # standard deviation by which it differs from recording to recording


def refuse_clipped(recordings: Sequence[Measurement]) -> None:
    """Raise `UserError` for a signal that stays at the edge of its range."""
    for measurement in recordings:
        recording = measurement.recording
        for name in ("rail_pressure", "line_pressure", "needle_lift"):
            is_lift = name == "needle_lift"  # clipped at 0 it serves
            unit, symbol = (MICROMETRE, "um") if is_lift else (MEGAPASCAL, "MPa")
            if (clipped := _clipped(getattr(recording, name), both=not is_lift)) is not None:
                level, count = clipped
                edge = f"{level / unit:.6g} {symbol}, the edge of its range"
                problem = f"is clipped: {count} samples in a row are exactly {edge}"
                raise UserError(f"{recording.path or 'recording'}, {name}", problem, "record with a wider range")


def _clipped(values: Floats, both: bool) -> tuple[float, int] | None:
    """The edge at which a noisy signal stays, and its longest run there; None for a signal that does not."""
    present = values[np.isfinite(values)]
    if present.size < 2 or float(np.mean(np.diff(present) == 0.0)) > _MOST_EQUAL:
        return None  # so coarse, or so smooth, that equal samples say nothing
    for edge in (np.max, np.min)[: 2 if both else 1]:
        level = float(edge(present))
        steps = np.flatnonzero(np.diff(np.concatenate(([False], present == level, [False]))))
        longest = int(np.max(steps[1::2] - steps[::2]))
        if longest >= _CLIPPED_RUN:
            return level, longest
    return None


def share_between_samples(measurement: Measurement) -> float:
    """Standard deviation of a mass, as a share, by edges of the lift between slow instants; 0 for means."""
    beyond_fast = max(0.0, (measurement.interval - FAST_INTERVAL) / (SLOW_INTERVAL - FAST_INTERVAL))
    return 0.0 if measurement.means else SLOW_SHARE * beyond_fast


def warnings(recordings: Sequence[Measurement]) -> list[str]:
    """Reasons for which a fit of these recordings is uncertain, in sentences."""
    result = []
    events = [(one, event) for one in recordings for event in one.events]
    pressures = distinct(rail_pressure_before(event, one.recording) for one, event in events)
    durations = np.array([open_time(event, one.recording) for one, event in events])
    lacking = ["one rail pressure"] * (pressures == 1)
    lacking += ["one energizing time"] * bool(np.ptp(durations) < POINT_DURATION)
    if lacking:
        result.append(
            f"{' and '.join(lacking)} only: what is fitted holds there and nowhere else for sure; add recordings at "
            "others, such as 60, 100 and 140 MPa by 0.6 and 1.9 ms"
        )
    if len(events) < _FEWEST_INJECTIONS:
        result.append(f"{len(events)} injections only: intervals are wide; record {_FEWEST_INJECTIONS} or more")
    between = max(map(share_between_samples, recordings))
    if between > LEAST_WARNED_SHARE:
        result.append(
            f"samples are instants at {recordings[0].recording.sample_rate:g} Hz: between them the edges of the lift "
            f"are lost, and masses are {between:.1%} (1 sigma) less sure, even if the verdict is adequate. Fit at "
            "the full rate of the bench (100 kHz); if samples are means over the sample period, state it: "
            'meaning = "mean" in [sampling] of the bench file (--bench)'
        )
    return result


def standstill(measurement: Measurement) -> tuple[float, float]:
    """Means of line minus rail pressure, and of rail pressure, before the injections [Pa]."""
    recording = measurement.recording
    shut = [slice(event.start, event.openings[0].first) for event in measurement.events]
    pressures = recording.line_pressure, recording.rail_pressure
    line, rail = (float(np.mean([np.mean(pressure[part]) for part in shut])) for pressure in pressures)
    return line - rail, rail


def sensor_gain(recordings: Sequence[Measurement], calibration: StatedAccuracy) -> float:
    """Gain g of y = (1 + g) p_L + o by standstill at all pressures, 0 if exact; a fit's offsets would absorb it."""
    if calibration.gain == 0.0:
        return 0.0
    offsets, pressures = np.array([standstill(one) for one in recordings]).T
    by = np.column_stack((np.ones_like(pressures), pressures))
    information = by.T @ by / DRIFT_SIGMA**2 + np.diag([OFFSET_SIGMA**-2, calibration.gain**-2])
    return float(np.linalg.solve(information, by.T @ offsets / DRIFT_SIGMA**2)[1])
