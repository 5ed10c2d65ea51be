"""Compares the residuals of the file's model and the fitted one, by signal and phase, and on folds left out."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from observer_rt.engine.estimation.phases import (
    BLOCKS,
    Phase,
    PhaseStatistics,
)
from observer_rt.foundation.documents import DocumentPart, Number
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.fit.cross_validation import Fold
from observer_rt.identification.fit.problem import INERTANCE, Calibration
from observer_rt.identification.likelihood.bounded_fit import Quadratic, linearise
from observer_rt.identification.likelihood.likelihood import (
    JudgedModel,
    Pool,
    RecordingLikelihood,
    Signal,
    pool_of,
)
from observer_rt.identification.likelihood.open_loop import SimulatedInjection, mass, measured_mass, simulated
from observer_rt.identification.likelihood.reading import is_chosen
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import InjectorParameters

Pair = Annotated[
    dict[str, Number], Field(description="`file`: by the model given, `fitted`: by the fitted one")
]


@dataclass(frozen=True)
class UnexplainedSignal:
    """Residuals of a signal: mean squares by phase, 1 where it leaves noise alone; nan without samples.

    chi2: of means of 8 samples, which coloured residuals fill (of samples where a phase is shorter); excess: rms of
    what these means are beyond noise, in standard deviations of a sample; variance: of samples; colour: the larger
    of means of 8 and of 20.
    """

    chi2: Mapping[Phase, float]
    excess: Mapping[Phase, float]
    variance: Mapping[Phase, float]
    colour: Mapping[Phase, float]

    @property
    def mean(self) -> float:
        """Mean chi2 of the phases."""
        return float(np.nanmean(list(self.chi2.values())))

    @property
    def worst(self) -> Phase:
        """With the largest chi2."""
        return max(self.chi2, key=lambda phase: np.nan_to_num(self.chi2[phase]))


def unexplained(statistics: PhaseStatistics) -> UnexplainedSignal:
    """In figures."""
    seen = [phase for phase in Phase if statistics.samples[phase] > 0]
    nothing = dict.fromkeys(Phase, math.nan)
    return UnexplainedSignal(
        nothing | {phase: _chi2(statistics, phase) for phase in seen},
        nothing | {phase: _excess(statistics, phase) for phase in seen},
        nothing | {phase: statistics.variance(phase) for phase in seen},
        nothing | {phase: statistics.colour(phase) for phase in seen},
    )


def _chi2(statistics: PhaseStatistics, phase: Phase) -> float:
    blocks = statistics.blocks[phase, 0]
    return float(statistics.block_squares[phase, 0] / blocks) if blocks else statistics.variance(phase)


def _excess(statistics: PhaseStatistics, phase: Phase) -> float:
    samples = BLOCKS[0] if statistics.blocks[phase, 0] else 1
    return math.sqrt(max(_chi2(statistics, phase) - 1.0, 0.0) / samples)


def pooled(recordings: Sequence[RecordingLikelihood], judged: Sequence[JudgedModel]) -> UnexplainedSignal:
    """Pools the line pressure of folds."""
    return unexplained(pool_of(recordings, judged)[Signal.LINE_PRESSURE])


def worst_folds(calibration: Calibration, judged: Sequence[JudgedModel]) -> UnexplainedSignal:
    """In each phase that of the fold with the most left: what the model gets wrong goes with the operating point."""
    of_folds = [
        pooled([recorded], [one]) for recorded, one in zip(calibration.recordings, judged, strict=True)
    ]

    def largest(figures: Sequence[Mapping[Phase, float]]) -> dict[Phase, float]:
        return {phase: float(np.fmax.reduce([one[phase] for one in figures])) for phase in Phase}

    return UnexplainedSignal(
        *(largest([getattr(one, each.name) for one in of_folds]) for each in fields(UnexplainedSignal))
    )


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
    lowest = np.array([r.lowest for r in calibration.ranges])
    highest = np.array([r.highest for r in calibration.ranges])
    return np.clip(theta, lowest, highest)


class Residual(DocumentPart):
    """A signal in a phase: rms of the prediction's error one sample ahead, in its unit; chi2 of its means of 8
    samples, 1 for noise alone."""

    signal: Signal
    phase: str
    rms: Pair
    unit: str
    chi2: Pair


class InjectedMass(DocumentPart):
    """Masses of an injection: fitted, by the file's model, measured; null without a measurement.

    time_s: when the needle opens; null in a recording so long that some injections were chosen.
    """

    recording: str
    time_s: Number
    rail_pressure_MPa: Number  # noqa: N815 - units as printed
    mass_mg: Number
    file_mass_mg: Number
    measured_mass_mg: Number


@dataclass(frozen=True, eq=False)
class FoldOverlay:
    """A fold with the models run open loop from the opening on; before: empty where the file's has no solution."""

    fold: Fold
    before: Sequence[SimulatedInjection]
    after: Sequence[SimulatedInjection]


@dataclass(frozen=True, eq=False)
class Comparison:
    """The file's model and the fitted one on the recordings as they are, their rail pressure not averaged.

    after: of the line pressure, by the fitted model; innovation: standard deviation of a sample of it [Pa]; swing:
    rms of the line pressure against the rail's while the needle is open [Pa]; open_loop: rms of the line pressure
    from the opening on, with nothing corrected [MPa].
    """

    residuals: tuple[Residual, ...]
    after: UnexplainedSignal
    innovation: float
    swing: float
    open_loop: dict[str, float | None]
    masses: tuple[InjectedMass, ...]
    overlays: Sequence[FoldOverlay]

    def share(self, phase: Phase) -> float:
        """Residuals in a phase beyond noise, over what the flow does to the line pressure."""
        return self.after.excess[phase] * self.innovation / self.swing


@dataclass(frozen=True, eq=False)
class _ModelOnFolds:
    """A model on all folds."""

    folds: Sequence[Fold]
    pool: Pool
    judged: Sequence[JudgedModel]
    models: Sequence[EffectiveModel]
    simulated: Sequence[Sequence[SimulatedInjection]]

    def chi2(self, signal: Signal, phase: Phase) -> float:
        return unexplained(self.pool[signal]).chi2[phase]

    def rms(self, signal: Signal, phase: Phase) -> float:
        """In the signal's unit: normalised mean square times the standard deviation it was normalised by."""
        sigma = math.sqrt(self.pool[signal].variance(phase))
        if signal is Signal.INJECTION_RATE:
            return sigma * float(np.mean([fold.measurement.rate_noise for fold in self.folds]))
        return sigma * self.innovation

    @property
    def innovation(self) -> float:
        """Standard deviation of a sample's innovation, by noise alone [Pa]."""
        scale = self.models[0].coefficients.pressure_scale
        return scale * float(np.mean([math.exp(one.log_sigma) for one in self.judged]))

    def open_loop(self) -> float:
        errors = [
            one.line_pressure - fold.measurement.recording.line_pressure[one.samples]
            for fold, runs in zip(self.folds, self.simulated, strict=True)
            for one in runs
        ]
        return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))


def compared(
    file: InjectorParameters, fitted: InjectorParameters, offsets: NDArray[np.float64], folds: Sequence[Fold]
) -> Comparison:
    """offsets: of the line-pressure sensor in each fold [MPa]."""
    after = _seen(fitted, offsets, folds)
    if after is None:
        raise ArithmeticError("the fitted model has no finite solution on the recordings it was fitted to")
    try:
        before = _seen(file, offsets, folds)
    except UserError:
        before = None  # too few samples for its sac: nothing to compare with

    def both(figure: Callable[..., float], *of: Signal | Phase, si: float = 1.0) -> dict[str, float | None]:
        return {
            "file": None if before is None else figure(before, *of) / si,
            "fitted": figure(after, *of) / si,
        }

    return Comparison(
        tuple(
            Residual(
                signal=signal,
                phase=phase.name.lower(),
                rms=both(_ModelOnFolds.rms, signal, phase, si=signal.si),
                unit=signal.unit,
                chi2=both(_ModelOnFolds.chi2, signal, phase),
            )
            for signal, statistics in after.pool.items()
            for phase in Phase
            if statistics.samples[phase] > 0
        ),
        unexplained(after.pool[Signal.LINE_PRESSURE]),
        after.innovation,
        _swing(folds),
        both(_ModelOnFolds.open_loop, si=MEGAPASCAL),
        tuple(_masses(before, after)),
        [
            FoldOverlay(fold, () if before is None else before.simulated[i], after.simulated[i])
            for i, fold in enumerate(folds)
        ],
    )


def _swing(folds: Sequence[Fold]) -> float:
    drops = [
        (fold.measurement.recording.rail_pressure - fold.measurement.recording.line_pressure)[
            opening.first : opening.last + 1
        ]
        for fold in folds
        for event in fold.measurement.events
        for opening in event.openings
    ]
    return float(np.sqrt(np.mean(np.concatenate(drops) ** 2)))


def _seen(
    injector: InjectorParameters, offsets: NDArray[np.float64], folds: Sequence[Fold]
) -> _ModelOnFolds | None:
    calibration = Calibration(injector, (), folds)
    judged = calibration.judge_all(offsets)
    if judged is None:
        return None
    models = [calibration.model(offsets, number) for number in range(len(folds))]
    runs = [simulated(fold.measurement, model) for fold, model in zip(folds, models, strict=True)]
    return _ModelOnFolds(folds, pool_of(calibration.recordings, judged), judged, models, runs)


def _masses(before: _ModelOnFolds | None, after: _ModelOnFolds) -> Iterator[InjectedMass]:
    for number, fold in enumerate(after.folds):
        measurement, density = fold.measurement, after.models[number].coefficients.density
        single = {} if fold.weighed is None else fold.weighed.single
        for i, simulated_injection in enumerate(after.simulated[number]):
            first = simulated_injection.event.openings[0].first
            weighed = (
                single[first][0]
                if first in single
                else measured_mass(measurement, simulated_injection, density)
            )
            by_file = math.nan if before is None else mass(measurement, before.simulated[number][i], density)
            yield InjectedMass(
                recording=str(measurement.recording.path or fold.recording),
                time_s=math.nan if is_chosen(measurement) else float(measurement.recording.time[first]),
                rail_pressure_MPa=measurement.rail_pressure / MEGAPASCAL,
                mass_mg=mass(measurement, simulated_injection, density) / MILLIGRAM,
                file_mass_mg=by_file / MILLIGRAM,
                measured_mass_mg=weighed / MILLIGRAM,
            )
