"""Calibrates a model: settles the structure chosen, judges it, writes its file."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tomlkit.items import Float, Trivia

from observer_rt.config.injector_file import InjectorFile, section_of
from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.errors import RunError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.identification.fit.causes import TriedCause, tried_causes
from observer_rt.identification.fit.folds import by_meter, folds_of, share_between_samples, thinned
from observer_rt.identification.fit.masses import MeanMass
from observer_rt.identification.fit.problem import INERTANCE, NEEDLE, NOZZLE, STRUCTURES, FreeParameter, Structure
from observer_rt.identification.fit.rate import rate_meter, rate_misfit
from observer_rt.identification.fit.residuals import Comparison, compared, pooled
from observer_rt.identification.fit.search import (
    FINE_EVENTS,
    ROUGH_EVENTS,
    ROUGH_ITERATIONS,
    FailedStructure,
    FittedStructure,
    fitted,
    settled,
)
from observer_rt.identification.fit.structures import Choice, choose, tried_structures
from observer_rt.identification.likelihood.appearance import healthy_remainder
from observer_rt.identification.likelihood.likelihood import GAIN_ERROR, joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement, rail_pressure_before
from observer_rt.identification.likelihood.reading import shortened
from observer_rt.model.baseline import Baseline, HealthyRemainder, NoiseFigures, PhaseFigures
from observer_rt.model.effects import effective_model, seen_in
from observer_rt.model.parameters import InjectorParameters

GATE = 2.5  # chi2 of a phase, above which a model is not adequate
TOLERATED = 0.03  # of the swing of the line pressure, up to which a residual is part of every interval
# Of a mass: impedance of the cells at the closed end, corners of the lift and the like.
LEAST_MASS_SHARE = 1.2e-3
ANSWERED_SHARE = 3e-3  # of a mass, where the lift was not measured; M: on plants of other lines and needles
RATE_MISFIT = 0.02  # of a measured rate, from which on its meter, and not the injector, has its shape
METERED = 0.5  # of this misfit, from which on poles of the meter explain it
ORIGIN = "observer-rt fit"
BASELINE = "baseline"
ROUGH = 0.8  # of the time, in which structures are compared
_DIGITS = 7
_OF_LINE = ("model", "cells", "wall_viscosity", "inlet_loss_factor", "impedance_ratio", "impedance_step")
"""Keys of [line] that a structure changes."""


class FlowLevel(StrEnum):
    """Measurement that fixes the absolute level of flow."""

    FILE = "file"
    RATE = "measured_rate"
    MASS = "measured_mass"


@dataclass(frozen=True)
class FittedNumber:
    """A parameter with its 95 % interval, in its printed unit. file: what the file had, None: nothing."""

    symbol: str
    value: float
    ci95: tuple[float, float]
    file: float | None
    unit: str


@dataclass(frozen=True, eq=False)
class CalibrationResult:
    """Result of a fit.

    file: the injector before; choice: of structures, compared on few events; fitted: the chosen one on many; kept:
    parameters the recordings do not tell, as in the file; comparison: before and after; rate_misfit: of the shape of
    a measured rate beside the model that explains the pressures and its integrals, as a share; meter: time constants
    [s] of the rate's meter, stated or found; causes: tried where more than noise is left, the best first;
    not_observed: why the observer could not learn with the fitted model, empty where it could; flow_level: of
    published masses over these, for the gain of a sensor was taken out before.
    """

    file: InjectorParameters
    measurements: Sequence[Measurement]
    choice: Choice
    fitted: FittedStructure
    kept: tuple[FreeParameter, ...]
    level: FlowLevel
    comparison: Comparison
    rate_misfit: float
    meter: tuple[float, ...] = ()
    causes: tuple[TriedCause, ...] = ()
    not_observed: str = ""
    flow_level: float = 1.0

    @property
    def injector(self) -> InjectorParameters:
        """The injector fitted."""
        return self.fitted.injector

    @property
    def sizes(self) -> dict[str, FittedNumber]:
        """The parameters fitted, by name."""
        sizes = {}
        for parameter, sigma in zip(self.fitted.calibration.free, self.fitted.certainty.sigmas, strict=True):
            value, before = parameter.of(self.injector), parameter.stated(self.file)
            low, high = parameter.interval(value, float(sigma))
            file = None if before is None else before / parameter.si
            ci95 = (low / parameter.si, high / parameter.si)
            sizes[parameter.name] = FittedNumber(parameter.symbol, value / parameter.si, ci95, file, parameter.unit)
        return sizes

    @property
    def above_gate(self) -> tuple[Phase, ...]:
        """Phases in which more is left than noise."""
        return tuple(phase for phase in Phase if self.comparison.left.chi2[phase] > GATE)

    @property
    def cause(self) -> TriedCause | None:
        """The effect that explains what the model leaves."""
        return self.causes[0] if self.causes and self.causes[0].explains else None

    @property
    def inadequate(self) -> tuple[Phase, ...]:
        """Phases the model does not explain, the worst first; none where it is adequate.

        A needle that answers commands makes up for what a line lacks, so that little is left of much.
        """
        share = self.comparison.share
        is_strict = self.measurements[0].is_answered or (self.cause is not None and self.cause.is_of_bench)
        over = [phase for phase in self.above_gate if is_strict or share(phase) > TOLERATED]
        return tuple(sorted(over, key=lambda phase: -self.comparison.left.chi2[phase]))

    @property
    def told_shares(self) -> NDArray[np.float64]:
        """Standard deviation of a mass by its own pressures, as share, where all but alpha_H is known: (folds,)."""
        calibration, at = self.fitted.calibration, self.fitted.minimum.at
        if NOZZLE not in calibration.free:
            return np.full(len(calibration.folds), math.inf)
        slopes = np.split(at.slopes[:, calibration.free.index(NOZZLE)], np.cumsum(at.residuals.counts[:-1]))
        by_fold = zip(calibration.folds, slopes[::3], strict=False)  # of line pressure; rate and mass follow
        return np.array([math.sqrt(len(fold.measurement.events) / (slope @ slope)) for fold, slope in by_fold])

    @property
    def mass_share(self) -> float:
        """Standard deviation of a mass, as a share, that learning will not remove.

        From what a recording left out changes, from structures that explain the recordings as well, from edges of
        the lift between slow instants, and from a lift that was not measured. How well a measured level was
        determined is in `level_share`.
        """
        held_out = self.fitted.held_out
        left_out = 0.0 if held_out is None else float(np.sqrt(np.mean(held_out.mass_shift**2)))
        between = max(map(share_between_samples, self.measurements))
        answered = ANSWERED_SHARE if self.measurements[0].is_answered else 0.0
        return math.hypot(LEAST_MASS_SHARE, left_out, self.choice.mass_spread, between, answered)

    @property
    def level_share(self) -> float | None:
        """Standard deviation of the level, as a share: how well it was determined, or the measurement's own.

        The former has the latter in it, and less of it by each further mass, as if no error were common to them. That
        of a rate is its gain's, and the density's; None where nothing was measured.
        """
        if self.level is FlowLevel.FILE:
            return None
        determined = zip(self.fitted.calibration.free, self.fitted.certainty.sigmas, strict=True)
        # An area, of a diameter.
        by_fit = sum(2.0 * float(sigma) for one, sigma in determined if one is INERTANCE)
        weighed = [fold.weighed for fold in self.fitted.calibration.folds if fold.weighed is not None]
        own = [one.sigma / one.mass for one in weighed]
        by_rate = math.hypot(GAIN_ERROR, 0.01 * self.file.accuracy.fuel_density_percent)
        return max(by_fit, float(np.median(own)) if own else by_rate)


def calibrate(
    file: InjectorParameters,
    recordings: Sequence[Measurement],
    weighed: Mapping[int, MeanMass],
    progress: Callable[[float], None],
    structures: Sequence[Structure] = STRUCTURES,
) -> CalibrationResult:
    """Fit an injector to recordings of it in health. weighed: measured masses, by the number of the recording.

    Raises `RunError` where no structure has a solution.
    """
    level = FlowLevel.MASS if weighed else FlowLevel.FILE
    if any(one.recording.injection_rate is not None for one in recordings):  # which gives it at every sample
        level = FlowLevel.RATE
    folds = folds_of(recordings, weighed)
    coarse = tuple(thinned(fold, ROUGH_EVENTS) for fold in folds)  # structures are compared on
    further = (() if level is FlowLevel.FILE else (INERTANCE,)) + (NEEDLE if recordings[0].is_answered else ())
    tried = tried_structures(structures, file, further, coarse, lambda share: progress(ROUGH * share))
    choice = choose(tried)
    if choice is None:
        failed = (one for one in tried if isinstance(one, FailedStructure))
        reasons = "; ".join(f"{one.structure.name}: {one.reason}" for one in failed)
        raise RunError(f"no structure can be fitted to these recordings\n  {reasons}")
    misfit = rate_misfit(choice.best.calibration, choice.best.judged)
    meter = recordings[0].recording.meter
    has_shape = misfit <= RATE_MISFIT and not meter  # poles are not known so well that V_S could be told from them
    if not has_shape and meter is None:
        free = rate_meter([fold.measurement for fold in coarse], effective_model(choice.best.injector))
        slow = [by_meter(fold, free) for fold in coarse]
        calibration = choice.best.calibration
        again = fitted(choice.best.structure, choice.best.injector, calibration.free, slow, ROUGH_ITERATIONS)
        if isinstance(again, FittedStructure) and rate_misfit(again.calibration, again.judged) < METERED * misfit:
            meter, misfit = free, rate_misfit(again.calibration, again.judged)
            choice, folds = replace(choice, best=again), tuple(by_meter(fold, free) for fold in folds)
    fine = [replace(thinned(fold, FINE_EVENTS), rate_shape=has_shape) for fold in folds]
    best, kept = settled(choice.best, file, fine)
    comparison = compared(file, best.injector, best.offsets, best.calibration.folds)
    done = CalibrationResult(file, recordings, choice, best, kept, level, comparison, misfit, meter or ())
    if done.above_gate:
        done = replace(done, causes=tried_causes(choice.best))
    progress(1.0)
    return done


def write_fitted(path: Path, file: InjectorFile, done: CalibrationResult, baseline: Baseline) -> None:
    """Write the file given with the fitted numbers. Raises `RunError` when it would not be taken back."""
    injector = done.injector
    with file.changed(path) as document:
        content: Any = document  # its sections are there, for the file was loaded
        if injector.line_outflow != done.file.line_outflow:
            content["line_outflow"] = injector.line_outflow.value
        section, before, after = content["line"], done.file.line, injector.line
        for key in _OF_LINE:
            value = getattr(after, key)
            if value is None:
                section.pop(key, None)
            elif value != getattr(before, key) or key in section:
                section[key] = value
        for parameter in done.fitted.calibration.free:
            value = parameter.of(injector)
            content[parameter.section][parameter.key] = Float(value, Trivia(), f"{value:.{_DIGITS}g}")
        if done.measurements[0].is_answered:
            content["needle"] = section_of({key: rounded(value) for key, value in dict(injector.needle).items()})
        if (share := done.level_share) is not None:
            density = done.file.accuracy.fuel_density_percent
            content["accuracy"] = {"fuel_density_percent": density, "mass_percent": rounded(100.0 * share)}
        content.pop(BASELINE, None)
        content[BASELINE] = section_of(baseline.model_dump(mode="json", exclude_none=True))


def baseline_of(done: CalibrationResult, hashes: dict[str, str]) -> Baseline:
    """Makes the section [baseline] of the file. hashes: SHA-256 of the recordings by name."""
    recordings, calibration = done.measurements, done.fitted.calibration
    # what the model gets wrong goes with the operating point: of each phase, the fold with the most left
    left = [pooled([fold], [judged]) for fold, judged in zip(calibration.recordings, done.fitted.judged, strict=True)]
    noise = {
        "rail_pressure_MPa": [one.noise.rail_pressure / MEGAPASCAL for one in recordings],
        "line_pressure_MPa": [one.noise.line_pressure / MEGAPASCAL for one in recordings],
        "needle_lift_um": [one.noise.needle_lift / MICROMETRE for one in recordings],
    }
    pressures = [
        rail_pressure_before(event, one.recording) / MEGAPASCAL for one in recordings for event in one.events
    ]
    return Baseline(
        adequate=not done.inadequate,
        level=done.level.value,
        mass_share=rounded(done.mass_share),
        sample_rate_Hz=rounded(recordings[0].recording.sample_rate),
        injections=sum(len(fold.measurement.events) for fold in done.fitted.calibration.folds),
        rail_pressure_MPa=_rounded_pair((min(pressures), max(pressures))),
        variance=_largest([one.variance for one in left]),
        chi2=_largest([one.chi2 for one in left]),
        colour=_largest([one.colour for one in left]),
        noise=NoiseFigures(**{name: rounded(sum(of) / len(of)) for name, of in noise.items()}),
        ci95={
            one.name: _rounded_pair(one.interval(one.of(done.injector), float(sigma)))
            for one, sigma in zip(done.fitted.calibration.free, done.fitted.certainty.sigmas, strict=True)
        },
        healthy=_remainder(done),
        recordings=tuple(shortened(hashes)),
        origin=ORIGIN,
        date=date.today().isoformat(),
    )


def _largest(figures: Sequence[Mapping[Phase, float]]) -> PhaseFigures:
    largest = {phase.name: rounded(float(np.fmax.reduce([one[phase] for one in figures]))) for phase in Phase}
    return PhaseFigures.of(largest)


def _remainder(done: CalibrationResult) -> HealthyRemainder:
    """Measures what the fitted model leaves of its injections, each fold compared with the others."""
    offset = float(np.mean(done.fitted.offsets)) * MEGAPASCAL
    model = effective_model(done.injector).with_terms("sensor", offset=offset)
    likelihood = joint_likelihood([fold.measurement for fold in done.fitted.calibration.folds], model)
    remainder = healthy_remainder(likelihood, model, seen_in(has_lift=True))
    return remainder.model_copy(update={"line_pressure_offset_MPa": rounded(offset / MEGAPASCAL)})


def rounded(value: float) -> float:
    """To the digits a file needs."""
    return float(f"{value:.{_DIGITS}g}")


def _rounded_pair(pair: tuple[float, float]) -> tuple[float, float]:
    return rounded(pair[0]), rounded(pair[1])
