"""Injections in reports: their curves, their gaps to models, and the changes of their masses by the effects found."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import computed_field

from observer_rt.foundation.documents import Entry, Figure, Inside, key, unit
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND
from observer_rt.identification.discovery.gaps import LINE_PRESSURE, ModelGaps, rms
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import SimulatedInjection, mean_mass, pressure_gap, simulated
from observer_rt.model.effective import EffectiveModel

POINT = Entry(lambda number, findings: findings.points[number], str)  # name of an operating point
SHOWN_RINGING = 6e-3  # s after the last closing


@dataclass(frozen=True, eq=False)
class Overlay:
    """One injection of a recording under two models."""

    title: str
    measurement: Measurement
    before: SimulatedInjection  # by the model as given
    after: SimulatedInjection | None  # with the effects found, if any
    samples: int  # number of those shown
    noise_floor: float  # gap of the line pressure by noise alone [Pa]


def typical_overlays(
    shown: Candidate, gaps: ModelGaps, measured: Sequence[Measurement], nominal: EffectiveModel
) -> tuple[Overlay, ...]:
    """The injection with the largest gap at two operating points held out: that of the median gap, and the worst."""
    ranked = sorted(gaps.points, key=lambda point: point.by_name[LINE_PRESSURE].before)
    chosen = {point.recording: point for point in (ranked[(len(ranked) - 1) // 2], ranked[-1])}
    overlays = []
    for recording, point in chosen.items():
        measurement = measured[recording]
        every = simulated(measurement, nominal)
        number = int(np.argmax([rms(pressure_gap(measurement, one)) for one in every]))
        before = every[number]
        after = simulated(measurement, gaps.refitted)[number] if shown.ids else None
        last = before.event.openings[-1].last + round(SHOWN_RINGING * measurement.recording.sample_rate)
        pressure, duration = measurement.rail_pressure / MEGAPASCAL, measurement.duration / MILLISECOND
        title = f"{pressure:.0f} MPa, needle open {duration:.2f} ms, injection {number + 1} of {len(every)}"
        samples, floor = max(1, last - int(before.samples[0])), point.by_name[LINE_PRESSURE].noise_floor * MEGAPASCAL
        overlays.append(Overlay(title, measurement, before, after, samples, floor))
    return tuple(overlays)


@dataclass(frozen=True)
class InjectionGap:
    """What the model as given and the one refitted miss of the line pressure on one event, rms [Pa].

    recording: its number; number: of the event in it, from 1.
    """

    recording: Annotated[int, POINT]
    number: int
    before: Annotated[float, key("before_MPa"), unit(MEGAPASCAL)]
    after: Annotated[float, key("after_MPa"), unit(MEGAPASCAL)]


@dataclass(frozen=True)
class MassChange:
    """Change of the mass of an injection by the effects found, at one operating point, mean [kg].

    recording: its number; nominal: mean mass by the model as given; half: half width of the 95 % interval of the
    change, from those of the sizes and from the residuals.
    """

    recording: Annotated[int, POINT]
    nominal: Annotated[float, key("nominal_mg"), unit(MILLIGRAM)]
    change: Inside[float]
    half: Inside[float]

    @computed_field  # type: ignore[prop-decorator]
    @property
    def change_pct(self) -> Figure:
        """The same as a share of the nominal mass [%]."""
        return 100.0 * self.change / self.nominal

    @computed_field  # type: ignore[prop-decorator]
    @property
    def ci95_pct(self) -> tuple[Figure, Figure]:
        """Ends of its 95 % interval."""
        half = 100.0 * self.half / self.nominal
        return self.change_pct - half, self.change_pct + half


def injection_gaps(
    gaps: ModelGaps, measured: Sequence[Measurement], nominal: EffectiveModel
) -> tuple[InjectionGap, ...]:
    """Gaps of every event, in the order of the recordings."""
    return tuple(
        InjectionGap(recording, number, *(rms(pressure_gap(measurement, run)) for run in runs))
        for recording, measurement in enumerate(measured)
        for number, runs in enumerate(
            zip(simulated(measurement, nominal), simulated(measurement, gaps.refitted), strict=True), start=1
        )
    )


def mass_changes(
    shown: Candidate, measured: Sequence[Measurement], nominal: EffectiveModel, left: float = 0.0
) -> tuple[MassChange, ...]:
    """Change of every recording's mean mass by `shown`. left: half width of a mass by residuals, as a share."""
    lowest, highest = np.array([(one.lowest, one.highest) for one in shown.hypothesis.ranges()]).reshape(-1, 2).T
    steps = np.diag(np.where(shown.theta + shown.half > highest, -1.0, 1.0) * shown.half)  # a half may be infinite
    moved = [shown.hypothesis.model(nominal, np.clip(shown.theta + step, lowest, highest)) for step in steps]
    result = []
    for recording, measurement in enumerate(measured):
        before, after = (mean_mass([measurement], model) for model in (nominal, shown.model(nominal)))
        half = math.hypot(left * after, *(mean_mass([measurement], model) - after for model in moved))
        result.append(MassChange(recording, before, after - before, half))
    return tuple(result)
