"""Entries of findings.json that differ from the fields of the search.

What makes them is given the `Findings` they belong to.
"""

import math
from typing import Any

from pydantic import Field

from observer_rt.foundation.documents import DocumentPart, Figures, Number
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.identification.discovery.gaps import PHASE_NAMES, Disagreement, ModelGaps
from observer_rt.identification.discovery.search.candidates import Candidate, Size
from observer_rt.identification.discovery.search.results import Cell, LargestMisfit, Part, Proposal
from observer_rt.identification.discovery.words.law_words import as_if
from observer_rt.identification.discovery.words.sentences import proposal_words
from observer_rt.identification.likelihood.likelihood import Signal
from observer_rt.identification.likelihood.open_loop import Consequence
from observer_rt.model.effect import Equation
from observer_rt.model.terms.term import Term

GapEntry = dict[str, dict[str, Number | bool] | None]
LearnedEntry = dict[str, str | list[float]]
"""`LearnedCurve.columns`."""


class RankedCandidate(DocumentPart):
    """Effects fitted together. chi2: -2 log L, constants left out; n_effective: independent samples."""

    ids: tuple[str, ...]
    held_out_chi2: Number
    chi2: Number
    n_effective: Number
    parameters: tuple[dict[str, Size], ...]
    plausible: bool
    moves: Consequence


class CellOfMap(DocumentPart):
    """Residuals of a signal in a phase at an operating point: nrmse over noise, significance in standard deviations,
    rms; after: with what was found. equation: which is violated, null where none is known to be."""

    signal: Signal
    phase: str = Field(description="closed, opening, open, closing or after")
    equation: Equation | None
    rail_pressure_MPa: Number  # noqa: N815 - units as printed
    open_ms: Number
    recording: str
    nrmse: Number
    significance: Number
    rms_MPa: Number = None  # noqa: N815
    rms_mm3_per_ms: Number = None
    after: Figures


class ProposedTerm(DocumentPart):
    """A law added to an equation. sentence: in words, behind `as if`;
    coefficient: value, ends of its 95 % interval, unit."""

    equation: str
    law: str
    sentence: str
    coefficient: dict[str, Number | str]
    hardly_told_from: tuple[str, ...]
    depends_on: tuple[str, ...]


class ProposedEffect(DocumentPart):
    """An effect of the vocabulary beside the terms of a proposal, with its sizes by parameter."""

    id: str
    parameters: dict[str, Size]


class ProposalEntry(DocumentPart):
    """Terms that would explain the recordings. gain: of -2 log L; probability: among all explanations tried;
    adequate: nothing but noise is left; sound: bounded where it was seen; may_enter: whether an amended model may
    have it; seen: range of every variable, beyond which the law stays as it is there; in_part: of one that leaves
    something but has no other objection."""

    number: int
    sentence: str
    terms: tuple[ProposedTerm, ...]
    effects: tuple[ProposedEffect, ...]
    gain: Number
    probability: float
    phase: str
    adequate: bool
    sound: bool
    may_enter: bool
    gap_held_out: Figures
    moves: Consequence
    seen: dict[str, tuple[float, float]]
    in_part: Part | None


class Unknown(DocumentPart):
    """Residuals that the best model leaves, and proposals that would explain them, the best first."""

    equation: Equation
    phase: str
    signal: Signal
    depends_on: tuple[str, ...]
    term: str
    proposals: tuple[ProposalEntry, ...]


def ranked(candidate: Candidate, findings: Any) -> RankedCandidate:
    """A candidate of the ranking."""
    return RankedCandidate(
        ids=candidate.ids,
        held_out_chi2=candidate.held_out,
        chi2=candidate.statistic,
        n_effective=findings.samples,
        parameters=tuple(candidate.parameters.values()),
        plausible=candidate.plausible,
        moves=candidate.moves,
    )


def cell_of_map(item: Disagreement, findings: Any) -> CellOfMap:
    """A cell of the map."""
    cell = item.before
    return CellOfMap(
        signal=cell.signal,
        phase=PHASE_NAMES[cell.phase],
        equation=item.equation,
        rail_pressure_MPa=cell.rail_pressure / MEGAPASCAL,
        open_ms=cell.duration / MILLISECOND,
        recording=findings.points[cell.recording],
        **_figures(cell),
        after=_figures(item.after),
    )


def _figures(cell: Cell) -> dict[str, float | None]:
    rms = f"rms_{_key(cell.signal.unit)}"
    return {"nrmse": math.sqrt(cell.variance), "significance": cell.excess, rms: cell.rms / cell.signal.si}


def gap_entry(gaps: ModelGaps, _: object) -> GapEntry:
    """Rms of model minus measurement by signal: `before` as given, `after` amended, `noise_floor`; with units."""
    result: GapEntry = {"line_pressure": None, "injection_rate": None}
    for name, gap in gaps.by_name.items():
        unit = _key(gap.unit)
        stated: dict[str, Number | bool] = {f"before_{unit}": gap.before, f"after_{unit}": gap.after}
        is_mass = name == "injected_mass"
        stated |= {"measured": gap.measured} if is_mass else {f"noise_floor_{unit}": gap.noise_floor}
        result[name] = stated
    return result


def _key(unit: str) -> str:
    """A unit as a part of a key."""
    return unit.replace("/", "_per_")


def unknown(left: LargestMisfit | None, findings: Any) -> Unknown | None:
    """The unexplained part, with the proposals."""
    if left is None:
        return None
    return Unknown(
        **vars(left) | {"phase": PHASE_NAMES[left.phase]},
        proposals=tuple(_proposal(number, one) for number, one in enumerate(findings.proposals, 1)),
    )


def _proposal(number: int, proposal: Proposal) -> ProposalEntry:
    before, after = proposal.held_out
    sizes = proposal.candidate.parameters
    return ProposalEntry(
        number=number,
        sentence=proposal_words(proposal),
        terms=tuple(_term(term, proposal.largest_lift) for term in proposal.terms),
        effects=tuple(ProposedEffect(id=name, parameters=sizes[name]) for name in proposal.effects),
        gain=proposal.gain,
        probability=proposal.probability,
        phase=PHASE_NAMES[proposal.phase],
        adequate=proposal.adequate,
        sound=proposal.unsound is None,
        may_enter=proposal.may_enter,
        gap_held_out={"before_MPa": before / MEGAPASCAL, "after_MPa": after / MEGAPASCAL},
        moves=proposal.candidate.moves,
        seen=proposal.seen_of_terms,
        in_part=proposal.part,
    )


def _term(term: Term, largest_lift: float | None) -> ProposedTerm:
    low, high = term.interval or (None, None)
    return ProposedTerm(
        equation=term.equation,
        law=str(term.law),
        sentence=as_if(term, largest_lift),
        coefficient={"value": term.coefficient, "low": low, "high": high, "unit": str(term.equation.unit)},
        hardly_told_from=term.equation.alike,
        depends_on=tuple(sorted(variable.word for variable in term.law.variables)),
    )
