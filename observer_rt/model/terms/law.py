"""Laws as trees: printed, evaluated over arrays, enclosed over boxes; numbers are in units of `variable`."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from observer_rt.core.model.model import Operation
from observer_rt.foundation.units import Floats
from observer_rt.model.terms.enclosure import SAME, Enclosure, enclosed
from observer_rt.model.terms.variable import Variable, unit_named

Memory = Callable[["Lag | Resonance", Floats], Floats]
"""Ends (2, n) of a law that remembers, by the law and those of its argument."""

LAGGED, RINGING, TABLE = "lagged", "ringing", "table"

# How tightly text binds: a part that binds less than its surroundings stands in parentheses.
_COMPARISON, _ADDITION, _FACTOR, _MINUS, _RAISED, _WHOLE = range(6)


FUNCTIONS = {operation.name.lower(): operation for operation in Operation if operation >= Operation.SQRT}
PAIRS = (Operation.MIN, Operation.MAX)  # the functions of two arguments


class Boxes(NamedTuple):
    """Boxes: ends (2, n) of variables, the value of the coefficient, the variable of slopes."""

    ends: Mapping[Variable, Floats] | Floats
    c: float
    by: Variable | None = None
    memory: Memory | None = None


class Law:
    """A law, or a part of one."""

    @property
    def parts(self) -> "tuple[Law, ...]":
        """Parts of the law, one level down."""
        match self:
            case Call(_, arguments):
                return arguments
            case Lag(argument) | Resonance(argument) | LawTable(argument):
                return (argument,)
        return ()

    def __str__(self) -> str:
        """Text that is parsed to the same law."""
        return _printed(self)[0]

    @property
    def all_parts(self) -> "Iterator[Law]":
        """The law itself, its parts and theirs."""
        yield self
        for part in self.parts:
            yield from part.all_parts

    @property
    def variables(self) -> frozenset[Variable]:
        """Variables on which the law depends."""
        return frozenset(part.variable for part in self.all_parts if isinstance(part, Quantity))

    @property
    def has_coefficient(self) -> bool:
        """Whether `c` is in the law."""
        return any(isinstance(part, Coefficient) for part in self.all_parts)

    @property
    def remembers(self) -> bool:
        """Whether the law depends on earlier values of its variables."""
        return any(isinstance(part, Lag | Resonance) for part in self.all_parts)

    def replaced(self, laws: "Mapping[Variable, Law]") -> "Law":
        """The law with other laws in the places of variables."""
        match self:
            case Quantity(variable):
                return laws.get(variable, self)
            case Call(operation, arguments):
                return Call(operation, tuple(one.replaced(laws) for one in arguments))
            case Lag(argument) | Resonance(argument) | LawTable(argument):
                return replace(self, argument=argument.replaced(laws))
        return self

    def held(self, seen: Mapping[Variable, tuple[float, float]]) -> "Law":
        """The law with its inputs held between the ends of ranges, in the units of `variable`."""
        above = {one: Call(Operation.MAX, (Quantity(one), Number(low))) for one, (low, _) in seen.items()}
        return self.replaced({one: Call(Operation.MIN, (above[one], Number(seen[one][1]))) for one in seen})

    def settled(self) -> "Law":
        """The law once its variables have been constant for long."""
        match self:
            case Lag(argument):
                return argument.settled()
            case Resonance():
                return ZERO
            case Call(operation, arguments):
                return Call(operation, tuple(one.settled() for one in arguments))
            case LawTable(argument):
                return replace(self, argument=argument.settled())
        return self

    def enclosed(self, boxes: Boxes) -> Enclosure:
        """Ends of the law's values and slopes in boxes."""
        match self:
            case Number():
                return Enclosure(SAME + self.reckoned)
            case Coefficient():
                return Enclosure(SAME + boxes.c)
            case Quantity(variable):
                return Enclosure(boxes.ends[variable], SAME + float(variable is boxes.by))
            case Call(operation, arguments):
                return enclosed(operation, *(one.enclosed(boxes) for one in arguments))
            case LawTable():
                return self.spelled.enclosed(boxes)
            case Lag(argument) | Resonance(argument) if boxes.memory:
                return Enclosure(boxes.memory(self, argument.enclosed(boxes).values))
        raise ValueError(f"'{self}' remembers: say what its memory makes of values")

    def at(self, values: Mapping[str, Any], c: float = 1.0, memory: Memory | None = None) -> Floats:
        """Values (n,) of the law at those of its variables, by name, each (n,) or a number; nan where undefined.

        Raises ValueError without `memory` for a law that remembers.
        """
        ends = {one: np.array([values[one.word]] * 2, dtype=np.float64).reshape(2, -1) for one in self.variables}
        with np.errstate(all="ignore"):
            return np.asarray(self.enclosed(Boxes(ends, c, None, memory)).values[0])


@dataclass(frozen=True)
class Number(Law):
    """Number as written, in its unit; without one it takes whatever unit makes the law right."""

    value: float
    unit: str = ""

    @property
    def reckoned(self) -> float:
        """Value in the units of `variable`."""
        factor_and_unit = unit_named(self.unit)
        return self.value if factor_and_unit is None else self.value * factor_and_unit[0]


@dataclass(frozen=True)
class Coefficient(Law):
    """`c`, whose value the term states."""


@dataclass(frozen=True)
class Quantity(Law):
    """The value of a variable."""

    variable: Variable


@dataclass(frozen=True)
class Call(Law):
    """An operation on its arguments."""

    operation: Operation
    arguments: tuple[Law, ...]


@dataclass(frozen=True)
class Lag(Law):
    """Argument behind a first-order lag, settled at the first value."""

    argument: Law
    milliseconds: float


@dataclass(frozen=True)
class Resonance(Law):
    """Resonance of this frequency and damping, below 1, as it adds to its argument; settled at the first value."""

    argument: Law
    kilohertz: float
    damping: float


@dataclass(frozen=True)
class LawTable(Law):
    """Straight lines between values at points that rise, the first and last value beyond."""

    argument: Law
    points: tuple[Number, ...]
    values: tuple[Number, ...]

    @property
    def spelled(self) -> Law:
        """The same law by operations: a sum of straight lines, each between two points."""
        law: Law = Number(self.values[0].reckoned)
        knots = [(point.reckoned, value.reckoned) for point, value in zip(self.points, self.values, strict=True)]
        for (start, low), (end, high) in pairwise(knots):
            beyond = Call(Operation.SUBTRACT, (self.argument, Number(start)))
            part = Call(Operation.MIN, (Call(Operation.MAX, (beyond, ZERO)), Number(end - start)))
            rising = Call(Operation.MULTIPLY, (Number((high - low) / (end - start)), part))
            law = Call(Operation.ADD, (law, rising))
        return law


ZERO, ONE = Number(0.0), Number(1.0)


_SIGNS = {  # and how tightly they bind
    Operation.GREATER: (">", _COMPARISON),
    Operation.LESS: ("<", _COMPARISON),
    Operation.ADD: ("+", _ADDITION),
    Operation.SUBTRACT: ("-", _ADDITION),
    Operation.MULTIPLY: ("*", _FACTOR),
    Operation.DIVIDE: ("/", _FACTOR),
    Operation.POWER: ("^", _RAISED),
}


def _printed(law: Law) -> tuple[str, int]:
    """Text of a law, and how tightly it binds."""
    match law:
        case Number(value, unit):
            text = repr(value).removesuffix(".0") + (f"[{unit}]" if unit else "")
            return text, _MINUS if text.startswith("-") else _WHOLE
        case Coefficient():
            return "c", _WHOLE
        case Quantity(variable):
            return variable.word, _WHOLE
        case Lag(argument, milliseconds):
            return f"{LAGGED}({argument}, {repr(milliseconds).removesuffix('.0')})", _WHOLE
        case Resonance(argument, kilohertz, damping):
            return f"{RINGING}({argument}, {repr(kilohertz).removesuffix('.0')}, {damping})", _WHOLE
        case LawTable(argument, points, values):
            knots = ", ".join(f"{point}, {value}" for point, value in zip(points, values, strict=True))
            return f"{TABLE}({argument}, {knots})", _WHOLE
        case Call(Operation.NEGATE, (Number() as number,)):  # without parentheses it is parsed as a negative number
            return f"-({number})", _MINUS
        case Call(Operation.NEGATE, (argument,)):
            return f"-{_within(argument, _MINUS)}", _MINUS
        case Call(operation, (left, right)) if operation in _SIGNS:
            sign, binding = _SIGNS[operation]
            if operation is Operation.POWER:
                return f"{_within(left, _WHOLE)}^{right}", binding
            least = max(binding, _ADDITION)  # a comparison is in none
            return f"{_within(left, least)} {sign} {_within(right, binding + 1)}", binding
        case Call(operation, arguments):
            return f"{operation.name.lower()}({', '.join(map(str, arguments))})", _WHOLE
    raise TypeError(f"no law: {law!r}")


def _within(part: Law, least: int) -> str:
    text, binding = _printed(part)
    return f"({text})" if binding < least else text
