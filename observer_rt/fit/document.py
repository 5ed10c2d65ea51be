"""A fit as a JSON document, in printed units."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from observer_rt.estimation.phases import Phase
from observer_rt.evidence.pooled import Signal
from observer_rt.fit.calibrate import GATE, Calibrated
from observer_rt.fit.choice import judged_by
from observer_rt.fit.identifiability import interval
from observer_rt.fit.search import Failed, Fitted
from observer_rt.fit.words import level_words, oddities, phase_name, verdict_words
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.model.baseline import Baseline

SCHEMA = 1


def as_json(done: Calibrated, baseline: Baseline, warnings: Sequence[str]) -> dict[str, Any]:
    """Numbers that are not there are null."""
    document = {
        "schema": SCHEMA,
        "verdict": "inadequate" if done.inadequate else "adequate",
        "verdict_words": verdict_words(done),
        "gate_chi2": GATE,
        "inadequate_phases": [phase_name(phase) for phase in done.inadequate],
        "structure": {
            "name": done.fitted.structure.name,
            "line_outflow": done.fitted.structure.outflow.value,
            "line_model": done.fitted.structure.line,
            "reason": done.choice.reason,
        },
        "structures": [_structure(one) for one in done.choice.tried],
        "parameters": _parameters(done),
        "kept": {one.name: {"value": one.of(done.injector) / one.si, "unit": one.unit} for one in done.kept},
        "directions": [
            {"sigma": one.sigma, "share": dict(one.share)} for one in done.fitted.certainty.directions
        ],
        "level": {"from": done.level.value, "words": level_words(done)},
        "residuals": _residuals(done),
        "open_loop_rms_MPa": _pair([value / MEGAPASCAL for value in done.comparison.open_loop]),
        "injections": [
            {
                "recording": str(done.found[one.recording].recording.path or one.recording),
                "time_s": one.time,
                "rail_pressure_MPa": one.rail_pressure / MEGAPASCAL,
                "mass_mg": one.after / MILLIGRAM,
                "file_mass_mg": one.before / MILLIGRAM,
                "measured_mass_mg": one.measured / MILLIGRAM,
            }
            for one in done.comparison.masses
        ],
        "mass_share": done.mass_share,
        "line_pressure_offsets_MPa": {
            str(done.found[part.recording].recording.path or part.recording): float(offset)
            for part, offset in zip(done.fitted.calibration.parts, done.offsets, strict=True)
        },
        "baseline": baseline.model_dump(mode="json"),
        "warnings": [*warnings, *oddities(done)],
    }
    return _finite(document)  # type: ignore[no-any-return]


def _structure(one: Fitted | Failed) -> dict[str, Any]:
    if isinstance(one, Failed):
        return {"name": one.structure.name, "failed": one.reason}
    return {
        "name": one.structure.name,
        "held_out": one.held_out is not None,
        "chi2": {phase_name(phase): judged_by(one).chi2[phase] for phase in Phase},
        "chi2_mean": judged_by(one).mean,
        "free": [parameter.name for parameter in one.calibration.free],
        "converged": one.minimum.converged,
    }


def _parameters(done: Calibrated) -> dict[str, Any]:
    result = {}
    for one, sigma in zip(done.fitted.calibration.free, done.fitted.certainty.sigmas, strict=True):
        value = one.of(done.injector)
        before = one.stated(done.file)
        result[one.name] = {
            "symbol": one.symbol,
            "value": value / one.si,
            "ci95": [limit / one.si for limit in interval(value, float(sigma))],
            "file": None if before is None else before / one.si,
            "unit": one.unit,
        }
    return result


def _residuals(done: Calibrated) -> list[dict[str, Any]]:
    units = {Signal.LINE_PRESSURE: (MEGAPASCAL, "MPa"), Signal.INJECTION_RATE: (MM3_PER_MS, "mm3/ms")}
    return [
        {
            "signal": one.signal.value,
            "phase": phase_name(one.phase),
            "rms": _pair([value / units[one.signal][0] for value in one.rms]),
            "unit": units[one.signal][1],
            "chi2": _pair(one.chi2),
        }
        for one in done.comparison.residuals
    ]


def _pair(values: Sequence[float]) -> dict[str, float]:
    return {"file": values[0], "fitted": values[1]}


def _finite(content: Any) -> Any:
    """JSON knows no nan."""
    if isinstance(content, float):
        return content if math.isfinite(content) else None
    if isinstance(content, Mapping):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(value) for value in content]
    return content
