"""The map of disagreement: where, in which phase and equation a model misses the recordings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.gaps import PHASE_NAMES, Disagreement
from observer_rt.identification.discovery.report.numbers import sign
from observer_rt.identification.discovery.report.text import equation_words
from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT
from observer_rt.identification.discovery.search.results import Cell
from observer_rt.identification.likelihood.likelihood import Signal
from observer_rt.identification.likelihood.operating_points import point_name

_WORST = 10.0  # times the noise, from which on a cell is as red as it gets
_WHITE, _RED = (255, 246, 240), (176, 38, 28)
_CALM = "#eef4f0"


@dataclass(frozen=True)
class ShownCell:
    """A cell: its number, colours of ground and text, and its tool tip."""

    text: str
    colour: str
    ink: str
    tip: str


@dataclass(frozen=True)
class ShownRow:
    """An operating point; a cell a column, None where there is none."""

    point: str
    recording: str
    cells: tuple[ShownCell | None, ...]


@dataclass(frozen=True)
class GapMap:
    """The map of disagreement: operating points by phases, coloured by the ratio of residual to noise.

    groups: signals with the number of their phases.
    """

    title: str
    groups: tuple[tuple[str, int], ...]
    phases: tuple[str, ...]
    rows: tuple[ShownRow, ...]


def gap_map(title: str, cells: Sequence[tuple[Cell, Disagreement]], recordings: Sequence[str]) -> GapMap:
    """Every cell of every recording, by rail pressure, then duration."""
    present = {(cell.signal, cell.phase) for cell, _ in cells}
    columns = [(signal, phase) for signal in Signal for phase in Phase if (signal, phase) in present]
    shown = {(cell.recording, cell.signal, cell.phase): _shown(cell, item) for cell, item in cells}
    places = {cell.recording: (cell.rail_pressure, cell.duration) for cell, _ in cells}
    groups = [(signal.words, sum(of is signal for of, _ in columns)) for signal in Signal]
    return GapMap(
        title,
        tuple(group for group in groups if group[1]),
        tuple(PHASE_NAMES[phase] for _, phase in columns),
        tuple(
            ShownRow(
                point_name(*places[recording]),
                recordings[recording],
                tuple(shown.get((recording, *column)) for column in columns),
            )
            for recording in sorted(places, key=lambda recording: (*places[recording], recording))
        ),
    )


def _shown(cell: Cell, item: Disagreement) -> ShownCell:
    ratio, signal = math.sqrt(cell.variance), cell.signal
    rms = f"{cell.rms / signal.si:.3g} {sign(signal.unit)} rms"
    tip = f"{rms}, {cell.excess:.1f} standard deviations beyond noise"
    if item.equation is not None:
        tip += f"; equation: {item.equation.value.replace('_', ' ')}"
    significant = cell.excess > SIGNIFICANT
    ratio = max(ratio, math.sqrt(cell.colour)) if significant else ratio
    digits = 2 if ratio < 2.0 else 1 if ratio < 100.0 else 0
    ink = "#fff" if significant and ratio > 0.5 * _WORST else "inherit"
    return ShownCell(f"{ratio:.{digits}f}", _colour(ratio) if significant else _CALM, ink, tip)


def _colour(ratio: float) -> str:
    share = min(1.0, max(0.0, math.log(max(ratio, 1.0)) / math.log(_WORST)))
    return "rgb({}, {}, {})".format(*(round(w + share * (r - w)) for w, r in zip(_WHITE, _RED, strict=True)))


def legend() -> dict[str, object]:
    """The map's colours from noise alone to the worst, that ratio, and what is significant [standard deviations]."""
    colours = [_colour(_WORST ** (i / 4.0)) for i in range(5)]
    return {"colours": colours, "worst": _WORST, "significant": SIGNIFICANT}


def violated_words(findings: Findings) -> str:
    """Names the equations that are violated, as the model has them; of a law its own."""
    one = findings.proposal
    if one is not None and not findings.discovery.effects and one.terms:
        return " and ".join(dict.fromkeys(f"{term.equation.words} ({term.equation})" for term in one.terms))
    equations = dict.fromkeys(item.equation for item in findings.where if item.equation is not None)
    injector = findings.gaps.refitted.injector
    return " and ".join(equation_words(equation, injector) for equation in equations)
