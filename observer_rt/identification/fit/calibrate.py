"""Calibrates a model to recordings: chooses its structure, fits its numbers, and says how far to trust them."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from observer_rt.engine.estimation.phases import Phase
from observer_rt.files.signals.recording import shown_slowly
from observer_rt.foundation.units import Floats
from observer_rt.identification.fit import forms, search
from observer_rt.identification.fit.causes import TriedCause, tried_causes
from observer_rt.identification.fit.comparison import Comparison, compared
from observer_rt.identification.fit.masses import WeighedMasses
from observer_rt.identification.fit.problem import GROUPS_OF_FOLD, Calibration, Fold, by_meter, folds_of, thinned
from observer_rt.identification.fit.structures import Choice, choose, tried_structures
from observer_rt.identification.fit.suitability import share_between_samples
from observer_rt.identification.likelihood.likelihood import JudgedModel
from observer_rt.identification.likelihood.measurement import Measurement, Rows
from observer_rt.identification.likelihood.open_loop import GAIN_ERROR, simulated
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters

CHI2_LIMIT = 2.5  # of a phase, above which a model is not adequate
TOLERATED_SHARE = 0.03  # of the swing of the line pressure, up to which a residual is part of every interval
LEAST_MASS_SHARE = 1.2e-3  # of a mass, by cells at the closed end, corners of the lift and the like
ANSWERED_MASS_SHARE = 3e-3  # of a mass, where the lift was not measured: found on plants of other lines and needles
RATE_MISFIT = 0.02  # of a measured rate, above which its meter, and not the injector, gives it its shape
METER_MISFIT_SHARE = 0.5  # of the misfit, below which a meter must bring it to explain it
TOLERATED_MISFIT = 0.005  # of measured masses, beyond their sigma, from which on it is said
COMPARISON_TIME = 0.8  # share of all the time that the comparison of structures takes


class LevelSource(StrEnum):
    """Measurement that fixes the absolute level of flow."""

    FILE = "file"
    RATE = "measured_rate"
    MASS = "measured_mass"


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    file: InjectorParameters  # before the fit
    measurements: Sequence[Measurement]
    choice: Choice  # among structures, compared on few events
    fitted: search.FittedStructure  # the chosen one on many events
    kept: tuple[forms.FreeParameter, ...]  # as in the file, because the recordings do not determine them
    level_source: LevelSource
    comparison: Comparison  # of the models before and after
    rate_misfit: float  # share of a measured rate's shape that a model of pressures and integrals does not explain
    meter: tuple[float, ...] = ()  # time constants [s] of the rate's meter, stated or fitted
    causes: tuple[TriedCause, ...] = ()  # tried where more than noise is left, the best first
    not_observed: str = ""  # why the observer could not learn with the fitted model; empty: it could
    flow_factor: float = 1.0  # published masses over these: a sensor's gain was removed before the fit

    @property
    def injector(self) -> InjectorParameters:
        return self.fitted.injector

    @property
    def sizes(self) -> dict[str, forms.FittedNumber]:
        fitted = self.fitted
        return forms.sizes_of(fitted.calibration.free, fitted.certainty.sigmas, self.file, self.injector)

    @property
    def above_limit(self) -> tuple[Phase, ...]:
        """Phases whose residuals are more than noise."""
        return tuple(phase for phase in Phase if self.comparison.unexplained.chi2[phase] > CHI2_LIMIT)

    @property
    def cause(self) -> TriedCause | None:
        """The effect that explains the residuals; None where no refit showed one."""
        return self.causes[0] if self.causes and self.causes[0].explains else None

    @property
    def inadequate(self) -> tuple[Phase, ...]:
        """Phases that the model does not explain, the worst first.

        Small residuals count only where a sensor causes them, or a needle answers commands: it hides a wrong line.
        """
        share = self.comparison.share
        is_strict = self.measurements[0].is_answered or (self.cause is not None and self.cause.is_of_bench)
        over = [phase for phase in self.above_limit if is_strict or share(phase) > TOLERATED_SHARE]
        return tuple(sorted(over, key=lambda phase: -self.comparison.unexplained.chi2[phase]))

    @property
    def shares_by_pressures(self) -> Floats:
        """Standard deviation of a mass by its own pressures, as a share, if only alpha_H were unknown: (folds,)."""
        calibration, at = self.fitted.calibration, self.fitted.minimum.at
        if forms.NOZZLE not in calibration.free:
            return np.full(len(calibration.folds), math.inf)
        slopes = np.split(at.slopes[:, calibration.free.index(forms.NOZZLE)], np.cumsum(at.residuals.counts[:-1]))
        by_fold = zip(calibration.folds, slopes[::GROUPS_OF_FOLD], strict=False)  # of the line pressure
        return np.array([math.sqrt(len(fold.measurement.events) / (slope @ slope)) for fold, slope in by_fold])

    @property
    def mass_share(self) -> float:
        """Standard deviation of a mass, as a share, that learning will not remove; `level_share` is the level's own.

        Causes: a recording left out, other structures as good, edges of the lift between slow instants, a lift not
        measured, measured masses that the model does not meet, and a floor.
        """
        held_out = self.fitted.held_out
        left_out = 0.0 if held_out is None else float(np.sqrt(np.mean(held_out.mass_shift**2)))
        between = max(map(share_between_samples, self.measurements))
        answered = ANSWERED_MASS_SHARE if self.measurements[0].is_answered else 0.0
        misfit = self.comparison.mass_misfit
        return math.hypot(LEAST_MASS_SHARE, left_out, self.choice.mass_spread, between, answered, misfit)

    @property
    def level_share(self) -> float | None:
        """Standard deviation of the level, as a share: the larger of fit and measurement; None without rate and mass.

        Errors of masses may not be independent, as the fit takes them; a rate's is of its gain and the density.
        """
        if self.level_source is LevelSource.FILE:
            return None
        determined = zip(self.fitted.calibration.free, self.fitted.certainty.sigmas, strict=True)
        # twice, for the level is an area's and the parameter a diameter
        by_fit = sum(2.0 * float(sigma) for one, sigma in determined if one is forms.INERTANCE)
        folds = self.fitted.calibration.folds
        own = [one.sigma / one.mass for fold in folds for one in fold.measured_masses.values()]
        by_rate = math.hypot(GAIN_ERROR, 0.01 * self.file.accuracy.fuel_density_percent)
        return max(by_fit, float(np.median(own)) if own else by_rate)


def calibrate(
    file: InjectorParameters,
    recordings: Sequence[Measurement],
    weighed: Mapping[int, WeighedMasses],
    progress: Callable[[float], None],
    structures: Sequence[forms.Structure] = forms.STRUCTURES,
) -> CalibrationResult:
    """Fit an injector to healthy recordings; weighed: masses by recording. Raises `RunError` without a solution."""
    source = LevelSource.MASS if weighed else LevelSource.FILE
    if any(one.recording.injection_rate is not None for one in recordings):  # which gives it at every sample
        source = LevelSource.RATE
    folds = folds_of(recordings, weighed)
    coarse = tuple(thinned(fold, search.ROUGH_EVENTS) for fold in folds)  # structures are compared on
    answering = forms.ANY_NEEDLE if forms.USUAL_SEAT in structures[0].free else forms.NEEDLE
    needle = answering if recordings[0].is_answered else ()
    further = (() if source is LevelSource.FILE else forms.LEVEL) + needle
    tried = tried_structures(structures, file, further, coarse, lambda share: progress(COMPARISON_TIME * share))
    choice = choose(tried)
    misfit = rate_misfit(choice.best.calibration, choice.best.judged)
    meter = recordings[0].recording.meter
    has_shape = misfit <= RATE_MISFIT and not meter  # poles are not known so well that V_S could be told from them
    if not has_shape and meter is None and (metered := _metered_fit(choice.best, coarse, misfit)) is not None:
        choice, meter, misfit = replace(choice, best=metered.best), metered.meter, metered.misfit
        folds = tuple(by_meter(fold, meter) for fold in folds)
    tempering = max(1.0, choice.best.unexplained.mean)
    fine = [replace(thinned(fold, search.FINE_EVENTS), rate_shape=has_shape, tempering=tempering) for fold in folds]
    best, kept = search.settled(choice.best, file, fine)
    comparison = compared(file, best.injector, best.offsets, best.calibration.folds)
    result = CalibrationResult(file, recordings, choice, best, kept, source, comparison, misfit, meter or ())
    if result.above_limit:
        result = replace(result, causes=tried_causes(choice.best))
    progress(1.0)
    return result


class MeteredFit(NamedTuple):
    """A structure fitted to a rate behind a meter: the meter's time constants [s], and the misfit that is left."""

    meter: tuple[float, float]
    best: search.FittedStructure
    misfit: float


def _metered_fit(best: search.FittedStructure, folds: Sequence[Fold], misfit: float) -> MeteredFit | None:
    """A structure fitted again with the rate's likeliest meter; None where it leaves METER_MISFIT_SHARE and more."""
    meter = rate_meter([fold.measurement for fold in folds], effective_model(best.injector))
    slow = [by_meter(fold, meter) for fold in folds]
    again = search.fitted(best.structure, best.injector, best.calibration.free, slow, search.ROUGH_ITERATIONS)
    if isinstance(again, search.FailedStructure):
        return None
    left = rate_misfit(again.calibration, again.judged)
    return MeteredFit(meter, again, left) if left < METER_MISFIT_SHARE * misfit else None


def rate_misfit(calibration: Calibration, judged: Sequence[JudgedModel]) -> float:
    """Root mean square of a measured rate minus the modelled one, beyond noise, over that of the rate; 0 without."""
    beyond, total = 0.0, 0.0
    for fold, model in zip(calibration.folds, judged, strict=True):
        measurement, z = fold.measurement, model.z_of_rate
        if measurement.recording.injection_rate is not None:
            beyond += measurement.rate_noise**2 * max(float(z @ z) - z.size, 0.0)
            total += float(np.sum(measurement.recording.injection_rate[Rows(measurement).rate_samples] ** 2))
    return math.sqrt(beyond / total) if total else 0.0


def rate_meter(measured: Sequence[Measurement], model: EffectiveModel) -> tuple[float, float]:
    """Time constants [s] of a meter of two poles and a free gain that gives a model's rate the measured shape."""
    runs = [
        (one.interval, run.rate, one.recording.injection_rate[run.rate_samples])
        for one in measured
        if one.recording.injection_rate is not None
        for run in simulated(one, model)
    ]
    rate = np.concatenate([recorded for _, _, recorded in runs])

    def missed(lags: Floats) -> Floats:
        shown = np.concatenate([shown_slowly(modelled, interval, *lags) for interval, modelled, _ in runs])
        gain = (shown @ rate) / (shown @ shown)
        return np.asarray(rate - shown * gain)

    best = least_squares(missed, (1.5e-4, 3e-5), bounds=(1e-6, 2e-3), x_scale=1e-4, diff_step=1e-3)
    slow, quick = sorted(map(float, best.x), reverse=True)
    return slow, quick
