"""Rows and cells of the page's tables: candidates, laws, masses, standstill, what would have been seen."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.discovery.findings import LEAST_MASS, Findings
from observer_rt.identification.discovery.report.law_words import as_if
from observer_rt.identification.discovery.report.numbers import shown, sign, significant
from observer_rt.identification.discovery.report.page_figures import point_words
from observer_rt.identification.discovery.report.text import Size, sizes_of, visible_words
from observer_rt.identification.discovery.search import search
from observer_rt.identification.discovery.search.results import (
    Candidate,
    Consequence,
    Discovery,
    Verdict,
)
from observer_rt.identification.discovery.standstill import StandstillFigure
from observer_rt.model.effect import Apparent
from observer_rt.model.effects import VOCABULARY

_LONGEST_BAR = 120  # px
_STANDSTILL = {
    "rail_line_offset": "line − rail pressure",
    "line_pressure_slope": "slope of line pressure",
    "rail_pressure_noise": "noise, rail pressure",
    "line_pressure_noise": "noise, line pressure",
    "needle_lift_noise": "noise, lift",
    "injection_rate_noise": "noise, rate",
}


def whole(text: str) -> str:
    """Text that is not broken into lines."""
    return text.replace(" ", "\u00a0")


def size_words(sizes: Mapping[str, Size]) -> list[str]:
    """Such as `v_H = 0.301`."""
    return [f"{name} = {size.value_text}" for name, size in sizes.items()]


def sizes(candidate: Candidate) -> list[str]:
    """All sizes of a candidate."""
    return [words for sizes in sizes_of(candidate).values() for words in size_words(sizes)]


def standing(candidate: Candidate, found: Discovery) -> str:
    """Rates a candidate of the ranking, in words."""
    doubt = "too small, or at a bound" if candidate.ids and not candidate.plausible else ""
    if candidate.ids in found.rivals:
        return "tied"
    if found.verdict is Verdict.UNKNOWN and candidate.ids == found.best.ids:
        return ", ".join(one for one in ("nearest, not enough", doubt) if one)
    return doubt


def bar(share: float) -> int:
    """Length of a bar [px]."""
    return max(1, round(_LONGEST_BAR * max(share, 0.0)))


def gained(gain: float) -> str:
    """A gain on held-out recordings."""
    return f"{gain:.0f}" if math.isfinite(gain) else "no solution"


def moved_pressure(moves: Consequence) -> str:
    """By how much the line pressure moves, in MPa."""
    return f"{moves.line_pressure / MEGAPASCAL:.2g}"


def moved_mass(moves: Consequence) -> str:
    """By how much the injected mass moves, in mg."""
    return f"{moves.mass / MILLIGRAM:+.2g}" if abs(moves.mass) >= LEAST_MASS else "0"


def indistinguishable(found: Discovery) -> dict[str, tuple[str, ...]]:
    """The effects found that have others nobody can tell from them, with these."""
    same = {effect.id: search.indistinguishable(VOCABULARY[effect.id]) for effect in found.effects}
    return {effect_id: others for effect_id, others in same.items() if others}


def role(point: str, findings: Findings) -> str:
    """Names the use of an operating point."""
    if not findings.shown.ids:
        return "shown" if point in findings.held_out else "judged"
    if not findings.held_apart:
        return "sizes fitted, and shown"
    return "shown" if point in findings.held_out else "sizes fitted"


def mass_rows(findings: Findings) -> list[tuple[str, str, str, str]]:
    """Every operating point, by rail pressure and duration: mass as given, its change, the same as a share."""
    rows = []
    for one in sorted(findings.masses, key=lambda one: _sort_key(findings, one.recording)):
        change, half = 100.0 * one.change / one.nominal, 100.0 * one.half / one.nominal
        step = 10.0 * significant(max(half, 1e-3))
        share = f"{'' if change < 0.0 else '+'}{shown(change, step)} ± {shown(half, step)} %"
        masses = f"{one.nominal / MILLIGRAM:.4g} mg", f"{one.change / MILLIGRAM:+.2g} mg"
        rows.append((point_words(findings, one.recording), *masses, share))
    return rows


def _sort_key(findings: Findings, recording: int) -> tuple[float, float, int]:
    cell = next(one.before for one in findings.where if one.before.recording == recording)
    return cell.rail_pressure, cell.duration, recording


def fitted_words(one: Candidate, largest_lift: float | None) -> str:
    """Laws and effects fitted together, in words."""
    return " and ".join([*(as_if(term, largest_lift) for term in one.terms), *one.named])


@dataclass(frozen=True)
class StandstillColumn:
    """Figures of one kind, by number of the recording."""

    title: str
    unit: str
    figures: dict[int | None, StandstillFigure]


def standstill_columns(checks: Sequence[StandstillFigure]) -> list[StandstillColumn]:
    """The figures of single recordings."""
    columns = []
    for name, words in _STANDSTILL.items():
        figures = {check.recording: check for check in checks if check.id == name}
        if figures:
            columns.append(StandstillColumn(words, next(iter(figures.values())).unit, figures))
    return columns


def apparent_sizes(checks: Sequence[StandstillFigure]) -> list[dict[str, StandstillFigure]]:
    """Apparent sizes by effect: of the settled needle, and of what is left."""
    by_id = {check.id.removeprefix("apparent_"): check for check in checks if check.recording is None}
    return [
        {name: check for name, check in by_id.items() if VOCABULARY[name].apparent is how} for how in Apparent
    ]


def with_sigma(figure: StandstillFigure) -> str:
    """A figure of the standstill with its standard deviation."""
    if math.isnan(figure.sigma):
        return f"{figure.value:#.3g}"
    step = significant(figure.sigma)
    return f"{shown(figure.value, step)} ± {shown(figure.sigma, step)}"


@dataclass(frozen=True)
class VisibleRow:
    """An effect: what it appears to be on the healthy injector, and the smallest size that would have been seen."""

    id: str
    apparent: str
    smallest: str


def visible_rows(findings: Findings) -> list[VisibleRow]:
    """Lists every effect that has a size."""
    appears = {} if findings.healthy is None else findings.healthy.appears
    rows = []
    for one in findings.discovery.smallest_visible:
        known, apparent = appears.get(one.id), "–"
        if known is not None:
            step = significant(max(known.uncertainty, known.scatter))
            scatter = f" ± {shown(known.scatter, step)}" if known.scatter > 0.0 else ""
            words = f"{shown(known.mean, step)}{scatter} {sign(known.unit)}"
            apparent = f"{one.parameter} = {words.rstrip()}"
        rows.append(VisibleRow(one.id, apparent, visible_words(one)))
    return rows
