"""The injector file of a fit: its fitted numbers, and the section [baseline] on the healthy injector."""

from collections.abc import Iterable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from tomlkit.items import Float, Trivia

from observer_rt.config.injector_file import InjectorFile, section_of
from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.identification.fit.calibrate import CalibrationResult
from observer_rt.identification.fit.comparison import pooled
from observer_rt.identification.fit.forms import FreeParameter
from observer_rt.identification.likelihood.appearance import healthy_remainder
from observer_rt.identification.likelihood.events import rail_pressure_before
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.reading import shortened
from observer_rt.model.baseline import Baseline, HealthyRemainder, NoiseFigures, PhaseFigures
from observer_rt.model.effects import effective_model, seen_in
from observer_rt.model.parameters import InjectorParameters

ORIGIN = "observer-rt fit"
BASELINE = "baseline"
_DIGITS = 7
_OF_LINE = ("model", "cells", "wall_viscosity", "inlet_loss_factor", "impedance_ratio", "impedance_step")
"""Keys of [line] that a structure changes."""


def write_fitted(path: Path, file: InjectorFile, done: CalibrationResult, baseline: Baseline) -> None:
    """Write the file given with the fitted numbers. Raises `RunError` when it could not be loaded again."""
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
        set_numbers(content, done.fitted.calibration.free, injector)
        if done.measurements[0].is_answered:
            content["needle"] = section_of({key: rounded(value) for key, value in dict(injector.needle).items()})
        if (share := done.level_share) is not None:
            density = done.file.accuracy.fuel_density_percent
            content["accuracy"] = {"fuel_density_percent": density, "mass_percent": rounded(100.0 * share)}
        content.pop(BASELINE, None)
        content[BASELINE] = section_of(baseline.model_dump(mode="json", exclude_none=True))


def set_numbers(content: Any, free: Iterable[FreeParameter], injector: InjectorParameters) -> None:
    """Sets the numbers of free parameters in the content of an injector file to those of an injector."""
    for parameter in free:
        value = parameter.of(injector)
        content[parameter.section][parameter.key] = Float(value, Trivia(), f"{value:.{_DIGITS}g}")


def baseline_of(done: CalibrationResult, hashes: dict[str, str]) -> Baseline:
    """The section [baseline] of the file. hashes: SHA-256 of the recordings by name."""
    recordings, calibration = done.measurements, done.fitted.calibration
    # a model's errors depend on the operating point: of each phase, the fold with the largest residuals counts
    left = [pooled([fold], [judged]) for fold, judged in zip(calibration.recordings, done.fitted.judged, strict=True)]
    noise = {
        "rail_pressure_MPa": [one.noise.rail_pressure / MEGAPASCAL for one in recordings],
        "line_pressure_MPa": [one.noise.line_pressure / MEGAPASCAL for one in recordings],
        "needle_lift_um": [one.noise.needle_lift / MICROMETRE for one in recordings],
    }
    pressures = [rail_pressure_before(event, one.recording) for one in recordings for event in one.events]
    return Baseline(
        adequate=not done.inadequate,
        level=done.level_source.value,
        mass_share=rounded(done.mass_share),
        sample_rate_Hz=rounded(recordings[0].recording.sample_rate),
        injections=sum(len(fold.measurement.events) for fold in done.fitted.calibration.folds),
        rail_pressure_MPa=_rounded_pair((min(pressures) / MEGAPASCAL, max(pressures) / MEGAPASCAL)),
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
    """Residuals of the fitted model, each fold compared with the shape of the others."""
    offset = float(np.mean(done.fitted.offsets)) * MEGAPASCAL
    model = effective_model(done.injector).with_changes("sensor", offset=offset)
    likelihood = joint_likelihood([fold.measurement for fold in done.fitted.calibration.folds], model)
    remainder = healthy_remainder(likelihood, model, seen_in(has_lift=True))
    return remainder.model_copy(update={"line_pressure_offset_MPa": rounded(offset / MEGAPASCAL)})


def rounded(value: float) -> float:
    """A number with the digits that a file needs."""
    return float(f"{value:.{_DIGITS}g}")


def _rounded_pair(pair: tuple[float, float]) -> tuple[float, float]:
    return rounded(pair[0]), rounded(pair[1])
