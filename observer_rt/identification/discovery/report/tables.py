"""Cells of the page's tables: candidates, laws, masses, standstill, what would have been seen."""

import math

from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.discovery.findings import LEAST_MASS, Findings
from observer_rt.identification.discovery.gaps import ModelGaps
from observer_rt.identification.discovery.injections import MassChange
from observer_rt.identification.discovery.numbers import shown, sign, significant
from observer_rt.identification.discovery.search.results import Candidate, Discovery, SmallestVisible, Verdict
from observer_rt.identification.discovery.standstill import StandstillFigure
from observer_rt.identification.likelihood.open_loop import Consequence
from observer_rt.model.effect import Apparent
from observer_rt.model.effects import VOCABULARY

STANDSTILL = {
    "rail_line_offset": "line − rail pressure",
    "line_pressure_slope": "slope of line pressure",
    "rail_pressure_noise": "noise, rail pressure",
    "line_pressure_noise": "noise, line pressure",
    "needle_lift_noise": "noise, lift",
    "injection_rate_noise": "noise, rate",
}
"""Figures of single recordings, and their headings."""


def mass_words(gaps: ModelGaps) -> str:
    """The gap in mass, absolute and as a share, where it is one to speak of."""
    gap = gaps.mass.before
    if gap < LEAST_MASS:
        return f"less than {LEAST_MASS / MILLIGRAM:g} mg"
    return f"{gap / MILLIGRAM:.2g} mg ({gap / gaps.injected:.1%})"


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
