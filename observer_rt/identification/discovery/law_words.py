"""Laws in the words of an engineer: one sentence with physical numbers, units and significant digits."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from observer_rt.core.model.model import Operation
from observer_rt.foundation.units import MICROMETRE, MILLIMETRE, shown, sign, significant
from observer_rt.identification.discovery.law_reading import GATES, SINCE, StraightLaw, line_of, product_of, with_unit
from observer_rt.model.terms.law import ONE, ZERO, Call, Lag, Law, LawTable, Number, Resonance
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable

_AS_IF: Mapping[TermEquation, tuple[str, str]] = {
    TermEquation.LINE_FLOW: ("the line lost {} less", "the line lost {} more"),
    TermEquation.LINE_PRESSURE: ("{} came into the line's end", "{} left the line beside the nozzle"),
    TermEquation.SEAT_FLOW: ("the seat let {} less through", "the seat let {} more through"),
    TermEquation.NOZZLE_FLOW: ("the nozzle lost {} of its flow", "the nozzle let {} more through"),
    TermEquation.STIFFNESS: ("the fuel in the line were softer by {}", "the fuel in the line were stiffer by {}"),
    TermEquation.INERTANCE: ("the line's inertance were {} less", "the line's inertance were {} more"),
    TermEquation.CHAMBER_PRESSURE: (
        "the pressure in the chamber were {} lower", "the pressure in the chamber were {} higher",
    ),
    TermEquation.LINE_PRESSURE_SENSOR: (
        "the line-pressure sensor read {} less", "the line-pressure sensor read {} more",
    ),
    TermEquation.NEEDLE_LIFT: ("the needle stood {} lower than measured", "the needle stood {} higher than measured"),
    TermEquation.RAIL_PRESSURE: (
        "the rail pressure were {} lower than measured", "the rail pressure were {} higher than measured",
    ),
}  # fmt: skip
"""Phrases by equation, for a negative and for a positive coefficient."""


@dataclass(frozen=True)
class Reading:
    size: float  # factor of the coefficient
    where: str  # when and where the law has this size
    per: str = ""  # unit of the quantity with which the amount grows; empty: a plain amount


def as_if(term: Term, largest_lift: float | None = None) -> str:
    """Describes a term as the sentence behind `as if`. largest_lift: of the needle [m]."""
    return plain_words(term, largest_lift) or f"{_phrase(term, 1.0)}, times {str(term.law).removeprefix('c * ')}"


def plain_words(term: Term, largest_lift: float | None = None) -> str:
    """Such as `the nozzle lost 21 % of its flow from 0.605 ms after the opening on`; empty without simple words."""
    largest = {} if largest_lift is None else {Variable.MAX_LIFT: Number(largest_lift / MILLIMETRE)}
    product = product_of(term.law.replaced(largest))
    if len(product.gates) > 1 or not product.size:
        return ""
    match product.factors:
        case (Resonance(_, kilohertz, damping),):
            rings = f"rang at {kilohertz:.3g} kHz with a damping of {damping:.3g}"
            return f"a tube before the line-pressure sensor {rings}"
        case (LawTable() as table,) if not product.gates:
            return _tabulated(term, table)
    reading = _read(product.factors)
    if reading is None:
        return ""
    gate = GATES[product.gates[0]] if product.gates else ""
    words = _phrase(term, product.size * reading.size)
    per = f"per {reading.per}" if reading.per else ""
    return " ".join(filter(None, (words, per, reading.where or ("" if gate else "all the time"), gate)))


def law_text(term: Term) -> str:
    """A term as an injector file has it, with its coefficient and the interval of that."""
    low, high = term.interval or (term.coefficient, term.coefficient)
    step = significant(0.5 * (high - low))
    sized = with_unit(shown(term.coefficient, step), sign("" if term.equation.is_share else str(term.equation.unit)))
    return f"{term.equation} = {term.law}, c = {sized} (95 %: {shown(low, step)} to {shown(high, step)})"


def rounded_size(term: Term, scale: float) -> str:
    """The coefficient times a scale, to the first digit in which its interval is uncertain."""
    low, high = term.interval or (term.coefficient, term.coefficient)
    step = 10.0 * significant(0.5 * abs((high - low) * scale))
    return shown(term.coefficient * scale, step) if step else f"{term.coefficient * scale:.3g}"


def _phrase(term: Term, scale: float) -> str:
    """What happens by the coefficient times a scale, in the unit people speak of."""
    words = _AS_IF[term.equation][term.coefficient * scale > 0.0]
    if term.equation.is_share:
        scale, unit = 100.0 * scale, "%"
    elif term.equation is TermEquation.NEEDLE_LIFT:
        scale, unit = MILLIMETRE / MICROMETRE * scale, "µm"
    else:
        unit = sign(str(term.equation.unit))
    return words.format(f"{rounded_size(term, scale).removeprefix('-')} {unit}")


def _tabulated(term: Term, table: LawTable) -> str:
    """Such as `the sensor read 1 MPa less, times 1 at 50, 0.2 at 90 of line pressure [MPa], straight between`."""
    line, largest = line_of(table.argument), max((value.reckoned for value in table.values), key=abs)
    if line is None or not largest:
        return ""
    places = [line.zero + point.reckoned / line.slope for point in table.points]
    shares = [value.reckoned / largest + 0.0 for value in table.values]
    knots = ", ".join(f"{share:.3g} at {place:.3g}" for share, place in zip(shares, places, strict=True))
    over = line.subject.words if line.subject.unit == "-" else f"{line.subject.words} [{line.subject.unit}]"
    return f"{_phrase(term, largest)}, times {knots} of {over}, straight between"


def _read(factors: tuple[Law, ...]) -> Reading | None:
    squared: Reading | None = None
    match factors:
        case ():
            return Reading(1.0, "")
        case (first,):
            return _read_one(first)
        case (Call(Operation.EXP) as fades, Call(Operation.SIN, (turns,))):
            decay, swing = _decay(fades), line_of(turns)
            if decay is None or swing is None or swing.subject.of != SINCE:
                return None
            kilohertz = swing.slope / (2.0 * math.pi)
            return Reading(1.0, f"at most, ringing at {kilohertz:.3g} kHz after every opening for {decay:.3g} ms")
        case (first, Call(Operation.ABS, (second,))):
            squared = _squared(line_of(first), line_of(second), "as its square, either way")
        case (first, second):
            squared = _squared(line_of(first), line_of(second), "as its square")
    if squared is not None:
        return squared
    reading, by = _read(factors[:-1]), _read_one(factors[-1])  # a law times another that says when or where it is
    if reading is None or by is None or by.per:
        return None
    return Reading(reading.size * by.size, f"{reading.where}, {by.where}", reading.per)


def _squared(left: StraightLaw | None, right: StraightLaw | None, words: str) -> Reading | None:
    """The product of two straight lines that are 0 at the same value of one quantity."""
    if left is None or right is None or (left.subject, left.zero) != (right.subject, right.zero):
        return None
    power = _power_of(right, words)
    return None if power is None else replace(power, size=left.slope / right.slope)


def _read_one(law: Law) -> Reading | None:
    line = line_of(law)
    if line is not None:
        return _in_proportion(line)
    match law:
        case Call(Operation.MAX, (argument, bound)) if bound == ZERO:
            return _over(argument, _kinked)
        case Call(Operation.GREATER, (argument, Number() as bound)):
            return _over(Call(Operation.SUBTRACT, (argument, bound)), lambda over: _step(over, "below", 1.0))
        case Call(Operation.LESS, (argument, Number() as bound)):
            return _over(Call(Operation.SUBTRACT, (bound, argument)), lambda over: _step(over, "below", 1.0))
        case Call(Operation.ADD, (first, Call(Operation.TANH, (argument,)))) if first == ONE:
            return _over(argument, lambda over: _step(over, "up to", 2.0))
        case Call(Operation.TANH, (argument,)):
            return _over(argument, _saturating)
        case Call(Operation.EXP, (Call(Operation.NEGATE, (Call(Operation.POWER, (argument, Number(2.0))),)),)):
            return _over(argument, _round)  # exp(-((u - A)/W)^2)
        case Call(Operation.EXP, (exponent,)):
            decay = _decay(law)
            if decay is not None:
                return Reading(1.0, f"at every opening, fading in {decay:.3g} ms")
            return _over(exponent, _fading)
        case Call(Operation.SQRT, (argument,)):
            return _over(argument, lambda over: _power_of(over, "as its root"))
        case Call(Operation.ABS, (argument,)):
            return _over(argument, _same_both_ways)
        case Call(Operation.POWER, (argument, Number(2.0))):
            return _over(argument, lambda over: _power_of(over, "as its square"))
        case Call(Operation.POWER, (argument, Number(3.0))):
            return _over(argument, lambda over: _power_of(over, "as its cube"))
        case Call(Operation.SIN, (argument,)):
            return _over(argument, _oscillation)
        case Call(Operation.SUBTRACT, (first, Lag(argument, milliseconds))) if first == argument:
            return _over(first, lambda over: _remembered(over, milliseconds))
    return None


def _over(argument: Law, words: Callable[[StraightLaw], Reading | None]) -> Reading | None:
    line = line_of(argument)
    return None if line is None else words(line)


def _in_proportion(line: StraightLaw) -> Reading:
    subject = line.subject
    if subject.of == {Variable.TIME: 1.0}:
        return Reading(line.slope, "growing steadily", "s")
    if subject.of == {Variable.INJECTION_NUMBER: 1.0}:
        return Reading(line.slope, f"beyond number {line.zero:.3g}", "injection")
    beyond = f" above {subject.amount(line.zero)}, and the opposite below" if line.zero else ""
    return Reading(line.slope, f"of {subject.words}{beyond}", subject.unit_word)


def _kinked(line: StraightLaw) -> Reading:
    subject, side = line.subject, "above" if line.slope > 0.0 else "below"
    return Reading(abs(line.slope), f"of {subject.words} {side} {subject.amount(line.zero)}", subject.unit_word)


def _step(line: StraightLaw, before: str, size: float) -> Reading:
    if line.slope < 0.0:
        return Reading(size, f"{before} {line.subject.at(line.zero)}")
    if line.subject.of == {Variable.INJECTION_NUMBER: 1.0}:
        return Reading(size, f"from the injection after number {line.zero:.3g} on")
    return Reading(size, f"from {line.subject.at(line.zero)} on")


def _saturating(line: StraightLaw) -> Reading:
    far = f"far above {line.subject.at(line.zero)}, and the opposite far below"
    return Reading(math.copysign(1.0, line.slope), far)


def _same_both_ways(line: StraightLaw) -> Reading | None:
    words = f"of the {line.subject.words}, the same both ways"
    return None if line.zero else Reading(abs(line.slope), words, line.subject.unit)


def _oscillation(line: StraightLaw) -> Reading | None:
    """The law sin(w t + p), w/(2 pi) in Hz; its amplitude stands before `and back`. None for one not over time."""
    if line.subject.of != {Variable.TIME: 1.0}:
        return None
    return Reading(1.0, f"and back, a wave of {line.slope / (2.0 * math.pi):.6g} Hz")


def _decay(law: Law) -> float | None:
    """A [ms] of exp(-time_since_opening/A); None for another law."""
    line = line_of(law.parts[0])
    fades = line is not None and line.subject.of == SINCE and line.slope < 0.0 and not line.zero
    return -1.0 / line.slope if line is not None and fades else None


def _round(line: StraightLaw) -> Reading:
    width = line.subject.amount(abs(1.0 / line.slope), 2)
    return Reading(1.0, f"round {line.subject.at(line.zero)}, within {width}")


def _fading(line: StraightLaw) -> Reading | None:
    """The law exp(-(u - A)/W) of a quantity u."""
    if line.slope >= 0.0:
        return None
    width = line.subject.amount(-1.0 / line.slope, 2)
    return Reading(1.0, f"at {line.subject.at(line.zero)}, fading over {width} above")


def _power_of(line: StraightLaw, words: str) -> Reading | None:
    """A power of a straight line, stated at the value of the quantity where the power is 1."""
    if line.slope <= 0.0:
        return None
    subject, reference = line.subject, 1.0 / line.slope
    if line.zero:
        beyond = f"{subject.amount(reference)} beyond {subject.amount(line.zero)}"
        return Reading(1.0, f"{beyond} of {subject.words}, {words}")
    return Reading(1.0, f"at {subject.at(reference)}, {words}")


def _remembered(line: StraightLaw, milliseconds: float) -> Reading:
    if Variable.NEEDLE_LIFT in line.subject.of:
        fades = f"fading in {milliseconds:.3g} ms, and the opposite after it fell"
        return Reading(1.0, f"right after it rose by the whole lift, {fades}")
    words = f"of {line.subject.words} beyond what it was {milliseconds:.3g} ms ago"
    return Reading(line.slope, words, line.subject.unit_word)
