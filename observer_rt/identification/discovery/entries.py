"""Entries of findings.json that differ from the fields of the search.

What makes them is given the `Findings` they belong to.
"""

import math
from typing import Any

from pydantic import Field

from observer_rt.foundation.documents import DocumentPart, Figures, Number
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.identification.discovery.gaps import Disagreement, ModelGaps
from observer_rt.identification.discovery.search.candidates import Candidate, Size
from observer_rt.identification.discovery.search.proposal import PHASE_NAMES
from observer_rt.identification.discovery.search.results import Cell
from observer_rt.identification.likelihood.likelihood import Signal
from observer_rt.identification.likelihood.open_loop import Consequence
from observer_rt.model.effect import Equation

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
