"""Results of a search in words, for screen, page and document."""

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.discovery.numbers import sign
from observer_rt.identification.discovery.search.results import Discovery, Proposal, SmallestVisible, Verdict

PHASE_WORDS = {
    Phase.STANDSTILL: "while the needle is shut",
    Phase.OPENING: "while the needle opens",
    Phase.OPEN: "while the needle is open",
    Phase.CLOSING: "while the needle closes",
    Phase.AFTER: "right after the needle has closed",
}


def headline(discovery: Discovery, reservations: str = "") -> str:
    """The verdict in one sentence, with its reservations."""
    sure = f"(confidence {discovery.confidence:.2f})"
    but = f", but: {reservations}" if reservations else ""
    return f"{discovery.verdict.value}: {_verdict_words(discovery)} {sure}{but}"


def _verdict_words(discovery: Discovery) -> str:
    if discovery.verdict is Verdict.NONE:
        return "the model explains the recordings; no effect is missing"
    if discovery.verdict is Verdict.UNKNOWN:
        return f"something is missing that no known effect explains{where_words(discovery)}"
    names = [" and ".join(ids) for ids in (discovery.named.ids, *discovery.rivals) if ids]
    names += [one.sentence for one in discovery.proposals]
    if discovery.verdict is Verdict.AMBIGUOUS and len(names) == 1:
        return f"{names[0]}, which may be one of the two"
    return ", or ".join(names)


def where_words(discovery: Discovery) -> str:
    """Place at which something unknown acts, to be appended to a sentence."""
    unexplained = discovery.unexplained
    if unexplained is None:
        return ""
    nearest = f"as if the {unexplained.equation.value.replace('_', ' ')} equation were wrong"
    laws = ", or ".join(one.sentence for one in discovery.proposals)
    return f"; it shows most {PHASE_WORDS[unexplained.phase]}, {laws or nearest}"


def standing_words(proposal: Proposal) -> str:
    """Rates a proposal: how far it explains the recordings, and whether a model may have it."""
    before, after = (value / MEGAPASCAL for value in proposal.held_out)
    apart = (
        f"line pressure held out: {before:.3g} MPa off before, {after:.3g} after" if before == before else ""
    )
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
    """The smallest size of an effect that would have been seen, such as `v_H = 0.0034`."""
    return f"{smallest.parameter} = {smallest.size:.2g} {sign(smallest.unit)}".rstrip()


def choices(discovery: Discovery) -> str:
    """Names the options that choose among tied candidates."""
    options = [f"--choose {'+'.join(ids)}" for ids in (discovery.named.ids, *discovery.rivals) if ids]
    options += [f"--accept-term {one.number}" for one in discovery.proposals if one.may_enter]
    return f"give the command again with {' or '.join(options)}, and --force"


def best_words(discovery: Discovery) -> str:
    """Names the nearest candidate where nothing explains the recordings."""
    if not discovery.best.ids:
        return "no known effect brings the model nearer"
    return f"nearest, and not enough: {' with '.join(discovery.best.ids)}"
