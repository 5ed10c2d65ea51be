"""Laws as formulas: LaTeX to be copied, and MathML that a browser shows without loading anything."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape

from observer_rt.identification.discovery.report.law_reading import (
    LIFT_SHARE,
    StraightLaw,
    line_of,
    product_of,
    with_largest_lift,
    with_unit,
)
from observer_rt.identification.discovery.report.law_words import rounded_size
from observer_rt.identification.discovery.report.numbers import shown, sign, significant
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
_SIGNS = {Operation.ADD: "+", Operation.SUBTRACT: "−", Operation.GREATER: ">", Operation.LESS: "<"}
_LOOSE = (Operation.ADD, Operation.SUBTRACT)  # need parentheses in a product


class _Latex:
    """Pieces of a formula as LaTeX."""

    def symbol(self, name: str, index: str) -> str:
        plain = name.replace("Δ", r"\Delta ").replace("π", r"\pi")
        letter = rf"\dot {plain[:-1]}" if plain.endswith("'") else plain
        upright = index if len(index) == 1 else rf"\mathrm{{{index}}}"
        return f"{letter}_{{{upright}}}" if index else letter

    def number(self, text: str, unit: str) -> str:
        mantissa, _, exponent = text.partition("e")
        value = rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa
        upright = unit.replace("³", "^3")
        return value if unit in ("", "-") else rf"{value}\,\mathrm{{{upright}}}"

    def row(self, *parts: str) -> str:
        return " ".join(parts)

    def sign(self, sign: str) -> str:
        return {"−": "-", "·": r"\cdot", "|": "|"}.get(sign, sign)

    def fraction(self, above: str, below: str) -> str:
        return rf"\frac{{{above}}}{{{below}}}"

    def power(self, base: str, exponent: str) -> str:
        return f"{base}^{{{exponent}}}"

    def root(self, of: str) -> str:
        return rf"\sqrt{{{of}}}"

    def call(self, name: str, *arguments: str) -> str:
        known = name in ("exp", "log", "sin", "cos", "tanh", "min", "max")
        upright = f"\\{name}" if known else rf"\mathrm{{{name}}}"
        return upright + self.fenced(", ".join(arguments))

    def fenced(self, inside: str) -> str:
        return rf"\left({inside}\right)"


class _MathMl:
    """Pieces of a formula as MathML."""

    def symbol(self, name: str, index: str) -> str:
        dotted = name.endswith("'")
        letter = f"<mi>{name.removesuffix(chr(39))}</mi>"
        letter = f'<mover accent="true">{letter}<mo>˙</mo></mover>' if dotted else letter
        return f"<msub>{letter}<mi>{index}</mi></msub>" if index else letter

    def number(self, text: str, unit: str) -> str:
        mantissa, _, exponent = text.partition("e")
        value = f"<mn>{mantissa.replace('-', '−')}</mn>"
        if exponent:
            value += f"<mo>·</mo><msup><mn>10</mn><mn>{int(exponent)}</mn></msup>"
        return value if unit in ("", "-") else f"{value}<mtext>\u00a0{escape(unit)}</mtext>"

    def row(self, *parts: str) -> str:
        return f"<mrow>{''.join(parts)}</mrow>"

    def sign(self, sign: str) -> str:
        return f"<mo>{escape(sign)}</mo>"

    def fraction(self, above: str, below: str) -> str:
        return f"<mfrac>{self.row(above)}{self.row(below)}</mfrac>"

    def power(self, base: str, exponent: str) -> str:
        return f"<msup>{self.row(base)}{self.row(exponent)}</msup>"

    def root(self, of: str) -> str:
        return f"<msqrt>{of}</msqrt>"

    def call(self, name: str, *arguments: str) -> str:
        return f"<mi>{name}</mi>{self.fenced('<mo>,</mo>'.join(arguments))}"

    def fenced(self, inside: str) -> str:
        return f"<mrow><mo>(</mo>{inside}<mo>)</mo></mrow>"


_Notation = _Latex | _MathMl


@dataclass(frozen=True)
class Formula:
    """A term as a formula. latex: source to be copied; mathml: for a page."""

    latex: str
    mathml: str


def formula(term: Term, largest_lift: float | None = None) -> Formula:
    """A term with its coefficient put in. largest_lift: of the needle [mm], None where it is not known."""
    mathml = _term(_MathMl(), term, largest_lift)
    return Formula(_term(_Latex(), term, largest_lift), f'<math display="block">{mathml}</math>')


def _term(as_: _Notation, term: Term, largest_lift: float | None) -> str:
    product = product_of(with_largest_lift(term.law, largest_lift))
    factors, size, unit = product.factors, product.size, sign(str(term.equation.unit))
    line, shell = None, None
    match factors:  # of order 1: the coefficient is one of so much a unit
        case (Applied(Operation.MAX, (argument, bound)),) if bound == ZERO:
            line, shell = line_of(argument), "max"
        case (one,):
            line = line_of(one)
    if line is None:
        parts = [_law(as_, one, in_product=True) for one in factors]
        if size == 0.5 and len(parts) == 1:  # (1 + tanh(...))/2
            size, parts = 1.0, [as_.fraction(_law(as_, factors[0]), as_.number("2", ""))]
    else:
        falls = shell is not None and line.slope < 0.0
        size *= abs(line.slope) if falls else line.slope
        unit = _per(unit, line.subject.unit)
        bare, zero = _quantity(as_, line), as_.number(f"{line.zero:.3g}", line.subject.unit)
        beyond = bare if not line.zero else as_.row(bare, *_signed(as_, -line.zero, line.subject.unit))
        beyond = as_.row(zero, as_.sign("−"), bare) if falls else beyond
        loose = bool(line.zero) or len(line.subject.of) > 1
        parts = [
            as_.call("max", beyond, as_.number("0", "")) if shell else as_.fenced(beyond) if loose else bare
        ]
    number = rounded_size(term, size)
    parts += [_gate(as_, gate) for gate in product.gates]
    sized = as_.number(number, unit)
    for part in parts:
        sized = as_.row(sized, as_.sign("·"), part)
    above, below = _LEFT[term.equation]
    left = as_.symbol(*above)
    left = left if below is None else as_.fraction(left, as_.symbol(*below))
    return as_.row(left, as_.sign("="), sized)


def _per(unit: str, other: str) -> str:
    if other in ("", "-"):
        return unit
    return f"{unit or '1'}/({other})" if "/" in other else f"{unit or '1'}/{other}"


def _signed(as_: _Notation, value: float, unit: str) -> tuple[str, str]:
    """A number that is added or taken away."""
    return as_.sign("−" if value < 0.0 else "+"), as_.number(f"{abs(value):.3g}", unit)


def _gate(as_: _Notation, gate: Variable) -> str:
    return as_.symbol("1", _GATES[gate])


def _law(as_: _Notation, law: Law, in_product: bool = False) -> str:
    """A law, or a part of one. in_product: in parentheses, where it is a sum."""
    line = None if isinstance(law, Quantity) else line_of(law)
    if line is not None:
        return _straight(as_, line, in_product)
    match law:
        case Number():
            return as_.number(f"{law.value:.4g}", sign(law.unit))
        case Quantity(variable):
            return _gate(as_, variable) if variable in _GATES else as_.symbol(*_SYMBOLS[variable])
        case Lagged(argument, milliseconds):
            return as_.call("lag", _law(as_, argument), as_.number(f"{milliseconds:.3g}", "ms"))
        case Ringing(argument, kilohertz, damping):
            frequency, damped = as_.number(f"{kilohertz:.4g}", "kHz"), as_.number(f"{damping:.3g}", "")
            return as_.call("ringing", _law(as_, argument), frequency, damped)
        case Tabulated(argument, points, values):
            numbers = (one for pair in zip(points, values, strict=True) for one in pair)
            return as_.call("table", _law(as_, argument), *(_law(as_, one) for one in numbers))
        case Applied(operation, arguments):
            return _applied(as_, operation, arguments, in_product)
    return as_.symbol("c", "")


def _quantity(as_: _Notation, line: StraightLaw) -> str:
    """The bare quantity of a line."""
    first, *others = (as_.symbol(*_SYMBOLS[variable]) for variable, sign in line.subject.of.items() if sign)
    if line.subject is LIFT_SHARE:
        return as_.fraction(first, as_.symbol(*_SYMBOLS[Variable.MAX_LIFT]))
    return as_.row(first, as_.sign("−"), others[0]) if others else first


def _straight(as_: _Notation, line: StraightLaw, in_product: bool) -> str:
    """(u - zero) over what makes it 1."""
    bare, width = _quantity(as_, line), 1.0 / line.slope
    above = as_.row(bare, *_signed(as_, -line.zero, line.subject.unit)) if line.zero else bare
    if width == 1.0:
        return as_.fenced(above) if in_product and (line.zero or len(line.subject.of) > 1) else above
    share = as_.fraction(above, as_.number(f"{abs(width):.3g}", line.subject.unit))
    return as_.row(as_.sign("−"), share) if width < 0.0 else share


def _turns(as_: _Notation, line: StraightLaw) -> str:
    """2 pi times a frequency times time, and a phase."""
    frequency = as_.number(f"{line.slope / (2.0 * math.pi):.6g}", _PER_TIME.get(line.subject.unit, ""))
    turns = as_.row(
        as_.number("2", ""),
        as_.symbol("π", ""),
        as_.sign("·"),
        frequency,
        as_.sign("·"),
        _quantity(as_, line),
    )
    phase = math.remainder(-line.slope * line.zero, 2.0 * math.pi)
    return as_.row(turns, *_signed(as_, phase, ""))


def _applied(as_: _Notation, operation: Operation, arguments: tuple[Law, ...], in_product: bool) -> str:
    match operation:
        case Operation.SIN if (line := line_of(arguments[0])) is not None and line.slope > 0.0:
            return as_.call("sin", _turns(as_, line))
        case Operation.NEGATE:
            return as_.row(as_.sign("−"), _law(as_, arguments[0], in_product=True))
        case Operation.MULTIPLY:
            one, other = (_law(as_, part, in_product=True) for part in arguments)
            return as_.row(one, as_.sign("·"), other)
        case Operation.DIVIDE:
            return as_.fraction(*(_law(as_, part) for part in arguments))
        case Operation.POWER:
            return as_.power(as_.fenced(_law(as_, arguments[0])), _law(as_, arguments[1]))
        case Operation.SQRT:
            return as_.root(_law(as_, arguments[0]))
        case Operation.ABS:
            return as_.row(as_.sign("|"), _law(as_, arguments[0]), as_.sign("|"))
        case operation if operation in _SIGNS:
            one, other = (_law(as_, part) for part in arguments)
            text = as_.row(one, as_.sign(_SIGNS[operation]), other)
            return as_.fenced(text) if in_product or operation not in _LOOSE else text
    return as_.call(operation.name.lower(), *(_law(as_, part) for part in arguments))


def law_text(term: Term) -> str:
    """A term as an injector file has it, with its coefficient and the interval of that."""
    low, high = term.interval or (term.coefficient, term.coefficient)
    step = significant(0.5 * (high - low))
    unit = "" if term.equation.is_share else str(term.equation.unit)
    sized = with_unit(shown(term.coefficient, step), sign(unit))
    return f"{term.equation} = {term.law}, c = {sized} (95 %: {shown(low, step)} to {shown(high, step)})"
