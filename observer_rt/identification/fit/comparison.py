"""Comparison of the residuals and masses of the file's model and the fitted one, by signal and phase."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Self

import numpy as np
from pydantic import Field

from observer_rt.engine.estimation.phases import BLOCKS, Phase, PhaseStatistics
from observer_rt.foundation.documents import DocumentPart, Number
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, Floats
from observer_rt.identification.fit.masses import MEAN
from observer_rt.identification.fit.problem import Calibration, Fold
from observer_rt.identification.likelihood.events import rail_pressure_before
from observer_rt.identification.likelihood.likelihood import JudgedModel, RecordingLikelihood
from observer_rt.identification.likelihood.signals import Pool, Signal, pool_of
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import InjectorParameters

Pair = Annotated[dict[str, Number], Field(description="`file`: by the model given, `fitted`: by the fitted one")]


@dataclass(frozen=True, eq=False)
class UnexplainedSignal:
    """Residuals of a signal: mean squares by phase, 1 for noise alone, nan without samples."""

    statistics: PhaseStatistics

    def _by_phase(self, figure: Callable[[Phase], float]) -> dict[Phase, float]:
        return {phase: figure(phase) if self.statistics.samples[phase] > 0 else math.nan for phase in Phase}

    @cached_property
    def chi2(self) -> Mapping[Phase, float]:
        """Mean square by phase, of means of 8 samples, which coloured residuals fill; of samples in a short phase."""
        has_blocks, quotients = self.statistics.blocks[:, 0] > 0.0, self.statistics.quotients
        return self._by_phase(lambda phase: float(quotients[phase, 1 if has_blocks[phase] else 0]))

    @property
    def variance(self) -> Mapping[Phase, float]:
        """Mean square by phase, of samples."""
        return self._by_phase(self.statistics.variance)

    @property
    def colour(self) -> Mapping[Phase, float]:
        """Mean square by phase, of means of 8 samples or of 20: the larger."""
        return self._by_phase(self.statistics.colour)

    def excess(self, phase: Phase) -> float:
        """Root mean square beyond noise of the means that chi2 is of, in standard deviations of a sample."""
        return math.sqrt(max(self.chi2[phase] - 1.0, 0.0) / (BLOCKS[0] if self.statistics.blocks[phase, 0] else 1))

    @property
    def mean(self) -> float:
        return float(np.nanmean(list(self.chi2.values())))

    @property
    def worst(self) -> Phase:
        return max(self.chi2, key=lambda phase: np.nan_to_num(self.chi2[phase]))


def pooled(recordings: Sequence[RecordingLikelihood], judged: Sequence[JudgedModel]) -> UnexplainedSignal:
    """Residuals of the line pressure on all folds together."""
    return UnexplainedSignal(pool_of(recordings, judged)[Signal.LINE_PRESSURE])


class Residual(DocumentPart):
    """A signal in a phase: rms of the error one sample ahead, in its unit; chi2 of means of 8, 1 for noise alone."""

    signal: Signal
    phase: str
    rms: Pair
    unit: str
    chi2: Pair


class RecordingMass(DocumentPart):
    """Mass of an injection, or mean of a recording's, or of a part of it; measured: null without a measurement."""

    recording: str
    injection: int | None = Field(None, description="number in the recording, from 1; null: the mean of all")
    rail_pressure_MPa: Number  # noqa: N815 - units as printed
    mass_mg: Pair
    measured_mass_mg: Number
    measured_sigma_mg: Number


@dataclass(frozen=True, eq=False)
class ModelOnFolds:
    """A model on all folds, with the rail pressure as recorded; models: with the offset of each fold."""

    folds: Sequence[Fold]
    pool: Pool
    judged: Sequence[JudgedModel]
    models: Sequence[EffectiveModel]

    @classmethod
    def of(cls, injector: InjectorParameters, offsets: Floats, folds: Sequence[Fold]) -> Self | None:
        """An injector's model on folds, None without a finite solution; offsets (folds,): of the sensor [MPa]."""
        calibration = Calibration(injector, (), folds)
        judged = calibration.judge_all(offsets)
        if judged is None:
            return None
        models = [calibration.model(offsets, number) for number in range(len(folds))]
        return cls(folds, pool_of(calibration.recordings, judged), judged, models)

    def chi2(self, signal: Signal, phase: Phase) -> float:
        """Mean square of means of 8 samples, of a signal in a phase."""
        return UnexplainedSignal(self.pool[signal]).chi2[phase]

    def rms(self, signal: Signal, phase: Phase) -> float:
        """Root mean square in the signal's unit."""
        sigma = math.sqrt(self.pool[signal].variance(phase)) / signal.si
        if signal is Signal.INJECTION_RATE:
            return sigma * float(np.mean([fold.measurement.rate_noise for fold in self.folds]))
        return sigma * self.innovation

    @property
    def innovation(self) -> float:
        """Standard deviation of a sample's innovation, by noise alone [Pa]."""
        scale = self.models[0].coefficients.pressure_scale
        return scale * float(np.mean([math.exp(one.log_sigma) for one in self.judged]))

    def mass(self, number: int, injection: int = MEAN) -> float:
        """Mass of an injection of a fold, or mean of all [mg]."""
        return self.folds[number].mass_of(self.judged[number].masses, injection) / MILLIGRAM


@dataclass(frozen=True, eq=False)
class Comparison:
    """The file's model and the fitted one on the same folds; before: None if the file's has no solution."""

    before: ModelOnFolds | None
    after: ModelOnFolds

    @cached_property
    def unexplained(self) -> UnexplainedSignal:
        """Residuals of the line pressure with the fitted model."""
        return UnexplainedSignal(self.after.pool[Signal.LINE_PRESSURE])

    def share(self, phase: Phase) -> float:
        """Residuals in a phase beyond noise, as a share of the swing of the line pressure by the flow."""
        return self.unexplained.excess(phase) * self.after.innovation / self._swing

    @cached_property
    def _swing(self) -> float:
        """Root mean square of the line pressure against the rail's while the needle is open [Pa]."""
        drops = []
        for fold in self.after.folds:
            drop = fold.measurement.recording.rail_pressure - fold.measurement.recording.line_pressure
            openings = (opening for event in fold.measurement.events for opening in event.openings)
            drops += [drop[opening.first : opening.last + 1] for opening in openings]
        return float(np.sqrt(np.mean(np.concatenate(drops) ** 2)))

    def _both(self, figure: Callable[..., float], *of: Signal | Phase | int) -> dict[str, float | None]:
        before = None if self.before is None else figure(self.before, *of)
        return {"file": before, "fitted": figure(self.after, *of)}

    @cached_property
    def residuals(self) -> tuple[Residual, ...]:
        """Residuals of every signal in every phase there is."""
        result = []
        for signal, statistics in self.after.pool.items():
            for phase in [one for one in Phase if statistics.samples[one] > 0]:
                rms, chi2 = (self._both(of, signal, phase) for of in (ModelOnFolds.rms, ModelOnFolds.chi2))
                result.append(Residual(signal=signal, phase=phase.label, rms=rms, unit=signal.unit, chi2=chi2))
        return tuple(result)

    @property
    def mass_misfit(self) -> float:
        """Root mean square of modelled masses beside the measured ones, as a share of these, beyond their sigma.

        Single injections of an operating point count by their mean: a model is wrong of all alike.
        """
        beyond = []
        for number, fold in enumerate(self.after.folds):
            for numbers in fold.weighings:
                measured = [fold.weighed[at] for at in numbers]
                off = np.mean([MILLIGRAM * self.after.mass(number, at) / fold.weighed[at].mass - 1 for at in numbers])
                beyond.append(off**2 - sum((one.sigma / one.mass) ** 2 for one in measured) / len(measured) ** 2)
        return math.sqrt(max(float(np.mean(beyond)), 0.0)) if beyond else 0.0

    def masses(self, level: float) -> tuple[RecordingMass, ...]:
        """Means of every fold; level: factor on all, for a sensor's gain that was removed before the fit."""
        return tuple(self._mass(level, number, MEAN) for number in range(len(self.after.folds)))

    def injection_masses(self, level: float) -> tuple[RecordingMass, ...]:
        """Masses of single injections that were weighed and took part."""
        singles = [(n, at) for n, fold in enumerate(self.after.folds) for at in sorted(fold.measured_masses) if at]
        return tuple(self._mass(level, number, injection) for number, injection in singles)

    def _mass(self, level: float, number: int, injection: int) -> RecordingMass:
        measurement = (fold := self.after.folds[number]).measurement
        pressure = measurement.rail_pressure
        for event in measurement.events:
            if event.number == injection:
                pressure = rail_pressure_before(event, measurement.recording)
        mass, sigma = fold.weighed.get(injection, (math.nan, math.nan))
        return RecordingMass(
            recording=str(measurement.recording.path or fold.recording),
            injection=injection or None,
            rail_pressure_MPa=pressure / MEGAPASCAL,
            mass_mg=self._both(lambda model, *of: level * model.mass(*of), number, injection),
            measured_mass_mg=level * mass / MILLIGRAM,
            measured_sigma_mg=level * sigma / MILLIGRAM,
        )


def compared(
    file: InjectorParameters, fitted: InjectorParameters, offsets: Floats, folds: Sequence[Fold]
) -> Comparison:
    """Compares the fitted model with the file's. offsets: of the line-pressure sensor in each fold [MPa]."""
    after = ModelOnFolds.of(fitted, offsets, folds)
    if after is None:
        raise ArithmeticError("the fitted model has no finite solution on the recordings it was fitted to")
    try:
        before = ModelOnFolds.of(file, offsets, folds)
    except UserError:
        before = None  # too slow a sample rate for the sac of the file
    return Comparison(before, after)
