"""Terms: corrections of one equation of the model by a law, and their bounds."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Self

from observer_rt.model.terms.law import Law
from observer_rt.model.terms.variable import FLOW, LIFT, PRESSURE, PURE, Unit


class TermEquation(StrEnum):
    """Equation that a term corrects; unit and meaning of its law, lowest and highest value it is held between."""

    LINE_FLOW = "line_flow", PRESSURE, "pressure lost along the line", -30.0, 30.0
    LINE_PRESSURE = "line_pressure", FLOW, "outflow from the line's closed end", -15.0, 15.0
    SEAT_FLOW = "seat_flow", PURE, "share added to the flow through the seat", -0.8, 0.8
    NOZZLE_FLOW = "nozzle_flow", PURE, "share added to the flow through the nozzle", -0.6, 0.6
    STIFFNESS = "stiffness", PURE, "share added to the stiffness of the fuel in the line", -0.6, 0.6
    INERTANCE = "inertance", PURE, "share added to the inertance of the line", -0.6, 4.0
    CHAMBER_PRESSURE = "chamber_pressure", PRESSURE, "pressure added in the chamber", -20.0, 20.0
    LINE_PRESSURE_SENSOR = "line_pressure_sensor", PRESSURE, "pressure added to the one recorded", -10.0, 10.0
    NEEDLE_LIFT = "needle_lift", LIFT, "lift added to the measured one", -0.1, 0.1
    RAIL_PRESSURE = "rail_pressure", PRESSURE, "pressure added to the measured rail pressure", -10.0, 10.0

    unit: Unit
    words: str
    bounds: tuple[float, float]

    def __new__(
        cls, name: str, unit: Unit = PURE, words: str = "", lowest: float = 0.0, highest: float = 0.0
    ) -> Self:
        """A member that is its name and knows the rest."""
        member = str.__new__(cls, name)
        member._value_, member.unit, member.words, member.bounds = name, unit, words, (lowest, highest)
        return member

    @property
    def number(self) -> int:
        """Place in the totals of a program."""
        return list(TermEquation).index(self)

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
    """A law added to an equation.

    coefficient: the value of the law's `c`; interval: its lowest and highest value at 95 %, None where nobody
    estimated it. Both in the units of `variable`.
    """

    equation: TermEquation
    law: Law
    coefficient: float = 1.0
    interval: tuple[float, float] | None = None

    def __str__(self) -> str:
        unit = "" if self.equation.is_share else f" [{self.equation.unit}]"
        text = f"{self.equation}: {self.equation.words}{unit} = {self.law}"
        if not self.law.has_coefficient:
            return text
        within = "" if self.interval is None else " ({:.3g} to {:.3g})".format(*self.interval)
        return f"{text}, c = {self.coefficient:.4g}{within}"
