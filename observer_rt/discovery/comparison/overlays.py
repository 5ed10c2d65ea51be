"""Which injections the report shows, and their signals: measured, by the model as given, by the amended one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.discovery.comparison.gaps import ModelGaps, PointGap
from observer_rt.discovery.search.result import Discovery
from observer_rt.evidence.measurement import Measurement
from observer_rt.evidence.open_loop import Simulated, simulated
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.model.effective import EffectiveModel

SHOWN_RINGING = 6e-3  # s after the last closing


@dataclass(frozen=True, eq=False)
class Overlay:
    """One injection: time [s] (n,) from its opening, and signals (n,) in SI; None for what there is not.

    noise_floor: of the line pressure [Pa]: what noise alone leaves between model and measurement.
    """

    title: str
    time: NDArray[np.float64]
    lift: NDArray[np.float64]
    line_pressure: NDArray[np.float64]
    nominal_pressure: NDArray[np.float64]
    amended_pressure: NDArray[np.float64] | None
    measured_rate: NDArray[np.float64] | None
    nominal_rate: NDArray[np.float64]
    amended_rate: NDArray[np.float64] | None
    noise_floor: float


def typical_overlays(
    found: Discovery, gaps: ModelGaps, measured: Sequence[Measurement], nominal: EffectiveModel
) -> tuple[Overlay, ...]:
    """First injections of two held-out operating points: the one in the middle by its gap, and the one worst off."""
    ranked = sorted(gaps.points, key=lambda point: point.line_pressure.before)
    chosen = {point.recording: point for point in (ranked[(len(ranked) - 1) // 2], ranked[-1])}
    amended = gaps.refitted if found.effects else None
    return tuple(_overlay(point, measured[number], nominal, amended) for number, point in chosen.items())


def _overlay(
    point: PointGap, measurement: Measurement, nominal: EffectiveModel, amended: EffectiveModel | None
) -> Overlay:
    recording = measurement.recording
    before = simulated(measurement, nominal)[0]
    after: Simulated | None = None if amended is None else simulated(measurement, amended)[0]
    last = before.event.openings[-1].last + round(SHOWN_RINGING * recording.sample_rate)
    shown = slice(0, max(1, last - int(before.samples[0])))
    samples = before.samples[shown]
    rate = recording.injection_rate
    pressure, duration = measurement.rail_pressure / MEGAPASCAL, measurement.duration / MILLISECOND
    return Overlay(
        title=f"{pressure:.0f} MPa, needle open {duration:.2f} ms",
        time=(samples - samples[0]) * measurement.interval,
        lift=recording.needle_lift[samples],
        line_pressure=recording.line_pressure[samples],
        nominal_pressure=before.line_pressure[shown],
        amended_pressure=None if after is None else after.line_pressure[shown],
        measured_rate=None if rate is None else rate[before.rate_samples[shown]],
        nominal_rate=before.rate[shown],
        amended_rate=None if after is None else after.rate[shown],
        noise_floor=point.line_pressure.noise_floor,
    )
