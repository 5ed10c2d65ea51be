"""Injections in reports: curves, open-loop gaps to models at points held out, changes of masses."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import computed_field

from observer_rt.foundation.documents import Entry, Figure, Inside, key, unit
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND, MM3_PER_MS, Floats
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.likelihood import open_loop
from observer_rt.identification.likelihood.excerpts import every_second_point
from observer_rt.identification.likelihood.measurement import Measurement, in_mass_window, noisier
from observer_rt.model.effective import EffectiveModel

LINE_PRESSURE, RATE, MASS = "line_pressure", "injection_rate", "injected_mass"
UNITS = {LINE_PRESSURE: ("MPa", MEGAPASCAL), RATE: ("mm3/ms", MM3_PER_MS), MASS: ("mg", MILLIGRAM)}
NOISE_RUNS = 3  # with noise added, for the noise floor
POINT = Entry(lambda number, findings: findings.points[number], str)  # name of an operating point
SHOWN_RINGING = 6e-3  # s after the last closing


@dataclass(frozen=True)
class Gap:
    """Root mean squares of model minus measurement for a quantity, in its printed unit."""

    name: str
    before: float  # of the nominal model; of a mass not measured, its error if the amended model is right
    after: float  # of the refitted model
    noise_floor: float  # that noise alone would leave
    measured: bool = True  # whether the quantity was measured

    @property
    def unit(self) -> str:
        return UNITS[self.name][0]

    @property
    def words(self) -> str:
        return self.name.replace("_", " ")


@dataclass(frozen=True)
class PointGaps:
    """Gaps of one recording by quantity; a rate is among them only where it was measured."""

    recording: int
    by_name: Mapping[str, Gap]


@dataclass(frozen=True)
class ModelGaps:
    """Gaps over all recordings held out, and of each."""

    by_name: Mapping[str, Gap]
    refitted: EffectiveModel  # the model with what was found, fitted to `fitted_on`
    points: tuple[PointGaps, ...]
    fitted_on: tuple[int, ...]  # numbers of recordings
    held_out: tuple[int, ...]  # numbers of recordings


def gaps_of(shown: Candidate, measured: Sequence[Measurement], nominal: EffectiveModel) -> ModelGaps:
    """Gaps of the nominal model and the one shown at every second operating point, fitted to the others."""
    amended = shown.model(nominal)
    fitted_on, held_out = every_second_point(measured)
    held_out = held_out or fitted_on
    refitted = shown.hypothesis.model(nominal, np.array(shown.sizes_of_half))
    points = tuple(_point(number, measured[number], nominal, refitted, amended) for number in held_out)
    by_name = {name: _over_points([point.by_name[name] for point in points]) for name in points[0].by_name}
    return ModelGaps(by_name, refitted, points, fitted_on, held_out)


def _over_points(gaps: Sequence[Gap]) -> Gap:
    columns = zip(*((gap.before, gap.after, gap.noise_floor) for gap in gaps), strict=True)
    before, after, floor = (float(np.sqrt(np.mean([value**2 for value in column]))) for column in columns)
    return Gap(gaps[0].name, before, after, floor, gaps[0].measured)


def _point(
    number: int, measurement: Measurement, nominal: EffectiveModel, refitted: EffectiveModel, amended: EffectiveModel
) -> PointGaps:
    """amended: has the masses that count as true if no rate was measured."""
    density, is_measured = amended.coefficients.density, measurement.recording.injection_rate is not None
    mass_of, model = (open_loop.measured_mass, nominal) if is_measured else (open_loop.mass, amended)
    true_masses = np.array([mass_of(measurement, one, density) for one in open_loop.simulated(measurement, model)])
    before, after = (_errors(measurement, model, true_masses) for model in (nominal, refitted))
    noisy = [_errors(measurement, refitted, true_masses, seed) for seed in range(NOISE_RUNS)]
    own_errors = {LINE_PRESSURE: [measurement.noise.line_pressure]}
    if is_measured:
        runs = open_loop.simulated(measurement, refitted)
        rate = [one.rate[in_mass_window(measurement, one.event, one.rate_samples)] for one in runs]
        own_errors[RATE] = [measurement.rate_noise, open_loop.GAIN_ERROR * rms(np.concatenate(rate))]
    own_errors[MASS] = [open_loop.GAIN_ERROR * float(np.mean(true_masses)) if is_measured else 0.0]
    by_name = {}
    for name, own in own_errors.items():
        si = UNITS[name][1]
        floor = math.hypot(*own, rms(np.concatenate([one[name] - after[name] for one in noisy])))
        with_measured = is_measured or name == LINE_PRESSURE
        by_name[name] = Gap(name, rms(before[name]) / si, rms(after[name]) / si, floor / si, with_measured)
    return PointGaps(number, by_name)


def _errors(
    measurement: Measurement, model: EffectiveModel, true_masses: Floats, seed: int | None = None
) -> dict[str, Floats]:
    """Model minus recording [SI]: line pressure (n,), rate (m,), masses (events,); seed: of noise on inputs."""
    rate = measurement.recording.injection_rate
    runs = open_loop.simulated(measurement if seed is None else noisier(measurement, seed), model)
    masses = np.array([open_loop.mass(measurement, one, model.coefficients.density) for one in runs])
    pressures = [open_loop.pressure_gap(measurement, one) for one in runs]
    errors = {LINE_PRESSURE: np.concatenate(pressures), MASS: masses - true_masses}
    if rate is not None:
        inside = [in_mass_window(measurement, one.event, one.rate_samples) for one in runs]
        rates = [(one.shown_rate - rate[one.rate_samples])[part] for one, part in zip(runs, inside, strict=True)]
        errors[RATE] = np.concatenate(rates)
    return errors


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True, eq=False)
class Overlay:
    """One injection of a recording under two models."""

    title: str
    measurement: Measurement
    before: open_loop.SimulatedInjection  # by the model as given
    after: open_loop.SimulatedInjection | None  # with the effects found, if any
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
        every = open_loop.simulated(measurement, nominal)
        number = int(np.argmax([rms(open_loop.pressure_gap(measurement, one)) for one in every]))
        before = every[number]
        after = open_loop.simulated(measurement, gaps.refitted)[number] if shown.ids else None
        last = before.event.openings[-1].last + round(SHOWN_RINGING * measurement.recording.sample_rate)
        pressure, duration = measurement.rail_pressure / MEGAPASCAL, measurement.duration / MILLISECOND
        title = f"{pressure:.0f} MPa, needle open {duration:.2f} ms, injection {number + 1} of {len(every)}"
        samples, floor = max(1, last - int(before.samples[0])), point.by_name[LINE_PRESSURE].noise_floor * MEGAPASCAL
        overlays.append(Overlay(title, measurement, before, after, samples, floor))
    return tuple(overlays)


@dataclass(frozen=True)
class InjectionGap:
    """Rms of what both models miss of the line pressure on one event [Pa]; number: of the event, from 1."""

    recording: Annotated[int, POINT]
    number: int
    before: Annotated[float, key("before_MPa"), unit(MEGAPASCAL)]
    after: Annotated[float, key("after_MPa"), unit(MEGAPASCAL)]


@dataclass(frozen=True)
class MassChange:
    """Mean change of an injected mass at one operating point [kg]; half: half width of its 95 % interval."""

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
    result = []
    for recording, measurement in enumerate(measured):
        runs = (open_loop.simulated(measurement, model) for model in (nominal, gaps.refitted))
        for number, pair in enumerate(zip(*runs, strict=True), start=1):
            both = (rms(open_loop.pressure_gap(measurement, run)) for run in pair)
            result.append(InjectionGap(recording, number, *both))
    return tuple(result)


def mass_changes(
    shown: Candidate, measured: Sequence[Measurement], nominal: EffectiveModel, left: float = 0.0
) -> tuple[MassChange, ...]:
    """Change of every recording's mean mass by `shown`. left: half width of a mass by residuals, as a share."""
    lowest, highest = np.array([(one.lowest, one.highest) for one in shown.hypothesis.ranges()]).reshape(-1, 2).T
    steps = np.diag(np.where(shown.theta + shown.half > highest, -1.0, 1.0) * shown.half)  # a half may be infinite
    moved = [shown.hypothesis.model(nominal, np.clip(shown.theta + step, lowest, highest)) for step in steps]
    result = []
    for recording, measurement in enumerate(measured):
        before, after = (open_loop.mean_mass([measurement], model) for model in (nominal, shown.model(nominal)))
        half = math.hypot(left * after, *(open_loop.mean_mass([measurement], model) - after for model in moved))
        result.append(MassChange(recording, before, after - before, half))
    return tuple(result)
