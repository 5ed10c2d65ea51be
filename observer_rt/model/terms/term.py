"""What a term is: a correction of one equation of the model by a law, and how large it may be."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from observer_rt.model.terms.law import Law
from observer_rt.model.terms.variable import PURE, Unit


class TermEquation(StrEnum):
    """What a term corrects."""

    LINE_FLOW = "line_flow"
    LINE_PRESSURE = "line_pressure"
    SEAT_FLOW = "seat_flow"
    NOZZLE_FLOW = "nozzle_flow"
    STIFFNESS = "stiffness"
    INERTANCE = "inertance"
    CHAMBER_PRESSURE = "chamber_pressure"
    LINE_PRESSURE_SENSOR = "line_pressure_sensor"
    NEEDLE_LIFT = "needle_lift"
    RAIL_PRESSURE = "rail_pressure"

    @property
    def number(self) -> int:
        """Its place in the totals of a program."""
        return list(TermEquation).index(self)

    @property
    def unit(self) -> Unit:
        """What the law's value is in."""
        return _CORRECTIONS[self].unit

    @property
    def is_share(self) -> bool:
        """Whether the quantity is multiplied by 1 + term."""
        return self.unit == PURE

    @property
    def words(self) -> str:
        """What the law's value is, for people."""
        return _CORRECTIONS[self].words

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value a term has at run time."""
        return _CORRECTIONS[self].lowest, _CORRECTIONS[self].highest


class _Correction(NamedTuple):
    unit: Unit
    words: str
    lowest: float
    highest: float


_PRESSURE, _FLOW, _LIFT = Unit(MPa=1.0), Unit(mm=3.0, ms=-1.0), Unit(mm=1.0)
_CORRECTIONS: Mapping[TermEquation, _Correction] = {
    TermEquation.LINE_FLOW: _Correction(_PRESSURE, "pressure lost along the line", -30.0, 30.0),
    TermEquation.LINE_PRESSURE: _Correction(_FLOW, "outflow from the line's closed end", -15.0, 15.0),
    TermEquation.SEAT_FLOW: _Correction(PURE, "share added to the flow through the seat", -0.8, 0.8),
    TermEquation.NOZZLE_FLOW: _Correction(PURE, "share added to the flow through the nozzle", -0.6, 0.6),
    TermEquation.STIFFNESS: _Correction(
        PURE, "share added to the stiffness of the fuel in the line", -0.6, 0.6
    ),
    TermEquation.INERTANCE: _Correction(PURE, "share added to the inertance of the line", -0.6, 4.0),
    TermEquation.CHAMBER_PRESSURE: _Correction(_PRESSURE, "pressure added in the chamber", -20.0, 20.0),
    TermEquation.LINE_PRESSURE_SENSOR: _Correction(
        _PRESSURE, "pressure added to what the line-pressure sensor records", -10.0, 10.0
    ),
    TermEquation.NEEDLE_LIFT: _Correction(
        _LIFT, "lift added to the measured one while the needle is open", -0.08, 0.08
    ),
    TermEquation.RAIL_PRESSURE: _Correction(
        _PRESSURE, "pressure added to the measured rail pressure", -10.0, 10.0
    ),
}


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
