"""Builds report.html: the answer first, then what it rests on, in words and units."""

import math
import re
from dataclasses import dataclass

from markupsafe import Markup, escape

from observer_rt.files.learned_picture import learned_figure
from observer_rt.foundation import units
from observer_rt.foundation.files import templates_of
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.discovery import gaps, numbers
from observer_rt.identification.discovery.findings import LEAST_MASS, Findings
from observer_rt.identification.discovery.numbers import sign
from observer_rt.identification.discovery.report import figures, tables, text
from observer_rt.identification.discovery.search.laws import guess_words
from observer_rt.identification.discovery.search.results import Verdict
from observer_rt.identification.discovery.words import law_words, sentences
from observer_rt.identification.discovery.words.sentences import candidate_words, proposal_words, where_words
from observer_rt.model.effects import VOCABULARY

_PAGES = templates_of(__package__)
for _module in (units, numbers, gaps, sentences, text, tables, figures, law_words):
    _PAGES.globals |= vars(_module)
_PAGES.globals |= {"VOCABULARY": VOCABULARY, "isfinite": math.isfinite}
_PAGES.globals |= {"learned_figure": learned_figure, "guess_words": guess_words}
_PAGES.filters["with_code"] = lambda text: Markup(re.sub("`(.+?)`", r"<code>\1</code>", escape(text)))
_PAGES.filters["sentence"] = lambda text: text[:1].upper() + text[1:]


def report(findings: Findings) -> str:
    """The page."""
    return _PAGES.get_template("report.html.j2").render(
        findings=findings, title=title(findings), tiles=tiles(findings)
    )


def title(findings: Findings) -> str:
    """The answer in a sentence, all explanations that are tied in it."""
    if findings.verdict is Verdict.NONE:
        return "Nothing is missing: the model explains the recordings"
    if findings.verdict is Verdict.UNKNOWN:
        return f"Something is missing that no effect of the vocabulary explains{where_words(findings)}"
    by_ids = {candidate.ids: candidate for candidate in findings.ranking}
    names = [candidate_words(by_ids[ids]) for ids in (findings.named.ids, *findings.rivals) if ids]
    first, *others = [*names, *map(proposal_words, findings.proposals)]
    if findings.chosen and others:
        return f"Missing: {first}, as was chosen; these recordings would allow {'; or '.join(others)} as well"
    doubt = ""
    if findings.verdict is Verdict.AMBIGUOUS:
        doubt = ": these recordings do not decide" if others else ", which may be one of the two"
    return f"Missing: {'; or '.join((first, *others))}{doubt}"


@dataclass(frozen=True)
class Tile:
    """A figure at the top of the page."""

    value: str
    unit: str
    text: str


def tiles(findings: Findings) -> list[Tile]:
    """Confidence, and gaps before and after."""
    amended = bool(findings.shown.ids)
    sure = "confidence that this is right"
    if findings.verdict is Verdict.UNKNOWN:
        sure = "confidence that something unknown is missing; how sure a law is: its interval, and what is held out"
    elif findings.rivals:
        sure = f"confidence that it is {' and '.join(findings.named.ids)}"
    elif findings.caveats:
        sure = "confidence, with the reservations above"
    result = [Tile(f"{findings.confidence:.0%}", "", sure)]
    for gap in findings.gaps.by_name.values():
        if gap.measured:
            value = f"{gap.before:.2g}" + (f" → {gap.after:.2g}" if amended else "")
            apart = ", held out" if amended and findings.held_apart else ""
            result.append(Tile(value, sign(gap.unit), f"{gap.words}, model minus measured, rms{apart}"))
        elif amended:
            least = LEAST_MASS / MILLIGRAM
            value = f"{gap.before:.2g}" if gap.before >= least else f"< {least:g}"
            result.append(Tile(value, gap.unit, f"{gap.words}, what the model given is wrong"))
    if findings.effects and len(result) < 4:
        result.append(Tile(f"{findings.explained:.0%}", "", "of the disagreement explained"))
    return result
