"""findings.json: what `discover` answers, in printed units (schema 1)."""

import json
import math
from typing import Any

from pydantic_core import to_json

from observer_rt.discovery.findings import Findings, Sources, gap_share
from observer_rt.discovery.gaps import PHASE_NAMES, Disagreement, ModelGaps
from observer_rt.discovery.opinion import Opinion
from observer_rt.discovery.report.text import definition, printed, proposal_words
from observer_rt.discovery.search.result import Candidate, Cell, Consequence, Discovery, Proposal
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.terms.term import Term

SCHEMA = 1


def as_json(findings: Findings, sources: Sources) -> dict[str, Any]:
    """The document, in printed units. Numbers that are not finite are null."""
    found = findings.discovery
    unknown = found.unexplained
    files: dict[int | None, str] = dict(enumerate(findings.files))
    document = {
        "schema": SCHEMA,
        "verdict": found.verdict,
        "confidence": found.confidence,
        "confidence_method": found.confidence_method,
        "caveats": findings.caveats,
        "effects": [
            {
                "id": effect.id,
                "parameters": printed(effect.id, effect.parameters),
                "confidence": found.confidence,
                "indistinguishable_from": effect.indistinguishable_from,
                "gap_share": gap_share(found, effect),
                "moves": _moves(effect.moves),
            }
            for effect in found.effects
        ],
        "rivals": found.rivals,
        "best": found.best.ids,
        "chosen": findings.chosen,
        "ranking": [_candidate(candidate, found) for candidate in found.ranking],
        "detection": {"gain": found.gain, "threshold": found.threshold},
        "where": [_where(item, findings.points) for item in findings.where],
        "unknown": None
        if unknown is None
        else {
            "equation": unknown.equation,
            "phase": PHASE_NAMES[unknown.phase],
            "signal": unknown.signal,
            "depends_on": unknown.depends_on,
            "term": unknown.term,
            "proposals": [_proposal(number, one) for number, one in enumerate(found.proposals, 1)],
        },
        "decide_by": found.decide_by,
        "smallest_visible": [
            {
                "id": one.id,
                "parameter": one.parameter,
                "value": float(f"{one.size / definition(one.id, one.parameter).si:.4g}"),
                "unit": definition(one.id, one.parameter).unit,
            }
            for one in found.smallest_visible
        ],
        "gap": _gaps(findings.gaps),
        "checks": [vars(check) | {"recording": files.get(check.recording)} for check in findings.checks],
        "observer": None if findings.opinion is None else _opinion(findings.opinion, findings.contradictions),
        "healthy_warning": findings.healthy_warning,
        "amended_model": findings.amended_model,
        "model": {"file": sources.model, "sha256": sources.model_hash, "in_force": sources.in_force},
        "recordings": sources.recordings,
        "judged_in_part": findings.in_part,
        "healthy": sources.healthy,
        "made": sources.made.isoformat(timespec="seconds"),
        "fitted_on": findings.fitted_on,
        "held_out": findings.held_out,
        "seconds": round(findings.seconds, 3),
    }
    content: dict[str, Any] = json.loads(to_json(document, inf_nan_mode="null"))
    return content


def _candidate(candidate: Candidate, found: Discovery) -> dict[str, Any]:
    return {
        "ids": candidate.ids,
        "held_out_chi2": candidate.held_out,
        "chi2": candidate.statistic,
        "n_effective": found.samples,
        "parameters": [
            printed(effect_id, parameters)
            for effect_id, parameters in zip(candidate.ids, candidate.parameters, strict=True)
        ],
        "plausible": candidate.plausible,
        "moves": _moves(candidate.moves),
    }


def _moves(moves: Consequence) -> dict[str, float]:
    return {
        "line_pressure_rms_MPa": moves.line_pressure / MEGAPASCAL,
        "injected_mass_mean_mg": moves.mass / MILLIGRAM,
    }


def _proposal(number: int, one: Proposal) -> dict[str, Any]:
    before, after = one.held_out
    sizes = dict(zip(one.found.ids, one.found.parameters, strict=True))
    return {
        "number": number,
        "sentence": proposal_words(one),
        "terms": [_term(term) for term in one.terms],
        "effects": [{"id": name, "parameters": printed(name, sizes[name])} for name in one.effects],
        "gain": one.gain,
        "phase": PHASE_NAMES[one.phase],
        "adequate": one.adequate,
        "sound": one.sound,
        "may_enter": one.may_enter,
        "gap_held_out": {"before_MPa": before / MEGAPASCAL, "after_MPa": after / MEGAPASCAL},
        "moves": _moves(one.moves),
    }


def _term(term: Term) -> dict[str, Any]:
    low, high = term.interval or (None, None)
    return {
        "equation": term.equation,
        "law": str(term.law),
        "coefficient": {"value": term.coefficient, "low": low, "high": high, "unit": str(term.equation.unit)},
        "hardly_told_from": term.equation.alike,
        "depends_on": sorted(variable.word for variable in term.law.variables),
    }


def _where(item: Disagreement, points: tuple[str, ...]) -> dict[str, Any]:
    cell = item.before
    return {
        "signal": cell.signal,
        "phase": PHASE_NAMES[cell.phase],
        "equation": item.equation,
        "rail_pressure_MPa": cell.rail_pressure / MEGAPASCAL,
        "open_ms": cell.duration / MILLISECOND,
        "recording": points[cell.recording],
        **_figures(cell),
        "after": _figures(item.after),
    }


def _figures(cell: Cell) -> dict[str, float]:
    return {
        "nrmse": math.sqrt(cell.variance),
        "significance": cell.excess,
        f"rms_{_key(cell.signal.unit)}": cell.rms / cell.signal.si,
    }


def _opinion(opinion: Opinion, against: tuple[str, ...]) -> dict[str, Any]:
    indicators = {}
    for indicator in opinion.indicators:
        parameter = VOCABULARY[indicator.effect_id].parameters[0]
        indicators[indicator.effect_id] = {
            "value": indicator.value / parameter.si,
            "sigma": indicator.sigma / parameter.si,
            "unit": parameter.unit,
        }
    return {
        "valid": opinion.valid,
        "injections": opinion.injections,
        "reasons": opinion.reasons,
        "indicators": indicators,
        "contradictions": against,
    }


def _gaps(gaps: ModelGaps) -> dict[str, Any]:
    result: dict[str, Any] = {"line_pressure": None, "injection_rate": None}
    for name, (unit, gap) in gaps.printed.items():
        result[name] = {f"{when}_{_key(unit)}": value for when, value in vars(gap).items()}
    del result["injected_mass"]["noise_floor_mg"]
    result["injected_mass"]["measured"] = gaps.injection_rate is not None
    return result


def _key(unit: str) -> str:
    """A unit as a part of a key."""
    return unit.replace("/", "_per_")
