"""Effects that no vocabulary has: law, sizes, equation of a right proposal. Imports nothing of `observer_rt`."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tests.plants.arrays import Array
from tests.plants.filters import filtered
from tests.plants.laws import BY_DROP, BY_LIFT, BY_RAIL, BY_TIME, NO_LAWS, TEN_PRODUCTS, Laws
from tests.plants.plant import LINE, RAIL, Step, seen_as
from tools.benchmarks.discovery import kinds
from tools.benchmarks.discovery.discrepancies import resonant_line
from tools.benchmarks.discovery.vocabulary import EFFECTS, TAP_DAMPING, bent_sensor

MPA, MS, US = 1e6, 1e-3, 1e-6
CREEP_TIME = 1.0 * MS
WEAK_BELOW, WAVE_OF_SENSOR = 90.0 * MPA, 60.0 * MPA
_T = kinds.TermEquation


def hum(amplitude: float, frequency: float) -> Callable[[Array], Array]:
    """A steady wave [Pa, Hz] by the recording's clock, at times [s]."""
    return lambda time: np.asarray(amplitude * np.sin(2.0 * math.pi * frequency * time), np.float64)


def creeping_sensor(share: float) -> Step:
    """A line-pressure sensor that shows a change at once too large, by a share that creeps away."""

    def creep(frequency: Array) -> NDArray[np.complex128]:
        return np.asarray(1.0 / (1.0 + 2j * math.pi * frequency * CREEP_TIME), np.complex128)

    def seen(time: Array, p: Array) -> Array:
        change = p - p[0]
        crept: Array = share * (change - filtered(change, float(time[1] - time[0]), creep))
        return p + crept

    return seen_as(LINE, seen)


def _law(name: str, low: float, high: float, both: bool = False, fault: str | None = None) -> kinds.HiddenParameter:
    return kinds.HiddenParameter(name, name if fault is None else fault, low, high, -high if both else 0.0)


_size = partial(_law, fault="")
_K = kinds.HiddenKind
_FLOW, _OUT, _STIFF, _SEAT, _LIFT = _T.LINE_FLOW, _T.LINE_PRESSURE, _T.STIFFNESS, _T.SEAT_FLOW, _T.NEEDLE_LIFT
_HOLES, _CHAMBER, _SENSOR = _T.NOZZLE_FLOW, _T.CHAMBER_PRESSURE, _T.LINE_PRESSURE_SENSOR
_LIFT_MEMORY = _law("lift_memory", 0.08 * MS, 0.25 * MS)
_KINDS = (
    _K("laminar_friction", _FLOW, (_law("line_laminar", 80.0, 400.0),)),
    _K("friction_by_pressure", _FLOW, (_law("pressure_friction", 1.0, 2.2, both=True),)),
    _K("slow_friction", _FLOW, (_law("slow_friction", 100.0, 500.0), _law("flow_memory", 0.15 * MS, 0.6 * MS))),
    # Pa s/m3: 1 to 5 MPa at 60 mm3/ms
    _K("slow_damper", _FLOW, (_law("damper", 1.7e10, 8e10), _law("flow_memory", 0.3 * MS, 1.0 * MS))),
    _K("stiction", _FLOW, (_law("stiction", 0.2 * MPA, 1.0 * MPA),), in_library=False),
    _K("inertance_by_flow", _T.INERTANCE, (_law("flow_inertance", 0.05, 0.3),)),
    _K("rail_hum", _T.RAIL_PRESSURE,
        (_size("amplitude", 0.3 * MPA, 1.0 * MPA), _size("frequency", 1.8e3, 4e3)), supply=hum,
        step=lambda *wave: seen_as(RAIL, lambda time, p: p - hum(*wave)(time))),  # which the sensor does not see
    _K("bent_rail_sensor", _T.RAIL_PRESSURE, (_size("bow", 1.0 * MPA, 4.0 * MPA, both=True),),
        without_rate=kinds.SENSOR, step=partial(bent_sensor, role=RAIL)),
    _K("needle_displacement", _OUT, (_law("needle_area", 2e-6, 8e-6),)),
    # m3/s/sqrt(Pa): 1 to 5 mm3/ms at 100 MPa
    _K("root_leakage", _OUT, (_law("root_leakage", 1e-10, 5e-10),), without_rate=kinds.SEAT),
    _K("open_leakage", _OUT, (_law("open_leakage", 2e-14, 1e-13),)),
    # m3/(s Pa): 1 to 5 mm3/ms at 20 MPa
    _K("yielding_fuel", _OUT, (_law("yielding", 0.5e-13, 2.5e-13), _law("pressure_memory", 0.15 * MS, 0.6 * MS)),
        also=kinds.STIFFNESS),
    _K("relief_leakage", _OUT, (_law("relief", 2e-14, 1.2e-13),), in_library=False),
    _K("stiffness_bend", _STIFF, (_law("stiffness_bend", 0.1, 0.5, both=True),)),
    _K("waxing_fuel", _STIFF, (_law("wax", 0.02, 0.08),), in_library=False),
    _K("warming_fuel", _STIFF, (_law("softening", 0.05, 0.3), _law("seat_growth", 0.2, 1.0)),
        also=kinds.SEAT, without_rate=kinds.MOMENTUM),
    _K("seat_by_speed", _SEAT, (_law("seat_speed", 0.1, 0.4, both=True),)),
    _K("stop_loss", _SEAT, (_law("stop_loss", 0.3, 0.7),), without_rate=kinds.NOZZLE),
    _K("middle_loss", _SEAT, (_law("middle_loss", 0.3, 0.7),), in_library=False),
    _K("seat_hysteresis", _SEAT, (_law("share", 0.4, 0.9, fault="seat_hysteresis"),), in_library=False),
    _K("lagged_lift", _LIFT, (_law("lift_ahead", 0.1, 0.4), _LIFT_MEMORY)),
    # its sensor: open a while longer than is seen
    _K("needle_behind", _LIFT, (_law("lift_behind", 0.1, 0.3), _LIFT_MEMORY)),
    _K("bent_lift", _LIFT, (_law("lift_bend", 0.15, 0.25, both=True),)),
    _K("needle_not_shut", _LIFT, (_law("least_lift", 0.5 * US, 3.0 * US),), without_rate=kinds.OUTFLOW),
    _K("coking_nozzle", _HOLES, (_law("loss", 0.03, 0.12, fault="orifice_area"),),
        by_number=lambda number: -float(number)),
    _K("plugged_hole", _HOLES, (_law("loss", 0.08, 0.3, fault="orifice_area"),), in_library=False,
        by_number=lambda number: -float(number > 0)),
    _K("closing_hole", _HOLES, (_law("loss", 0.1, 0.3, fault="hole_closing"),), in_library=False),
    _K("viscous_nozzle", _HOLES, (_law("viscous_loss", 0.03, 0.12),)),
    _K("opening_loss", _HOLES,
        (_law("opening_loss", 0.15, 0.5, both=True), _law("opening_time", 0.15 * MS, 0.6 * MS))),
    _K("chamber_by_number", _CHAMBER, (_law("step", 1.5 * MPA, 5.0 * MPA, fault="chamber_pressure_step"),),
        by_number=float),
    _K("chamber_by_flow", _CHAMBER, (_law("flow_back_pressure", 5e10, 2e11),)),  # Pa s/m3: 3 to 12 MPa at 60 mm3/ms
    _K("chamber_ringing", _CHAMBER, (_law("chamber_ringing", 4 * MPA, 15 * MPA),), in_library=False),
    _K("bent_line_sensor", _SENSOR, (_size("bow", 1.0 * MPA, 4.0 * MPA, both=True),),
        without_rate=kinds.MOMENTUM, step=bent_sensor),
    _K("weak_sensor", _SENSOR, (_size("share", 0.03, 0.12, both=True),),
        without_rate=kinds.MOMENTUM,
        step=lambda share: seen_as(LINE, lambda _, p: p - share * np.maximum(WEAK_BELOW - p, 0.0))),
    _K("wavy_sensor", _SENSOR, (_size("size", 0.5 * MPA, 2.0 * MPA, both=True),), in_library=False,
        without_rate=kinds.MOMENTUM,
        step=lambda size: seen_as(LINE, lambda _, p: p + size * np.sin(2.0 * math.pi * p / WAVE_OF_SENSOR))),
    _K("tap_resonance", _SENSOR, (_size("frequency", 5e3, 9e3),), without_rate=kinds.SEAT,
        step=lambda frequency: resonant_line(frequency, TAP_DAMPING)),
    _K("drifting_sensor", _SENSOR, (_size("rate", 5.0 * MPA, 20.0 * MPA, both=True),),  # of the rate, per second
        without_rate=kinds.MOMENTUM, step=lambda rate: seen_as(LINE, lambda time, p: p + rate * time)),
    _K("creeping_sensor", _SENSOR, (_size("share", 0.03, 0.12, both=True),), in_library=False, step=creeping_sensor),
)  # fmt: skip
KINDS = {kind.name: kind for kind in _KINDS}
VOCABULARY_KINDS = EFFECTS | {
    "seat_outflow": _K("seat_outflow", _T.LINE_PRESSURE, (_law("share", 1.0, 1.0, fault="seat_outflow"),))
}
"""Effects that have a name: to be found by it, or, where it is taken away, by a term as good."""
NOT_IN = {"A": frozenset({"rail_pressure_skew"}), "B": frozenset({"seat_outflow"})}
"""Effects that plants of a tier cannot show: a rail at rest has no delay, and all real lines drain by the seat."""
_INPUTS = {BY_RAIL: "rail_pressure", BY_TIME: "time_since_opening", BY_LIFT: "needle_lift", BY_DROP: "sac_pressure"}


def _of_two(name: str, laws: Laws) -> kinds.HiddenKind:
    """A law of two inputs at once, at its one size."""
    stated = ((what, value) for what, value in laws._asdict().items() if value != getattr(NO_LAWS, what))
    inputs = frozenset(_INPUTS[int(number)] for number in (laws.first_factor, laws.second_factor))
    parameters = tuple(_law(what, value, value) for what, value in stated)
    return _K(name, _SEAT if laws.seat_product else _HOLES, parameters, in_library=False, inputs=inputs)


PRODUCT_KINDS = {name: _of_two(name, laws) for name, (laws, _) in TEN_PRODUCTS.items()}
ALL_KINDS = VOCABULARY_KINDS | KINDS | PRODUCT_KINDS
