"""The answer in words, for the screen and the first lines of the report."""

from collections.abc import Mapping, Sequence

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MM3_PER_MS
from observer_rt.identification.discovery.findings import Caveat, Findings, gap_share
from observer_rt.identification.discovery.report.formula import law_text
from observer_rt.identification.discovery.report.law_words import as_if
from observer_rt.identification.discovery.report.numbers import shown, sign, significant
from observer_rt.identification.discovery.search.results import (
    Alternative,
    Candidate,
    Discovery,
    FittedParameter,
    Proposal,
    SmallestVisible,
    Verdict,
)
from observer_rt.model.effect import EffectParameter, Equation
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.parameters import EffectValue, Finite, InjectorParameters, LineOutflow

UNITS = {"MPa": MEGAPASCAL, "mm³/ms": MM3_PER_MS, "mg": MILLIGRAM, "µm": MICROMETRE}
"""SI values of the units of signals, as people write them."""
_DIGITS = 8  # of printed values: far below any interval, free of conversion noise
PHASE_WORDS = {
    Phase.STANDSTILL: "while the needle is shut",
    Phase.OPENING: "while the needle opens",
    Phase.OPEN: "while the needle is open",
    Phase.CLOSING: "while the needle closes",
    Phase.AFTER: "right after the needle has closed",
}


class Size(EffectValue):
    """A fitted parameter with its 95 % interval, in its printed unit: as files have it."""

    ci95: tuple[Finite, Finite]

    @property
    def digits(self) -> tuple[str, str, str]:
        """The value and the ends of its interval, digits as the interval deserves."""
        step = significant(max(self.ci95[1] - self.value, self.value - self.ci95[0]))
        return shown(self.value, step), shown(self.ci95[0], step), shown(self.ci95[1], step)

    @property
    def value_text(self) -> str:
        """Such as `0.301`, with the unit."""
        return f"{self.digits[0]} {sign(self.unit)}".rstrip()

    @property
    def interval_text(self) -> str:
        """Such as `0.295 to 0.307`, with the unit."""
        return f"{self.digits[1]} to {self.digits[2]} {sign(self.unit)}".rstrip()


def equation_words(equation: Equation, injector: InjectorParameters) -> str:
    """Names an equation as an injector's model has it."""
    lump, drained = injector.line.model == "lump", injector.line_outflow
    outflow = "Q_H" if drained is LineOutflow.NOZZLE else "Q_S"
    match equation:
        case Equation.LINE_PRESSURE if lump:
            return f"the balance of the line, p_L' = K_L/V_L (Q_L - {outflow}), (20)"
        case Equation.LINE_PRESSURE:
            return f"the balance at the closed end of the line, which {outflow} drains"
        case Equation.LINE_FLOW if lump:
            return "the flow through the line, Q_L' = ..., (19)"
        case Equation.LINE_FLOW:
            return "the motion of the fuel along the line"
        case Equation.SAC_PRESSURE:
            return "the balance of the sac, p_S' = K_C/V_S (Q_S - Q_H), with (21) and (23)"
        case Equation.INPUT:
            return "an input: rail pressure, lift or chamber pressure is not what it is taken for"
        case Equation.OUTPUT:
            return "the output: the line-pressure sensor does not show p_L"


def printed(effect_id: str, parameters: Sequence[FittedParameter]) -> dict[str, Size]:
    """The fitted parameters of an effect, printed, by name."""
    sizes = {}
    for one in parameters:
        known = definition(effect_id, one.name)
        value, low, high = (float(f"{si / known.si:.{_DIGITS}g}") for si in (one.value, *one.ci95))
        sizes[one.name] = Size(value=value, ci95=(low, high), unit=known.unit)
    return sizes


def sizes_of(candidate: Candidate) -> dict[str, dict[str, Size]]:
    """The sizes of the effects of a candidate, printed, by id; those of terms are not among them."""
    fitted = zip(candidate.ids, candidate.parameters, strict=True)
    return {name: printed(name, sizes) for name, sizes in fitted if name in candidate.named}


def definition(effect_id: str, name: str) -> EffectParameter:
    """The vocabulary's definition of an effect's parameter."""
    return next(p for p in VOCABULARY[effect_id].parameters if p.name == name)


def as_text(findings: Findings) -> str:
    """A few lines: verdict, effects with intervals, the gap before and after."""
    found = findings.discovery
    lines = [headline(found, findings.caveats, findings.accepted)]
    for effect in found.effects:
        sizes = ", ".join(_size_words(printed(effect.id, effect.parameters), "95 %: "))
        others = f" [or {', '.join(effect.indistinguishable_from)}]" if effect.indistinguishable_from else ""
        share = gap_share(found, effect)
        lines.append(
            f"  {effect.id}{others}: {sizes or VOCABULARY[effect.id].sentence}; explains "
            f"{f'{share:.0%}' if share >= 0.01 else 'less than 1%'} of the disagreement"
        )
    for decisive in found.decide_by:
        lines.append(f"  to tell {' from '.join(decisive.separates)}: {decisive.measurement}")
    if findings.is_open:
        lines.append(f"  no amended model while these are tied: {choices(found)}")
    if found.unexplained is not None:
        lines.append(f"  {found.unexplained.term}; {best_words(found)}")
    for number, proposal in enumerate(found.proposals, 1):
        lines += [f"  proposal {number}: {proposal_words(proposal)}", f"    {standing_words(proposal)}"]
        lines += [f"    or {alternative_words(one, proposal.largest_lift)}" for one in proposal.alternatives]
        lines += [f"    {law_text(term)}" for term in proposal.terms]
    option = acceptance(findings)
    if option:
        lines.append(f"  to have it in the amended model: {option}, and --force")
    if findings.remainder is not None:
        lines.append(f"  {part_words(findings)}")
    if found.verdict is Verdict.NONE and found.smallest_visible:  # wear may be there up to these all the same
        wear = (one for one in found.smallest_visible if VOCABULARY[one.id].wear)
        names = (f"{one.id} below {visible_words(one)}" for one in wear)
        lines.append(f"  not seen: {', '.join(names)}; all in the report")
    return "\n".join([*lines, *gap_lines(findings)])


def proposal_words(one: Proposal) -> str:
    """Describes a proposal in a sentence."""
    parts = [as_if(term, one.largest_lift) for term in one.terms]
    sizes = sizes_of(one.found)
    known = [f"{name} ({', '.join(_size_words(sizes[name], '95 %: '))})" for name in one.effects]
    return " with ".join([*([f"as if {' and '.join(parts)}"] if parts else []), *known])


def alternative_words(one: Alternative, largest_lift: float | None) -> str:
    """Describes what line pressure cannot tell from a proposal, with its mass. largest_lift: of the needle [m]."""
    moved = f"injected mass {one.moves.mass / MILLIGRAM:+.2g} mg"
    return (
        f"{_law_words(one, largest_lift)}, {moved}: line pressure cannot tell the two apart, a measured rate may "
        f"(--instead {one.found.terms[0].equation})"
    )


def _law_words(one: Alternative, largest_lift: float | None) -> str:
    (term,) = one.found.terms
    return f"as if {as_if(term, largest_lift)}"


def acceptance(findings: Findings) -> str:
    """Options that put a proposal into the amended model; empty where none do, or one is in it."""
    if findings.amended_model is not None:
        return ""
    numbered = enumerate(findings.discovery.proposals, start=1)
    may = [(number, one.may_enter) for number, one in numbered if one.may_enter or one.may_enter_in_part]
    number, whole = max(may, key=lambda one: one[1], default=(0, False))
    return f"--accept-term {number}{'' if whole else ' --in-part'}" if number else ""


def part_words(findings: Findings) -> str:
    """Says what a proposal accepted in part leaves; empty where none is."""
    one = findings.proposal
    if findings.remainder is None or one is None or one.part is None:
        return ""
    return (
        f"accepted in part: it closes {one.part.closed:.0%} of the gap held out; the "
        f"{one.part.left / MEGAPASCAL:.2g} MPa left belong to the model's stated uncertainty, by which masses "
        f"have ±{one.part.mass_half:.1%} more"
    )


def standing_words(one: Proposal) -> str:
    """Rates a proposal: how far it explains the recordings, and whether a model may have it."""
    before, after = (value / MEGAPASCAL for value in one.held_out)
    apart = (
        f"line pressure held out: {before:.3g} MPa off before, {after:.3g} after" if before == before else ""
    )
    moved = f"injected mass {one.moves.mass / MILLIGRAM:+.2g} mg"
    fit = "explains all"
    refusal = one.refusal if one.part is None else one.part.refusal
    if one.may_enter_in_part and one.part is not None:
        closed, half = f"{one.part.closed:.0%}", f"{one.part.mass_half:.1%}"
        fit = f"closes {closed} of the gap: a model may have it in part, masses ±{half}"
    elif refusal is not None:
        fit = f"no model may have it, for {refusal.reason}: {refusal.remedy}"
    alike = dict.fromkeys(other for term in one.terms for other in term.equation.alike)
    hardly = f"line pressure alone hardly tells it from a law of {' or '.join(alike)}" if alike else ""
    return "; ".join(filter(None, (fit, apart, moved, hardly)))


def visible_words(one: SmallestVisible) -> str:
    """The smallest size of an effect that would have been seen, such as `v_H = 0.0034`."""
    unit = definition(one.id, one.parameter)
    return f"{one.parameter} = {one.size / unit.si:.2g} {sign(unit.unit)}".rstrip()


def headline(found: Discovery, caveats: Sequence[Caveat] = (), accepted: int = 0) -> str:
    """The verdict in one sentence, with its reservations. accepted: number of a proposal, 0 for none."""
    sure = f"(confidence {found.confidence:.2f})"
    but = f", but: {caveat_words(caveats)}" if caveats else ""
    return f"{found.verdict.value}: {_verdict_words(found, accepted)} {sure}{but}"


def _verdict_words(found: Discovery, accepted: int) -> str:
    if found.verdict is Verdict.NONE:
        return "the model explains the recordings; no effect is missing"
    if found.verdict is Verdict.UNKNOWN:
        return f"something is missing that no known effect explains{where_words(found, accepted)}"
    names = [" and ".join(ids) for ids in (found.named.ids, *found.rivals)]
    if found.verdict is Verdict.AMBIGUOUS and not found.rivals:
        return f"{names[0]}, which may be one of the two"
    return ", or ".join(names)


def caveat_words(caveats: Sequence[Caveat]) -> str:
    """The reservations in a few words, for a headline."""
    return "; ".join(caveat.words for caveat in caveats)


def choices(found: Discovery) -> str:
    """Names the options that choose among tied candidates."""
    options = " or ".join(f"--choose {'+'.join(ids)}" for ids in (found.named.ids, *found.rivals))
    return f"give the command again with {options}, and --force"


def best_words(found: Discovery) -> str:
    """Names the nearest candidate where nothing explains the recordings."""
    if not found.best.ids:
        return "no known effect brings the model nearer"
    return f"nearest, and not enough: {' with '.join(found.best.ids)}"


def where_words(found: Discovery, accepted: int) -> str:
    """Place at which something unknown acts, to be appended to a sentence. accepted: as of `headline`."""
    place = found.unexplained
    if place is None:
        return ""
    shows = f"; it shows most {PHASE_WORDS[place.phase]}"
    if found.proposals:
        one = found.proposals[max(accepted, 1) - 1]
        either = [_law_words(other, one.largest_lift) for other in one.alternatives]
        return ", or ".join((f"{shows}, {proposal_words(one)}", *either))
    return f"{shows}, as if the {place.equation.value.replace('_', ' ')} equation were wrong"


def candidate_words(candidate: Candidate) -> str:
    """The effects of a candidate with their sizes and intervals, for a title."""
    return " and ".join(
        ", ".join((name.replace("_", " "), *_size_words(sizes, "")))
        for name, sizes in sizes_of(candidate).items()
    )


def _size_words(sizes: Mapping[str, Size], level: str) -> list[str]:
    return [f"{name} = {one.value_text} ({level}{one.interval_text})" for name, one in sizes.items()]


def gap_lines(findings: Findings) -> list[str]:
    """The gaps on held-out operating points."""
    apart = findings.held_apart and findings.shown.ids
    where = "on operating points held out" if apart else "on the recordings"
    lines = []
    for gap in findings.gaps.printed.values():
        if gap.measured:
            after = f" before, {gap.after:.3g} after" if findings.shown.ids else ""
            alone = f"(noise alone {gap.noise_floor:.2g})"
            lines.append(f"  {gap.words} {where}: {gap.before:.3g} {gap.unit} off{after} {alone}")
        elif findings.shown.ids:
            lines.append(
                f"  {gap.words}: the model given is {gap.before:.2g} {gap.unit} off, if this is right"
            )
    return lines
