"""How far models run open loop are from recordings, before and after what was found, at points held out."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.likelihood.measurement import Measurement, in_mass_window, noisier
from observer_rt.identification.likelihood.open_loop import GAIN_ERROR, mass, measured_mass, pressure_gap, simulated
from observer_rt.identification.likelihood.operating_points import every_second_point
from observer_rt.model.effective import EffectiveModel

LINE_PRESSURE, RATE, MASS = "line_pressure", "injection_rate", "injected_mass"
UNITS = {LINE_PRESSURE: ("MPa", MEGAPASCAL), RATE: ("mm3/ms", MM3_PER_MS), MASS: ("mg", MILLIGRAM)}
NOISE_RUNS = 3  # with noise added, for the noise floor


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
        """Unit of the quantity, as printed."""
        return UNITS[self.name][0]

    @property
    def words(self) -> str:
        """Name of the quantity for people."""
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
    """Gaps at every second operating point, of the nominal model and of the one shown, fitted to the others.

    A single operating point is both fitted and compared.
    """
    amended = shown.model(nominal)
    fitted_on, held_out = every_second_point(measured)
    held_out = held_out or fitted_on
    refitted = shown.hypothesis.model(nominal, np.array(shown.sizes_of_half))
    points = tuple(_point(number, measured[number], nominal, refitted, amended) for number in held_out)
    by_name = {name: _over_points([point.by_name[name] for point in points]) for name in points[0].by_name}
    return ModelGaps(by_name, refitted, points, fitted_on, held_out)


def _over_points(gaps: Sequence[Gap]) -> Gap:
    """The gap of a quantity over several recordings: the root mean square of theirs."""
    columns = zip(*((gap.before, gap.after, gap.noise_floor) for gap in gaps), strict=True)
    before, after, floor = (float(np.sqrt(np.mean([value**2 for value in column]))) for column in columns)
    return Gap(gaps[0].name, before, after, floor, gaps[0].measured)


def _point(
    number: int, measurement: Measurement, nominal: EffectiveModel, refitted: EffectiveModel, amended: EffectiveModel
) -> PointGaps:
    """Gaps of a recording. amended: has the masses that count as true if no rate was measured."""
    density, is_measured = amended.coefficients.density, measurement.recording.injection_rate is not None
    mass_of, model = (measured_mass, nominal) if is_measured else (mass, amended)
    true_masses = np.array([mass_of(measurement, one, density) for one in simulated(measurement, model)])
    before, after = (_errors(measurement, model, true_masses) for model in (nominal, refitted))
    noisy = [_errors(measurement, refitted, true_masses, seed) for seed in range(NOISE_RUNS)]
    own_errors = {LINE_PRESSURE: [measurement.noise.line_pressure]}
    if is_measured:
        runs = simulated(measurement, refitted)
        rate = [one.rate[in_mass_window(measurement, one.event, one.rate_samples)] for one in runs]
        own_errors[RATE] = [measurement.rate_noise, GAIN_ERROR * rms(np.concatenate(rate))]
    own_errors[MASS] = [GAIN_ERROR * float(np.mean(true_masses)) if is_measured else 0.0]
    by_name = {}
    for name, own in own_errors.items():
        si = UNITS[name][1]
        floor = math.hypot(*own, rms(np.concatenate([one[name] - after[name] for one in noisy])))
        with_measured = is_measured or name == LINE_PRESSURE
        by_name[name] = Gap(name, rms(before[name]) / si, rms(after[name]) / si, floor / si, with_measured)
    return PointGaps(number, by_name)


def _errors(
    measurement: Measurement, model: EffectiveModel, true_masses: NDArray[np.float64], seed: int | None = None
) -> dict[str, NDArray[np.float64]]:
    """Model minus recording by quantity [SI]: line pressure (n,), a measured rate (m,), masses (events,).

    A rate counts while fuel is injected. seed: of noise that is added to the inputs of the model; None adds none.
    """
    rate = measurement.recording.injection_rate
    runs = simulated(measurement if seed is None else noisier(measurement, seed), model)
    masses = np.array([mass(measurement, one, model.coefficients.density) for one in runs])
    pressures = [pressure_gap(measurement, one) for one in runs]
    errors = {LINE_PRESSURE: np.concatenate(pressures), MASS: masses - true_masses}
    if rate is not None:
        inside = [in_mass_window(measurement, one.event, one.rate_samples) for one in runs]
        rates = [(one.shown_rate - rate[one.rate_samples])[part] for one, part in zip(runs, inside, strict=True)]
        errors[RATE] = np.concatenate(rates)
    return errors


def rms(values: NDArray[np.float64]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))
