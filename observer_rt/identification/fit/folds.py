"""Prepares recordings for a fit: folds of few events, the gain of the line-pressure sensor; refuses clipped ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.identification.fit.masses import MeanMass
from observer_rt.identification.likelihood.events import open_time, rail_pressure_before
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.operating_points import POINT_DURATION, distinct, events_by_point
from observer_rt.model.accuracy import StatedAccuracy

T = TypeVar("T")

RING_DOWN = 5e-3  # s after the last closing that count: the line forgets within less
_RUN = 5  # equal samples at the edge of a range that are no chance
_FINE = 0.2  # share of equal neighbours, below which a signal is so noisy that a run of them is none
_FEW = 6  # injections, below which intervals are wide
BETWEEN_SAMPLES = 0.005  # of a mass, by instants SLOW apart: of the richer plant, every fifth sample
FAST, SLOW = 10e-6, 50e-6  # s between samples: edges of the lift lost nothing, and that
WORTH_A_WORD = 0.001  # of a mass
OFFSET = 2.5 * MEGAPASCAL  # standard deviation of the sensor's offset
DRIFT = 0.05 * MEGAPASCAL  # and of what it differs by from recording to recording


@dataclass(frozen=True, eq=False)
class Fold:
    """A part of the data that can be left out of a fit: a recording, or some events of the only one."""

    measurement: Measurement  # with shortened events
    recording: int  # its number
    weights: NDArray[np.float64]  # (events,) number of injections for which each event stands
    weighed: MeanMass | None = None  # None: not measured
    rate_shape: bool = False  # whether a measured rate counts sample by sample, and not by its integrals alone

    def mass_residuals(self, masses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean of modelled masses (events,) [kg] beside the measured one, in standard deviations (1,), or (0,)."""
        if self.weighed is None:
            return np.zeros(0)
        mean = np.average(masses, weights=self.weights)
        return np.array([(mean - self.weighed.mass) / self.weighed.sigma])


def folds_of(recordings: Sequence[Measurement], weighed: Mapping[int, MeanMass]) -> tuple[Fold, ...]:
    """Every recording as a fold; a single recording is divided by operating points, or else into halves.

    With a measured mass it stays whole, for that is of all injections. weighed: masses by number of the recording.
    """
    short = []
    for recording in recordings:
        tail = round(RING_DOWN * recording.recording.sample_rate)
        events = tuple(replace(e, end=min(e.end, e.openings[-1].last + tail)) for e in recording.events)
        short.append(replace(recording, events=events))
    if len(short) > 1 or len(short[0].events) == 1 or weighed:
        groups = [(number, list(recording.events)) for number, recording in enumerate(short)]
    else:
        points = events_by_point(short[0])
        if len(points) == 1:
            half = (len(points[0]) + 1) // 2
            points = [points[0][:half], points[0][half:]]
        groups = [(0, events) for events in points]
    return tuple(
        Fold(replace(short[n], events=tuple(events)), n, np.ones(len(events)), weighed.get(n)) for n, events in groups
    )


def by_meter(fold: Fold, meter: tuple[float, ...]) -> Fold:
    """A fold whose rate has a meter of these time constants [s]."""
    recording = replace(fold.measurement.recording, meter=meter)
    return replace(fold, measurement=replace(fold.measurement, recording=recording))


def thinned(fold: Fold, most: int) -> Fold:
    """At most so many events of each operating point, spread evenly."""
    kept = [
        (event, len(point) / min(most, len(point)))
        for point in events_by_point(fold.measurement)
        for event in spread(point, most)
    ]
    kept.sort(key=lambda item: item[0].start)
    measurement = replace(fold.measurement, events=tuple(event for event, _ in kept))
    return replace(fold, measurement=measurement, weights=np.array([share for _, share in kept]))


def spread(items: Sequence[T], most: int) -> list[T]:
    """At most so many items, spread evenly."""
    return [items[n] for n in np.linspace(0, len(items) - 1, min(most, len(items))).round().astype(int)]


def standstill(measurement: Measurement) -> tuple[float, float]:
    """Means of line minus rail pressure, and of rail pressure, before the injections [Pa]."""
    recording = measurement.recording
    shut = [slice(event.start, event.openings[0].first) for event in measurement.events]
    pressures = recording.line_pressure, recording.rail_pressure
    line, rail = (float(np.mean([np.mean(pressure[part]) for part in shut])) for pressure in pressures)
    return line - rail, rail


def refuse_clipped(recordings: Sequence[Measurement]) -> None:
    """Raise `UserError` for a signal that stays at the edge of its range."""
    for measurement in recordings:
        recording = measurement.recording
        signals = (
            ("rail_pressure", recording.rail_pressure, MEGAPASCAL, "MPa", True),
            ("line_pressure", recording.line_pressure, MEGAPASCAL, "MPa", True),
            ("needle_lift", recording.needle_lift, MICROMETRE, "um", False),  # clipped at 0 it serves
        )
        for name, values, unit, symbol, both in signals:
            if (clipped := _clipped(values, both)) is not None:
                level, count = clipped
                raise UserError(
                    f"{recording.path or 'recording'}, {name}",
                    f"is clipped: {count} samples in a row are exactly {level / unit:.6g} {symbol}, the edge of "
                    "its range",
                    "record with a wider range",
                )


def _clipped(values: NDArray[np.float64], both: bool) -> tuple[float, int] | None:
    """The edge at which a noisy signal stays, and its longest run there; None for a signal that does not."""
    present = values[np.isfinite(values)]
    if present.size < 2 or float(np.mean(np.diff(present) == 0.0)) > _FINE:
        return None  # so coarse, or so smooth, that equal samples say nothing
    for edge in (np.max, np.min)[: 2 if both else 1]:
        level = float(edge(present))
        steps = np.flatnonzero(np.diff(np.concatenate(([False], present == level, [False]))))
        longest = int(np.max(steps[1::2] - steps[::2]))
        if longest >= _RUN:
            return level, longest
    return None


def share_between_samples(measurement: Measurement) -> float:
    """Standard deviation of a mass, as a share, by edges of the lift between slow instants; 0 for means."""
    return 0.0 if measurement.means else BETWEEN_SAMPLES * max(0.0, (measurement.interval - FAST) / (SLOW - FAST))


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
    if len(events) < _FEW:
        result.append(f"{len(events)} injections only: intervals are wide; record {_FEW} or more")
    between = max(map(share_between_samples, recordings))
    if between > WORTH_A_WORD:
        result.append(
            f"samples are instants at {recordings[0].recording.sample_rate:g} Hz: between them the edges of the lift "
            f"are lost, and masses are {between:.1%} (1 sigma) less sure, even if the verdict is adequate. Fit at "
            "the full rate of the bench (100 kHz); if samples are means over the sample period, state it: "
            'meaning = "mean" in [sampling] of the bench file (--bench)'
        )
    return result


def sensor_gain(recordings: Sequence[Measurement], calibration: StatedAccuracy) -> float:
    """The gain g of y = (1 + g) p_L + o by standstill at the pressures of all recordings; 0 for exact sensors.

    A fit cannot find it: with one pressure in each recording the offsets would absorb it, and falsify the level.
    """
    if calibration.gain == 0.0:
        return 0.0
    offsets, pressures = np.array([standstill(one) for one in recordings]).T
    by = np.column_stack((np.ones_like(pressures), pressures))
    information = by.T @ by / DRIFT**2 + np.diag([OFFSET**-2, calibration.gain**-2])
    return float(np.linalg.solve(information, by.T @ offsets / DRIFT**2)[1])
