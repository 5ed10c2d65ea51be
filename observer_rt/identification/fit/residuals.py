"""Compares the residuals of the file's model and the fitted one, by signal and phase, and on folds left out."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.optimize import least_squares

from observer_rt.engine.estimation.phases import BLOCKS, Phase, PhaseStatistics
from observer_rt.files.signals.recording import shown_slowly
from observer_rt.foundation.documents import DocumentPart, Number
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.fit.cross_validation import Fold
from observer_rt.identification.fit.problem import INERTANCE, Calibration
from observer_rt.identification.likelihood.bounded_fit import Quadratic, linearise
from observer_rt.identification.likelihood.likelihood import JudgedModel, Pool, RecordingLikelihood, Signal, pool_of
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import simulated
from observer_rt.identification.likelihood.windows import Rows
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import InjectorParameters

Pair = Annotated[dict[str, Number], Field(description="`file`: by the model given, `fitted`: by the fitted one")]


@dataclass(frozen=True, eq=False)
class UnexplainedSignal:
    """Residuals of a signal: mean squares by phase, 1 where it leaves noise alone; nan without samples."""

    statistics: PhaseStatistics

    def _by_phase(self, figure: Callable[[Phase], float]) -> dict[Phase, float]:
        return {phase: figure(phase) if self.statistics.samples[phase] > 0 else math.nan for phase in Phase}

    @cached_property
    def chi2(self) -> Mapping[Phase, float]:
        """Of means of 8 samples, which coloured residuals fill; of samples where a phase is shorter."""

        def of(phase: Phase) -> float:
            blocks = self.statistics.blocks[phase, 0]
            squares = self.statistics.block_squares[phase, 0]
            return float(squares / blocks) if blocks else self.statistics.variance(phase)

        return self._by_phase(of)

    @property
    def variance(self) -> Mapping[Phase, float]:
        """Of samples."""
        return self._by_phase(self.statistics.variance)

    @property
    def colour(self) -> Mapping[Phase, float]:
        """The larger of means of 8 and of 20 samples."""
        return self._by_phase(self.statistics.colour)

    def excess(self, phase: Phase) -> float:
        """Root mean square of what chi2 is of beyond noise, in standard deviations of a sample."""
        samples = BLOCKS[0] if self.statistics.blocks[phase, 0] else 1
        return math.sqrt(max(self.chi2[phase] - 1.0, 0.0) / samples)

    @property
    def mean(self) -> float:
        """Mean chi2 of the phases."""
        return float(np.nanmean(list(self.chi2.values())))

    @property
    def worst(self) -> Phase:
        """With the largest chi2."""
        return max(self.chi2, key=lambda phase: np.nan_to_num(self.chi2[phase]))


def pooled(recordings: Sequence[RecordingLikelihood], judged: Sequence[JudgedModel]) -> UnexplainedSignal:
    """Pools the line pressure of folds."""
    return UnexplainedSignal(pool_of(recordings, judged)[Signal.LINE_PRESSURE])


def rate_misfit(calibration: Calibration, judged: Sequence[JudgedModel]) -> float:
    """Root mean square of a measured rate minus the modelled one, beyond noise, over that of the rate; 0 without."""
    beyond, total = 0.0, 0.0
    for fold, model in zip(calibration.folds, judged, strict=True):
        rate, z = fold.measurement.recording.injection_rate, model.rate_z[:-1]
        if rate is not None:
            beyond += fold.measurement.rate_noise**2 * max(float(z @ z) - z.size, 0.0)
            total += float(np.sum(rate[Rows(fold.measurement).rate_samples] ** 2))
    return math.sqrt(beyond / total) if total else 0.0


def rate_meter(measured: Sequence[Measurement], model: EffectiveModel) -> tuple[float, float]:
    """Time constants [s] of a meter of two poles with which a model's rate has the shape of the measured one.

    Its gain is free: the level is not the meter's.
    """
    pairs = [
        (one.interval, run.rate, one.recording.injection_rate[run.rate_samples])
        for one in measured
        if one.recording.injection_rate is not None
        for run in simulated(one, model)
    ]
    rate = np.concatenate([each for _, _, each in pairs])

    def missed(lags: NDArray[np.float64]) -> NDArray[np.float64]:
        shown = np.concatenate([shown_slowly(each, interval, *lags) for interval, each, _ in pairs])
        return np.asarray(rate - shown * (shown @ rate) / (shown @ shown))

    best = least_squares(missed, (1.5e-4, 3e-5), bounds=(1e-6, 2e-3), x_scale=1e-4, diff_step=1e-3)
    slow, quick = sorted(map(float, best.x), reverse=True)
    return slow, quick


@dataclass(frozen=True)
class HeldOut:
    """Every fold judged by what the others say of the parameters.

    unexplained: of the line pressure; mass_shift: by what share the mass of its injections moves when a fold is left
    out (folds,), which is how sure masses are at operating points nobody fitted.
    """

    unexplained: UnexplainedSignal
    mass_shift: NDArray[np.float64]


def held_out(calibration: Calibration, at: Quadratic) -> HeldOut | None:
    """At the minimum of all folds. None with a single fold, or where the model has no solution without one.

    theta without a fold is one Newton step from the minimum: it is near, and all slopes are known there.
    """
    folds = len(calibration.folds)
    if folds < 2:
        return None
    left_out, shifts = [], []
    for number in range(folds):
        theta = without(calibration, at, [number])
        judged_model, all_in = calibration.judge(theta, number), calibration.judge(at.theta, number)
        if judged_model is None or all_in is None:
            return None
        left_out.append(judged_model)
        shifts.append(float(np.sum(judged_model.masses) / np.sum(all_in.masses)) - 1.0)
    return HeldOut(pooled(calibration.recordings, left_out), np.array(shifts))


def without(calibration: Calibration, at: Quadratic, left_out: Sequence[int]) -> NDArray[np.float64]:
    """theta by all folds but some, their own offsets as they are, and the level, which may be measured in one."""
    information, gradient = at.information.copy(), at.gradient.copy()
    for number in left_out:
        own = calibration.residuals_of(at.theta, number)
        assert own is not None  # the minimum has it
        alone = linearise(partial(calibration.residuals_of, number=number), at.theta, own, calibration.ranges)
        information -= alone.information
        gradient -= alone.gradient
    held = [len(calibration.free) + number for number in left_out]
    held += [place for place, one in enumerate(calibration.free) if one is INERTANCE]
    kept = np.setdiff1d(np.arange(at.theta.size), held)
    theta = at.theta.copy()
    theta[kept] -= np.linalg.pinv(information[np.ix_(kept, kept)], hermitian=True) @ gradient[kept]
    lowest, highest = np.array([(range_.lowest, range_.highest) for range_ in calibration.ranges]).T
    return np.clip(theta, lowest, highest)


class Residual(DocumentPart):
    """A signal in a phase: rms of the prediction's error one sample ahead, in its unit; chi2 of its means of 8
    samples, 1 for noise alone."""

    signal: Signal
    phase: str
    rms: Pair
    unit: str
    chi2: Pair


class RecordingMass(DocumentPart):
    """Mean mass of the injections of a recording, or of a part of it; measured: null without a measurement."""

    recording: str
    rail_pressure_MPa: Number  # noqa: N815 - units as printed
    mass_mg: Pair
    measured_mass_mg: Number


@dataclass(frozen=True, eq=False)
class ModelOnFolds:
    """A model on the recordings as they are, their rail pressure not averaged.

    models: with the offset of each fold.
    """

    folds: Sequence[Fold]
    pool: Pool
    judged: Sequence[JudgedModel]
    models: Sequence[EffectiveModel]

    @classmethod
    def of(cls, injector: InjectorParameters, offsets: NDArray[np.float64], folds: Sequence[Fold]) -> Self | None:
        """None where it has no finite solution. offsets: of the line-pressure sensor in each fold [MPa]."""
        calibration = Calibration(injector, (), folds)
        judged = calibration.judge_all(offsets)
        if judged is None:
            return None
        models = [calibration.model(offsets, number) for number in range(len(folds))]
        return cls(folds, pool_of(calibration.recordings, judged), judged, models)

    def chi2(self, signal: Signal, phase: Phase) -> float:
        """Of means of 8 samples."""
        return UnexplainedSignal(self.pool[signal]).chi2[phase]

    def rms(self, signal: Signal, phase: Phase) -> float:
        """In the signal's unit: normalised mean square times the standard deviation it was normalised by."""
        sigma = math.sqrt(self.pool[signal].variance(phase)) / signal.si
        if signal is Signal.INJECTION_RATE:
            return sigma * float(np.mean([fold.measurement.rate_noise for fold in self.folds]))
        return sigma * self.innovation

    @property
    def innovation(self) -> float:
        """Standard deviation of a sample's innovation, by noise alone [Pa]."""
        scale = self.models[0].coefficients.pressure_scale
        return scale * float(np.mean([math.exp(one.log_sigma) for one in self.judged]))

    def mass(self, number: int) -> float:
        """Mean mass of a fold's injections [mg]."""
        return float(np.average(self.judged[number].masses, weights=self.folds[number].weights)) / MILLIGRAM


@dataclass(frozen=True, eq=False)
class Comparison:
    """The fitted model and the file's on the same folds. before: None where the file's has no solution."""

    before: ModelOnFolds | None
    after: ModelOnFolds

    @cached_property
    def left(self) -> UnexplainedSignal:
        """What the fitted model leaves of the line pressure."""
        return UnexplainedSignal(self.after.pool[Signal.LINE_PRESSURE])

    def share(self, phase: Phase) -> float:
        """Residuals in a phase beyond noise, over what the flow does to the line pressure."""
        return self.left.excess(phase) * self.after.innovation / self._swing

    @cached_property
    def _swing(self) -> float:
        """Root mean square of the line pressure against the rail's while the needle is open [Pa]."""
        drops = [
            (recording.rail_pressure - recording.line_pressure)[opening.first : opening.last + 1]
            for measurement in (fold.measurement for fold in self.after.folds)
            for recording in (measurement.recording,)
            for event in measurement.events
            for opening in event.openings
        ]
        return float(np.sqrt(np.mean(np.concatenate(drops) ** 2)))

    def _both(self, figure: Callable[..., float], *of: Signal | Phase | int) -> dict[str, float | None]:
        before = None if self.before is None else figure(self.before, *of)
        return {"file": before, "fitted": figure(self.after, *of)}

    @cached_property
    def residuals(self) -> tuple[Residual, ...]:
        """Of every signal in every phase there is."""
        return tuple(
            Residual(
                signal=signal,
                phase=phase.name.lower(),
                rms=self._both(ModelOnFolds.rms, signal, phase),
                unit=signal.unit,
                chi2=self._both(ModelOnFolds.chi2, signal, phase),
            )
            for signal, statistics in self.after.pool.items()
            for phase in Phase
            if statistics.samples[phase] > 0
        )

    def masses(self, level: float) -> tuple[RecordingMass, ...]:
        """Of every fold; level: times these, where the gain of a sensor was taken out before."""
        return tuple(
            RecordingMass(
                recording=str(fold.measurement.recording.path or fold.recording),
                rail_pressure_MPa=fold.measurement.rail_pressure / MEGAPASCAL,
                mass_mg=self._both(lambda model, number: level * model.mass(number), number),
                measured_mass_mg=math.nan if fold.weighed is None else level * fold.weighed.mass / MILLIGRAM,
            )
            for number, fold in enumerate(self.after.folds)
        )


def compared(
    file: InjectorParameters, fitted: InjectorParameters, offsets: NDArray[np.float64], folds: Sequence[Fold]
) -> Comparison:
    """offsets: of the line-pressure sensor in each fold [MPa]."""
    after = ModelOnFolds.of(fitted, offsets, folds)
    if after is None:
        raise ArithmeticError("the fitted model has no finite solution on the recordings it was fitted to")
    try:
        before = ModelOnFolds.of(file, offsets, folds)
    except UserError:
        before = None  # too few samples for its sac: nothing to compare with
    return Comparison(before, after)
