"""The answer in words, for the screen and the report."""

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.law_words import law_text
from observer_rt.identification.discovery.search.candidates import size_words
from observer_rt.identification.discovery.search.results import Verdict
from observer_rt.identification.discovery.sentences import (
    best_words,
    choices,
    headline,
    standing_words,
    visible_words,
)
from observer_rt.model.effects import VOCABULARY


def as_text(findings: Findings) -> str:
    """A few lines: verdict, effects with intervals, the gap before and after."""
    lines = [headline(findings, caveat_words(findings))]
    for effect in findings.effects:
        sizes = ", ".join(size_words(effect.parameters, "95 %: "))
        others = f" [or {', '.join(effect.indistinguishable_from)}]" if effect.indistinguishable_from else ""
        lines.append(
            f"  {effect.id}{others}: {sizes or VOCABULARY[effect.id].sentence}; explains "
            f"{f'{effect.gap_share:.0%}' if effect.gap_share >= 0.01 else 'less than 1%'} of the disagreement"
        )
    for decisive in findings.decide_by:
        lines.append(f"  to tell {' from '.join(decisive.separates)}: {decisive.measurement}")
    if findings.is_open:
        lines.append(f"  no amended model while these are tied: {choices(findings)}")
    if findings.verdict is Verdict.UNKNOWN:
        lines.append(f"  {best_words(findings)}")
    for proposal in findings.proposals:
        lines += [f"  proposal {proposal.number}: {proposal.sentence}", f"    {standing_words(proposal)}"]
        lines += [f"    {law_text(term)}" for term in proposal.terms]
    option = acceptance(findings)
    if option:
        lines.append(f"  to have it in the amended model: {option}, and --force")
    if findings.remainder is not None:
        lines.append(f"  {part_words(findings)}")
    # Wear may be there up to these all the same.
    if findings.verdict is Verdict.NONE and findings.smallest_visible:
        wear = (one for one in findings.smallest_visible if VOCABULARY[one.id].wear)
        names = (f"{one.id} below {visible_words(one)}" for one in wear)
        lines.append(f"  not seen: {', '.join(names)}; all in the report")
    return "\n".join([*lines, *gap_lines(findings)])


def caveat_words(findings: Findings) -> str:
    """The reservations in a few words, for a headline."""
    return "; ".join(caveat.words for caveat in findings.caveats)


def acceptance(findings: Findings) -> str:
    """Options that put a proposal into the amended model; empty where none do, or one is in it."""
    if findings.amended_model is not None or findings.is_open:
        return ""
    may = [one.number for one in findings.proposals if one.may_enter]
    return f"--accept-term {may[0]}" if may else ""


def part_words(findings: Findings) -> str:
    """Says what a proposal accepted in part leaves; empty where none is."""
    proposal = findings.proposal
    if findings.remainder is None or proposal is None or proposal.part is None:
        return ""
    return (
        f"accepted in part: it closes {proposal.part.closed:.0%} of the gap held out; the "
        f"{proposal.part.left / MEGAPASCAL:.2g} MPa left belong to the model's stated uncertainty, by which masses "
        f"have ±{proposal.part.mass_half:.1%} more"
    )


def gap_lines(findings: Findings) -> list[str]:
    """The gaps on held-out operating points."""
    apart = findings.held_apart and findings.shown.ids
    where = "on operating points held out" if apart else "on the recordings"
    lines = []
    for gap in findings.gaps.by_name.values():
        if gap.measured:
            after = f" before, {gap.after:.3g} after" if findings.shown.ids else ""
            alone = f"(noise alone {gap.noise_floor:.2g})"
            lines.append(f"  {gap.words} {where}: {gap.before:.3g} {gap.unit} off{after} {alone}")
        elif findings.shown.ids:
            lines.append(
                f"  {gap.words}: the model given is {gap.before:.2g} {gap.unit} off, if this is right"
            )
    return lines
