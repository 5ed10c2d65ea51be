"""report.html: the answer first, then what it rests on, in one self-contained page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from html import escape

from observer_rt import __version__
from observer_rt.discovery.figures import Bars, Overlay, gap_figure, overlay_figure
from observer_rt.discovery.findings import Findings, gap_share
from observer_rt.discovery.page import callout, code, document, figure, paragraph, section, table
from observer_rt.discovery.printed import printed
from observer_rt.discovery.report_map import legend, map_table, point_name
from observer_rt.discovery.report_tables import checks_table, opinion_parts, ranking_table
from observer_rt.discovery.result import Discovery, FittedEffect, Verdict
from observer_rt.discovery.show import Gap
from observer_rt.discovery.text import EQUATION_WORDS, effects_words, where_words
from observer_rt.model.effects import VOCABULARY
from observer_rt.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MM3_PER_MS

_SHOWN_HASH = 16  # digits


@dataclass(frozen=True)
class Sources:
    """What a report was made from. recordings: SHA-256 by file name; healthy: names of healthy recordings."""

    model: str
    model_hash: str
    recordings: Mapping[str, str]
    healthy: tuple[str, ...]
    made: datetime


def report(findings: Findings, overlays: Sequence[Overlay], sources: Sources) -> str:
    """The page."""
    found = findings.discovery
    parts = [
        _header(sources),
        *_answer(findings),
        section("Where model and measurement disagree", *_maps(findings)),
        section("A typical injection", *_overlay(found, overlays)),
        section("On operating points the model was not fitted to", *_held_out(findings)),
        section("The effects, and how sure they are", *_effects(found)),
        section("Candidates and their evidence", *ranking_table(found)),
        section("What could not be told apart, and what would decide", *_undecided(found)),
        section("Sensors and line at standstill", *checks_table(findings.checks, findings.recordings)),
        section(
            "What the learning observer says of the same recordings", *opinion_parts(found, findings.opinion)
        ),
        section("How this was found", *_method(findings, sources)),
        f"<footer>observer_rt {__version__}, <code>observer-rt discover</code>, {findings.seconds:.0f} s. "
        f"What this page says is also in {code('findings.json')} beside it.</footer>",
    ]
    return document(f"Discovery: {found.verdict.value}", "\n".join(part for part in parts if part))


def _header(sources: Sources) -> str:
    made = sources.made.strftime("%Y-%m-%d %H:%M")
    return (
        f"<header><span>What is missing in {code(sources.model)}, by {len(sources.recordings)} recordings</span>"
        f"<span>{made}</span></header>"
    )


def _answer(findings: Findings) -> list[str]:
    found = findings.discovery
    return [
        f'<div class="answer"><span class="verdict {found.verdict.value}">{found.verdict.value}</span></div>',
        f"<h1>{_title(found)}</h1>",
        paragraph(_consequence(findings), "lead"),
        _tiles(findings),
        *(paragraph(escape(VOCABULARY[effect.id].sentence)) for effect in found.effects),
        *_warning(findings),
    ]


def _title(found: Discovery) -> str:
    if found.verdict is Verdict.NONE:
        return "Nothing is missing: the model explains the recordings"
    if found.verdict is Verdict.UNKNOWN:
        return f"Something is missing that no effect of the vocabulary explains{where_words(found)}"
    words = effects_words(found)
    if found.verdict is Verdict.AMBIGUOUS:
        return f"Missing: most likely {escape(words)}, but these recordings do not decide"
    return f"Missing: {escape(words)}"


def _consequence(findings: Findings) -> str:
    found, gaps = findings.discovery, findings.gaps
    pressure = gaps.line_pressure
    before = f"<b>{pressure.before / MEGAPASCAL:.2g} MPa</b> off in line pressure"
    if gaps.injection_rate is not None or found.effects:
        share = gaps.mass.before / gaps.injected
        before += f" and <b>{gaps.mass.before / MILLIGRAM:.2g} mg</b> ({share:.1%}) in injected mass"
    alone = f"noise alone makes {pressure.noise_floor / MEGAPASCAL:.2g} MPa"
    if not found.effects:
        return f"The model as given is {before} (rms); {alone}."
    return (
        f"Without it the model is {before} (rms). With it {pressure.after / MEGAPASCAL:.2g} MPa are left, of which "
        f"{alone}. The amended model stands in {code(findings.amended_model or '')}; every command and the daemon "
        "load it as it is."
    )


def _tiles(findings: Findings) -> str:
    found, gaps = findings.discovery, findings.gaps
    tiles = [(f"{found.confidence:.0%}", "confidence that this is right")]

    def arrow(gap: Gap, si: float, unit: str) -> str:
        if not found.effects:
            return f"{gap.before / si:.2g} <small>{unit}</small>"
        return f"{gap.before / si:.2g} → {gap.after / si:.2g} <small>{unit}</small>"

    tiles.append((arrow(gaps.line_pressure, MEGAPASCAL, "MPa"), "line pressure, model minus measured, rms"))
    if gaps.injection_rate is not None:
        tiles.append(
            (arrow(gaps.injection_rate, MM3_PER_MS, "mm³/ms"), "injection rate, model minus measured, rms")
        )
        tiles.append((arrow(gaps.mass, MILLIGRAM, "mg"), "injected mass, model minus measured, rms"))
    elif found.effects:
        tiles.append(
            (
                f"{gaps.mass.before / MILLIGRAM:.2g} <small>mg</small>",
                "injected mass, what the model given is wrong",
            )
        )
    if found.effects and len(tiles) < 4:
        share = sum(gap_share(found, effect) for effect in found.effects)
        tiles.append((f"{min(share, 1.0):.0%}", "of the disagreement explained"))
    inner = "".join(f'<div class="tile"><b>{value}</b><span>{text}</span></div>' for value, text in tiles)
    return f'<div class="tiles">{inner}</div>'


def _warning(findings: Findings) -> list[str]:
    result = []
    if findings.discovery.unexplained is not None:
        result.append(
            callout(
                escape(
                    findings.discovery.unexplained.term[:1].upper() + findings.discovery.unexplained.term[1:]
                )
                + ".",
                "bad",
            )
        )
    if findings.contradictions:
        said = "; ".join(escape(line) for line in findings.contradictions)
        result.append(
            callout(f"The learning observer does not agree: {said}. Do not act before this is understood.")
        )
    if findings.healthy_warning:
        result.append(callout(escape(findings.healthy_warning)))
    return result


def _maps(findings: Findings) -> list[str]:
    after = (
        "With the amended model"
        if findings.discovery.effects
        else "With the best candidate, which is not enough"
    )
    before = map_table(
        "Model as given", [(item.before, item) for item in findings.where], findings.recordings
    )
    if findings.discovery.verdict is Verdict.NONE:
        return [before, legend()]
    amended = map_table(after, [(item.after, item) for item in findings.where], findings.recordings)
    equations = dict.fromkeys(
        EQUATION_WORDS[item.equation] for item in findings.where if item.equation is not None
    )
    violated = f"Violated: {' and '.join(equations)}." if equations else ""
    return [f'<div class="maps">{before}{amended}</div>', legend(), paragraph(violated)]


def _overlay(found: Discovery, overlays: Sequence[Overlay]) -> list[str]:
    if not overlays:
        return []
    caption = (
        "The models follow the measurement up to the opening of the needle and run on their own from there, fed with "
        "the measured rail pressure and lift. Grey band: 95 % of what measurement noise alone leaves."
    )
    if found.effects:
        caption += " The amended model was fitted to other operating points than these."
    return [figure(overlay_figure(overlays), caption)]


def _held_out(findings: Findings) -> list[str]:
    gaps = findings.gaps
    first = {item.before.recording: item.before for item in findings.where}
    labels = [point_name(first[point.recording]).replace(", ", "\n") for point in gaps.points]
    amended = bool(findings.discovery.effects)
    pressures = tuple(point.line_pressure for point in gaps.points)
    groups = [Bars("line pressure", "MPa", MEGAPASCAL, pressures, amended)]
    rates = tuple(point.injection_rate for point in gaps.points if point.injection_rate is not None)
    masses = tuple(point.mass for point in gaps.points)
    if rates:
        groups.append(Bars("injection rate", "mm³/ms", MM3_PER_MS, rates, amended))
        groups.append(Bars("injected mass", "mg", MILLIGRAM, masses, amended))
    elif amended:
        groups.append(
            Bars("injected mass, against the amended model", "mg", MILLIGRAM, masses, amended=False)
        )
    held_out = set(findings.held_out) != set(findings.fitted_on)
    how = (
        "For this picture the amended model was fitted to every second operating point and judged on the others, "
        "which are shown."
        if held_out
        else "There is one operating point only: nothing is held out, the model is judged where it was fitted."
    )
    if not amended:
        how = "The model as given, on every second operating point."
    return [figure(gap_figure(labels, groups), how)]


def _effects(found: Discovery) -> list[str]:
    rows = [row for effect in found.effects for row in _rows(effect)]
    if not rows:
        return []
    headings = ("effect", "size", "95 % interval", "confidence", "signature")
    return [
        table(headings, rows),
        paragraph(f"Confidence: {escape(found.confidence_method)}.", "note"),
    ]


def _rows(effect: FittedEffect) -> list[list[str]]:
    definition = VOCABULARY[effect.id]
    sizes = [printed(effect.id, parameter) for parameter in effect.parameters]
    return [
        [
            code(effect.id),
            "<br>".join(escape(size.value_text) for size in sizes) or "in force",
            "<br>".join(escape(size.interval_text) for size in sizes),
            f"{effect.confidence:.2f}",
            escape(definition.signature),
        ]
    ]


def _undecided(found: Discovery) -> list[str]:
    rows = [
        [" / ".join(code(one) for one in item.separates), escape(item.measurement)]
        for item in found.decide_by
    ]
    parts = []
    if found.rivals:
        others = "; ".join(" with ".join(code(one) for one in ids) for ids in found.rivals)
        parts.append(paragraph(f"These recordings are explained as well by: {others}."))
    if rows:
        parts.append(table(("to tell apart", "measure"), rows))
    for effect in found.effects:
        same = VOCABULARY[effect.id].indistinguishable
        if same:
            parts.append(
                paragraph(
                    f"{code(effect.id)} and {', '.join(code(one) for one in same)} have the same effect on every "
                    "signal; either name is right for the model."
                )
            )
    if not parts and found.effects:
        parts.append(paragraph("Nothing: every other candidate explains the recordings significantly worse."))
    return parts


def _method(findings: Findings, sources: Sources) -> list[str]:
    fitted, held_out = set(findings.fitted_on), set(findings.held_out)
    rows = [
        [
            code(name),
            "fitted" if name in fitted - held_out else "shown",
            f"<code>{digest[:_SHOWN_HASH]}…</code>",
        ]
        for name, digest in sources.recordings.items()
    ]
    found, noise = findings.discovery, findings.discovery.noise
    healthy = (
        f" Phases are judged relative to what is left on {len(sources.healthy)} healthy recordings."
        if sources.healthy
        else ""
    )
    return [
        paragraph(
            "Every candidate is compared with the recordings through whitened innovations: what the model, corrected "
            "at every sample as far as the noise of its inputs explains, predicts wrongly of the next. Noise comes "
            f"from the recordings: rail pressure {noise.rail_pressure / MEGAPASCAL:.3f} MPa, line pressure "
            f"{noise.line_pressure / MEGAPASCAL:.3f} MPa, lift {noise.needle_lift / MICROMETRE:.2f} µm a sample. "
            f"An effect is named when -2 log L falls by more than {found.threshold:.0f}; here it fell by "
            f"{found.gain:.0f}. Names and sizes come from all recordings; for the pictures above the sizes were "
            f"found again on every second operating point.{healthy}"
        ),
        table(("recording", "held-out comparison", "SHA-256"), rows),
        paragraph(
            f"Model: {code(sources.model)}, SHA-256 <code>{sources.model_hash[:_SHOWN_HASH]}…</code>", "note"
        ),
    ]
