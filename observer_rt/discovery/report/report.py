"""report.html: the answer first, then what it rests on, in one self-contained page."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from html import escape

from observer_rt import __version__
from observer_rt.discovery.findings import Findings, explained_share
from observer_rt.discovery.report.gap_parts import held_out, maps, typical_injections
from observer_rt.discovery.report.gaps import Gap
from observer_rt.discovery.report.html import callout, code, document, paragraph, section, table
from observer_rt.discovery.report.opinion_part import opinion_parts
from observer_rt.discovery.report.tables import (
    LEAST_MASS,
    checks_table,
    effects_table,
    ranking_table,
    undecided,
)
from observer_rt.discovery.report.text import effects_words, where_words
from observer_rt.discovery.result import Discovery, Verdict
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MM3_PER_MS
from observer_rt.model.effects import VOCABULARY

_SHOWN_HASH = 16  # digits


@dataclass(frozen=True)
class Sources:
    """What a report was made from.

    in_force: effects in the model already; recordings: SHA-256 by file name; healthy: names of healthy recordings.
    """

    model: str
    model_hash: str
    in_force: tuple[str, ...]
    recordings: Mapping[str, str]
    healthy: tuple[str, ...]
    made: datetime


def report(findings: Findings, sources: Sources) -> str:
    """The page."""
    found = findings.discovery
    parts = [
        _header(sources),
        *_answer(findings),
        section("Where model and measurement disagree", *maps(findings)),
        section("A typical injection", *typical_injections(found, findings.overlays)),
        section("On operating points the model was not fitted to", *held_out(findings)),
        section("The effects, and how sure they are", *effects_table(findings)),
        section("Candidates and their evidence", *ranking_table(found)),
        section("What could not be told apart, and what would decide", *undecided(found)),
        section("Sensors and line at standstill", *checks_table(findings.checks, findings.files)),
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
    count = len(sources.recordings)
    by = f"{count} recordings" if count > 1 else "one recording"
    known = (
        f" (in force there: {', '.join(code(one) for one in sources.in_force)})" if sources.in_force else ""
    )
    what = f"What is missing in {code(sources.model)}{known}, by {by}"
    return f"<header><span>{what}</span><span>{made}</span></header>"


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
        before += f" and <b>{_mass_words(gaps.mass.before, gaps.injected)}</b> in injected mass"
    alone = f"noise alone makes {pressure.noise_floor / MEGAPASCAL:.2g} MPa"
    if not found.effects:
        return f"The model as given is {before} (rms); {alone}."
    it = "it" if len(found.effects) == 1 else "them"
    left = f"{pressure.after / MEGAPASCAL:.2g} MPa are left, of which {alone}"
    return (
        f"Without {it} the model is {before} (rms). With {it} {left}. The amended model stands in "
        f"{code(findings.amended_model or '')}; every command and the daemon load it as it is."
    )


def _mass_words(gap: float, injected: float) -> str:
    """A gap in mass [kg], absolute and as a share, where it is one to speak of."""
    if gap < LEAST_MASS:
        return f"less than {LEAST_MASS / MILLIGRAM:g} mg"
    return f"{gap / MILLIGRAM:.2g} mg ({gap / injected:.1%})"


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
                f"{_least(gaps.mass.before)} <small>mg</small>",
                "injected mass, what the model given is wrong",
            )
        )
    if found.effects and len(tiles) < 4:
        tiles.append((f"{explained_share(found):.0%}", "of the disagreement explained"))
    inner = "".join(f'<div class="tile"><b>{value}</b><span>{text}</span></div>' for value, text in tiles)
    return f'<div class="tiles">{inner}</div>'


def _least(gap: float) -> str:
    """A gap in mass [kg], in mg."""
    return f"{gap / MILLIGRAM:.2g}" if gap >= LEAST_MASS else f"< {LEAST_MASS / MILLIGRAM:g}"


def _warning(findings: Findings) -> list[str]:
    result = []
    unexplained = findings.discovery.unexplained
    if unexplained is not None:
        result.append(callout(f"{escape(unexplained.term[:1].upper() + unexplained.term[1:])}.", "bad"))
    if findings.contradictions:
        said = "; ".join(escape(line) for line in findings.contradictions)
        result.append(
            callout(f"The learning observer does not agree: {said}. Do not act before this is understood.")
        )
    if findings.healthy_warning:
        result.append(callout(escape(findings.healthy_warning)))
    return result


def _method(findings: Findings, sources: Sources) -> list[str]:
    fitted, held_out = set(findings.fitted_on), set(findings.held_out)
    only_fitted = fitted - held_out
    points = [
        [code(name), "sizes fitted again" if name in only_fitted else "shown"] for name in findings.points
    ]
    files = [
        [code(name), f"<code>{digest[:_SHOWN_HASH]}…</code>"] for name, digest in sources.recordings.items()
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
        table(("operating point", "in the comparison"), points),
        table(("recording", "SHA-256"), files),
        paragraph(
            f"Model: {code(sources.model)}, SHA-256 <code>{sources.model_hash[:_SHOWN_HASH]}…</code>", "note"
        ),
    ]
