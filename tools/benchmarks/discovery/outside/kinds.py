"""Effects that no vocabulary has: the law each follows, its sizes, and the equation a right proposal has.

Imports nothing of `observer_rt`: the laws are the plant's own.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tests.plants.arrays import Array
from tests.plants.plant import LINE, RAIL, Step, seen_as
from tools.benchmarks.discovery.hidden import (
    MOMENTUM,
    NOZZLE,
    OUTFLOW,
    SEAT,
    SENSOR,
    HiddenKind,
    HiddenParameter,
    TermEquation,
)
from tools.benchmarks.discovery.real_line.discrepancies import resonant_line
from tools.benchmarks.discovery.real_line.hidden import EFFECTS, TAP_DAMPING, bent_sensor
from tools.benchmarks.realism.channels import filtered

MPA, MS, US = 1e6, 1e-3, 1e-6
CREEP_TIME = 1.0 * MS
_T = TermEquation


def hum(amplitude: float, frequency: float) -> Callable[[Array], Array]:
    """A steady wave [Pa, Hz] by the recording's clock, at times [s]."""
    return lambda time: np.asarray(amplitude * np.sin(2.0 * math.pi * frequency * time), np.float64)


def deaf_rail(amplitude: float, frequency: float) -> Step:
    """A rail-pressure sensor that does not see this wave."""
    return seen_as(RAIL, lambda time, p: p - hum(amplitude, frequency)(time))


def drifting_sensor(rate: float) -> Step:
    """A line-pressure sensor whose offset grows [Pa/s]."""
    return seen_as(LINE, lambda time, p: p + rate * time)


def creeping_sensor(share: float) -> Step:
    """A line-pressure sensor that shows a change at once too large, by a share that creeps away."""

    def creep(frequency: Array) -> NDArray[np.complex128]:
        return np.asarray(1.0 / (1.0 + 2j * math.pi * frequency * CREEP_TIME), np.complex128)

    def seen(time: Array, p: Array) -> Array:
        change = p - p[0]
        crept: Array = share * (change - filtered(change, float(time[1] - time[0]), creep))
        return p + crept

    return seen_as(LINE, seen)


def _law(name: str, lowest: float, highest: float, both: bool = False) -> HiddenParameter:
    return HiddenParameter(name, name, lowest, highest, -highest if both else 0.0)


_KINDS = (
    HiddenKind("laminar_friction", _T.LINE_FLOW, (_law("line_laminar", 80.0, 400.0),)),
    HiddenKind("friction_by_pressure", _T.LINE_FLOW, (_law("pressure_friction", 1.0, 2.2, both=True),)),
    HiddenKind(
        "slow_friction",
        _T.LINE_FLOW,
        (_law("slow_friction", 100.0, 500.0), _law("flow_memory", 0.15 * MS, 0.6 * MS)),
    ),
    HiddenKind("stiction", _T.LINE_FLOW, (_law("stiction", 0.2 * MPA, 1.0 * MPA),), in_library=False),
    HiddenKind("inertance_by_flow", _T.INERTANCE, (_law("flow_inertance", 0.05, 0.3),)),
    HiddenKind(
        "rail_hum",
        _T.RAIL_PRESSURE,
        (
            HiddenParameter("amplitude", "", 0.3 * MPA, 1.0 * MPA),
            HiddenParameter("frequency", "", 1.8e3, 4e3),
        ),
        step=deaf_rail,
        supply=hum,
    ),
    HiddenKind(
        "bent_rail_sensor",
        _T.RAIL_PRESSURE,
        (HiddenParameter("bow", "", 1.0 * MPA, 4.0 * MPA, -4.0 * MPA),),
        without_rate=SENSOR,
        step=partial(bent_sensor, role=RAIL),
    ),
    HiddenKind("needle_displacement", _T.LINE_PRESSURE, (_law("needle_area", 2e-6, 8e-6),)),
    HiddenKind(
        "root_leakage",
        _T.LINE_PRESSURE,
        (_law("root_leakage", 1e-10, 5e-10),),  # m3/s/sqrt(Pa): 1 to 5 mm3/ms at 100 MPa
        without_rate=SEAT,
    ),
    HiddenKind("open_leakage", _T.LINE_PRESSURE, (_law("open_leakage", 2e-14, 1e-13),)),
    HiddenKind("relief_leakage", _T.LINE_PRESSURE, (_law("relief", 2e-14, 1.2e-13),), in_library=False),
    HiddenKind("stiffness_bend", _T.STIFFNESS, (_law("stiffness_bend", 0.1, 0.5, both=True),)),
    HiddenKind("waxing_fuel", _T.STIFFNESS, (_law("wax", 0.02, 0.08),), in_library=False),
    HiddenKind(
        "warming_fuel",
        _T.STIFFNESS,
        (_law("softening", 0.05, 0.3), _law("seat_growth", 0.2, 1.0)),
        also=SEAT,
        without_rate=MOMENTUM,
    ),
    HiddenKind("seat_by_speed", _T.SEAT_FLOW, (_law("seat_speed", 0.1, 0.4, both=True),)),
    HiddenKind("stop_loss", _T.SEAT_FLOW, (_law("stop_loss", 0.3, 0.7),), without_rate=NOZZLE),
    HiddenKind("middle_loss", _T.SEAT_FLOW, (_law("middle_loss", 0.3, 0.7),), in_library=False),
    HiddenKind(
        "seat_hysteresis",
        _T.SEAT_FLOW,
        (HiddenParameter("share", "seat_hysteresis", 0.4, 0.9),),
        in_library=False,
    ),
    HiddenKind(
        "lagged_lift",
        _T.NEEDLE_LIFT,
        (_law("lift_ahead", 0.1, 0.4), _law("lift_memory", 0.08 * MS, 0.25 * MS)),
    ),
    HiddenKind(
        "needle_behind",  # its sensor: open a while longer than is seen
        _T.NEEDLE_LIFT,
        (_law("lift_behind", 0.1, 0.3), _law("lift_memory", 0.08 * MS, 0.25 * MS)),
    ),
    HiddenKind("bent_lift", _T.NEEDLE_LIFT, (_law("lift_bend", 0.15, 0.25, both=True),)),
    HiddenKind(
        "needle_not_shut", _T.NEEDLE_LIFT, (_law("least_lift", 0.5 * US, 3.0 * US),), without_rate=OUTFLOW
    ),
    HiddenKind(
        "coking_nozzle",
        _T.NOZZLE_FLOW,
        (HiddenParameter("loss", "orifice_area", 0.03, 0.12),),
        by_number=lambda number: -float(number),
    ),
    HiddenKind(
        "plugged_hole",
        _T.NOZZLE_FLOW,
        (HiddenParameter("loss", "orifice_area", 0.08, 0.3),),
        in_library=False,
        by_number=lambda number: -float(number > 0),
    ),
    HiddenKind(
        "closing_hole",
        _T.NOZZLE_FLOW,
        (HiddenParameter("loss", "hole_closing", 0.1, 0.3),),
        in_library=False,
    ),
    HiddenKind("viscous_nozzle", _T.NOZZLE_FLOW, (_law("viscous_loss", 0.03, 0.12),)),
    HiddenKind(
        "opening_loss",
        _T.NOZZLE_FLOW,
        (_law("opening_loss", 0.15, 0.5, both=True), _law("opening_time", 0.15 * MS, 0.6 * MS)),
    ),
    HiddenKind(
        "chamber_by_number",
        _T.CHAMBER_PRESSURE,
        (HiddenParameter("step", "chamber_pressure_step", 1.5 * MPA, 5.0 * MPA),),
        by_number=float,
    ),
    HiddenKind(
        "chamber_by_flow",
        _T.CHAMBER_PRESSURE,
        (_law("flow_back_pressure", 5e10, 2e11),),  # Pa s/m3: 3 to 12 MPa at 60 mm3/ms
    ),
    HiddenKind(
        "chamber_ringing",
        _T.CHAMBER_PRESSURE,
        (_law("chamber_ringing", 4 * MPA, 15 * MPA),),
        in_library=False,
    ),
    HiddenKind(
        "bent_line_sensor",
        _T.LINE_PRESSURE_SENSOR,
        (HiddenParameter("bow", "", 1.0 * MPA, 4.0 * MPA, -4.0 * MPA),),
        without_rate=MOMENTUM,
        step=bent_sensor,
    ),
    HiddenKind(
        "tap_resonance",
        _T.LINE_PRESSURE_SENSOR,
        (HiddenParameter("frequency", "", 5e3, 9e3),),
        without_rate=SEAT,
        step=lambda frequency: resonant_line(frequency, TAP_DAMPING),
    ),
    HiddenKind(
        "drifting_sensor",
        _T.LINE_PRESSURE_SENSOR,
        (HiddenParameter("rate", "", 5.0 * MPA, 20.0 * MPA, -20.0 * MPA),),  # per second
        without_rate=MOMENTUM,
        step=drifting_sensor,
    ),
    HiddenKind(
        "creeping_sensor",
        _T.LINE_PRESSURE_SENSOR,
        (HiddenParameter("share", "", 0.03, 0.12, -0.12),),
        in_library=False,
        step=creeping_sensor,
    ),
)
KINDS = {kind.name: kind for kind in _KINDS}
_MOVING = frozenset({"opening", "closing"})
ACTS_IN = {
    **dict.fromkeys(("root_leakage", "needle_not_shut"), frozenset({"standstill", "after"})),
    **dict.fromkeys(("needle_displacement", "seat_by_speed", "middle_loss", "seat_hysteresis"), _MOVING),
    "lagged_lift": _MOVING,
    "needle_behind": _MOVING | {"after"},
    **dict.fromkeys(("open_leakage", "bent_lift", "coking_nozzle", "plugged_hole"), _MOVING | {"open"}),
    **dict.fromkeys(
        ("closing_hole", "viscous_nozzle", "opening_loss", "chamber_by_number"), _MOVING | {"open"}
    ),
    **dict.fromkeys(("chamber_by_flow", "chamber_ringing"), _MOVING | {"open"}),
    "stop_loss": frozenset({"open"}),
    "tap_resonance": _MOVING | {"after"},
}
"""Phases of an injection in which alone a law acts; that of a kind not here may act in all."""


VOCABULARY_KINDS = EFFECTS | {
    "seat_outflow": HiddenKind(
        "seat_outflow", _T.LINE_PRESSURE, (HiddenParameter("share", "seat_outflow", 1.0, 1.0),)
    )
}
"""Effects that have a name: to be found by it, or, where it is taken away, by a term as good."""
NOT_IN = {"A": frozenset({"rail_pressure_skew"}), "B": frozenset({"seat_outflow"})}
"""Effects that plants of a tier cannot show: a rail at rest has no delay, and all real lines drain by the seat."""


def kind_named(name: str) -> HiddenKind:
    """Of either table. Raises KeyError."""
    return KINDS[name] if name in KINDS else VOCABULARY_KINDS[name]
