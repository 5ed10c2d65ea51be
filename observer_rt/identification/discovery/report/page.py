"""Builds report.html: the answer first, then what it rests on, in words and units."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.files import templates_of
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLIMETRE
from observer_rt.identification.discovery.findings import (
    LEAST_MASS,
    Findings,
    PrintedFigure,
    Sources,
    explained_share,
    remark,
    stands_out,
)
from observer_rt.identification.discovery.gaps import PHASE_NAMES, Disagreement, ModelGaps
from observer_rt.identification.discovery.report import text
from observer_rt.identification.discovery.report.figures import (
    Bars,
    RecordingResiduals,
    gap_figure,
    laws_figure,
    overlay_figure,
    residual_figure,
)
from observer_rt.identification.discovery.report.formula import formula, law_text
from observer_rt.identification.discovery.report.law_words import as_if
from observer_rt.identification.discovery.report.numbers import shown, sign, significant
from observer_rt.identification.discovery.report.plan import HEADINGS, plan_rows, plan_words
from observer_rt.identification.discovery.report.text import (
    UNITS,
    Size,
    candidate_words,
    printed,
    visible_words,
    where_words,
)
from observer_rt.identification.discovery.search import search
from observer_rt.identification.discovery.search.adequacy import SIGNIFICANT
from observer_rt.identification.discovery.search.results import (
    Candidate,
    Cell,
    Consequence,
    Discovery,
    Proposal,
    Verdict,
)
from observer_rt.identification.discovery.standstill import StandstillFigure
from observer_rt.identification.likelihood.likelihood import Signal
from observer_rt.identification.likelihood.operating_points import point_name
from observer_rt.model.effect import Apparent
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.term_effect import is_term

_LONGEST_BAR = 120  # px
_STANDSTILL = {
    "rail_line_offset": "line − rail pressure",
    "line_pressure_slope": "slope of line pressure",
    "rail_pressure_noise": "noise, rail pressure",
    "line_pressure_noise": "noise, line pressure",
    "needle_lift_noise": "noise, lift",
    "injection_rate_noise": "noise, rate",
}
_WORST = 10.0  # times the noise, from which on a cell is as red as it gets
_WHITE, _RED = (255, 246, 240), (176, 38, 28)
_CALM = "#eef4f0"
_PAGES = templates_of(__package__)


@dataclass(frozen=True)
class StandstillColumn:
    """Figures of one kind, by number of the recording."""

    title: str
    unit: str
    figures: dict[int | None, StandstillFigure]


@dataclass(frozen=True)
class Tile:
    """A figure at the top of the page."""

    value: str
    unit: str
    text: str


def title(findings: Findings) -> str:
    """The answer in a sentence, all explanations that are tied in it."""
    found = findings.discovery
    if found.verdict is Verdict.NONE:
        return "Nothing is missing: the model explains the recordings"
    if found.verdict is Verdict.UNKNOWN:
        shows = where_words(found, findings.accepted)
        return f"Something is missing that no effect of the vocabulary explains{shows}"
    by_ids = {candidate.ids: candidate for candidate in found.ranking}
    tied = [candidate_words(by_ids[ids]) for ids in (found.named.ids, *found.rivals)]
    words = "; or ".join(tied)
    if findings.chosen and found.rivals:
        return f"Missing: {tied[0]}, as was chosen; these recordings would allow {'; or '.join(tied[1:])} as well"
    if found.rivals:
        return f"Missing: {words}: these recordings do not decide"
    if found.verdict is Verdict.AMBIGUOUS:
        return f"Missing: {words}, which may be one of the two"
    return f"Missing: {words}"


def mass_words(gaps: ModelGaps) -> str:
    """The gap in mass, absolute and as a share, where it is one to speak of."""
    gap = gaps.mass.before
    if gap < LEAST_MASS:
        return f"less than {LEAST_MASS / MILLIGRAM:g} mg"
    return f"{gap / MILLIGRAM:.2g} mg ({gap / gaps.injected:.1%})"


def tiles(findings: Findings) -> list[Tile]:
    """Confidence, and gaps before and after."""
    found, gaps = findings.discovery, findings.gaps
    sure = "confidence that this is right"
    if found.verdict is Verdict.UNKNOWN:
        sure = "confidence that something unknown is missing; how sure a law is: its interval, and what is held out"
    elif found.rivals:
        sure = f"confidence that it is {' and '.join(found.named.ids)}"
    elif findings.caveats:
        sure = "confidence, with the reservations above"
    result = [Tile(f"{found.confidence:.0%}", "", sure)]
    for gap in gaps.printed.values():
        if gap.measured:
            value = f"{gap.before:.2g}" + (f" → {gap.after:.2g}" if findings.shown.ids else "")
            apart = ", held out" if findings.shown.ids and findings.held_apart else ""
            result.append(Tile(value, sign(gap.unit), f"{gap.words}, model minus measured, rms{apart}"))
        elif findings.shown.ids:
            least = LEAST_MASS / MILLIGRAM
            value = f"{gap.before:.2g}" if gaps.mass.before >= LEAST_MASS else f"< {least:g}"
            result.append(Tile(value, gap.unit, f"{gap.words}, what the model given is wrong"))
    if found.effects and len(result) < 4:
        result.append(Tile(f"{explained_share(found):.0%}", "", "of the disagreement explained"))
    return result


def held_out_figure(findings: Findings) -> str:
    """The gaps at operating points the sizes were not fitted to, as <svg>."""
    gaps, amended = findings.gaps, bool(findings.shown.ids)
    places = {i.before.recording: (i.before.rail_pressure, i.before.duration) for i in findings.where}
    labels = [point_name(*places[point.recording]).replace(", ", "\n") for point in gaps.points]
    label = with_words(findings) if amended else None
    of_points = [point.printed for point in gaps.points]
    groups = []
    for name, gap in gaps.printed.items():
        every = tuple(printed[name] for printed in of_points if name in printed)
        if gap.measured:
            groups.append(Bars(gap.words, sign(gap.unit), every, label))
        elif amended:
            groups.append(Bars(f"{gap.words}, if this is right", gap.unit, every, None))
    return gap_figure(labels, groups)


def printed_in(value: float, unit: str) -> str:
    """Two digits of a value in SI, with its unit."""
    return f"{value / UNITS[unit]:.2g} {unit}"


def whole(text: str) -> str:
    """Text that is not broken into lines."""
    return text.replace(" ", "\u00a0")


def size_words(sizes: Mapping[str, Size]) -> list[str]:
    """Such as `v_H = 0.301`."""
    return [f"{name} = {size.value_text}" for name, size in sizes.items()]


def sizes(candidate: Candidate) -> list[str]:
    """All sizes of a candidate."""
    every = zip(candidate.ids, candidate.parameters, strict=True)
    return [words for effect_id, fitted in every for words in size_words(printed(effect_id, fitted))]


def standing(candidate: Candidate, found: Discovery) -> str:
    """Rates a candidate of the ranking, in words."""
    doubt = "too small, or at a bound" if candidate.ids and not candidate.plausible else ""
    if candidate.ids in found.rivals:
        return "tied"
    if found.verdict is Verdict.UNKNOWN and candidate.ids == found.best.ids:
        return ", ".join(one for one in ("nearest, not enough", doubt) if one)
    return doubt


def explained_ids(found: Discovery) -> tuple[str, ...]:
    """The effects found, and those tied with them."""
    every = (found.named.ids, *found.rivals) if found.effects else ()
    return tuple(dict.fromkeys(effect_id for ids in every for effect_id in ids))


def role(point: str, findings: Findings) -> str:
    """Names the use of an operating point."""
    if not findings.shown.ids:
        return "shown" if point in findings.held_out else "judged"
    if not findings.held_apart:
        return "sizes fitted, and shown"
    return "shown" if point in findings.held_out else "sizes fitted"


def with_words(findings: Findings) -> str:
    """The model with what was found, for a legend."""
    found = findings.discovery
    if found.effects or findings.proposal is None:
        return f"with {' and '.join(found.named.ids)}"
    return f"with proposal {found.proposals.index(findings.proposal) + 1}"


def injections_figure(findings: Findings) -> str:
    """What the models miss of every injection, recording by recording, as <svg>."""
    held_out = set(findings.gaps.held_out) if findings.held_apart else set()
    groups = []
    for number in dict.fromkeys(one.recording for one in findings.injections):
        of_one = [one for one in findings.injections if one.recording == number]
        before, after = ([getattr(one, name) / MEGAPASCAL for one in of_one] for name in ("before", "after"))
        groups.append(RecordingResiduals(_place(findings, number), before, after, number in held_out))
    floor = findings.gaps.line_pressure.noise_floor / MEGAPASCAL
    return residual_figure(groups, floor, with_words(findings) if findings.shown.ids else None)


def _place(findings: Findings, recording: int) -> str:
    cell = next(one.before for one in findings.where if one.before.recording == recording)
    return point_name(cell.rail_pressure, cell.duration)


@dataclass(frozen=True)
class PointMass:
    """An operating point: mass of an injection as given, and by how much what was found changes it."""

    point: str
    nominal: str
    change: str
    share: str


def mass_rows(findings: Findings) -> list[PointMass]:
    """Lists every operating point, by rail pressure and duration."""
    rows = []
    for one in findings.masses:
        half = one.half / one.nominal
        step = 10.0 * significant(max(100.0 * half, 1e-3))
        share = f"{shown(100.0 * one.change / one.nominal, step)} ± {shown(100.0 * half, step)} %"
        share = share if one.change < 0.0 else f"+{share}"
        nominal, change = f"{one.nominal / MILLIGRAM:.4g} mg", f"{one.change / MILLIGRAM:+.2g} mg"
        rows.append(
            (
                (_sort_key(findings, one.recording)),
                PointMass(_place(findings, one.recording), nominal, change, share),
            )
        )
    return [row for _, row in sorted(rows, key=lambda pair: pair[0])]


def _sort_key(findings: Findings, recording: int) -> tuple[float, float, int]:
    cell = next(one.before for one in findings.where if one.before.recording == recording)
    return cell.rail_pressure, cell.duration, recording


@dataclass(frozen=True)
class LawRow:
    """A law as a formula and as text, and its sentence."""

    sentence: str
    mathml: str
    latex: str
    text: str


def law_rows(one: Proposal) -> list[LawRow]:
    """The laws of a proposal."""
    lift = None if one.largest_lift is None else one.largest_lift / MILLIMETRE
    rows = []
    for term in one.terms:
        drawn = formula(term, lift)
        rows.append(LawRow(as_if(term, lift), drawn.mathml, drawn.latex, law_text(term)))
    return rows


def fitted_words(one: Candidate, largest_lift: float | None) -> str:
    """Laws and effects fitted together, in words."""
    lift = None if largest_lift is None else largest_lift / MILLIMETRE
    effects = [effect.id for effect in one.hypothesis.effects if not is_term(effect)]
    return " and ".join([*(as_if(term, lift) for term in one.terms), *effects])


def violated_words(findings: Findings) -> str:
    """Names the equations that are violated, as the model has them; of a law its own."""
    one = findings.proposal
    if one is not None and not findings.discovery.effects and one.terms:
        return " and ".join(dict.fromkeys(f"{term.equation.words} ({term.equation})" for term in one.terms))
    equations = dict.fromkeys(item.equation for item in findings.where if item.equation is not None)
    injector = findings.gaps.refitted.injector
    return " and ".join(text.equation_words(equation, injector) for equation in equations)


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


def learned(indicator: PrintedFigure) -> str:
    """Prints the observer's size of an effect, with its 95 % interval."""
    if indicator.value is None or not indicator.sigma:
        return "not needed"
    step = significant(indicator.sigma)
    interval = shown(1.96 * indicator.sigma, step)
    return f"{shown(indicator.value, step)} ± {interval} {sign(indicator.unit)}"


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


def usual_size(findings: Findings, effect_id: str) -> str:
    """Prints the size an effect appears to have on the healthy injector."""
    known = findings.usual.get(effect_id)
    if known is None:
        return "–"
    sigma = math.hypot(known.uncertainty, known.scatter)
    step = significant(sigma)
    return f"{shown(known.mean, step)} ± {shown(1.96 * sigma, step)} {sign(known.unit)}"


def amended_path(findings: Findings, sources: Sources) -> str:
    """The amended model as a command takes it."""
    name = findings.amended_model or ""
    return f"{sources.folder}/{name}" if sources.folder else name


def found_size(found: Discovery, effect_id: str) -> str:
    """Prints the size found of an effect."""
    sized = [size_words(printed(e.id, e.parameters[:1])) for e in found.effects if e.id == effect_id]
    return sized[0][0] if sized else "–"


_PAGES.globals |= vars(text) | globals()
_PAGES.globals |= {
    "remark": remark,
    "stands_out": stands_out,
    "overlay_figure": overlay_figure,
    "laws_figure": laws_figure,
    "PLAN_HEADINGS": HEADINGS,
    "plan_rows": plan_rows,
    "plan_words": plan_words,
}


def report(findings: Findings, sources: Sources) -> str:
    """The page."""
    found, where = findings.discovery, findings.where
    nearest = f"Nearest, not enough: {' + '.join(found.best.ids)}"
    after = f"{with_words(findings)[:1].upper()}{with_words(findings)[1:]}" if findings.shown.ids else nearest
    return _PAGES.get_template("report.html.j2").render(
        findings=findings,
        found=found,
        sources=sources,
        map_before=_gap_map("Model as given", [(item.before, item) for item in where], findings.points),
        map_after=_gap_map(after, [(item.after, item) for item in where], findings.points),
        violated=violated_words(findings),
        legend={
            "colours": [_colour(_WORST ** (i / 4.0)) for i in range(5)],
            "worst": _WORST,
            "significant": SIGNIFICANT,
        },
    )


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
