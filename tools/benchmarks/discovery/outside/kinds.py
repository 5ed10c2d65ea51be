"""Effects that no vocabulary has: the law each follows, its sizes, and the equation a right proposal has.

Imports nothing of `observer_rt`: equations are called as its terms call them, the laws are the plant's own.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from tools.benchmarks.arrays import Array
from tools.benchmarks.discovery.hidden import HiddenParameter
from tools.benchmarks.discovery.real_line.discrepancies import resonant_line
from tools.benchmarks.discovery.real_line.hidden import BOW_ENDS, EFFECTS, TAP_DAMPING, bent_sensor
from tools.benchmarks.plant_laws import Laws
from tools.benchmarks.plant_parameters import Faults
from tools.benchmarks.realism.channels import filtered
from tools.benchmarks.sampling import Measured, Step

MPA, MM3_PER_MS, MS, US = 1e6, 1e-6, 1e-3, 1e-6
CREEP_TIME = 1.0 * MS


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
class Kind:
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

    def draw(self, rng: Generator) -> tuple[float, ...]:
        """Sizes of its parameters, SI."""
        return tuple(parameter.draw(rng) for parameter in self.parameters)

    def equations(self, with_rate: bool) -> Family:
        """Those of which a proposal is right: of its family, and what these signals do not tell from it."""
        family = next(family for family in FAMILIES if self.equation in family)
        return family | self.also | (frozenset() if with_rate else self.without_rate)

    def laws(self, values: Sequence[float]) -> Laws:
        """What the plant does beyond its equations."""
        return Laws(**self._named(values, Laws._fields))

    def faults(self, values: Sequence[float], number: int) -> Faults:
        """What is wrong with the plant at an injection."""
        first, *others = values
        return Faults(**self._named((first * self.by_number(number), *others), Faults._fields))

    def steps(self, values: Sequence[float]) -> tuple[Step, ...]:
        """What sensors make of their signals."""
        return () if self.step is None else (self.step(*values),)

    def supplies(self, values: Sequence[float]) -> tuple[Callable[[Array], Array], ...]:
        """What is added to the true rail pressure."""
        return () if self.supply is None else (self.supply(*values),)

    def _named(self, values: Sequence[float], fields: Sequence[str]) -> dict[str, float]:
        pairs = zip(self.parameters, values, strict=True)
        return {p.fault: value for p, value in pairs if p.fault in fields}


def hum(amplitude: float, frequency: float) -> Callable[[Array], Array]:
    """A steady wave [Pa, Hz] by the recording's clock, at times [s]."""
    return lambda time: np.asarray(amplitude * np.sin(2.0 * math.pi * frequency * time), np.float64)


def deaf_rail(amplitude: float, frequency: float) -> Step:
    """A rail-pressure sensor that does not see this wave."""

    def step(seen: Measured) -> Measured:
        return replace(seen, rail_pressure=seen.rail_pressure - hum(amplitude, frequency)(seen.time))

    return step


def bent_rail_sensor(bow: float) -> Step:
    """As `bent_sensor`, of the rail pressure."""
    low, high = BOW_ENDS

    def step(seen: Measured) -> Measured:
        p = seen.rail_pressure
        return replace(seen, rail_pressure=p + 4.0 * bow * (p - low) * (p - high) / (high - low) ** 2)

    return step


def drifting_sensor(rate: float) -> Step:
    """A line-pressure sensor whose offset grows [Pa/s]."""

    def step(seen: Measured) -> Measured:
        return replace(seen, line_pressure=seen.line_pressure + rate * seen.time)

    return step


def creeping_sensor(share: float) -> Step:
    """A line-pressure sensor that shows a change at once too large, by a share that creeps away."""

    def creep(frequency: Array) -> NDArray[np.complex128]:
        return np.asarray(1.0 / (1.0 + 2j * math.pi * frequency * CREEP_TIME), np.complex128)

    def step(seen: Measured) -> Measured:
        change = seen.line_pressure - seen.line_pressure[0]
        crept = filtered(change, float(seen.time[1] - seen.time[0]), creep)
        return replace(seen, line_pressure=seen.line_pressure + share * (change - crept))

    return step


def _law(name: str, lowest: float, highest: float, both: bool = False) -> HiddenParameter:
    return HiddenParameter(name, name, lowest, highest, -highest if both else 0.0)


_KINDS = (
    Kind("laminar_friction", _T.LINE_FLOW, (_law("line_laminar", 80.0, 400.0),)),
    Kind("friction_by_pressure", _T.LINE_FLOW, (_law("pressure_friction", 1.0, 2.2, both=True),)),
    Kind(
        "slow_friction",
        _T.LINE_FLOW,
        (_law("slow_friction", 100.0, 500.0), _law("flow_memory", 0.15 * MS, 0.6 * MS)),
    ),
    Kind("stiction", _T.LINE_FLOW, (_law("stiction", 0.2 * MPA, 1.0 * MPA),), in_library=False),
    Kind("inertance_by_flow", _T.INERTANCE, (_law("flow_inertance", 0.05, 0.3),)),
    Kind(
        "rail_hum",
        _T.RAIL_PRESSURE,
        (
            HiddenParameter("amplitude", "", 0.3 * MPA, 1.0 * MPA),
            HiddenParameter("frequency", "", 1.8e3, 4e3),
        ),
        step=deaf_rail,
        supply=hum,
    ),
    Kind(
        "bent_rail_sensor",
        _T.RAIL_PRESSURE,
        (HiddenParameter("bow", "", 1.0 * MPA, 4.0 * MPA, -4.0 * MPA),),
        without_rate=SENSOR,
        step=bent_rail_sensor,
    ),
    Kind("needle_displacement", _T.LINE_PRESSURE, (_law("needle_area", 2e-6, 8e-6),)),
    Kind(
        "root_leakage",
        _T.LINE_PRESSURE,
        (_law("root_leakage", 1e-10, 5e-10),),  # m3/s/sqrt(Pa): 1 to 5 mm3/ms at 100 MPa
        without_rate=SEAT,
    ),
    Kind("open_leakage", _T.LINE_PRESSURE, (_law("open_leakage", 2e-14, 1e-13),)),
    Kind("relief_leakage", _T.LINE_PRESSURE, (_law("relief", 2e-14, 1.2e-13),), in_library=False),
    Kind("stiffness_bend", _T.STIFFNESS, (_law("stiffness_bend", 0.1, 0.5, both=True),)),
    Kind("waxing_fuel", _T.STIFFNESS, (_law("wax", 0.02, 0.08),), in_library=False),
    Kind(
        "warming_fuel",
        _T.STIFFNESS,
        (_law("softening", 0.05, 0.3), _law("seat_growth", 0.2, 1.0)),
        also=SEAT,
        without_rate=MOMENTUM,
    ),
    Kind("seat_by_speed", _T.SEAT_FLOW, (_law("seat_speed", 0.1, 0.4, both=True),)),
    Kind("stop_loss", _T.SEAT_FLOW, (_law("stop_loss", 0.3, 0.7),), without_rate=NOZZLE),
    Kind("middle_loss", _T.SEAT_FLOW, (_law("middle_loss", 0.3, 0.7),), in_library=False),
    Kind(
        "seat_hysteresis",
        _T.SEAT_FLOW,
        (HiddenParameter("share", "seat_hysteresis", 0.4, 0.9),),
        in_library=False,
    ),
    Kind(
        "lagged_lift",
        _T.NEEDLE_LIFT,
        (_law("lift_memory_share", 0.1, 0.4, both=True), _law("lift_memory", 0.08 * MS, 0.25 * MS)),
    ),
    Kind("bent_lift", _T.NEEDLE_LIFT, (_law("lift_bend", 0.15, 0.4, both=True),)),
    Kind("needle_not_shut", _T.NEEDLE_LIFT, (_law("least_lift", 0.5 * US, 3.0 * US),), without_rate=OUTFLOW),
    Kind(
        "coking_nozzle",
        _T.NOZZLE_FLOW,
        (HiddenParameter("loss", "orifice_area", 0.03, 0.12),),
        by_number=lambda number: -float(number),
    ),
    Kind(
        "plugged_hole",
        _T.NOZZLE_FLOW,
        (HiddenParameter("loss", "orifice_area", 0.08, 0.3),),
        in_library=False,
        by_number=lambda number: -float(number > 0),
    ),
    Kind(
        "closing_hole",
        _T.NOZZLE_FLOW,
        (HiddenParameter("loss", "hole_closing", 0.1, 0.3),),
        in_library=False,
    ),
    Kind("viscous_nozzle", _T.NOZZLE_FLOW, (_law("viscous_loss", 0.03, 0.12),)),
    Kind(
        "opening_loss",
        _T.NOZZLE_FLOW,
        (_law("opening_loss", 0.15, 0.5, both=True), _law("opening_time", 0.15 * MS, 0.6 * MS)),
    ),
    Kind(
        "chamber_by_number",
        _T.CHAMBER_PRESSURE,
        (HiddenParameter("step", "chamber_pressure_step", 1.5 * MPA, 5.0 * MPA),),
        by_number=float,
    ),
    Kind(
        "chamber_by_flow",
        _T.CHAMBER_PRESSURE,
        (_law("flow_back_pressure", 5e10, 2e11),),  # Pa s/m3: 3 to 12 MPa at 60 mm3/ms
    ),
    Kind(
        "chamber_ringing",
        _T.CHAMBER_PRESSURE,
        (_law("chamber_ringing", 4 * MPA, 15 * MPA),),
        in_library=False,
    ),
    Kind(
        "bent_line_sensor",
        _T.LINE_PRESSURE_SENSOR,
        (HiddenParameter("bow", "", 1.0 * MPA, 4.0 * MPA, -4.0 * MPA),),
        without_rate=MOMENTUM,
        step=bent_sensor,
    ),
    Kind(
        "tap_resonance",
        _T.LINE_PRESSURE_SENSOR,
        (HiddenParameter("frequency", "", 5e3, 9e3),),
        without_rate=SEAT,
        step=lambda frequency: resonant_line(frequency, TAP_DAMPING),
    ),
    Kind(
        "drifting_sensor",
        _T.LINE_PRESSURE_SENSOR,
        (HiddenParameter("rate", "", 5.0 * MPA, 20.0 * MPA, -20.0 * MPA),),  # per second
        without_rate=MOMENTUM,
        step=drifting_sensor,
    ),
    Kind(
        "creeping_sensor",
        _T.LINE_PRESSURE_SENSOR,
        (HiddenParameter("share", "", 0.03, 0.12, -0.12),),
        in_library=False,
        step=creeping_sensor,
    ),
)
KINDS = {kind.name: kind for kind in _KINDS}


def _of_vocabulary(
    name: str, equation: TermEquation, also: Family = frozenset(), without_rate: Family = frozenset()
) -> Kind:
    """An effect of the vocabulary, at sizes that matter."""
    effect = EFFECTS[name]
    return Kind(
        name, equation, effect.hidden.parameters, also=also, without_rate=without_rate, step=effect.step
    )


_VOCABULARY = (
    _of_vocabulary("orifice_area", _T.NOZZLE_FLOW),
    _of_vocabulary("seat_area", _T.SEAT_FLOW),
    _of_vocabulary("guide_leakage", _T.LINE_PRESSURE),
    _of_vocabulary("line_friction", _T.LINE_FLOW),
    _of_vocabulary("bulk_modulus", _T.STIFFNESS),
    _of_vocabulary("line_volume", _T.STIFFNESS),
    _of_vocabulary("pressure_dependent_bulk_modulus", _T.STIFFNESS),
    _of_vocabulary("entrained_air", _T.STIFFNESS),
    _of_vocabulary("fuel_density", _T.INERTANCE, also=SEAT | NOZZLE),
    _of_vocabulary("orifice_cavitation", _T.NOZZLE_FLOW),
    _of_vocabulary("lift_dependent_seat_coefficient", _T.SEAT_FLOW),
    _of_vocabulary("chamber_pressure_rise", _T.CHAMBER_PRESSURE),
    _of_vocabulary("lift_offset", _T.NEEDLE_LIFT),
    _of_vocabulary("needle_lift_sensor_lag", _T.NEEDLE_LIFT, without_rate=SENSOR),
    _of_vocabulary("lift_gain", _T.NEEDLE_LIFT),
    _of_vocabulary("rail_pressure_sensor_gain", _T.RAIL_PRESSURE, without_rate=SENSOR),
    _of_vocabulary("rail_pressure_sensor_offset", _T.RAIL_PRESSURE, without_rate=SENSOR),
    _of_vocabulary("line_pressure_sensor_lag", _T.LINE_PRESSURE_SENSOR, without_rate=SEAT),
    _of_vocabulary("line_pressure_sensor_offset", _T.LINE_PRESSURE_SENSOR, without_rate=MOMENTUM),
    _of_vocabulary("channel_skew", _T.LINE_PRESSURE_SENSOR, without_rate=SEAT),
    _of_vocabulary("rail_pressure_skew", _T.RAIL_PRESSURE, without_rate=SENSOR | SEAT),
    Kind("seat_outflow", _T.LINE_PRESSURE, (HiddenParameter("share", "seat_outflow", 1.0, 1.0),)),
)
VOCABULARY_KINDS = {kind.name: kind for kind in _VOCABULARY}
"""Effects that have a name: to be found by it, or, where it is taken away, by a term as good."""
NOT_IN = {"A": frozenset({"rail_pressure_skew"}), "B": frozenset({"seat_outflow"})}
"""Effects that plants of a tier cannot show: a rail at rest has no delay, and all real lines drain by the seat."""


def kind_named(name: str) -> Kind:
    """Of either table. Raises KeyError."""
    return KINDS[name] if name in KINDS else VOCABULARY_KINDS[name]
