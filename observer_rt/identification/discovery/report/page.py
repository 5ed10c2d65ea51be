"""Builds report.html: the answer in the words of the terminal, then what it rests on, in figures and tables."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from observer_rt.engine.estimation.phases import Phase
from observer_rt.files.learned_picture import learned_figure
from observer_rt.foundation import units
from observer_rt.foundation.units import shown, sign, significant
from observer_rt.foundation.version import __version__
from observer_rt.identification.discovery.disagreement import Disagreement
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.injections import MassChange
from observer_rt.identification.discovery.report import figures, text
from observer_rt.identification.discovery.search import proposal
from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT_EXCESS
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.laws import guess_words
from observer_rt.identification.discovery.search.results import Cell, Discovery, SmallestVisible, Verdict
from observer_rt.identification.discovery.standstill import StandstillFigure
from observer_rt.identification.likelihood.signals import Signal
from observer_rt.model.effect import Equation
from observer_rt.model.effects import VOCABULARY

REDDEST_RATIO = 10.0  # times the noise, from which on a cell is as red as it gets
_WHITE, _RED = (255, 246, 240), (176, 38, 28)
_CALM = "#eef4f0"


def standing(candidate: Candidate, discovery: Discovery) -> str:
    """Rates a candidate of the ranking, in words."""
    doubt = "too small, or at a bound" if candidate.ids and not candidate.plausible else ""
    if candidate.ids in discovery.rivals:
        return "tied"
    if discovery.verdict is Verdict.UNKNOWN and candidate.ids == discovery.best.ids:
        return ", ".join(one for one in ("nearest, not enough", doubt) if one)
    return doubt


def mass_share(change: MassChange) -> str:
    """The change of a mass as a share, with its interval."""
    half = 100.0 * change.half / change.nominal
    step = 10.0 * significant(max(half, 1e-3))
    return f"{'' if change.change_pct < 0.0 else '+'}{shown(change.change_pct, step)} ± {shown(half, step)} %"


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
    cells = ((getattr(item, side), item.equation) for item in where)
    return {(cell.recording, cell.signal, cell.phase): _shown(cell, equation) for cell, equation in cells}


def _shown(cell: Cell, equation: Equation | None) -> ShownCell:
    ratio, signal = math.sqrt(cell.variance), cell.signal
    rms = f"{cell.rms / signal.si:.3g} {sign(signal.unit)} rms"
    tip = f"{rms}, {cell.excess:.1f} standard deviations beyond noise"
    if equation is not None:
        tip += f"; equation: {equation.value.replace('_', ' ')}"
    stands_out = cell.excess > SIGNIFICANT_EXCESS
    ratio = max(ratio, math.sqrt(cell.colour)) if stands_out else ratio
    digits = 2 if ratio < 2.0 else 1 if ratio < 100.0 else 0
    ink = "#fff" if stands_out and ratio > 0.5 * REDDEST_RATIO else "inherit"
    share = min(1.0, max(0.0, math.log(max(ratio, 1.0)) / math.log(REDDEST_RATIO)))
    red = "rgb({}, {}, {})".format(*(round(w + share * (r - w)) for w, r in zip(_WHITE, _RED, strict=True)))
    return ShownCell(f"{ratio:.{digits}f}", red if stands_out else _CALM, ink, tip)


# a name that a template is not given is an error
_PAGES = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined)
_PAGES.loader = PackageLoader(__package__)
for _names in (*map(vars, (units, proposal, text, figures)), globals()):
    _PAGES.globals |= _names
_PAGES.globals |= {"version": __version__, "VOCABULARY": VOCABULARY, "isfinite": math.isfinite}
_PAGES.globals |= {"learned_figure": learned_figure, "guess_words": guess_words}
_PAGES.filters["with_code"] = lambda text: Markup(re.sub("`(.+?)`", r"<code>\1</code>", str(escape(text))))
_PAGES.filters["sentence"] = lambda text: text[:1].upper() + text[1:]


def report(findings: Findings) -> str:
    """The page."""
    return _PAGES.get_template("report.html.j2").render(findings=findings)
