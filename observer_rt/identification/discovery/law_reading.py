"""Reads the tree of a law: its size and gates, and whether it is a straight line over a physical quantity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain
from math import isclose

from observer_rt.foundation.units import MILLIMETRE
from observer_rt.model.terms.law import (
    ZERO,
    Call,
    Coefficient,
    Lag,
    Law,
    LawTable,
    Number,
    Operation,
    Quantity,
    Resonance,
)
from observer_rt.model.terms.term import Variable

GATES = {
    Variable.OPEN: "while the needle is open",
    Variable.CLOSED: "while the needle is shut",
    Variable.OPENING: "while the needle opens",
    Variable.CLOSING: "while the needle closes",
}


@dataclass(frozen=True)
class Subject:
    """A physical quantity: one variable, or the difference of two; unit: of its values."""

    words: str
    unit: str
    of: Mapping[Variable, float]

    @property
    def unit_word(self) -> str:
        """Unit after "per" in a sentence."""
        return self.unit if self.unit != "-" else "unit"

    def amount(self, value: float, digits: int = 3) -> str:
        """A value of the quantity with its unit."""
        return with_unit(f"{value:.{digits}g}", self.unit)

    def at(self, value: float) -> str:
        """The quantity at a value, in words: `a line pressure of 95 MPa`."""
        if self.of == SINCE:
            return f"{value:.3g} ms after the opening"
        article = "an" if self.words[0] in "aeiou" else "a"
        return f"{article} {self.words} of {self.amount(value)}"


SINCE = {Variable.TIME_SINCE_OPENING: 1.0}
_PRESSURES = {
    Variable.LINE_PRESSURE: "line",
    Variable.SAC_PRESSURE: "sac",
    Variable.CHAMBER_PRESSURE: "chamber",
}
SUBJECTS = (
    Subject("flow through the line", "mm³/ms", {Variable.LINE_FLOW: 1.0}),
    Subject("flow through the seat", "mm³/ms", {Variable.SEAT_FLOW: 1.0}),
    Subject("injection rate", "mm³/ms", {Variable.NOZZLE_FLOW: 1.0}),
    Subject("rail pressure", "MPa", {Variable.RAIL_PRESSURE: 1.0}),
    *(Subject(f"{name} pressure", "MPa", {variable: 1.0}) for variable, name in _PRESSURES.items()),
    Subject(
        "pressure above the chamber's", "MPa", {Variable.LINE_PRESSURE: 1.0, Variable.CHAMBER_PRESSURE: -1.0}
    ),
    Subject(
        "pressure drop over the nozzle", "MPa", {Variable.SAC_PRESSURE: 1.0, Variable.CHAMBER_PRESSURE: -1.0}
    ),
    Subject("pressure drop over the seat", "MPa", {Variable.LINE_PRESSURE: 1.0, Variable.SAC_PRESSURE: -1.0}),
    Subject("needle lift", "mm", {Variable.NEEDLE_LIFT: 1.0}),
    Subject("speed of the needle", "mm/ms", {Variable.LIFT_RATE: 1.0}),
    Subject("change of the line pressure", "MPa/ms", {Variable.LINE_PRESSURE_RATE: 1.0}),
    Subject("change of the rail pressure", "MPa/ms", {Variable.RAIL_PRESSURE_RATE: 1.0}),
    Subject("time since the opening", "ms", SINCE),
    Subject("time", "s", {Variable.TIME: 1.0}),
    Subject("injection", "-", {Variable.INJECTION_NUMBER: 1.0}),
)
LIFT_SHARE = Subject("needle lift over the largest", "-", {Variable.NEEDLE_LIFT: 1.0, Variable.MAX_LIFT: 0.0})


@dataclass(frozen=True)
class StraightLaw:
    """The law slope * (quantity - zero)."""

    subject: Subject
    slope: float
    zero: float


@dataclass(frozen=True)
class Product:
    """A law as a product of its size, its gates, and all other factors."""

    size: float
    gates: tuple[Variable, ...]
    factors: tuple[Law, ...]


def with_unit(number: str, unit: str) -> str:
    """A number with its unit, if it has one."""
    return number if unit in ("", "-") else f"{number} {unit}"


def with_largest_lift(law: Law, largest: float | None) -> Law:
    """The law with the largest lift [m] as a number; unchanged without one."""
    if largest is None:
        return law
    match law:
        case Quantity(Variable.MAX_LIFT):
            return Number(largest / MILLIMETRE)
        case Call(operation, arguments):
            return Call(operation, tuple(with_largest_lift(one, largest) for one in arguments))
        case Lag(argument) | Resonance(argument) | LawTable(argument):
            return replace(law, argument=with_largest_lift(argument, largest))
    return law


def product_of(law: Law) -> Product:
    """Split a law into its factors; the coefficient counts as 1."""
    match law:
        case Coefficient():
            return Product(1.0, (), ())
        case Number():
            return Product(law.reckoned, (), ())
        case Quantity(variable) if variable in GATES:
            return Product(1.0, (variable,), ())
        case Call(Operation.NEGATE, (argument,)):
            product = product_of(argument)
            return Product(-product.size, product.gates, product.factors)
        case Call(Operation.MULTIPLY, arguments):
            parts = [product_of(one) for one in arguments]
            size = parts[0].size * parts[1].size
            gates, factors = (
                tuple(chain.from_iterable(getattr(one, name) for one in parts))
                for name in ("gates", "factors")
            )
            return Product(size, gates, factors)
        case Call(Operation.DIVIDE, (argument, Number() as number)) if number != ZERO:
            product = product_of(argument)
            return Product(product.size / number.reckoned, product.gates, product.factors)
    return Product(1.0, (), (law,))


def line_of(law: Law) -> StraightLaw | None:
    """The law as a straight line over one physical quantity; None if it is not one."""
    combination = _combination(law)
    if combination is None:
        return None
    slopes, constant = combination
    first = next(iter(slopes), None)
    if first is None:
        return None
    if first == _SHARE and len(slopes) == 1:
        return StraightLaw(LIFT_SHARE, slopes[first], -constant / slopes[first])
    for subject in SUBJECTS:
        slope = slopes.get(next(iter(subject.of)), 0.0)
        alike = slopes.keys() == subject.of.keys() and all(
            isclose(slopes[variable], slope * sign) for variable, sign in subject.of.items()
        )
        if alike:
            return StraightLaw(subject, slope, -constant / slope + 0.0)
    return None


_SHARE = Variable.MAX_LIFT  # stands for lift over the largest lift
_Combination = tuple[dict[Variable, float], float]


def _combination(law: Law) -> _Combination | None:
    """Slope by variable, and the constant, of a linear law; None for any other."""
    match law:
        case Number():
            return {}, law.reckoned
        case Quantity(variable) if variable not in GATES and variable is not Variable.MAX_LIFT:
            return {variable: 1.0}, 0.0
        case Call(Operation.DIVIDE, (Quantity(Variable.NEEDLE_LIFT), Quantity(Variable.MAX_LIFT))):
            return {_SHARE: 1.0}, 0.0
        case Call(Operation.NEGATE, (argument,)):
            return _times(_combination(argument), -1.0)
        case Call(Operation.ADD, (left, right)):
            return _sum(_combination(left), _combination(right))
        case Call(Operation.SUBTRACT, (left, right)):
            return _sum(_combination(left), _times(_combination(right), -1.0))
        case Call(Operation.MULTIPLY, arguments):
            first, second = map(_combination, arguments)
            if first is None or second is None or (first[0] and second[0]):
                return None
            return _times(first, second[1]) if first[0] else _times(second, first[1])
        case Call(Operation.DIVIDE, (argument, Number() as number)) if number != ZERO:
            return _times(_combination(argument), 1.0 / number.reckoned)
    return None


def _times(combination: _Combination | None, factor: float) -> _Combination | None:
    if combination is None:
        return None
    return {variable: factor * slope for variable, slope in combination[0].items()}, factor * combination[1]


def _sum(left: _Combination | None, right: _Combination | None) -> _Combination | None:
    if left is None or right is None:
        return None
    slopes = {v: left[0].get(v, 0.0) + right[0].get(v, 0.0) for v in (*left[0], *right[0])}
    return {variable: slope for variable, slope in slopes.items() if slope}, left[1] + right[1]
