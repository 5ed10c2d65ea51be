"""The head of the page: the answer in a sentence, the figures below it, how to use it."""

from dataclasses import dataclass

from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.discovery.findings import LEAST_MASS, Findings, Sources, explained_share
from observer_rt.identification.discovery.gaps import ModelGaps
from observer_rt.identification.discovery.report.numbers import sign
from observer_rt.identification.discovery.report.text import UNITS, candidate_words, where_words
from observer_rt.identification.discovery.search.results import Discovery, Verdict


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


def printed_in(value: float, unit: str) -> str:
    """Two digits of a value in SI, with its unit."""
    return f"{value / UNITS[unit]:.2g} {unit}"


def explained_ids(found: Discovery) -> tuple[str, ...]:
    """The effects found, and those tied with them."""
    every = (found.named.ids, *found.rivals) if found.effects else ()
    return tuple(dict.fromkeys(effect_id for ids in every for effect_id in ids))


def amended_path(findings: Findings, sources: Sources) -> str:
    """The amended model as a command takes it."""
    name = findings.amended_model or ""
    return f"{sources.folder}/{name}" if sources.folder else name
