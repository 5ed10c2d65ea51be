"""The answer in words, for the screen and the report."""

import math
from operator import attrgetter

from observer_rt.engine.estimation.phases import PHASE_WORDS
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, sign
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.law_words import law_text
from observer_rt.identification.discovery.search.candidates import size_words
from observer_rt.identification.discovery.search.proposal import Proposal
from observer_rt.identification.discovery.search.results import Discovery, SmallestVisible, Verdict
from observer_rt.model.effects import VOCABULARY

MOST_NOISE = 3.0  # times the noise, that a model which explains the recordings may leave


def as_text(findings: Findings) -> str:
    """A few lines: verdict, effects with intervals, laws, the gap before and after."""
    lines = [headline(findings, "; ".join(caveat.words for caveat in findings.caveats))]
    for effect in findings.effects:
        sizes = ", ".join(size_words(effect.parameters, "95 %: "))
        others = f" [or {', '.join(effect.indistinguishable_from)}]" if effect.indistinguishable_from else ""
        share = f"{effect.gap_share:.0%}" if effect.gap_share >= 0.01 else "less than 1%"
        words = sizes or VOCABULARY[effect.id].sentence
        lines.append(f"  {effect.id}{others}: {words}; explains {share} of the disagreement")
    for decisive in findings.decide_by:
        lines.append(f"  to tell {' from '.join(decisive.separates)}: {decisive.measurement}")
    if findings.is_open:
        lines.append(f"  no amended model while these are tied: {_choices(findings)}")
    if findings.verdict is Verdict.UNKNOWN:
        nearest = f"nearest, and not enough: {' with '.join(findings.best.ids)}"
        lines.append(f"  {nearest if findings.best.ids else 'no known effect brings the model nearer'}")
    for proposal in findings.proposals:
        lines += [f"  proposal {proposal.number}: {proposal.sentence}", f"    {standing_words(proposal)}"]
        lines += [f"    {law_text(term)}" for term in proposal.terms]
    may_enter = [proposal.number for proposal in findings.proposals if proposal.may_enter]
    if may_enter and findings.amended_model is None and not findings.is_open:
        lines.append(f"  to have it in the amended model: --accept-term {may_enter[0]}, and --force")
    part = None if findings.proposal is None else findings.proposal.part
    if findings.remainder is not None and part is not None:
        lines.append(
            f"  accepted in part: it closes {part.closed:.0%} of the gap held out; the {part.left / MEGAPASCAL:.2g} "
            f"MPa left belong to the model's stated uncertainty, by which masses have ±{part.mass_half:.1%} more"
        )
    if findings.verdict is Verdict.NONE and findings.smallest_visible:  # Wear may be there up to these all the same.
        wear = (one for one in findings.smallest_visible if VOCABULARY[one.id].wear)
        names = (f"{one.id} below {visible_words(one)}" for one in wear)
        lines.append(f"  not seen: {', '.join(names)}; all in the report")
    return "\n".join([*lines, *_gap_lines(findings)])


def headline(discovery: Discovery, reservations: str = "") -> str:
    """The verdict in one sentence, with its reservations."""
    sure = f"(confidence {discovery.confidence:.2f})"
    but = f", but: {reservations}" if reservations else ""
    return f"{discovery.verdict.value}: {_verdict_words(discovery)} {sure}{but}"


def _verdict_words(discovery: Discovery) -> str:
    unexplained = discovery.unexplained
    laws = [one.sentence for one in discovery.proposals]
    if discovery.verdict is Verdict.NONE:
        if discovery.noise_ratio <= MOST_NOISE:
            return "the model explains the recordings; no effect is missing"
        most = max(discovery.before, key=attrgetter("variance"))
        where = f"{most.signal.words} {PHASE_WORDS[most.phase]} at {most.point}"
        left = f"it leaves {discovery.noise_ratio:.1f} times the noise, most in the {where}"
        return f"no effect stands out, yet the model does not explain the recordings: {left}"
    if discovery.verdict is Verdict.UNKNOWN:
        words = "something is missing that no known effect explains"
        if unexplained is None:
            return words
        equation = f"as if the {unexplained.equation.value.replace('_', ' ')} equation were wrong"
        return f"{words}; it shows most {PHASE_WORDS[unexplained.phase]}, {', or '.join(laws) or equation}"
    names = [" and ".join(ids) for ids in (discovery.named.ids, *discovery.rivals) if ids] + laws
    if discovery.verdict is Verdict.AMBIGUOUS and len(names) == 1:
        return f"{names[0]}, which may be one of the two"
    return ", or ".join(names)


def standing_words(proposal: Proposal) -> str:
    """Says how much a proposal explains, whether a model may accept it, and where it was seen."""
    before, after = (value / MEGAPASCAL for value in proposal.held_out)
    apart = "" if math.isnan(before) else f"line pressure held out: {before:.3g} MPa off before, {after:.3g} after"
    moved = f"injected mass {proposal.candidate.moves.mass / MILLIGRAM:+.2g} mg"
    fit = f"explains all (probability {proposal.probability:.2f})" if proposal.adequate else ""
    if proposal.refusal is not None:
        fit = f"no model may have it, for {proposal.refusal.reason}: {proposal.refusal.remedy}"
    elif proposal.part is not None:
        closed, half = f"{proposal.part.closed:.0%}", f"{proposal.part.mass_half:.1%}"
        fit = f"closes {closed} of the gap: a model may have it in part, masses ±{half}"
    held = [f"{name} {low:g} to {high:g}" for name, (low, high) in proposal.seen_of_terms.items()]
    where = f"seen at {', '.join(held)}, beyond it stays as it is there" if held else ""
    return "; ".join(filter(None, (fit, apart, moved, where)))


def visible_words(smallest: SmallestVisible) -> str:
    """Smallest size of an effect that recordings would show, such as `v_H = 0.0034`."""
    return f"{smallest.parameter} = {smallest.size:.2g} {sign(smallest.unit)}".rstrip()


def _choices(discovery: Discovery) -> str:
    options = [f"--choose {'+'.join(ids)}" for ids in (discovery.named.ids, *discovery.rivals) if ids]
    options += [f"--accept-term {one.number}" for one in discovery.proposals if one.may_enter]
    return f"give the command again with {' or '.join(options)}, and --force"


def _gap_lines(findings: Findings) -> list[str]:
    apart = findings.held_apart and findings.shown.ids
    where = "on operating points held out" if apart else "on the recordings"
    lines = []
    for gap in findings.gaps.by_name.values():
        if gap.measured:
            after = f" before, {gap.after:.3g} after" if findings.shown.ids else ""
            alone = f"(noise alone {gap.noise_floor:.2g})"
            lines.append(f"  {gap.words} {where}: {gap.before:.3g} {gap.unit} off{after} {alone}")
        elif findings.shown.ids:
            lines.append(f"  {gap.words}: the model given is {gap.before:.2g} {gap.unit} off, if this is right")
    return lines
