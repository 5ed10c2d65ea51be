"""The answer in words, for the screen and the first lines of the report; terms in the words of an engineer."""

import re
from collections.abc import Mapping, Sequence

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MILLIMETRE, MM3_PER_MS
from observer_rt.identification.discovery.findings import Caveat, Findings, gap_share
from observer_rt.identification.discovery.search.curves import AXES, SINCE
from observer_rt.identification.discovery.search.results import (
    Candidate,
    Discovery,
    FittedParameter,
    Proposal,
    SmallestVisible,
    Verdict,
)
from observer_rt.model.effect import EffectParameter, Equation
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.parameters import EffectValue, Finite
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation

_SIGNS = {"um": "µm", "us": "µs", "mm3/ms": "mm³/ms", "m3/(s Pa)": "m³/(s Pa)", "-": ""}
"""Units as people write them, by those of files."""
UNITS = {"MPa": MEGAPASCAL, "mm³/ms": MM3_PER_MS, "mg": MILLIGRAM, "µm": MICROMETRE}
"""SI values of the units of signals, as people write them."""
_DIGITS = 8  # of printed values: far below any interval, free of conversion noise
EQUATION_WORDS = {
    Equation.LINE_PRESSURE: "the balance of the line, p_L' = K_L/V_L (Q_L - Q_H), (20)",
    Equation.LINE_FLOW: "the flow through the line, Q_L' = ..., (19)",
    Equation.SAC_PRESSURE: "the balance of the sac, p_S' = K_C/V_S (Q_S - Q_H), with (21) and (23)",
    Equation.INPUT: "an input: rail pressure, lift or chamber pressure is not what it is taken for",
    Equation.OUTPUT: "the output: the line-pressure sensor does not show p_L",
}
PHASE_WORDS = {
    Phase.STANDSTILL: "while the needle is shut",
    Phase.OPENING: "while the needle opens",
    Phase.OPEN: "while the needle is open",
    Phase.CLOSING: "while the needle closes",
    Phase.AFTER: "right after the needle has closed",
}
_AS_IF: Mapping[TermEquation, tuple[str, str, str]] = {
    TermEquation.LINE_FLOW: ("the line lost more pressure, by", "the line lost {} less", "the line lost {} more"),
    TermEquation.LINE_PRESSURE: (
        "fuel left the line beside the nozzle,", "{} came into the line's end", "{} left the line beside the nozzle",
    ),
    TermEquation.SEAT_FLOW: (
        "the flow through the seat were larger by a share of",
        "the seat let {} less through", "the seat let {} more through",
    ),
    TermEquation.NOZZLE_FLOW: (
        "the flow through the nozzle were larger by a share of",
        "the nozzle lost {} of its flow", "the nozzle let {} more through",
    ),
    TermEquation.STIFFNESS: (
        "the fuel in the line were stiffer by a share of",
        "the fuel in the line were softer by {}", "the fuel in the line were stiffer by {}",
    ),
    TermEquation.INERTANCE: (
        "the inertance of the line were larger by a share of",
        "the line's inertance were {} less", "the line's inertance were {} more",
    ),
    TermEquation.CHAMBER_PRESSURE: (
        "the pressure in the chamber were higher by",
        "the pressure in the chamber were {} lower", "the pressure in the chamber were {} higher",
    ),
    TermEquation.LINE_PRESSURE_SENSOR: (
        "the line-pressure sensor read more, by",
        "the line-pressure sensor read {} less", "the line-pressure sensor read {} more",
    ),
    TermEquation.NEEDLE_LIFT: (
        "the needle stood higher than measured, by",
        "the needle stood {} lower than measured", "the needle stood {} higher than measured",
    ),
    TermEquation.RAIL_PRESSURE: (
        "the rail pressure were higher than measured, by",
        "the rail pressure were {} lower than measured", "the rail pressure were {} higher than measured",
    ),
}  # fmt: skip
"""By equation: of any law, and of a simple one with a negative coefficient and a positive one."""
_RINGS = "a tube before the line-pressure sensor rang at {0} kHz with a damping of {1}"
_AXIS_OF = {str(parse(axis.over)): axis for axis in AXES}
_NUMBER = r"(-?[\d.]+(?:e[-+]?\d+)?)"
_OVER = "(" + "|".join(map(re.escape, _AXIS_OF)) + ")"
_SINCE = r"\(?time_since_opening / 1\)?"
_DROP = r"\(?\(line_pressure - chamber_pressure\) / 100\)?"
_LIFT = r"\(?needle_lift / max_lift\)?"
_WORDS = tuple(
    (re.compile(rf"c \* \(?{pattern}\)?"), words)
    for pattern, words in {
        "1": "all the time",
        r"line_flow / 60": "at a flow of 60 mm³/ms, in proportion to it",
        rf"sqrt\({_DROP}\)": "at 100 MPa, as the root of the pressure",
        rf"sqrt\({_DROP}\) \* closed": "at 100 MPa while the needle is shut, as the root of the pressure",
        rf"{_DROP} \* closed": "at 100 MPa while the needle is shut, in proportion to the pressure",
        rf"{_DROP} \* open": "at 100 MPa while the needle is open, in proportion to the pressure",
        rf"{_LIFT} - lagged\({_LIFT}, {_NUMBER}\)": (
            "right after it rose by the whole lift, fading in {0} ms, and the other way after it fell"
        ),
        r"\(1 \+ tanh\(\(" + _OVER + rf" - {_NUMBER}\) / {_NUMBER}\)\) / 2": "from {0} on",
        r"exp\(-\(\(" + _OVER + rf" - {_NUMBER}\) / {_NUMBER}\)\^2": "round {0}",
        rf"exp\(-{_SINCE} / {_NUMBER}": "at every opening, fading in {0} ms",
        rf"exp\(-{_SINCE} / {_NUMBER}\) \* sin\(6\.283185307 \* {_NUMBER} \* {_SINCE} \+ {_NUMBER}\)": (
            "at most, ringing at {1} kHz after every opening for {0} ms"
        ),
        rf"sin\(6\.283185307 \* {_NUMBER}\[Hz\] \* time \+ {_NUMBER}": "and back, a wave of {0} Hz",
        rf"injection_number > {_NUMBER}": "from the injection after number {0} on",
        rf"\(?injection_number - 1\)? / {_NUMBER}": "after {0} injections, growing from one to the next",
        rf"time / {_NUMBER}": "after {0} s, growing steadily",
        rf"ringing\(line_pressure / 1, {_NUMBER}, {_NUMBER}\)": _RINGS,
        "open": "while the needle is open",
        "closed": "while the needle is shut",
        "opening": "while the needle opens",
        "closing": "while the needle closes",
    }.items()
)


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


def sign(unit: str) -> str:
    """A unit as people write it."""
    return _SIGNS.get(unit, unit)


def printed(effect_id: str, parameters: Sequence[FittedParameter]) -> dict[str, Size]:
    """The fitted parameters of an effect, printed, by name."""
    sizes = {}
    for one in parameters:
        known = definition(effect_id, one.name)
        value, low, high = (float(f"{si / known.si:.{_DIGITS}g}") for si in (one.value, *one.ci95))
        sizes[one.name] = Size(value=value, ci95=(low, high), unit=known.unit)
    return sizes


def definition(effect_id: str, name: str) -> EffectParameter:
    """The vocabulary's definition of an effect's parameter."""
    return next(p for p in VOCABULARY[effect_id].parameters if p.name == name)


def significant(uncertainty: float) -> float:
    """The unit of the second digit of an uncertainty: what a value is rounded to."""
    return 10.0 ** (int(f"{uncertainty:.0e}".split("e")[1]) - 1) if uncertainty > 0.0 else 0.0


def shown(value: float, step: float) -> str:
    """A value rounded to a step of 10^n; as short as it may be."""
    if not step > 0.0:
        return f"{value:.6g}"
    decimals = -int(f"{step:.0e}".split("e")[1])
    if -3 <= decimals <= 6:
        return f"{round(value, decimals):.{max(decimals, 0)}f}"
    digits = 1 + max(0, int(f"{abs(value) or step:.0e}".split("e")[1]) + decimals)
    return f"{value:.{digits}g}"


def as_text(findings: Findings) -> str:
    """A few lines: verdict, effects with intervals, the gap before and after."""
    found = findings.discovery
    lines = [headline(found, findings.caveats)]
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
    if found.proposals and found.proposals[0].may_enter and findings.amended_model is None:
        lines.append("  to have it in the amended model: --accept-term 1, and --force")
    if found.verdict is Verdict.NONE and found.smallest_visible:  # wear may be there up to these all the same
        wear = (one for one in found.smallest_visible if VOCABULARY[one.id].wear)
        names = (f"{one.id} below {visible_words(one)}" for one in wear)
        lines.append(f"  not seen: {', '.join(names)}; all in the report")
    return "\n".join([*lines, *gap_lines(findings)])


def proposal_words(one: Proposal) -> str:
    """Describes a proposal in a sentence with the law and its coefficient."""
    parts = [as_if(term, _sized_law(term)) for term in one.terms]
    sizes = dict(zip(one.found.ids, one.found.parameters, strict=True))
    known = [
        f"{name} ({', '.join(_size_words(printed(name, sizes[name]), '95 %: '))})" for name in one.effects
    ]
    return " with ".join([*([f"as if {' and '.join(parts)}"] if parts else []), *known])


def _sized_law(term: Term) -> str:
    low, high = term.interval or (term.coefficient, term.coefficient)
    step = significant(0.5 * (high - low))
    between = f"c = {shown(term.coefficient, step)}, 95 %: {shown(low, step)} to {shown(high, step)}"
    unit = "" if term.equation.is_share else f"in {sign(str(term.equation.unit))}; "
    return f"{term.law} ({unit}{between})"


def standing_words(one: Proposal) -> str:
    """Rates a proposal: how far it explains the recordings, and whether a model may have it."""
    before, after = (value / MEGAPASCAL for value in one.held_out)
    apart = (
        f"line pressure held out: {before:.3g} MPa off before, {after:.3g} after" if before == before else ""
    )
    moved = f"injected mass {one.moves.mass / MILLIGRAM:+.2g} mg"
    fit = "explains all"
    if one.refusal is not None:
        fit = f"no model may have it, for {one.refusal.reason}: {one.refusal.remedy}"
    alike = dict.fromkeys(other for term in one.terms for other in term.equation.alike)
    hardly = f"line pressure alone hardly tells it from a law of {' or '.join(alike)}" if alike else ""
    return "; ".join(filter(None, (fit, apart, moved, hardly)))


def visible_words(one: SmallestVisible) -> str:
    """The smallest size of an effect that would have been seen, such as `v_H = 0.0034`."""
    unit = definition(one.id, one.parameter)
    return f"{one.parameter} = {one.size / unit.si:.2g} {sign(unit.unit)}".rstrip()


def headline(found: Discovery, caveats: Sequence[Caveat] = ()) -> str:
    """The verdict in one sentence, with its reservations."""
    sure = f"(confidence {found.confidence:.2f})"
    but = f", but: {caveat_words(caveats)}" if caveats else ""
    return f"{found.verdict.value}: {_verdict_words(found)} {sure}{but}"


def _verdict_words(found: Discovery) -> str:
    if found.verdict is Verdict.NONE:
        return "the model explains the recordings; no effect is missing"
    if found.verdict is Verdict.UNKNOWN:
        return f"something is missing that no known effect explains{where_words(found)}"
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


def where_words(found: Discovery) -> str:
    """Place at which something unknown acts, to be appended to a sentence."""
    place = found.unexplained
    if place is None:
        return ""
    best = found.proposals[0] if found.proposals and found.proposals[0].adequate else None
    plain = [_plain_words(term) for term in best.terms] if best is not None and not best.effects else []
    equation = place.equation.value.replace("_", " ")
    what = " and ".join(plain) if plain and all(plain) else f"the {equation} equation were wrong"
    return f"; it shows most {PHASE_WORDS[place.phase]}, as if {what}"


def candidate_words(candidate: Candidate) -> str:
    """The effects of a candidate with their sizes and intervals, for a title."""
    return " and ".join(
        ", ".join((effect_id.replace("_", " "), *_size_words(printed(effect_id, parameters), "")))
        for effect_id, parameters in zip(candidate.ids, candidate.parameters, strict=True)
    )


def _size_words(sizes: Mapping[str, Size], level: str) -> list[str]:
    return [f"{name} = {one.value_text} ({level}{one.interval_text})" for name, one in sizes.items()]


def gap_lines(findings: Findings) -> list[str]:
    """The gaps on held-out operating points."""
    apart = findings.held_apart and findings.discovery.effects
    where = "on operating points held out" if apart else "on the recordings"
    lines = []
    for gap in findings.gaps.printed.values():
        if gap.measured:
            after = f" before, {gap.after:.3g} after" if findings.discovery.effects else ""
            alone = f"(noise alone {gap.noise_floor:.2g})"
            lines.append(f"  {gap.words} {where}: {gap.before:.3g} {gap.unit} off{after} {alone}")
        elif findings.discovery.effects:
            lines.append(
                f"  {gap.words}: the model given is {gap.before:.2g} {gap.unit} off, if this is right"
            )
    return lines


def as_if(term: Term, sized: str) -> str:
    """Describes a term by its effect. sized: its law with its coefficient."""
    plain = _plain_words(term)
    return f"{plain}: {term.equation} = {sized}" if plain else f"{_AS_IF[term.equation][0]} {sized}"


def _plain_words(term: Term) -> str:
    """Such as `the nozzle lost 21 % of its flow from 0.605 ms after the opening on`.

    Empty where the law is not so simple.
    """
    matches = ((pattern.fullmatch(str(term.law)), words) for pattern, words in _WORDS)
    found, words = next(((found, words) for found, words in matches if found), (None, ""))
    if found is None:
        return ""
    numbers = list(found.groups())
    if words is _RINGS:
        return words.format(*(f"{float(number):.3g}" for number in numbers))
    if numbers and numbers[0] in _AXIS_OF:
        axis = _AXIS_OF[numbers[0]]
        value = f"{axis.offset + axis.scale * float(numbers[1]):.3g}"
        named = f"a {axis.words} of {value}{'' if axis.unit == '-' else f' {axis.unit}'}"
        numbers = [f"{value} ms after the opening" if axis is SINCE else named]
    size = abs(term.coefficient)
    amount = f"{size:.3g} {sign(str(term.equation.unit))}"
    if term.equation.is_share:
        amount = f"{100.0 * size:.3g} %"
    elif term.equation is TermEquation.NEEDLE_LIFT:
        amount = f"{size * MILLIMETRE / MICROMETRE:.3g} µm"
    return f"{_AS_IF[term.equation][1 + (term.coefficient > 0.0)].format(amount)} {words.format(*numbers)}"
