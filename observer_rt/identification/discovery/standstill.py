"""Standstill: what the signals say of sensors and line while the needle is shut, before any injection is judged."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import dead_band
from observer_rt.foundation.documents import Entry, Figure
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MM3_PER_MS
from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT
from observer_rt.identification.likelihood.likelihood import JointLikelihood, JudgedModel
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.model.effect import Effect
from observer_rt.model.effective import Coefficients, EffectiveModel
from observer_rt.model.effects import VOCABULARY

SETTLED = 15e-3  # s after a closing, from which the line is at rest but for some ringing
# Name of a recording.
_FILE = Entry(lambda number, findings: None if number is None else findings.files[number], str | None)
_FEWEST_BLOCKS = 4
OFFSET_TOLERATED, SLOPE_TOLERATED = 0.02 * MEGAPASCAL, 2 * MEGAPASCAL  # Pa, Pa/s


@dataclass(frozen=True)
class StandstillFigure:
    """A figure of the standstill, in `unit`.

    recording: its number, None for all together; sigma: standard deviation, nan for a noise level.
    """

    id: str
    recording: Annotated[int | None, _FILE]
    value: Figure
    sigma: Figure
    unit: str
    passed: bool


def standstill_checks(
    measured: Sequence[Measurement],
    likelihood: JointLikelihood,
    nominal: EffectiveModel,
    amended: EffectiveModel,
    usual_offset: float = 0.0,
) -> tuple[StandstillFigure, ...]:
    """Offset, slope and noise of every recording, and the lag of a sensor over all recordings.

    usual_offset: of the line-pressure sensor on the healthy injector [Pa]. A lag does not show at rest, a ringing
    recorded late being a ringing like any other: it is its residual beside the amended model, from opening on.
    """
    result: list[StandstillFigure] = []
    for number, measurement in enumerate(measured):
        result += _of_recording(number, measurement, nominal.coefficients, usual_offset)
    judged = likelihood.judge(amended)
    for effect in VOCABULARY.values():
        moved = effect.apparent and likelihood.judge(effect.apply(amended, (effect.parameters[0].dead_zone,)))
        if judged and moved:
            result.append(_apparent(effect, judged, moved))
    return tuple(result)


def _of_recording(
    number: int, measurement: Measurement, c: Coefficients, usual_offset: float
) -> list[StandstillFigure]:
    noise, result = measurement.noise, list[StandstillFigure]()
    means = _period_means(measurement, 2.0 * math.pi / c.line.mode)
    if means is not None:
        offset, scatter = float(np.mean(means.differences)), float(np.std(means.differences, ddof=1))
        moved = offset - usual_offset, scatter / math.sqrt(means.differences.size)
        result = [
            _judged("rail_line_offset", number, *moved, MEGAPASCAL, "MPa", OFFSET_TOLERATED),
            _judged("line_pressure_slope", number, *means.slope(), MEGAPASCAL, "MPa/s", SLOPE_TOLERATED),
        ]
    levels = [
        ("rail_pressure_noise", noise.rail_pressure / MEGAPASCAL, "MPa"),
        ("line_pressure_noise", noise.line_pressure / MEGAPASCAL, "MPa"),
        ("needle_lift_noise", noise.needle_lift / MICROMETRE, "um"),
    ]
    if not math.isnan(measurement.rate_noise):
        levels.append(("injection_rate_noise", measurement.rate_noise / MM3_PER_MS, "mm3/ms"))
    return result + [StandstillFigure(name, number, value, math.nan, unit, True) for name, value, unit in levels]


def _judged(
    name: str, number: int | None, value: float, sigma: float, si: float, unit: str, tolerated: float
) -> StandstillFigure:
    """A figure and its standard deviation [SI], which stands out beyond both that and its tolerance."""
    passed = abs(value) <= max(tolerated, SIGNIFICANT * sigma)
    return StandstillFigure(name, number, value / si, sigma / si, unit, passed)


@dataclass(frozen=True, eq=False)
class _PeriodMeans:
    """Means over whole periods of the line, in which its ringing cancels (b,), SI.

    differences: line minus rail pressure; times, lines: from the means of their stretch of standstill.
    """

    differences: NDArray[np.float64]
    times: NDArray[np.float64]
    lines: NDArray[np.float64]
    stretches: int

    def slope(self) -> tuple[float, float]:
        """Slope of the line pressure within the stretches, and its standard deviation [Pa/s]."""
        spread, freedom = float(self.times @ self.times), self.times.size - self.stretches - 1
        if not spread > 0.0 or freedom < 1:
            return 0.0, math.inf
        slope = float(self.times @ self.lines) / spread
        left = self.lines - slope * self.times
        return slope, math.sqrt(float(left @ left) / freedom / spread)


def _period_means(measurement: Measurement, period: float) -> _PeriodMeans | None:
    """None where too little of the needle's rest is there."""
    recording = measurement.recording
    signals = recording.time, recording.line_pressure, recording.rail_pressure
    size = max(1, round(period * recording.sample_rate))
    places = np.flatnonzero(_calm(measurement))
    moments = []
    for stretch in np.split(places, np.flatnonzero(np.diff(places) > 1) + 1):
        if stretch.size >= size:
            rows = stretch[: stretch.size - stretch.size % size].reshape(-1, size)
            time, line, rail = (signal[rows].mean(axis=1) for signal in signals)
            moments.append((line - rail, time - time.mean(), line - line.mean()))
    if sum(differences.size for differences, *_ in moments) < _FEWEST_BLOCKS:
        return None
    differences, times, lines = (np.concatenate(each) for each in zip(*moments, strict=True))
    return _PeriodMeans(differences, times, lines, len(moments))


def _calm(measurement: Measurement) -> NDArray[np.bool_]:
    """Samples (n,) with both pressures, SETTLED and more after the needle was last seen open, or not seen."""
    recording = measurement.recording
    opens, _ = dead_band(measurement.noise.needle_lift)
    every, settled = np.arange(recording.samples), round(SETTLED * recording.sample_rate)
    last_open = np.maximum.accumulate(np.where(recording.needle_lift <= opens, -settled - 1, every))
    finite = np.isfinite(recording.rail_pressure + recording.line_pressure)
    return np.asarray((every - last_open > settled) & finite, np.bool_)


def _apparent(effect: Effect, judged: Sequence[JudgedModel], moved: Sequence[JudgedModel]) -> StandstillFigure:
    """Size of an effect on top of a judged model by one Gauss-Newton step on the innovations, as if it were alone.

    moved: the model with the effect as small as it matters.
    """
    parameter = effect.parameters[0]
    here = np.concatenate([one.z for one in judged])
    slope = (np.concatenate([one.z for one in moved]) - here) / parameter.dead_zone
    length = float(slope @ slope)
    value = -float(slope @ here) / length if length > 0.0 else 0.0
    sigma = 1.0 / math.sqrt(length) if length > 0.0 else math.inf
    return _judged(f"apparent_{effect.id}", None, value, sigma, parameter.si, parameter.unit, parameter.dead_zone)
