"""Terms: corrections of one equation of the model by a law, their bounds, and all of them as one program.

Compiled code interprets the program, so that no law needs a compiler. It is postfix, in rows of operation and
operand; the end of a term adds the top of the stack to the total of its equation.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Self

import numpy as np

from observer_rt.core.model import model
from observer_rt.foundation.units import Floats
from observer_rt.model.terms.law import Call, Coefficient, Lag, Law, LawTable, Number, Quantity, Resonance
from observer_rt.model.terms.variable import FLOW, LIFT, PRESSURE, PURE, Unit, Variable


class TermEquation(StrEnum):
    """Equation that a term corrects, with unit and meaning of its law, and bounds within which the core holds it."""

    LINE_FLOW = "line_flow", PRESSURE, "pressure lost along the line"
    LINE_PRESSURE = "line_pressure", FLOW, "outflow from the line's closed end"
    SEAT_FLOW = "seat_flow", PURE, "share added to the flow through the seat"
    NOZZLE_FLOW = "nozzle_flow", PURE, "share added to the flow through the nozzle"
    STIFFNESS = "stiffness", PURE, "share added to the stiffness of the fuel in the line"
    INERTANCE = "inertance", PURE, "share added to the inertance of the line"
    CHAMBER_PRESSURE = "chamber_pressure", PRESSURE, "pressure added in the chamber"
    LINE_PRESSURE_SENSOR = "line_pressure_sensor", PRESSURE, "pressure added to the one recorded"
    NEEDLE_LIFT = "needle_lift", LIFT, "lift added to the measured one"
    RAIL_PRESSURE = "rail_pressure", PRESSURE, "pressure added to the measured rail pressure"

    unit: Unit
    words: str
    number: int  # place in the totals of a program
    bounds: tuple[float, float]

    def __new__(cls, name: str, unit: Unit = PURE, words: str = "") -> Self:
        """A member that is its name and knows the rest."""
        member, count = str.__new__(cls, name), len(cls.__members__)
        member._value_, member.unit, member.words, member.number = name, unit, words, count
        member.bounds = model.LOWEST_TOTAL[count], model.HIGHEST_TOTAL[count]
        return member

    @property
    def alike(self) -> tuple["TermEquation", ...]:
        """Other equations in which a simple law does much the same to the line pressure."""
        return tuple(one for group in _ALIKE if self in group for one in sorted(group - {self}))

    @property
    def is_share(self) -> bool:
        """Whether the quantity is multiplied by 1 + term."""
        return self.unit == PURE


_ALIKE = (
    {TermEquation.LINE_FLOW, TermEquation.INERTANCE, TermEquation.RAIL_PRESSURE},
    {TermEquation.SEAT_FLOW, TermEquation.NEEDLE_LIFT},
    {TermEquation.NOZZLE_FLOW, TermEquation.CHAMBER_PRESSURE},
)


@dataclass(frozen=True)
class Term:
    """A law added to an equation, in the units of `variable`."""

    equation: TermEquation
    law: Law
    coefficient: float = 1.0  # value of the law's `c`
    interval: tuple[float, float] | None = None  # of the coefficient at 95 %; None: nobody estimated it

    def __str__(self) -> str:
        unit = "" if self.equation.is_share else f" [{self.equation.unit}]"
        text = f"{self.equation}: {self.equation.words}{unit} = {self.law}"
        if not self.law.has_coefficient:
            return text
        within = "" if self.interval is None else " ({:.3g} to {:.3g})".format(*self.interval)
        return f"{text}, c = {self.coefficient:.4g}{within}"


def program_of(terms: Sequence[Term], fixed: Mapping[Variable, float] = MappingProxyType({})) -> Floats:
    """The program (n, 2) of terms, those of the sensor last; fixed: variables that are constants."""
    rows: list[tuple[float, float]] = []
    for term in sorted(terms, key=lambda term: term.equation is TermEquation.LINE_PRESSURE_SENSOR):
        rows.extend(_rows(term.law, term.coefficient, fixed))
        rows.append((model.OP_END, term.equation.number))
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _rows(law: Law, c: float, fixed: Mapping[Variable, float]) -> Iterator[tuple[float, float]]:
    match law:
        case Number():
            yield model.OP_NUMBER, law.reckoned
        case Coefficient():
            yield model.OP_NUMBER, c
        case Quantity(variable):
            yield (model.OP_NUMBER, fixed[variable]) if variable in fixed else (model.OP_VARIABLE, variable)
        case Lag(argument, milliseconds):
            yield from _rows(argument, c, fixed)
            yield model.OP_LAG, milliseconds
        case Resonance(argument, kilohertz, damping):
            yield from _rows(argument, c, fixed)
            yield model.OP_NUMBER, kilohertz
            yield model.OP_NUMBER, damping
            yield model.OP_RINGING, 0.0
        case LawTable():
            yield from _rows(law.spelled, c, fixed)
        case Call(operation, arguments):
            for argument in arguments:
                yield from _rows(argument, c, fixed)
            yield operation, 0.0
