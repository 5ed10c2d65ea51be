"""What `discover` answers for programs, in printed units: findings.json (schema 1), tables as CSV, figures as SVG."""

import csv
import json
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic_core import to_json

from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MILLISECOND, MM3_PER_MS
from observer_rt.identification.discovery.findings import Findings, Opinion, Sources, gap_share
from observer_rt.identification.discovery.gaps import PHASE_NAMES, Disagreement, ModelGaps, Overlay
from observer_rt.identification.discovery.report.figures import overlay_figure
from observer_rt.identification.discovery.report.page import held_out_figure, with_words
from observer_rt.identification.discovery.report.text import definition, printed, proposal_words
from observer_rt.identification.discovery.search.results import (
    Candidate,
    Cell,
    Consequence,
    Discovery,
    Proposal,
)
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
        "sound": one.unsound is None,
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
    for name, gap in gaps.printed.items():
        figures = {"before": gap.before, "after": gap.after, "noise_floor": gap.noise_floor}
        result[name] = {f"{when}_{_key(gap.unit)}": value for when, value in figures.items()}
    del result["injected_mass"]["noise_floor_mg"]
    result["injected_mass"]["measured"] = gaps.printed["injected_mass"].measured
    return result


def _key(unit: str) -> str:
    """A unit as a part of a key."""
    return unit.replace("/", "_per_")


_TABLES = ("effects.csv", "candidates.csv", "disagreement.csv", "gaps.csv", "standstill.csv")
_INJECTIONS_FIGURE, _GAPS_FIGURE = "injections.svg", "gaps.svg"
_XML = '<?xml version="1.0" encoding="utf-8"?>\n'

Row = Sequence[str | float | int | None]


def write_data(folder: Path, findings: Findings) -> None:
    """Tables and figures into a folder, which is made."""
    folder.mkdir(exist_ok=True)
    rows = (_effect_rows, _candidate_rows, _disagreement_rows, _gap_rows, _standstill_rows)
    for name, table in zip(_TABLES, rows, strict=True):
        _write(folder / name, table(findings))
    label = with_words(findings.discovery)
    for number, overlay in enumerate(findings.overlays, start=1):
        _write(folder / f"injection_{number}.csv", _injection_rows(overlay))
    for name, svg in (
        (_INJECTIONS_FIGURE, overlay_figure(findings.overlays, label)),
        (_GAPS_FIGURE, held_out_figure(findings)),
    ):
        (folder / name).write_text(_XML + svg, encoding="utf-8")


def remove_data(folder: Path) -> None:
    """Take away what an earlier run wrote there, and nothing else."""
    if folder.is_dir():
        names = (*_TABLES, _INJECTIONS_FIGURE, _GAPS_FIGURE)
        for path in (*(folder / name for name in names), *folder.glob("injection_[0-9].csv")):
            path.unlink(missing_ok=True)
        if not any(folder.iterdir()):
            folder.rmdir()


def _write(path: Path, rows: Iterable[Row]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([_text(value) for value in row] for row in rows)


def _text(value: str | float | None) -> str:
    """Ten digits; nothing for what there is not."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    return f"{value:.10g}" if isinstance(value, float) else str(value)


def _effect_rows(findings: Findings) -> Iterator[Row]:
    yield "candidate", "effect", "parameter", "unit", "value", "ci95_low", "ci95_high"
    for candidate in findings.discovery.ranking:
        for effect_id, parameters in zip(candidate.ids, candidate.parameters, strict=True):
            for name, one in printed(effect_id, parameters).items():
                yield "+".join(candidate.ids), effect_id, name, one.unit, one.value, *one.ci95


def _candidate_rows(findings: Findings) -> Iterator[Row]:
    found = findings.discovery
    nominal = next(one for one in found.ranking if not one.ids)
    yield (
        *("candidate", "minus_2_log_l", "gain", "held_out_gain", "moves_line_pressure_rms_MPa"),
        *("moves_injected_mass_mg", "plausible"),
    )
    for one in found.ranking:
        yield (
            "+".join(one.ids) or "model as given",
            one.statistic,
            nominal.statistic - one.statistic,
            nominal.held_out - one.held_out,
            one.moves.line_pressure / MEGAPASCAL,
            one.moves.mass / MILLIGRAM,
            int(one.plausible),
        )


def _disagreement_rows(findings: Findings) -> Iterator[Row]:
    """What stands in the map: every signal in every phase at every operating point, before and after."""
    figures = ("ratio_to_noise", "colour", "significance_sigma", "rms")
    yield (
        *("operating_point", "rail_pressure_MPa", "open_ms", "signal", "unit", "phase"),
        *(f"{figure}_{when}" for when in ("before", "after") for figure in figures),
    )
    for item in findings.where:
        cell = item.before
        yield (
            findings.points[cell.recording],
            cell.rail_pressure / MEGAPASCAL,
            cell.duration / MILLISECOND,
            cell.signal.value,
            cell.signal.unit,
            PHASE_NAMES[cell.phase],
            *_numbers(cell),
            *_numbers(item.after),
        )


def _numbers(cell: Cell) -> Row:
    return math.sqrt(cell.variance), math.sqrt(cell.colour), cell.excess, cell.rms / cell.signal.si


def _gap_rows(findings: Findings) -> Iterator[Row]:
    """Rms of model minus measurement; of the mass against the model with what was found where none is measured."""
    after = bool(findings.discovery.effects)
    yield "operating_point", "signal", "unit", "before", "after", "noise_alone"
    for point in findings.gaps.points:
        for gap in point.printed.values():
            left = gap.after if after else None
            yield findings.points[point.recording], gap.name, gap.unit, gap.before, left, gap.noise_floor


def _standstill_rows(findings: Findings) -> Iterator[Row]:
    yield "recording", "figure", "value", "sigma", "unit", "passed", "explained"
    for check in findings.checks:
        name = "" if check.recording is None else findings.files[check.recording]
        yield name, check.id, check.value, check.sigma, check.unit, int(check.passed), int(check.explained)


def _injection_rows(one: Overlay) -> Iterator[Row]:
    """The signals of one injection of the report, measured and modelled."""
    columns = {
        "time_ms": (one.time, MILLISECOND),
        "needle_lift_um": (one.lift, MICROMETRE),
        "line_pressure_MPa": (one.line_pressure, MEGAPASCAL),
        "line_pressure_as_given_MPa": (one.nominal_pressure, MEGAPASCAL),
        "line_pressure_amended_MPa": (one.amended_pressure, MEGAPASCAL),
        "injection_rate_mm3_per_ms": (one.measured_rate, MM3_PER_MS),
        "injection_rate_as_given_mm3_per_ms": (one.nominal_rate, MM3_PER_MS),
        "injection_rate_amended_mm3_per_ms": (one.amended_rate, MM3_PER_MS),
    }
    there = {name: values / si for name, (values, si) in columns.items() if values is not None}
    yield tuple(there)
    yield from zip(*(values.tolist() for values in there.values()), strict=True)
