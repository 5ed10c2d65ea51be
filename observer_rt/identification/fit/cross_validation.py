"""Prepares recordings for a fit: folds of few events, measured masses; refuses signals that are clipped."""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM
from observer_rt.identification.likelihood.measurement import Measurement, open_time, rail_pressure_before
from observer_rt.identification.likelihood.operating_points import POINT_DURATION, distinct, events_by_point

T = TypeVar("T")

RING_DOWN = 5e-3  # s after the last closing that count: the line forgets within less
_RUN = 5  # equal samples at the edge of a range that are no chance
_FINE = 0.2  # share of equal neighbours, below which a signal is so noisy that a run of them is none
_FEW = 6  # injections, below which intervals are wide
BETWEEN_SAMPLES = 0.005  # of a mass, by instants SLOW apart: of the richer plant, every fifth sample
FAST, SLOW = 10e-6, 50e-6  # s between samples: edges of the lift lost nothing, and that
WORTH_A_WORD = 0.001  # of a mass
RECORDING, INJECTION, MASS, SIGMA = "recording", "injection", "mass_mg", "sigma_mg"
SHARE_SIGMA = 0.005  # of a mass whose uncertainty is not stated: a good injection analyser
LARGEST_MASS = 2000.0  # mg
_EXAMPLE = f"{RECORDING},{MASS} with lines such as healthy_60.csv,31.4"


@dataclass(frozen=True)
class MeasuredMasses:
    """Measured masses of a recording's injections [kg], each with its standard deviation.

    single: by the first sample of the injection; mean: of all injections, None where they were not weighed together.
    """

    single: Mapping[int, tuple[float, float]]
    mean: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Fold:
    """Data that are left out to judge a fit by: a recording, or some events of the only one.

    measurement: its events shortened; recording: number of its recording; weights: how
    many injections of the recording each event stands for (events,); weighed: masses, None where none are measured.
    """

    measurement: Measurement
    recording: int
    weights: NDArray[np.float64]
    weighed: MeasuredMasses | None = None

    def mass_residuals(self, masses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Modelled masses (events,) [kg] beside the measured ones, in standard deviations (m,)."""
        if self.weighed is None:
            return np.zeros(0)
        single = self.weighed.single
        residuals = [
            (mass - single[first][0]) / single[first][1]
            for event, mass in zip(self.measurement.events, masses, strict=True)
            if (first := event.openings[0].first) in single
        ]
        if self.weighed.mean is not None:
            mean, sigma = self.weighed.mean
            residuals.append((float(np.average(masses, weights=self.weights)) - mean) / sigma)
        return np.array(residuals)


def folds_of(recordings: Sequence[Measurement], weighed: Mapping[int, MeasuredMasses]) -> tuple[Fold, ...]:
    """Every recording as a fold; of a single one its operating points, or else its events by halves.

    weighed: by the number of the recording.
    """
    short = []
    for recording in recordings:
        tail = round(RING_DOWN * recording.recording.sample_rate)
        events = tuple(replace(e, end=min(e.end, e.openings[-1].last + tail)) for e in recording.events)
        short.append(replace(recording, events=events))
    if len(short) > 1 or len(short[0].events) == 1:
        groups = [(number, list(recording.events)) for number, recording in enumerate(short)]
    else:
        points = events_by_point(short[0])
        if len(points) == 1:
            half = (len(points[0]) + 1) // 2
            points = [points[0][:half], points[0][half:]]
        groups = [(0, events) for events in points]
    return tuple(
        Fold(replace(short[n], events=tuple(events)), n, np.ones(len(events)), weighed.get(n))
        for n, events in groups
    )


def thinned(fold: Fold, most: int) -> Fold:
    """At most so many events of each operating point, spread evenly."""
    kept = [
        (event, len(point) / min(most, len(point)))
        for point in events_by_point(fold.measurement)
        for event in spread(point, most)
    ]
    kept.sort(key=lambda item: item[0].start)
    events = tuple(event for event, _ in kept)
    return replace(
        fold,
        measurement=replace(fold.measurement, events=events),
        weights=np.array([share for _, share in kept]),
    )


def spread(items: Sequence[T], most: int) -> list[T]:
    """At most so many items, spread evenly."""
    return [items[n] for n in np.linspace(0, len(items) - 1, min(most, len(items))).round().astype(int)]


def standstill(measurement: Measurement) -> tuple[float, float]:
    """Means of line minus rail pressure, and of rail pressure, before the injections [Pa]."""
    recording = measurement.recording
    shut = [slice(event.start, event.openings[0].first) for event in measurement.events]
    line, rail = (
        float(np.mean([np.mean(pressure[each]) for each in shut]))
        for pressure in (recording.line_pressure, recording.rail_pressure)
    )
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
            clipped = _clipped(values, both)
            if clipped is not None:
                level, count = clipped
                raise UserError(
                    f"{recording.path or 'recording'}, {name}",
                    f"is clipped: {count} samples in a row are exactly {level / unit:.6g} {symbol}, the edge of "
                    "its range",
                    "record with a wider range",
                )


def _clipped(values: NDArray[np.float64], both: bool) -> tuple[float, int] | None:
    """The edge at which a noisy signal stays, and its longest run there; None where it does not."""
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
    """Standard deviation of a mass, as a share: instants far apart miss where the needle leaves and meets its seat.

    A mean over the sample period does not, for it holds what flowed in between.
    """
    return (
        0.0
        if measurement.means
        else BETWEEN_SAMPLES * max(0.0, (measurement.interval - FAST) / (SLOW - FAST))
    )


def warnings(recordings: Sequence[Measurement]) -> list[str]:
    """Reasons why a result is less sure, in sentences."""
    result = []
    events = [(one, event) for one in recordings for event in one.events]
    pressures = distinct(rail_pressure_before(event, one.recording) for one, event in events)
    durations = np.array([open_time(event, one.recording) for one, event in events])
    one_duration = float(np.ptp(durations)) < POINT_DURATION
    if pressures == 1 and one_duration:
        result.append(
            "one operating point only: what is fitted holds there and nowhere else for sure; add recordings at other "
            "rail pressures and energizing times, such as 60, 100 and 140 MPa by 0.6 and 1.9 ms"
        )
    elif pressures == 1:
        result.append("one rail pressure only: add recordings at others, such as 60 and 140 MPa")
    elif one_duration:
        result.append("one energizing time only: add recordings with others, such as 0.6 and 1.9 ms")
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


def read_masses(path: Path, recordings: Sequence[Measurement]) -> dict[int, MeasuredMasses]:
    """Measured masses by the number of the recording.

    CSV: `recording` (file name), `mass_mg`, and, where there are such columns, `injection` (number in the recording
    from 1, pilot and main as one; empty: the mean of all) and `sigma_mg` (standard deviation, else 0.5 %).
    Raises `UserError` naming the line.
    """
    with file_errors(path), path.open(encoding="utf-8-sig", newline="") as file:
        try:
            rows = list(csv.reader(file))
        except (csv.Error, UnicodeDecodeError) as error:
            raise UserError(str(path), f"is no CSV: {error}", f"write {_EXAMPLE}") from None
    if not rows:
        raise UserError(str(path), "is empty", f"write {_EXAMPLE}")
    header = [name.strip() for name in rows[0]]
    _check_header(f"{path}, line 1", header)
    single: dict[int, dict[int, tuple[float, float]]] = {}
    means: dict[int, tuple[float, float]] = {}
    for line, cells in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in cells):
            continue
        location = f"{path}, line {line}"
        if len(cells) != len(header):
            raise UserError(
                location, f"has {len(cells)} cells, the header {len(header)}", "give every column a value"
            )
        row = {name: cell.strip() for name, cell in zip(header, cells, strict=True)}
        number = _recording(location, row[RECORDING], recordings)
        mass = _mass(location, row)
        first = _first_sample(location, row.get(INJECTION, ""), recordings[number])
        masses_by_injection = means if first is None else single.setdefault(number, {})
        key = number if first is None else first
        if key in masses_by_injection:
            raise UserError(
                location, f"another line has the mass of {row[RECORDING]}, too", "give every mass once"
            )
        masses_by_injection[key] = mass
    numbers = sorted(single.keys() | means.keys())
    if not numbers:
        raise UserError(str(path), "holds no mass", f"write {_EXAMPLE}")
    return {number: MeasuredMasses(single.get(number, {}), means.get(number)) for number in numbers}


def _check_header(location: str, header: Sequence[str]) -> None:
    allowed = (RECORDING, INJECTION, MASS, SIGMA)
    for name in (RECORDING, MASS):
        if name not in header:
            raise UserError(location, f"has no column {name}", f"known columns: {', '.join(allowed)}")
    for name in header:
        if name not in allowed or header.count(name) > 1:
            problem = "is given twice" if name in allowed else "is unknown"
            raise UserError(location, f"column '{name}' {problem}", f"known columns: {', '.join(allowed)}")


def _recording(location: str, name: str, recordings: Sequence[Measurement]) -> int:
    paths = [one.recording.path for one in recordings]
    numbers = [n for n, path in enumerate(paths) if path is not None and name in (path.name, str(path))]
    if len(numbers) != 1:
        names = ", ".join(sorted({path.name for path in paths if path is not None}))
        problem = "is none of the recordings" if not numbers else "is the name of several recordings"
        raise UserError(location, f"'{name}' {problem}", f"name one as on the command line: {names}")
    return numbers[0]


def _mass(location: str, row: Mapping[str, str]) -> tuple[float, float]:
    """Mass and standard deviation [kg]."""
    mass = _number(f"{location}, {MASS}", row[MASS], LARGEST_MASS)
    stated = row.get(SIGMA, "")
    sigma = _number(f"{location}, {SIGMA}", stated, mass) if stated else SHARE_SIGMA * mass
    return mass * MILLIGRAM, sigma * MILLIGRAM


def _number(location: str, text: str, highest: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value <= highest:
        raise UserError(location, f"'{text}' is out of range", f"give mg above 0 and up to {highest:g}")
    return value


def _first_sample(location: str, text: str, measurement: Measurement) -> int | None:
    """First sample of the injection of this number; None for the mean of all."""
    if not text:
        return None
    time = measurement.recording.time
    left_out = np.searchsorted(time, [injection.time for injection in measurement.injections.left_out])
    firsts = sorted([event.openings[0].first for event in measurement.events] + left_out.tolist())
    try:
        number = int(text)
    except ValueError:
        number = 0
    if not 1 <= number <= len(firsts):
        raise UserError(
            f"{location}, {INJECTION}", f"'{text}' is none of them", f"give 1 to {len(firsts)}, or nothing"
        )
    return int(firsts[number - 1])
