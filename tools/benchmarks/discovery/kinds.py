"""Hidden faults and laws of the plant: sizes, equations, places in a model. Imports nothing of `observer_rt`."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

from numpy.random import Generator

from tests.plants.arrays import Array
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults
from tests.plants.plant import Step

HEALTHY = Faults()
MICROMETRE, MICROSECOND = 1e-6, 1e-6
RECIPROCAL = frozenset({"bulk_modulus", "line_volume"})
"""The exact class: only K_L/V_L enters, so naming either is right, with 1 + r the other's reciprocal."""


@dataclass(frozen=True)
class HiddenParameter:
    """One parameter: its name in the vocabulary, the plant's fault, and its sizes, SI, drawn log-uniformly.

    lowest is below what can be detected; most_negative: 0 where only one sign is physical.
    """

    name: str
    fault: str
    lowest: float
    highest: float
    most_negative: float = 0.0

    def draw(self, rng: Generator) -> float:
        """A size, of either sign where both are allowed; the only one there is."""
        if self.lowest == self.highest:
            return self.lowest
        negative = self.most_negative < 0.0 and rng.random() < 0.5
        highest = -self.most_negative if negative else self.highest
        size = math.exp(rng.uniform(math.log(self.lowest), math.log(highest)))
        return -size if negative else size


NEAR_TIES = (
    frozenset({"seat_area", "lift_gain", "lift_offset", "lift_dependent_seat_coefficient"}),
    frozenset({"line_pressure_sensor_lag", "channel_skew"}),
    frozenset({"channel_skew", "rail_pressure_skew", "needle_lift_sensor_lag"}),
    frozenset({"rail_pressure_sensor_gain", "rail_pressure_sensor_offset", "line_pressure_sensor_offset"}),
    frozenset({"fuel_density", "orifice_area", "seat_area"}),
)
"""Effects that differ by little at some sizes: an answer that leaves one of a group open may leave all of it open."""


def near_tie(name: str, effect: str) -> bool:
    """Whether an effect may stand beside the true one in an ambiguous answer."""
    return same_effect(name, effect) or any({name, effect} <= group for group in NEAR_TIES)


def same_effect(first: str, second: str) -> bool:
    """Whether two ids are one as far as any recording can tell."""
    return first == second or {first, second} == RECIPROCAL


class TermEquation(StrEnum):
    LINE_FLOW = "line_flow"  # momentum
    RAIL_PRESSURE = "rail_pressure"
    INERTANCE = "inertance"
    LINE_PRESSURE = "line_pressure"  # outflow of the line
    STIFFNESS = "stiffness"
    SEAT_FLOW = "seat_flow"
    NEEDLE_LIFT = "needle_lift"
    NOZZLE_FLOW = "nozzle_flow"
    CHAMBER_PRESSURE = "chamber_pressure"
    LINE_PRESSURE_SENSOR = "line_pressure_sensor"


_T = TermEquation
MOMENTUM = frozenset({_T.LINE_FLOW, _T.RAIL_PRESSURE, _T.INERTANCE})
OUTFLOW = frozenset({_T.LINE_PRESSURE})
STIFFNESS = frozenset({_T.STIFFNESS})
SEAT = frozenset({_T.SEAT_FLOW, _T.NEEDLE_LIFT})
NOZZLE = frozenset({_T.NOZZLE_FLOW, _T.CHAMBER_PRESSURE})
SENSOR = frozenset({_T.LINE_PRESSURE_SENSOR})
FAMILIES = (MOMENTUM, OUTFLOW, STIFFNESS, SEAT, NOZZLE, SENSOR)
"""Equations in which a term does much the same."""

Family = frozenset[TermEquation]


@dataclass(frozen=True)
class HiddenKind:
    """One effect. Parameters change laws or faults of the plant by their name, the first with the injection's number.

    equation: of the true term; also: where a term does the same in every signal; without_rate: where it does the same
    in the line pressure; in_library: whether the product's terms have its form; by_number: factor of the first
    parameter for the injection with this number from 0 on; steps: of sensors; supply: added to the rail [Pa];
    switch: fault that is set to 1, of an effect without a size; inputs: of a law that goes by two at once.
    """

    name: str
    equation: TermEquation
    parameters: tuple[HiddenParameter, ...] = ()
    in_library: bool = True
    also: Family = frozenset()
    without_rate: Family = frozenset()
    by_number: Callable[[int], float] = field(default=lambda number: 1.0)
    step: Callable[..., Step] | None = None
    supply: Callable[..., Callable[[Array], Array]] | None = None
    switch: str = ""
    inputs: frozenset[str] = frozenset()

    def draw(self, rng: Generator, from_share: float | None) -> tuple[float, ...]:
        """Sizes of its parameters; from_share: the lower part of the (log) range of the first that is left out."""
        if from_share is None:
            return tuple(p.draw(rng) for p in self.parameters)
        first, *others = self.parameters
        lowest = math.exp((1.0 - from_share) * math.log(first.lowest) + from_share * math.log(first.highest))
        return (replace(first, lowest=lowest).draw(rng), *(p.draw(rng) for p in others))

    def equations(self, with_rate: bool) -> Family:
        """Equations of a right proposal: its family, and those that these signals do not distinguish from it."""
        family = next(family for family in FAMILIES if self.equation in family)
        return family | self.also | (frozenset() if with_rate else self.without_rate)

    def laws(self, values: Sequence[float], before: Laws = NO_LAWS) -> Laws:
        return before._replace(**self.named(values, Laws._fields))

    def faults(self, values: Sequence[float], number: int = 0, before: Faults = HEALTHY) -> Faults:
        if self.switch:
            return before._replace(**{self.switch: 1.0})
        first, *others = values
        return before._replace(**self.named((first * self.by_number(number), *others), Faults._fields))

    def steps(self, values: Sequence[float]) -> tuple[Step, ...]:
        return () if self.step is None else (self.step(*values),)

    def supplies(self, values: Sequence[float]) -> tuple[Callable[[Array], Array], ...]:
        """Waves that are added to the true rail pressure."""
        return () if self.supply is None else (self.supply(*values),)

    def named(self, values: Sequence[float], fields: Sequence[str]) -> dict[str, float]:
        pairs = zip(self.parameters, values, strict=True)
        return {p.fault: value for p, value in pairs if p.fault in fields}
