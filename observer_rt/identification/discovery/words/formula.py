"""Laws as formulas: LaTeX to be copied, of which MathML is made that a browser shows without loading anything."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from latex2mathml.converter import convert

from observer_rt.identification.discovery.numbers import shown, sign, significant
from observer_rt.identification.discovery.words.law_reading import (
    LIFT_SHARE,
    StraightLaw,
    line_of,
    product_of,
    with_largest_lift,
    with_unit,
)
from observer_rt.identification.discovery.words.law_words import rounded_size
from observer_rt.model.terms.law import (
    ZERO,
    Applied,
    Lagged,
    Law,
    Number,
    Operation,
    Quantity,
    Ringing,
    Tabulated,
)
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable

_SYMBOLS: Mapping[Variable, tuple[str, str]] = {
    Variable.RAIL_PRESSURE: ("p", "R"),
    Variable.LINE_PRESSURE: ("p", "L"),
    Variable.SAC_PRESSURE: ("p", "S"),
    Variable.CHAMBER_PRESSURE: ("p", "C"),
    Variable.LINE_FLOW: ("Q", "L"),
    Variable.SEAT_FLOW: ("Q", "S"),
    Variable.NOZZLE_FLOW: ("Q", "H"),
    Variable.NEEDLE_LIFT: ("x", ""),
    Variable.MAX_LIFT: ("x", "max"),
    Variable.LIFT_RATE: ("x'", ""),
    Variable.RAIL_PRESSURE_RATE: ("p'", "R"),
    Variable.LINE_PRESSURE_RATE: ("p'", "L"),
    Variable.TIME_SINCE_OPENING: ("t", "open"),
    Variable.TIME: ("t", ""),
    Variable.INJECTION_NUMBER: ("n", ""),
}
_GATES = {
    Variable.OPEN: "open",
    Variable.CLOSED: "shut",
    Variable.OPENING: "opening",
    Variable.CLOSING: "closing",
}
_LEFT: Mapping[TermEquation, tuple[tuple[str, str], tuple[str, str] | None]] = {
    TermEquation.LINE_FLOW: (("Δp", "lost"), None),
    TermEquation.LINE_PRESSURE: (("Q", "out"), None),
    TermEquation.SEAT_FLOW: (("ΔQ", "S"), ("Q", "S")),
    TermEquation.NOZZLE_FLOW: (("ΔQ", "H"), ("Q", "H")),
    TermEquation.STIFFNESS: (("ΔK", "L"), ("K", "L")),
    TermEquation.INERTANCE: (("ΔI", "L"), ("I", "L")),
    TermEquation.CHAMBER_PRESSURE: (("Δp", "C"), None),
    TermEquation.LINE_PRESSURE_SENSOR: (("Δp", "L, read"), None),
    TermEquation.NEEDLE_LIFT: (("Δx", ""), None),
    TermEquation.RAIL_PRESSURE: (("Δp", "R"), None),
}
"""What a term adds, and what it is a share of."""
_PER_TIME = {"ms": "kHz", "s": "Hz"}
_SIGNS = {Operation.ADD: "+", Operation.SUBTRACT: "-", Operation.GREATER: ">", Operation.LESS: "<"}
_LOOSE = (Operation.ADD, Operation.SUBTRACT)  # need parentheses in a product


def _symbol(name: str, index: str) -> str:
    plain = name.replace("Δ", r"\Delta ").replace("π", r"\pi")
    letter = rf"\dot {plain[:-1]}" if plain.endswith("'") else plain
    upright = index if len(index) == 1 else rf"\mathrm{{{index}}}"
    return f"{letter}_{{{upright}}}" if index else letter


def _number(text: str, unit: str) -> str:
    mantissa, _, exponent = text.partition("e")
    value = rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa
    upright = unit.replace("³", "^3")
    return value if unit in ("", "-") else rf"{value}\,\mathrm{{{upright}}}"


def _call(name: str, *arguments: str) -> str:
    known = name in ("exp", "log", "sin", "cos", "tanh", "min", "max")
    upright = f"\\{name}" if known else rf"\mathrm{{{name}}}"
    return upright + _fenced(", ".join(arguments))


def _fenced(inside: str) -> str:
    return rf"\left({inside}\right)"


@dataclass(frozen=True)
class Formula:
    """A term as a formula. latex: source to be copied; mathml: for a page."""

    latex: str
    mathml: str


def formula(term: Term, largest_lift: float | None = None) -> Formula:
    """A term with its coefficient put in. largest_lift: of the needle [m], None where it is not known."""
    latex = _term(term, largest_lift)
    return Formula(latex, convert(latex, display="block"))


def _term(term: Term, largest_lift: float | None) -> str:
    product = product_of(with_largest_lift(term.law, largest_lift))
    factors, size, unit = product.factors, product.size, sign(str(term.equation.unit))
    line, shell = None, None
    match factors:  # of order 1: the coefficient is one of so much a unit
        case (Applied(Operation.MAX, (argument, bound)),) if bound == ZERO:
            line, shell = line_of(argument), "max"
        case (one,):
            line = line_of(one)
    if line is None:
        parts = [_law(one, in_product=True) for one in factors]
        if size == 0.5 and len(parts) == 1:  # (1 + tanh(...))/2
            size, parts = 1.0, [rf"\frac{{{_law(factors[0])}}}{{2}}"]
    else:
        falls = shell is not None and line.slope < 0.0
        size *= abs(line.slope) if falls else line.slope
        unit = _per(unit, line.subject.unit)
        bare, zero = _quantity(line), _number(f"{line.zero:.3g}", line.subject.unit)
        beyond = f"{bare} {_signed(-line.zero, line.subject.unit)}" if line.zero else bare
        beyond = f"{zero} - {bare}" if falls else beyond
        loose = bool(line.zero) or len(line.subject.of) > 1
        parts = [_call("max", beyond, "0") if shell else _fenced(beyond) if loose else bare]
    gates = (_symbol("1", _GATES[gate]) for gate in product.gates)
    sized = r" \cdot ".join((_number(rounded_size(term, size), unit), *parts, *gates))
    above, below = _LEFT[term.equation]
    left = _symbol(*above)
    left = left if below is None else rf"\frac{{{left}}}{{{_symbol(*below)}}}"
    return f"{left} = {sized}"


def _per(unit: str, other: str) -> str:
    if other in ("", "-"):
        return unit
    return f"{unit or '1'}/({other})" if "/" in other else f"{unit or '1'}/{other}"


def _signed(value: float, unit: str) -> str:
    """A number that is added or taken away."""
    return f"{'-' if value < 0.0 else '+'} {_number(f'{abs(value):.3g}', unit)}"


def _law(law: Law, in_product: bool = False) -> str:
    """A law, or a part of one. in_product: in parentheses, where it is a sum."""
    line = None if isinstance(law, Quantity) else line_of(law)
    if line is not None:
        return _straight(line, in_product)
    match law:
        case Number():
            return _number(f"{law.value:.4g}", sign(law.unit))
        case Quantity(variable):
            return _symbol(*(("1", _GATES[variable]) if variable in _GATES else _SYMBOLS[variable]))
        case Lagged(argument, milliseconds):
            return _call("lag", _law(argument), _number(f"{milliseconds:.3g}", "ms"))
        case Ringing(argument, kilohertz, damping):
            frequency, damped = _number(f"{kilohertz:.4g}", "kHz"), _number(f"{damping:.3g}", "")
            return _call("ringing", _law(argument), frequency, damped)
        case Tabulated(argument, points, values):
            numbers = (one for pair in zip(points, values, strict=True) for one in pair)
            return _call("table", _law(argument), *(_law(one) for one in numbers))
        case Applied(operation, arguments):
            return _applied(operation, arguments, in_product)
    return _symbol("c", "")


def _quantity(line: StraightLaw) -> str:
    """The bare quantity of a line."""
    first, *others = (_symbol(*_SYMBOLS[variable]) for variable, sign in line.subject.of.items() if sign)
    if line.subject is LIFT_SHARE:
        return rf"\frac{{{first}}}{{{_symbol(*_SYMBOLS[Variable.MAX_LIFT])}}}"
    return " - ".join((first, *others[:1]))


def _straight(line: StraightLaw, in_product: bool) -> str:
    """(u - zero) over what makes it 1."""
    bare, width = _quantity(line), 1.0 / line.slope
    above = f"{bare} {_signed(-line.zero, line.subject.unit)}" if line.zero else bare
    if width == 1.0:
        return _fenced(above) if in_product and (line.zero or len(line.subject.of) > 1) else above
    share = rf"\frac{{{above}}}{{{_number(f'{abs(width):.3g}', line.subject.unit)}}}"
    return f"- {share}" if width < 0.0 else share


def _turns(line: StraightLaw) -> str:
    """2 pi times a frequency times time, and a phase."""
    frequency = _number(f"{line.slope / (2.0 * math.pi):.6g}", _PER_TIME.get(line.subject.unit, ""))
    phase = math.remainder(-line.slope * line.zero, 2.0 * math.pi)
    return rf"2 \pi \cdot {frequency} \cdot {_quantity(line)} {_signed(phase, '')}"


def _applied(operation: Operation, arguments: tuple[Law, ...], in_product: bool) -> str:
    match operation:
        case Operation.SIN if (line := line_of(arguments[0])) is not None and line.slope > 0.0:
            return _call("sin", _turns(line))
        case Operation.NEGATE:
            return f"- {_law(arguments[0], in_product=True)}"
        case Operation.MULTIPLY:
            return r" \cdot ".join(_law(part, in_product=True) for part in arguments)
        case Operation.DIVIDE:
            return rf"\frac{{{_law(arguments[0])}}}{{{_law(arguments[1])}}}"
        case Operation.POWER:
            return f"{_fenced(_law(arguments[0]))}^{{{_law(arguments[1])}}}"
        case Operation.SQRT:
            return rf"\sqrt{{{_law(arguments[0])}}}"
        case Operation.ABS:
            return f"| {_law(arguments[0])} |"
        case operation if operation in _SIGNS:
            text = f" {_SIGNS[operation]} ".join(map(_law, arguments))
            return _fenced(text) if in_product or operation not in _LOOSE else text
    return _call(operation.name.lower(), *(_law(part) for part in arguments))


def law_text(term: Term) -> str:
    """A term as an injector file has it, with its coefficient and the interval of that."""
    low, high = term.interval or (term.coefficient, term.coefficient)
    step = significant(0.5 * (high - low))
    unit = "" if term.equation.is_share else str(term.equation.unit)
    sized = with_unit(shown(term.coefficient, step), sign(unit))
    return f"{term.equation} = {term.law}, c = {sized} (95 %: {shown(low, step)} to {shown(high, step)})"
