"""What may be hidden in a recording: faults and laws of the plant with their sizes, and where they stand in a model.

Imports nothing of `observer_rt`: ids and parameter names are the contract, laws are the plant's own, equations are
called as the package's terms call them.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

from numpy.random import Generator

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant import Step
from tools.benchmarks.plant_laws import Laws
from tools.benchmarks.plant_parameters import Faults

HEALTHY = "healthy"
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
        """A size, of either sign where both are allowed."""
        negative = self.most_negative < 0.0 and rng.random() < 0.5
        highest = -self.most_negative if negative else self.highest
        size = math.exp(rng.uniform(math.log(self.lowest), math.log(highest)))
        return -size if negative else size


@dataclass(frozen=True)
class HiddenEffect:
    """An effect: the first parameter is its size; a switch has none, and sets its fault to 1."""

    id: str
    parameters: tuple[HiddenParameter, ...] = ()
    switch: str = ""

    def faults(self, values: Sequence[float]) -> Faults:
        """The plant with this effect, its parameters in order."""
        if self.switch:
            return Faults(**{self.switch: 1.0})
        return Faults(**{p.fault: value for p, value in zip(self.parameters, values, strict=True)})


def _single(
    effect: str, name: str, fault: str, lowest: float, highest: float, negative: float = 0.0
) -> HiddenEffect:
    return HiddenEffect(effect, (HiddenParameter(name, fault, lowest, highest, negative),))


_EFFECTS = (
    _single("orifice_area", "v_H", "orifice_area", 2e-3, 0.5, -0.5),
    _single("seat_area", "v_S", "seat_area", 7e-3, 0.4, -0.4),
    _single("guide_leakage", "c", "guide_leakage", 1.5e-15, 1.5e-13),  # m3/(s Pa)
    _single("line_friction", "k", "line_friction", 6e-3, 3.0, -0.5),
    HiddenEffect("seat_outflow", switch="seat_outflow"),
    _single("bulk_modulus", "r", "bulk_modulus", 3e-4, 0.25, -0.25),
    _single("line_volume", "r", "line_volume", 3e-4, 0.25, -0.25),
    _single("pressure_dependent_bulk_modulus", "n", "bulk_modulus_slope", 0.015, 8.0, -6.0),
    _single("entrained_air", "g", "entrained_air", 2e-5, 8e-3),
    _single("fuel_density", "r", "fuel_density", 2e-4, 0.08, -0.08),
    _single("orifice_cavitation", "n_crit_excess", "orifice_cavitation", 0.03, 0.3),
    HiddenEffect(
        "lift_dependent_seat_coefficient",
        (
            HiddenParameter("a", "seat_lift_loss", 0.015, 0.7, -0.6),
            HiddenParameter("x_c", "seat_lift_scale", 20 * MICROMETRE, 80 * MICROMETRE),
        ),
    ),
    HiddenEffect(
        "chamber_pressure_rise",
        (
            HiddenParameter("dp", "chamber_pressure_step", 0.25e6, 12e6),  # Pa
            HiddenParameter("s", "chamber_pressure_share", 0.05, 1.0),
        ),
    ),
    _single("lift_offset", "x_0", "lift_offset", 0.15 * MICROMETRE, 25 * MICROMETRE, -25 * MICROMETRE),
    _single("needle_lift_sensor_lag", "tau", "lift_sensor_lag", 0.5 * MICROSECOND, 60 * MICROSECOND),
    _single("lift_gain", "g", "lift_gain", 7e-3, 0.2, -0.2),
    _single("rail_pressure_sensor_gain", "g", "rail_pressure_sensor_gain", 2.5e-5, 0.03, -0.03),
    _single("rail_pressure_sensor_offset", "o", "rail_pressure_sensor_offset", 5e3, 5e6, -5e6),  # Pa
    _single(
        "line_pressure_sensor_lag", "tau", "line_pressure_sensor_lag", 0.3 * MICROSECOND, 80 * MICROSECOND
    ),
    _single("line_pressure_sensor_offset", "o", "line_pressure_sensor_offset", 5e3, 5e6, -5e6),  # Pa
    _single("channel_skew", "d", "channel_skew", 0.3 * MICROSECOND, 50 * MICROSECOND, -50 * MICROSECOND),
)

HIDDEN = {effect.id: effect for effect in _EFFECTS}


def same_effect(first: str, second: str) -> bool:
    """Whether two ids are one as far as any recording can tell."""
    return first == second or {first, second} == RECIPROCAL


class TermEquation(StrEnum):
    """Where a term stands in the model."""

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
    parameter for the injection with this number from 0 on; steps: of sensors; supply: added to the rail [Pa].
    """

    name: str
    equation: TermEquation
    parameters: tuple[HiddenParameter, ...]
    in_library: bool = True
    also: Family = frozenset()
    without_rate: Family = frozenset()
    by_number: Callable[[int], float] = field(default=lambda number: 1.0)
    step: Callable[..., Step] | None = None
    supply: Callable[..., Callable[[Array], Array]] | None = None

    def draw(self, rng: Generator, from_share: float = 0.0) -> tuple[float, ...]:
        """Sizes of its parameters; from_share: the lower part of the (log) range of the first that is left out."""
        first, *others = self.parameters
        lowest = math.exp((1.0 - from_share) * math.log(first.lowest) + from_share * math.log(first.highest))
        return (replace(first, lowest=lowest).draw(rng), *(p.draw(rng) for p in others))

    def equations(self, with_rate: bool) -> Family:
        """Those of which a proposal is right: of its family, and what these signals do not tell from it."""
        family = next(family for family in FAMILIES if self.equation in family)
        return family | self.also | (frozenset() if with_rate else self.without_rate)

    def laws(self, values: Sequence[float]) -> Laws:
        """What the plant does beyond its equations."""
        return Laws(**self.named(values, Laws._fields))

    def faults(self, values: Sequence[float], number: int = 0) -> Faults:
        """What is wrong with the plant at an injection."""
        first, *others = values
        return Faults(**self.named((first * self.by_number(number), *others), Faults._fields))

    def steps(self, values: Sequence[float]) -> tuple[Step, ...]:
        """What sensors make of their signals."""
        return () if self.step is None else (self.step(*values),)

    def supplies(self, values: Sequence[float]) -> tuple[Callable[[Array], Array], ...]:
        """What is added to the true rail pressure."""
        return () if self.supply is None else (self.supply(*values),)

    def named(self, values: Sequence[float], fields: Sequence[str]) -> dict[str, float]:
        """Those of its parameters that are such fields."""
        pairs = zip(self.parameters, values, strict=True)
        return {p.fault: value for p, value in pairs if p.fault in fields}
