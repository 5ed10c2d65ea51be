"""Cells of the page's tables: candidates, masses, standstill, what would have been seen; the map of disagreement."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.discovery.findings import LEAST_MASS, Findings
from observer_rt.identification.discovery.gaps import MASS, Disagreement, ModelGaps
from observer_rt.identification.discovery.injections import MassChange
from observer_rt.identification.discovery.numbers import shown, sign, significant
from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.results import Cell, Discovery, SmallestVisible, Verdict
from observer_rt.identification.discovery.standstill import StandstillFigure
from observer_rt.identification.likelihood.likelihood import Signal
from observer_rt.identification.likelihood.open_loop import Consequence
from observer_rt.model.effect import Apparent, Equation
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.parameters import LineOutflow

STANDSTILL = {
    "rail_line_offset": "line − rail pressure",
    "line_pressure_slope": "slope of line pressure",
    "rail_pressure_noise": "noise, rail pressure",
    "line_pressure_noise": "noise, line pressure",
    "needle_lift_noise": "noise, lift",
    "injection_rate_noise": "noise, rate",
}
"""Figures of single recordings, and their headings."""
WORST = 10.0  # times the noise, from which on a cell is as red as it gets
_WHITE, _RED = (255, 246, 240), (176, 38, 28)
_CALM = "#eef4f0"
_OF_LUMP = {
    Equation.LINE_PRESSURE: "the balance of the line, p_L' = K_L/V_L (Q_L - {outflow}), (20)",
    Equation.LINE_FLOW: "the flow through the line, Q_L' = ..., (19)",
}
_OF_WAVES = {
    Equation.LINE_PRESSURE: "the balance at the closed end of the line, which {outflow} drains",
    Equation.LINE_FLOW: "the motion of the fuel along the line",
}
_OTHERS = {
    Equation.SAC_PRESSURE: "the balance of the sac, p_S' = K_C/V_S (Q_S - Q_H), with (21) and (23)",
    Equation.INPUT: "an input: rail pressure, lift or chamber pressure is not what it is taken for",
    Equation.OUTPUT: "the output: the line-pressure sensor does not show p_L",
}


def mass_words(gaps: ModelGaps) -> str:
    """The gap in mass, absolute and as a share, where it is one to speak of."""
    gap, least = gaps.by_name[MASS].before, LEAST_MASS / MILLIGRAM
    if gap < least:
        return f"less than {least:g} mg"
    return f"{gap:.2g} mg ({gap * MILLIGRAM / gaps.injected:.1%})"


def standing(candidate: Candidate, discovery: Discovery) -> str:
    """Rates a candidate of the ranking, in words."""
    doubt = "too small, or at a bound" if candidate.ids and not candidate.plausible else ""
    if candidate.ids in discovery.rivals:
        return "tied"
    if discovery.verdict is Verdict.UNKNOWN and candidate.ids == discovery.best.ids:
        return ", ".join(one for one in ("nearest, not enough", doubt) if one)
    return doubt


def moved_pressure(moves: Consequence) -> str:
    """By how much the line pressure moves, in MPa."""
    return f"{moves.line_pressure / MEGAPASCAL:.2g}"


def moved_mass(moves: Consequence) -> str:
    """By how much the injected mass moves, in mg."""
    return f"{moves.mass / MILLIGRAM:+.2g}" if abs(moves.mass) >= LEAST_MASS else "0"


def role(point: str, findings: Findings) -> str:
    """Names the use of an operating point."""
    if not findings.shown.ids:
        return "shown" if point in findings.held_out else "judged"
    if not findings.held_apart:
        return "sizes fitted, and shown"
    return "shown" if point in findings.held_out else "sizes fitted"


def mass_share(change: MassChange) -> str:
    """The change of a mass as a share, with its interval."""
    half = 100.0 * change.half / change.nominal
    step = 10.0 * significant(max(half, 1e-3))
    return f"{'' if change.change_pct < 0.0 else '+'}{shown(change.change_pct, step)} ± {shown(half, step)} %"


def apparent_sizes(findings: Findings) -> list[dict[str, StandstillFigure]]:
    """Apparent sizes by effect: of the settled needle, and of the residuals."""
    by_id = {
        check.id.removeprefix("apparent_"): check for check in findings.checks if check.recording is None
    }
    return [
        {name: check for name, check in by_id.items() if VOCABULARY[name].apparent is how} for how in Apparent
    ]


def with_sigma(figure: StandstillFigure) -> str:
    """A figure of the standstill with its standard deviation."""
    if math.isnan(figure.sigma):
        return f"{figure.value:#.3g}"
    step = significant(figure.sigma)
    return f"{shown(figure.value, step)} ± {shown(figure.sigma, step)}"


def healthy_words(smallest: SmallestVisible, findings: Findings) -> str:
    """Says how large an effect appears to be on the healthy injector."""
    appears = {} if findings.baseline is None else findings.baseline.appears
    if (apparent := appears.get(smallest.id)) is None:
        return "–"
    step = significant(max(apparent.uncertainty, apparent.scatter))
    scatter = f" ± {shown(apparent.scatter, step)}" if apparent.scatter > 0.0 else ""
    return f"{smallest.parameter} = {shown(apparent.mean, step)}{scatter} {sign(apparent.unit)}".rstrip()


@dataclass(frozen=True)
class ShownCell:
    """A cell: its number, colours of ground and text, and its tool tip."""

    text: str
    colour: str
    ink: str
    tip: str


def map_columns(where: Sequence[Disagreement]) -> dict[Signal, list[Phase]]:
    """Phases of every signal in the map."""
    present = {(item.before.signal, item.before.phase) for item in where}
    columns = {signal: [phase for phase in Phase if (signal, phase) in present] for signal in Signal}
    return {signal: phases for signal, phases in columns.items() if phases}


def shown_cells(where: Sequence[Disagreement], side: str) -> dict[tuple[int, Signal, Phase], ShownCell]:
    """Cells of the map. side: `before` or `after`."""
    shown = {}
    for item in where:
        cell = getattr(item, side)
        shown[cell.recording, cell.signal, cell.phase] = _shown(cell, item.equation)
    return shown


def _shown(cell: Cell, equation: Equation | None) -> ShownCell:
    ratio, signal = math.sqrt(cell.variance), cell.signal
    rms = f"{cell.rms / signal.si:.3g} {sign(signal.unit)} rms"
    tip = f"{rms}, {cell.excess:.1f} standard deviations beyond noise"
    if equation is not None:
        tip += f"; equation: {equation.value.replace('_', ' ')}"
    significant = cell.excess > SIGNIFICANT
    ratio = max(ratio, math.sqrt(cell.colour)) if significant else ratio
    digits = 2 if ratio < 2.0 else 1 if ratio < 100.0 else 0
    ink = "#fff" if significant and ratio > 0.5 * WORST else "inherit"
    return ShownCell(f"{ratio:.{digits}f}", _colour(ratio) if significant else _CALM, ink, tip)


def _colour(ratio: float) -> str:
    share = min(1.0, max(0.0, math.log(max(ratio, 1.0)) / math.log(WORST)))
    return "rgb({}, {}, {})".format(*(round(w + share * (r - w)) for w, r in zip(_WHITE, _RED, strict=True)))


def legend() -> str:
    """The map's colours from noise alone to the worst."""
    return ", ".join(_colour(WORST ** (i / 4.0)) for i in range(5))


def violated_words(findings: Findings) -> str:
    """Names the equations that are violated, as the model has them; of a law its own."""
    proposal = findings.proposal
    if proposal is not None and not findings.effects and proposal.terms:
        return " and ".join(
            dict.fromkeys(f"{term.equation.words} ({term.equation})" for term in proposal.terms)
        )
    equations = dict.fromkeys(item.equation for item in findings.where if item.equation is not None)
    injector = findings.gaps.refitted.injector
    outflow = "Q_H" if injector.line_outflow is LineOutflow.NOZZLE else "Q_S"
    of_line = _OF_LUMP if injector.line.model == "lump" else _OF_WAVES
    return " and ".join((of_line | _OTHERS)[proposal].format(outflow=outflow) for proposal in equations)
