"""Standstill: what the signals say of sensors and line while the needle is shut, before any injection is judged."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from observer_rt.core.stream.stream import dead_band
from observer_rt.foundation.documents import Entry, Figure
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MM3_PER_MS, Bools, Floats
from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT_EXCESS
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
    """A figure of the standstill, in `unit`; recording: None for all together; sigma: nan for a noise level."""

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

    usual_offset: of the healthy line-pressure sensor [Pa]. Nothing at rest shows a lag, for
    late ringing looks like any other: it is found beside the amended model, from the opening on.
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
    stretches = _period_means(measurement, 2.0 * math.pi / c.line.mode)
    if sum(one.differences.size for one in stretches) >= _FEWEST_BLOCKS:
        means = _PeriodMeans(*map(np.concatenate, zip(*stretches, strict=True)))
        offset, scatter = float(np.mean(means.differences)), float(np.std(means.differences, ddof=1))
        moved = offset - usual_offset, scatter / math.sqrt(means.differences.size)
        slope = _slope(means, len(stretches))
        result = [
            _judged("rail_line_offset", number, *moved, MEGAPASCAL, "MPa", OFFSET_TOLERATED),
            _judged("line_pressure_slope", number, *slope, MEGAPASCAL, "MPa/s", SLOPE_TOLERATED),
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
    """A figure that passes within `tolerated` or SIGNIFICANT_EXCESS sigmas; value, sigma and tolerated are in SI."""
    passed = abs(value) <= max(tolerated, SIGNIFICANT_EXCESS * sigma)
    return StandstillFigure(name, number, value / si, sigma / si, unit, passed)


class _PeriodMeans(NamedTuple):
    """Means over whole periods of the line, in which its ringing cancels, (b,) each, SI."""

    differences: Floats  # line minus rail pressure
    times: Floats  # from the mean of their stretch of standstill
    lines: Floats  # pressures, from the mean of their stretch of standstill


def _period_means(measurement: Measurement, period: float) -> list[_PeriodMeans]:
    recording = measurement.recording
    signals = recording.time, recording.line_pressure, recording.rail_pressure
    size = max(1, round(period * recording.sample_rate))
    calm = np.flatnonzero(_calm(measurement))
    means = []
    for stretch in np.split(calm, np.flatnonzero(np.diff(calm) > 1) + 1):
        if stretch.size >= size:
            rows = stretch[: stretch.size - stretch.size % size].reshape(-1, size)
            time, line, rail = (signal[rows].mean(axis=1) for signal in signals)
            means.append(_PeriodMeans(line - rail, time - time.mean(), line - line.mean()))
    return means


def _slope(means: _PeriodMeans, stretches: int) -> tuple[float, float]:
    """Slope of the line pressure within the stretches, and its standard deviation [Pa/s]."""
    spread, freedom = float(means.times @ means.times), means.times.size - stretches - 1
    if not spread > 0.0 or freedom < 1:
        return 0.0, math.inf
    slope = float(means.times @ means.lines) / spread
    left = means.lines - slope * means.times
    return slope, math.sqrt(float(left @ left) / freedom / spread)


def _calm(measurement: Measurement) -> Bools:
    """Samples (n,) with both pressures, SETTLED and more after the last one with an open or unknown needle."""
    recording = measurement.recording
    opens, _ = dead_band(measurement.noise.needle_lift)
    every, settled = np.arange(recording.samples), round(SETTLED * recording.sample_rate)
    last_open = np.maximum.accumulate(np.where(recording.needle_lift <= opens, -settled - 1, every))
    finite = np.isfinite(recording.rail_pressure + recording.line_pressure)
    return np.asarray((every - last_open > settled) & finite, np.bool_)


def _apparent(effect: Effect, judged: Sequence[JudgedModel], moved: Sequence[JudgedModel]) -> StandstillFigure:
    """Size of an effect beside a judged model, by one Gauss-Newton step. moved: with the effect at its dead zone."""
    parameter = effect.parameters[0]
    here = np.concatenate([one.z for one in judged])
    slope = (np.concatenate([one.z for one in moved]) - here) / parameter.dead_zone
    length = float(slope @ slope)
    value = -float(slope @ here) / length if length > 0.0 else 0.0
    sigma = 1.0 / math.sqrt(length) if length > 0.0 else math.inf
    return _judged(f"apparent_{effect.id}", None, value, sigma, parameter.si, parameter.unit, parameter.dead_zone)
