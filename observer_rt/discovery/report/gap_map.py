"""The map of disagreement as HTML tables: operating points by phases, before and after."""

import math
from collections.abc import Sequence
from html import escape

from observer_rt.discovery.result import Cell, Signal
from observer_rt.discovery.search.disagreement import PHASE_NAMES, SIGNIFICANT, Disagreement
from observer_rt.estimation.phases import Phase
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND, MM3_PER_MS

SIGNAL_NAMES = {Signal.LINE_PRESSURE: "line pressure", Signal.INJECTION_RATE: "injection rate"}
_UNITS = {Signal.LINE_PRESSURE: (MEGAPASCAL, "MPa"), Signal.INJECTION_RATE: (MM3_PER_MS, "mm³/ms")}
_WORST = 10.0  # times the noise, from which on a cell is as red as it gets
_WHITE, _RED = (255, 246, 240), (176, 38, 28)
_CALM = "#eef4f0"


def point_name(cell: Cell) -> str:
    """An operating point, such as `100 MPa, 1.93 ms`."""
    return f"{cell.rail_pressure / MEGAPASCAL:.0f} MPa, {cell.duration / MILLISECOND:.2f} ms"


def map_table(title: str, cells: Sequence[tuple[Cell, Disagreement]], recordings: Sequence[str]) -> str:
    """A heat map: every cell is coloured and numbered by the ratio of residual to noise."""
    columns = [
        (signal, phase)
        for signal in Signal
        for phase in Phase
        if any(cell.signal is signal and cell.phase is phase for cell, _ in cells)
    ]
    by_place = {(cell.recording, cell.signal, cell.phase): (cell, item) for cell, item in cells}
    lines = [_heads(columns)]
    rows = sorted({(cell.rail_pressure, cell.duration, cell.recording) for cell, _ in cells})
    for _, _, recording in rows:
        row = [
            _cell(*by_place[recording, *column]) if (recording, *column) in by_place else "<td></td>"
            for column in columns
        ]
        first = next(cell for cell, _ in cells if cell.recording == recording)
        head = f'<th class="point" title="{escape(recordings[recording])}">{point_name(first)}</th>'
        lines.append(f"<tr>{head}{''.join(row)}</tr>")
    return (
        f'<div class="scroll"><h3>{escape(title)}</h3><table class="map">\n'
        + "\n".join(lines)
        + "\n</table></div>"
    )


def legend() -> str:
    """What the colours mean."""
    stops = ", ".join(_colour(_WORST ** (i / 4.0)) for i in range(5))
    return (
        f'<p class="note">1 = noise alone<span class="legend" style="background: linear-gradient(to right, {stops})">'
        f"</span>{_WORST:g} times the noise and more. Cells within {SIGNIFICANT:g} standard deviations of noise are "
        "pale green. Phases: needle closed, opening, open, closing, and the ringing after.</p>"
    )


def _heads(columns: Sequence[tuple[Signal, Phase]]) -> str:
    groups = []
    for signal in Signal:
        span = sum(of is signal for of, _ in columns)
        if span:
            groups.append(f'<th class="group" colspan="{span}">{SIGNAL_NAMES[signal]}</th>')
    phases = "".join(f'<th class="phase">{PHASE_NAMES[phase]}</th>' for _, phase in columns)
    return f'<tr><th class="point"></th>{"".join(groups)}</tr>\n<tr><th class="point"></th>{phases}</tr>'


def _cell(cell: Cell, item: Disagreement) -> str:
    ratio = math.sqrt(cell.variance)
    si, unit = _UNITS[cell.signal]
    tip = f"{cell.rms / si:.3g} {unit} rms, {cell.excess:.1f} standard deviations beyond noise"
    if item.equation is not None:
        tip += f"; equation: {item.equation.value.replace('_', ' ')}"
    significant = cell.excess > SIGNIFICANT
    ratio = max(ratio, math.sqrt(cell.colour)) if significant else ratio
    colour = _colour(ratio) if significant else _CALM
    ink = "#fff" if significant and ratio > 0.5 * _WORST else "inherit"
    return f'<td style="background:{colour};color:{ink}" title="{tip}">{_shown(ratio)}</td>'


def _shown(ratio: float) -> str:
    return f"{ratio:.2f}" if ratio < 2.0 else f"{ratio:.1f}" if ratio < 100.0 else f"{ratio:.0f}"


def _colour(ratio: float) -> str:
    share = min(1.0, max(0.0, math.log(max(ratio, 1.0)) / math.log(_WORST)))
    return "rgb({}, {}, {})".format(*(round(w + share * (r - w)) for w, r in zip(_WHITE, _RED, strict=True)))
