"""The fitted injector file: the file given, its comments and layout kept, with the fitted numbers and [baseline]."""

from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from tomlkit.items import Float, Trivia

from observer_rt.config.injector_file import InjectorFile, inline
from observer_rt.estimation.phases import Phase
from observer_rt.evidence.appearance import healthy_remainder
from observer_rt.evidence.likelihood import evidence_of
from observer_rt.evidence.measurement import rail_pressure_before
from observer_rt.evidence.reading import shortened
from observer_rt.fit.calibrate import Calibrated
from observer_rt.fit.problem import interval
from observer_rt.fit.residuals import worst_parts
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.model.baseline import Baseline, HealthyRemainder, NoiseFigures, PhaseFigures
from observer_rt.model.effects import BUILT_IN, effective_model
from observer_rt.model.parameters import LineParameters

ORIGIN = "observer-rt fit"
BASELINE = "baseline"
_DIGITS = 7
_PAIR = 2


def write_fitted(path: Path, file: InjectorFile, done: Calibrated, baseline: Baseline) -> None:
    """Write the file given with the fitted numbers. Raises `RunError` when it would not be taken back."""
    injector = done.injector
    with file.changed(path) as document:
        content: Any = document  # its sections are there, for the file was loaded
        if injector.line_outflow != done.file.line_outflow:
            content["line_outflow"] = injector.line_outflow.value
        _state_line(content["line"], done.file.line, injector.line)
        for parameter in done.fitted.calibration.free:
            value = parameter.of(injector)
            number = Float(value, Trivia(), f"{value:.{_DIGITS}g}")
            content[parameter.section][parameter.key] = number
        content.pop(BASELINE, None)
        content[BASELINE] = _tables(baseline.model_dump(mode="json", exclude_none=True))


def _tables(entry: Mapping[str, Any]) -> Any:
    """A section; what holds numbers or pairs stands in one line of it, what holds more is a section below."""
    table = tomlkit.table()
    for key, value in entry.items():
        is_section = isinstance(value, dict) and any(
            isinstance(one, dict) or (isinstance(one, list) and len(one) > _PAIR) for one in value.values()
        )
        table[key] = _tables(value) if is_section else inline(value) if isinstance(value, dict) else value
    return table


def _state_line(section: Any, before: LineParameters, after: LineParameters) -> None:
    """What a structure changes in [line]."""
    for key in ("model", "cells", "wall_viscosity", "inlet_loss_factor", "impedance_ratio", "impedance_step"):
        value = getattr(after, key)
        if value is None:
            section.pop(key, None)
        elif value != getattr(before, key) or key in section:
            section[key] = value


def baseline_of(done: Calibrated, hashes: dict[str, str]) -> Baseline:
    """What the file is to remember. hashes: SHA-256 of the recordings by name."""
    found, left = done.found, worst_parts(done.fitted.calibration, done.fitted.judged)
    noise = {
        "rail_pressure_MPa": [one.noise.rail_pressure / MEGAPASCAL for one in found],
        "line_pressure_MPa": [one.noise.line_pressure / MEGAPASCAL for one in found],
        "needle_lift_um": [one.noise.needle_lift / MICROMETRE for one in found],
    }
    pressures = [
        rail_pressure_before(event, one.recording) / MEGAPASCAL for one in found for event in one.events
    ]
    sigmas = done.fitted.certainty.sigmas
    return Baseline(
        adequate=not done.inadequate,
        level=done.level.value,
        mass_share=rounded(done.mass_share),
        sample_rate_Hz=rounded(found[0].recording.sample_rate),
        injections=sum(len(part.measurement.events) for part in done.fitted.calibration.parts),
        rail_pressure_MPa=_rounded_pair((min(pressures), max(pressures))),
        variance=_by_phase(left.variance),
        chi2=_by_phase(left.chi2),
        colour=_by_phase(left.colour),
        noise=NoiseFigures(**{name: rounded(sum(of) / len(of)) for name, of in noise.items()}),
        ci95={
            one.name: _rounded_pair(interval(one.of(done.injector), float(sigma)))
            for one, sigma in zip(done.fitted.calibration.free, sigmas, strict=True)
        },
        healthy=_remainder(done),
        recordings=tuple(shortened(hashes)),
        origin=ORIGIN,
        date=date.today().isoformat(),
    )


def _by_phase(figures: Mapping[Phase, float]) -> PhaseFigures:
    return PhaseFigures.of({phase.name: rounded(value) for phase, value in figures.items()})


def _remainder(done: Calibrated) -> HealthyRemainder:
    """What the fitted model leaves of the injections it was fitted to, each part compared with the others."""
    offset = float(np.mean(done.offsets)) * MEGAPASCAL
    model = effective_model(done.injector).with_terms("sensor", offset=offset)
    evidence = evidence_of([part.measurement for part in done.fitted.calibration.parts], model)
    found = healthy_remainder(evidence, model, tuple(BUILT_IN.values()))
    return found.model_copy(update={"line_pressure_offset_MPa": rounded(offset / MEGAPASCAL)})


def rounded(value: float) -> float:
    """To the digits a file needs."""
    return float(f"{value:.{_DIGITS}g}")


def _rounded_pair(pair: tuple[float, float]) -> tuple[float, float]:
    return rounded(pair[0]), rounded(pair[1])
