"""Terms as an injector file states them; units within a law are checked, and that of its coefficient derived.

A bare number takes whatever unit makes the law right, and so does what it is multiplied with; a number with a unit,
a variable and `c` have one.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Self

from pydantic import BeforeValidator, Field, model_validator

from observer_rt.core.model.model import Operation
from observer_rt.foundation.documents import Section
from observer_rt.foundation.errors import UserError, did_you_mean
from observer_rt.model.terms.law import Call, Coefficient, Lag, Law, LawTable, Number, Quantity, Resonance
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import PURE, UNIT_NAMES, VARIABLES, Unit, Variable, unit_named

SeenRange = Mapping[Variable, tuple[float, float]]
"""Lowest and highest value of variables, in their units."""
NOT_SEEN: SeenRange = MappingProxyType({})
_Finite = Annotated[float, Field(allow_inf_nan=False)]
_ALIKE = (Operation.ADD, Operation.SUBTRACT, Operation.GREATER, Operation.LESS, Operation.MIN, Operation.MAX)
_COMPARED = (Operation.GREATER, Operation.LESS)
_KEPT = (Operation.NEGATE, Operation.ABS)


class TermCoefficient(Section):
    """The value of a law's `c` in a unit; low, high: ends of the 95 % interval, None if it was not estimated."""

    value: _Finite
    unit: str
    low: _Finite | None = None
    high: _Finite | None = None

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if (self.low is None) != (self.high is None):
            raise ValueError("one of 'low' and 'high' is missing; give both, or neither")
        if self.low is not None and self.high is not None and not self.low <= self.value <= self.high:
            raise ValueError("'value' is not between 'low' and 'high'; correct one of the three")
        return self


class TermInForce(Section):
    """A term added to the nominal model, because `discover` found it or somebody knows it of this injector.

    seen: range of every variable in which the law was seen; beyond its ends the law stays constant.
    """

    equation: TermEquation
    law: str
    coefficient: TermCoefficient | None = None
    seen: dict[str, tuple[_Finite, _Finite]] = Field(default={})
    origin: str = ""
    evidence: str = ""
    date: Annotated[str, BeforeValidator(str)] = ""  # TOML has dates of its own

    @classmethod
    def of(cls, term: Term, unit: str = "", seen: SeenRange = NOT_SEEN, **why: str) -> Self:
        """A term as a file states it; unit: of its `c`, if the law leaves it open; why: origin, evidence, date."""
        stated = None
        if term.law.has_coefficient:
            low, high = term.interval or (None, None)
            own_unit = coefficient_unit(term.equation, term.law)
            stated = TermCoefficient(value=term.coefficient, unit=str(own_unit or unit or PURE), low=low, high=high)
        ranges = {one.word: seen[one] for one in sorted(term.law.variables & set(seen))}
        return cls(equation=term.equation, law=str(term.law), coefficient=stated, seen=ranges, **why)

    @property
    def words(self) -> str:
        """Equation, law and coefficient in one line, such as `line_flow: c*line_flow, c = -0.14 MPa`."""
        if self.coefficient is None:
            return f"{self.equation}: {self.law}"
        unit = "" if self.coefficient.unit == str(PURE) else f" {self.coefficient.unit}"
        return f"{self.equation}: {self.law}, c = {self.coefficient.value:g}{unit}"

    @property
    def term(self) -> Term:
        """The term of this entry, its law held in the range seen.

        Raises `UserError`, located by key, for a law that cannot be read or whose units do not fit, and for a
        coefficient that is missing, superfluous or in a wrong unit.
        """
        from observer_rt.model.terms.parser import parse

        try:
            law = parse(self.law)
            needed = coefficient_unit(self.equation, law)
        except UserError as error:
            raise UserError("law", f"'{self.law}', {error.location}: {error.problem}", error.remedy) from None
        law = law.held(self.range_seen)
        if not law.has_coefficient:
            if self.coefficient is not None:
                raise UserError("coefficient", "the law has no c", "write c into the law, or leave it out")
            return Term(self.equation, law)
        if self.coefficient is None:
            example = f'coefficient = {{ value = 1.0, unit = "{needed or PURE}" }}'
            raise UserError("coefficient", "is missing, but the law has c", f"add {example}")
        return Term(self.equation, law, *self._in_unit(self.coefficient, needed))

    @property
    def range_seen(self) -> SeenRange:
        """Ranges of `seen` by variable. Raises `UserError` for an entry that is no range of a variable."""
        for name, (low, high) in self.seen.items():
            if name not in VARIABLES or not low < high:
                meant = did_you_mean(name, VARIABLES) if name not in VARIABLES else ""
                raise UserError(f"seen.{name}", "is no range of a variable", f"{meant}give [lowest, highest]")
        return {VARIABLES[name]: ends for name, ends in self.seen.items()}

    def _in_unit(self, stated: TermCoefficient, needed: Unit | None) -> tuple[float, tuple[float, float] | None]:
        """Value and interval of a coefficient in the units of laws. Raises `UserError` for a unit but `needed`."""
        factor_and_unit = unit_named(stated.unit)
        if factor_and_unit is None:
            remedy = f"{did_you_mean(stated.unit, UNIT_NAMES)}units: {', '.join(UNIT_NAMES)}"
            raise UserError("coefficient.unit", f"unknown unit '{stated.unit}'", remedy)
        scale, unit = factor_and_unit
        if needed is not None and unit != needed:
            raise UserError("coefficient.unit", f"is '{stated.unit}'", f"give it in '{needed}'")
        between = None if stated.low is None or stated.high is None else (stated.low * scale, stated.high * scale)
        return stated.value * scale, between


def coefficient_unit(equation: TermEquation, law: Law) -> Unit | None:
    """The unit of `c`; None if open or without `c`. Raises `UserError` for a law whose units do not fit."""
    check = _UnitCheck()
    check.alike(check.unit_of(law), equation.unit, f"'{law}'", f"what {equation} adds")
    return check.coefficient


class _UnitCheck:
    """Check of the units in a law, None for an open one; coefficient: unit of `c`, None until it is known."""

    def __init__(self) -> None:
        self.coefficient: Unit | None = None

    def unit_of(self, law: Law) -> Unit | None:
        """The unit of a law. Raises `UserError` for parts whose units do not fit."""
        match law:
            case Number(_, name):
                factor_and_unit = unit_named(name)
                return None if factor_and_unit is None else factor_and_unit[1]
            case Coefficient():
                return self.coefficient or Unit(c=1.0)
            case Quantity(variable):
                return variable.unit
            case Lag(argument) | Resonance(argument):
                return self.unit_of(argument)
            case LawTable(argument, points, values):
                point_unit = self.unit_of(argument)
                for point in points:
                    self.alike(point_unit, self.unit_of(point), f"in '{law}', '{argument}'", f"the point {point}")
                unit = self.unit_of(values[0])
                for value in values[1:]:
                    unit = self.alike(unit, self.unit_of(value), f"in '{law}', {values[0]}", f"{value}")
                return unit
            case Call(operation, arguments):
                return self._of_operation(law, operation, arguments)
        raise TypeError(f"no law: {law!r}")

    def alike(self, left: Unit | None, right: Unit | None, first: str, second: str) -> Unit | None:
        """The unit of two operands. Raises `UserError` if theirs differ; first, second: the operands as text."""
        if left is None or right is None:
            return left or right
        if left.c != right.c and self.coefficient is None:
            remaining = right._replace(c=0.0).times(left._replace(c=0.0), -1.0)
            self.coefficient = remaining.raised(1.0 / (left.c - right.c))
        left, right = self._resolved(left), self._resolved(right)
        if left != right:
            problem = f"{first} is in {left}, {second} is in {right}"
            raise UserError("units", problem, "give a number the missing unit, such as 100[MPa], or correct the law")
        return left

    def _resolved(self, unit: Unit) -> Unit:
        if self.coefficient is None:
            return unit
        return unit._replace(c=0.0).times(self.coefficient, unit.c)

    def _of_operation(self, law: Law, operation: Operation, arguments: tuple[Law, ...]) -> Unit | None:
        units = [self.unit_of(one) for one in arguments]
        first = units[0]
        if operation in _ALIKE:
            unit = self.alike(first, units[1], f"in '{law}', '{arguments[0]}'", f"'{arguments[1]}'")
            return PURE if operation in _COMPARED else unit
        if operation in (Operation.MULTIPLY, Operation.DIVIDE):
            if first is None or units[1] is None:
                return None
            return first.times(units[1], 1.0 if operation is Operation.MULTIPLY else -1.0)
        if operation in _KEPT:
            return first
        if operation in (Operation.SQRT, Operation.POWER):
            exponent = arguments[1] if operation is Operation.POWER else Number(0.5)
            assert isinstance(exponent, Number)
            return None if first is None else first.raised(exponent.value)
        return self.alike(first, PURE, f"in '{law}', '{arguments[0]}'", f"what {operation.name.lower()}() takes")
