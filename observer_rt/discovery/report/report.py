"""report.html: the answer first, then what it rests on, in one self-contained page."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from observer_rt import __version__
from observer_rt.discovery.findings import Findings, Sources
from observer_rt.discovery.gaps import PHASE_NAMES, Disagreement
from observer_rt.discovery.opinion import remark
from observer_rt.discovery.report import text, views
from observer_rt.discovery.report.figures import laws_figure, overlay_figure
from observer_rt.discovery.report.text import sign
from observer_rt.discovery.search.adequacy import SIGNIFICANT
from observer_rt.discovery.search.result import Cell
from observer_rt.estimation.phases import Phase
from observer_rt.evidence.likelihood import Signal
from observer_rt.evidence.operating_points import point_name
from observer_rt.foundation.pages import templates_of

_PAGES = templates_of(__package__)
_PAGES.globals |= vars(text) | vars(views)
_PAGES.globals |= {"version": __version__, "remark": remark, "overlay_figure": overlay_figure}
_PAGES.globals["laws_figure"] = laws_figure
_WORST = 10.0  # times the noise, from which on a cell is as red as it gets
_WHITE, _RED = (255, 246, 240), (176, 38, 28)
_CALM = "#eef4f0"


def report(findings: Findings, sources: Sources) -> str:
    """The page."""
    found, where = findings.discovery, findings.where
    after = "With what was found" if found.effects else f"Nearest, not enough: {' + '.join(found.best.ids)}"
    equations = dict.fromkeys(
        text.EQUATION_WORDS[item.equation] for item in where if item.equation is not None
    )
    return _PAGES.get_template("report.html.j2").render(
        findings=findings,
        found=found,
        sources=sources,
        map_before=_gap_map("Model as given", [(item.before, item) for item in where], findings.points),
        map_after=_gap_map(after, [(item.after, item) for item in where], findings.points),
        violated=" and ".join(equations),
        legend={
            "colours": [_colour(_WORST ** (i / 4.0)) for i in range(5)],
            "worst": _WORST,
            "significant": SIGNIFICANT,
        },
    )


@dataclass(frozen=True)
class ShownCell:
    """A cell: its number, colours of ground and text, and what is told of it besides."""

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


def _gap_map(title: str, cells: Sequence[tuple[Cell, Disagreement]], recordings: Sequence[str]) -> GapMap:
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
