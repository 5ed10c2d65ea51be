"""findings.json: what `discover` answers, in printed units (schema 1)."""

import math
from typing import Any

from observer_rt.discovery.comparison.disagreement import PHASE_NAMES, Disagreement
from observer_rt.discovery.comparison.gaps import Gap, Gaps
from observer_rt.discovery.comparison.standstill import StandstillFigure
from observer_rt.discovery.findings import Findings, Sources, gap_share
from observer_rt.discovery.opinion import Opinion
from observer_rt.discovery.report.printed_units import definition, printed
from observer_rt.discovery.search.result import (
    Candidate,
    Consequence,
    Discovery,
    FittedEffect,
    FittedParameter,
    SmallestVisible,
)
from observer_rt.evidence.pooled import Signal
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND, MM3_PER_MS
from observer_rt.model.effects import VOCABULARY

SCHEMA = 1


def as_json(findings: Findings, sources: Sources) -> dict[str, Any]:
    """The document, in printed units."""
    found = findings.discovery
    unknown = found.unexplained
    return {
        "schema": SCHEMA,
        "verdict": found.verdict.value,
        "confidence": found.confidence,
        "confidence_method": found.confidence_method,
        "caveats": [{"id": one.id, "words": one.words, "sentence": one.sentence} for one in findings.caveats],
        "effects": [_effect(effect, found) for effect in found.effects],
        "rivals": [list(ids) for ids in found.rivals],
        "best": list(found.best.ids),
        "chosen": list(findings.chosen),
        "ranking": [_candidate(candidate, found) for candidate in found.ranking],
        "detection": {"gain": _finite(found.gain), "threshold": _finite(found.threshold)},
        "where": [_where(item, findings.points) for item in findings.where],
        "unknown": None
        if unknown is None
        else {
            "equation": unknown.equation.value,
            "phase": PHASE_NAMES[unknown.phase],
            "signal": unknown.signal.value,
            "depends_on": list(unknown.depends_on),
            "term": unknown.term,
        },
        "decide_by": [
            {"measurement": item.measurement, "separates": list(item.separates)} for item in found.decide_by
        ],
        "smallest_visible": [_visible(one) for one in found.smallest_visible],
        "gap": _gaps(findings.gaps),
        "checks": [_check(check, findings.files) for check in findings.checks],
        "observer": None if findings.opinion is None else _opinion(findings.opinion, findings.contradictions),
        "healthy_warning": findings.healthy_warning,
        "amended_model": findings.amended_model,
        "model": {
            "file": sources.model,
            "sha256": sources.model_hash,
            "in_force": list(sources.in_force),
        },
        "recordings": dict(sources.recordings),
        "judged_in_part": list(findings.in_part),
        "healthy": list(sources.healthy),
        "made": sources.made.isoformat(timespec="seconds"),
        "fitted_on": list(findings.fitted_on),
        "held_out": list(findings.held_out),
        "seconds": round(findings.seconds, 3),
    }


def _visible(one: SmallestVisible) -> dict[str, Any]:
    parameter = definition(one.id, one.parameter)
    return {
        "id": one.id,
        "parameter": one.parameter,
        "value": float(f"{one.size / parameter.si:.4g}"),
        "unit": parameter.unit,
    }


def _effect(effect: FittedEffect, found: Discovery) -> dict[str, Any]:
    return {
        "id": effect.id,
        "parameters": _parameters(effect.id, effect.parameters),
        "confidence": found.confidence,
        "indistinguishable_from": list(effect.indistinguishable_from),
        "gap_share": gap_share(found, effect),
        "moves": _moves(effect.moves),
    }


def _parameters(effect_id: str, parameters: tuple[FittedParameter, ...]) -> dict[str, Any]:
    result = {}
    for parameter in parameters:
        shown = printed(effect_id, parameter)
        result[shown.name] = {"value": shown.value, "ci95": list(shown.ci95), "unit": shown.unit}
    return result


def _candidate(candidate: Candidate, found: Discovery) -> dict[str, Any]:
    return {
        "ids": list(candidate.ids),
        "held_out_chi2": _finite(candidate.held_out),
        "chi2": _finite(candidate.statistic),
        "n_effective": found.samples,
        "parameters": [
            _parameters(effect_id, parameters)
            for effect_id, parameters in zip(candidate.ids, candidate.parameters, strict=True)
        ],
        "plausible": candidate.plausible,
        "moves": _moves(candidate.moves),
    }


def _moves(moves: Consequence) -> dict[str, float | None]:
    return {
        "line_pressure_rms_MPa": _finite(moves.line_pressure / MEGAPASCAL),
        "injected_mass_mean_mg": _finite(moves.mass / MILLIGRAM),
    }


def _where(item: Disagreement, points: tuple[str, ...]) -> dict[str, Any]:
    unit, name = (
        (MEGAPASCAL, "rms_MPa")
        if item.before.signal is Signal.LINE_PRESSURE
        else (MM3_PER_MS, "rms_mm3_per_ms")
    )
    return {
        "signal": item.before.signal.value,
        "phase": PHASE_NAMES[item.before.phase],
        "equation": None if item.equation is None else item.equation.value,
        "rail_pressure_MPa": item.before.rail_pressure / MEGAPASCAL,
        "open_ms": item.before.duration / MILLISECOND,
        "recording": points[item.before.recording],
        "nrmse": math.sqrt(item.before.variance),
        "significance": item.before.excess,
        name: item.before.rms / unit,
        "after": {
            "nrmse": math.sqrt(item.after.variance),
            "significance": item.after.excess,
            name: item.after.rms / unit,
        },
    }


def _check(check: StandstillFigure, files: tuple[str, ...]) -> dict[str, Any]:
    return {
        "id": check.id,
        "recording": None if check.recording is None else files[check.recording],
        "value": check.value,
        "sigma": _finite(check.sigma),
        "unit": check.unit,
        "passed": check.passed,
        "explained": check.explained,
    }


def _opinion(opinion: Opinion, against: tuple[str, ...]) -> dict[str, Any]:
    indicators = {}
    for indicator in opinion.indicators:
        parameter = VOCABULARY[indicator.effect_id].parameters[0]
        indicators[indicator.effect_id] = {
            "value": indicator.value / parameter.si,
            "sigma": _finite(indicator.sigma / parameter.si),
            "unit": parameter.unit,
        }
    return {
        "valid": opinion.valid,
        "injections": opinion.injections,
        "reasons": dict(opinion.reasons),
        "indicators": indicators,
        "contradictions": list(against),
    }


def _gaps(gaps: Gaps) -> dict[str, Any]:
    return {
        "line_pressure": _gap(gaps.line_pressure, "MPa", MEGAPASCAL),
        "injection_rate": None
        if gaps.injection_rate is None
        else _gap(gaps.injection_rate, "mm3_per_ms", MM3_PER_MS),
        "injected_mass": {
            "before_mg": _finite(gaps.mass.before / MILLIGRAM),
            "after_mg": _finite(gaps.mass.after / MILLIGRAM),
            "measured": gaps.injection_rate is not None,
        },
    }


def _gap(gap: Gap, unit: str, si: float) -> dict[str, float | None]:
    return {
        f"before_{unit}": _finite(gap.before / si),
        f"after_{unit}": _finite(gap.after / si),
        f"noise_floor_{unit}": _finite(gap.noise_floor / si),
    }


def _finite(value: float) -> float | None:
    """JSON has no infinity."""
    return value if math.isfinite(value) else None
