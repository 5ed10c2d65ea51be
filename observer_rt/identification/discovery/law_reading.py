"""Structure of a law: its size, its gates, and the straight line over a physical quantity that it may be."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from observer_rt.core.model.model import Operation
from observer_rt.model.terms.law import ZERO, Call, Coefficient, Law, Number, Quantity
from observer_rt.model.terms.variable import Variable

GATES = {
    Variable.OPEN: "while the needle is open",
    Variable.CLOSED: "while the needle is shut",
    Variable.OPENING: "while the needle opens",
    Variable.CLOSING: "while the needle closes",
}


@dataclass(frozen=True)
class Subject:
    """A physical quantity: one variable, or a combination of two."""

    words: str
    unit: str
    of: Mapping[Variable, float]  # factors of the variables

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
_PRESSURES = {Variable.LINE_PRESSURE: "line", Variable.SAC_PRESSURE: "sac", Variable.CHAMBER_PRESSURE: "chamber"}
SUBJECTS = (
    Subject("flow through the line", "mm³/ms", {Variable.LINE_FLOW: 1.0}),
    Subject("flow through the seat", "mm³/ms", {Variable.SEAT_FLOW: 1.0}),
    Subject("injection rate", "mm³/ms", {Variable.NOZZLE_FLOW: 1.0}),
    Subject("rail pressure", "MPa", {Variable.RAIL_PRESSURE: 1.0}),
    *(Subject(f"{name} pressure", "MPa", {variable: 1.0}) for variable, name in _PRESSURES.items()),
    Subject("pressure above the chamber's", "MPa", {Variable.LINE_PRESSURE: 1.0, Variable.CHAMBER_PRESSURE: -1.0}),
    Subject("pressure drop over the nozzle", "MPa", {Variable.SAC_PRESSURE: 1.0, Variable.CHAMBER_PRESSURE: -1.0}),
    Subject("pressure drop over the seat", "MPa", {Variable.LINE_PRESSURE: 1.0, Variable.SAC_PRESSURE: -1.0}),
    Subject("needle lift", "mm", {Variable.NEEDLE_LIFT: 1.0}),
    Subject("speed of the needle", "mm/ms", {Variable.LIFT_RATE: 1.0}),
    Subject("change of the line pressure", "MPa/ms", {Variable.LINE_PRESSURE_RATE: 1.0}),
    Subject("change of the rail pressure", "MPa/ms", {Variable.RAIL_PRESSURE_RATE: 1.0}),
    Subject("time since the opening", "ms", SINCE),
    Subject("time", "s", {Variable.TIME: 1.0}),
    Subject("injection", "-", {Variable.INJECTION_NUMBER: 1.0}),
    Subject("needle lift over the largest", "-", {Variable.NEEDLE_LIFT: 1.0, Variable.MAX_LIFT: 0.0}),
)
_PROBES = np.array((-170.0, -3.7, 23.0, 311.0))  # values of a variable at which a straight law lies on its line


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


def product_of(law: Law) -> Product:
    """The factors of a law; its coefficient counts as 1."""
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
            left, right = map(product_of, arguments)
            return Product(left.size * right.size, left.gates + right.gates, left.factors + right.factors)
        case Call(Operation.DIVIDE, (argument, Number() as number)) if number != ZERO:
            product = product_of(argument)
            return Product(product.size / number.reckoned, product.gates, product.factors)
    return Product(1.0, (), (law,))


def line_of(law: Law) -> StraightLaw | None:
    """The law as a straight line over one physical quantity, by its values; None for any other law."""
    if not law.variables or law.variables & set(GATES) or law.has_coefficient or law.remembers:
        return None
    # the largest lift is 1, so that a lift is a share of it; all others are varied
    zero = {variable.word: float(variable is Variable.MAX_LIFT) for variable in law.variables}
    varied = sorted(law.variables - {Variable.MAX_LIFT})
    constant = law.at(zero).item()
    slopes = {variable: _rounded(law.at(zero | {variable.word: 1.0}).item() - constant) for variable in varied}
    probes = {variable: number * _PROBES for number, variable in enumerate(varied, start=1)}
    straight = constant + sum(slope * probes[variable] for variable, slope in slopes.items())
    rounding = 1e-9 * max(map(abs, slopes.values()), default=0.0)
    values = law.at(zero | {variable.word: places for variable, places in probes.items()})
    if not math.isfinite(rounding) or not np.allclose(values, straight, 1e-9, rounding):
        return None
    for subject in SUBJECTS:
        slope = slopes.get(next(iter(subject.of)), 0.0)
        is_alike = all(math.isclose(slopes[variable], slope * subject.of.get(variable, 0.0)) for variable in varied)
        if slope and subject.of.keys() == law.variables and is_alike:
            return StraightLaw(subject, slope, _rounded(-constant / slope) + 0.0)
    return None


def _rounded(value: float) -> float:
    """A value to 12 digits: without rounding errors equal lines are equal."""
    return float(f"{value:.12g}")
