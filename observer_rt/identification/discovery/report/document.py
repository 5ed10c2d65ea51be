"""findings.json: the findings of `discover` for programs, in printed units, and how they are made of `Findings`."""

import math
from typing import Any

from pydantic import Field

from observer_rt.foundation.documents import Document, Figures
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND
from observer_rt.identification.discovery.findings import (
    Caveat,
    Findings,
    PrintedFigure,
    Sources,
    gap_share,
)
from observer_rt.identification.discovery.gaps import PHASE_NAMES, Disagreement, ModelGaps
from observer_rt.identification.discovery.injections import MassChange
from observer_rt.identification.discovery.report.document_entries import (
    AlternativeEntry,
    CellOfMap,
    Gap,
    InjectionEntry,
    LostEntry,
    MassEntry,
    ModelSource,
    NamedEffect,
    PartEntry,
    ProposalEntry,
    ProposedTerm,
    RankedCandidate,
    StandstillCheck,
    Unknown,
    VisibleSize,
)
from observer_rt.identification.discovery.report.formula import formula
from observer_rt.identification.discovery.report.law_words import as_if
from observer_rt.identification.discovery.report.text import definition, printed, proposal_words, sizes_of
from observer_rt.identification.discovery.search.results import (
    Candidate,
    Cell,
    Consequence,
    Decisive,
    Discovery,
    Proposal,
    Verdict,
)
from observer_rt.identification.planning.plan import MeasurementPlan
from observer_rt.model.terms.term import Term

FINDINGS = "findings.json"


class FindingsDocument(Document):
    """Findings of `observer-rt discover`. Keys with a default came later: earlier versions did not write them."""

    verdict: Verdict
    confidence: float
    confidence_method: str
    caveats: tuple[Caveat, ...]
    effects: tuple[NamedEffect, ...]
    rivals: tuple[tuple[str, ...], ...]
    best: tuple[str, ...] = ()
    chosen: tuple[str, ...] = ()
    ranking: tuple[RankedCandidate, ...]
    detection: Figures = Field(description="gain of the winner in -2 log L, threshold it had to exceed")
    where: tuple[CellOfMap, ...]
    unknown: Unknown | None = None
    decide_by: tuple[Decisive, ...]
    smallest_visible: tuple[VisibleSize, ...] = ()
    gap: dict[str, Gap | None]
    checks: tuple[StandstillCheck, ...] = ()
    healthy_warning: str = ""
    amended_model: str | None
    accepted_proposal: int = Field(
        default=0, description="number of the one in the amended model, 0 for none"
    )
    in_part: bool = Field(default=False, description="whether that leaves something, stated as [remainder]")
    injections: tuple[InjectionEntry, ...] = ()
    masses: tuple[MassEntry, ...] = ()
    model: ModelSource
    recordings: dict[str, str] = Field(description="SHA-256 by file name")
    judged_in_part: tuple[str, ...] = ()
    healthy: tuple[str, ...] = ()
    made: str = Field(default="", description="local time, ISO 8601")
    fitted_on: tuple[str, ...]
    held_out: tuple[str, ...]
    plan: MeasurementPlan | None = None
    seconds: float

    @property
    def proposal(self) -> str:
        """The first proposal; empty without one."""
        return next((one.sentence for one in self.unknown.proposals), "") if self.unknown else ""


def document_of(findings: Findings, sources: Sources) -> FindingsDocument:
    """Puts findings into printed units."""
    found = findings.discovery
    files: dict[int | None, str] = dict(enumerate(findings.files))
    return FindingsDocument(
        schema=1,
        verdict=found.verdict,
        confidence=found.confidence,
        confidence_method=found.confidence_method,
        caveats=findings.caveats,
        effects=tuple(
            NamedEffect(
                id=effect.id,
                parameters=printed(effect.id, effect.parameters),
                confidence=found.confidence,
                indistinguishable_from=effect.indistinguishable_from,
                gap_share=gap_share(found, effect),
                moves=_moves(effect.moves),
            )
            for effect in found.effects
        ),
        rivals=found.rivals,
        best=found.best.ids,
        chosen=findings.chosen,
        ranking=tuple(_candidate(candidate, found) for candidate in found.ranking),
        detection={"gain": found.gain, "threshold": found.threshold},
        where=tuple(_cell(item, findings.points) for item in findings.where),
        unknown=_unknown(found),
        decide_by=found.decide_by,
        smallest_visible=tuple(
            VisibleSize(
                id=one.id,
                parameter=one.parameter,
                value=float(f"{one.size / definition(one.id, one.parameter).si:.4g}"),
                unit=definition(one.id, one.parameter).unit,
            )
            for one in found.smallest_visible
        ),
        gap=_gaps(findings.gaps),
        checks=tuple(
            StandstillCheck(**vars(one) | {"recording": files.get(one.recording)}) for one in findings.checks
        ),
        healthy_warning=findings.healthy_warning,
        amended_model=findings.amended_model,
        accepted_proposal=findings.accepted,
        in_part=findings.remainder is not None,
        injections=tuple(
            InjectionEntry(
                recording=findings.points[one.recording],
                number=one.number,
                before_MPa=one.before / MEGAPASCAL,
                after_MPa=one.after / MEGAPASCAL,
            )
            for one in findings.injections
        ),
        masses=tuple(_mass(one, findings.points[one.recording]) for one in findings.masses),
        model=ModelSource(file=sources.model, sha256=sources.model_hash, in_force=sources.in_force),
        recordings=dict(sources.recordings),
        judged_in_part=findings.in_part,
        healthy=sources.healthy,
        made=sources.made.isoformat(timespec="seconds"),
        fitted_on=findings.fitted_on,
        held_out=findings.held_out,
        plan=findings.plan,
        seconds=round(findings.seconds, 3),
    )


def _mass(one: MassChange, point: str) -> MassEntry:
    change, half = (100.0 * value / one.nominal for value in (one.change, one.half))
    return MassEntry(
        recording=point,
        nominal_mg=one.nominal / MILLIGRAM,
        change_pct=change,
        ci95_pct=(change - half, change + half),
    )


def _candidate(candidate: Candidate, found: Discovery) -> RankedCandidate:
    return RankedCandidate(
        ids=candidate.ids,
        held_out_chi2=candidate.held_out,
        chi2=candidate.statistic,
        n_effective=found.samples,
        parameters=tuple(sizes_of(candidate).values()),
        plausible=candidate.plausible,
        moves=_moves(candidate.moves),
    )


def _moves(moves: Consequence) -> dict[str, float | None]:
    return {
        "line_pressure_rms_MPa": moves.line_pressure / MEGAPASCAL,
        "injected_mass_mean_mg": moves.mass / MILLIGRAM,
    }


def _cell(item: Disagreement, points: tuple[str, ...]) -> CellOfMap:
    cell = item.before
    return CellOfMap(
        signal=cell.signal,
        phase=PHASE_NAMES[cell.phase],
        equation=item.equation,
        rail_pressure_MPa=cell.rail_pressure / MEGAPASCAL,
        open_ms=cell.duration / MILLISECOND,
        recording=points[cell.recording],
        **_figures(cell),
        after=_figures(item.after),
    )


def _figures(cell: Cell) -> dict[str, Any]:
    rms = f"rms_{_key(cell.signal.unit)}"
    return {"nrmse": math.sqrt(cell.variance), "significance": cell.excess, rms: cell.rms / cell.signal.si}


def _gaps(gaps: ModelGaps) -> dict[str, dict[str, float | bool | None] | None]:
    result: dict[str, dict[str, float | bool | None] | None] = {"line_pressure": None, "injection_rate": None}
    for name, gap in gaps.printed.items():
        unit = _key(gap.unit)
        stated = result[name] = {f"before_{unit}": gap.before, f"after_{unit}": gap.after}
        is_mass = name == "injected_mass"
        stated |= {"measured": gap.measured} if is_mass else {f"noise_floor_{unit}": gap.noise_floor}
    return result


def _key(unit: str) -> str:
    """A unit as a part of a key."""
    return unit.replace("/", "_per_")


def _unknown(found: Discovery) -> Unknown | None:
    left = found.unexplained
    if left is None:
        return None
    return Unknown(
        equation=left.equation,
        phase=PHASE_NAMES[left.phase],
        signal=left.signal,
        depends_on=left.depends_on,
        term=left.term,
        proposals=tuple(_proposal(number, one) for number, one in enumerate(found.proposals, 1)),
    )


def _proposal(number: int, one: Proposal) -> ProposalEntry:
    before, after = one.held_out
    lift = one.largest_lift
    base = one.found.statistic + one.gain
    sizes = sizes_of(one.found)
    return ProposalEntry(
        number=number,
        sentence=proposal_words(one),
        terms=_terms(one.found, lift),
        effects=tuple(NamedEffect(id=name, parameters=sizes[name]) for name in one.effects),
        gain=one.gain,
        phase=PHASE_NAMES[one.phase],
        adequate=one.adequate,
        sound=one.unsound is None,
        may_enter=one.may_enter,
        gap_held_out={"before_MPa": before / MEGAPASCAL, "after_MPa": after / MEGAPASCAL},
        moves=_moves(one.moves),
        in_part=None
        if one.part is None
        else PartEntry(
            closed=one.part.closed,
            left_MPa=one.part.left / MEGAPASCAL,
            mass_ci95_pct=100.0 * one.part.mass_half,
            refused="" if one.part.refusal is None else one.part.refusal.reason,
        ),
        alternatives=tuple(
            AlternativeEntry(terms=_terms(each.found, lift), moves=_moves(each.moves))
            for each in one.alternatives
        ),
        lost=tuple(
            LostEntry(
                terms=_terms(each, lift),
                effects=each.named,
                gain=base - each.statistic,
            )
            for each in one.lost
        ),
    )


def _terms(found: Candidate, largest_lift: float | None) -> tuple[ProposedTerm, ...]:
    return tuple(_term(term, largest_lift) for term in found.terms)


def _term(term: Term, largest_lift: float | None) -> ProposedTerm:
    low, high = term.interval or (None, None)
    return ProposedTerm(
        equation=term.equation,
        law=str(term.law),
        sentence=as_if(term, largest_lift),
        latex=formula(term, largest_lift).latex,
        coefficient=PrintedFigure(value=term.coefficient, low=low, high=high, unit=str(term.equation.unit)),
        hardly_told_from=term.equation.alike,
        depends_on=tuple(sorted(variable.word for variable in term.law.variables)),
    )
