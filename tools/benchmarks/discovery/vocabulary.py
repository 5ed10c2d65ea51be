"""Hidden effects: named ones at sizes of both tiers, pairs, and nameless ones. Imports nothing of `observer_rt`."""

from dataclasses import replace

import numpy as np

from tests.plants.plant import LINE, RAIL, Step, seen_as
from tools.benchmarks.discovery import kinds
from tools.benchmarks.discovery.discrepancies import resonant_line

MPA = 1e6
TAP_DAMPING = 0.15
BOW_ENDS = (60e6, 140e6)  # Pa, where a sensor with a bent characteristic is right
PAIR_FROM = 0.5  # of the (log) range of sizes, in pairs


def bent_sensor(bow: float, role: str = LINE) -> Step:
    """A pressure sensor with a quadratic characteristic: right at BOW_ENDS, too low by `bow` [Pa] between."""
    low, high = BOW_ENDS
    return seen_as(role, lambda _, p: p + 4.0 * bow * (p - low) * (p - high) / (high - low) ** 2)


Sizes = tuple[float, float] | tuple[float, float, float]
Kinds = tuple[kinds.HiddenKind, ...]


def _of_vocabulary(
    effect: str,
    equation: kinds.TermEquation,
    name: str,
    sizes: Sizes,
    on_lines: tuple[float, float],
    *more: kinds.HiddenParameter,
    fault: str = "",
    **how: kinds.Family,
) -> Kinds:
    """An effect by the name and sizes of its first parameter, SI, in tiers A and B, there of either sign where both
    are physical, but for friction; fault: of the plant, where it is not called as the effect is.
    """
    first = kinds.HiddenParameter(name, fault or effect, *sizes)
    negative = -on_lines[1] if first.most_negative < 0.0 and effect != "line_friction" else 0.0
    second = replace(first, lowest=on_lines[0], highest=on_lines[1], most_negative=negative)
    return tuple(kinds.HiddenKind(effect, equation, (each, *more), **how) for each in (first, second))  # type: ignore[arg-type]


_v, _T, _UM, _US = _of_vocabulary, kinds.TermEquation, kinds.MICROMETRE, kinds.MICROSECOND
_EFFECTS = (
    _v("orifice_area", _T.NOZZLE_FLOW, "v_H", (2e-3, 0.5, -0.5), (0.02, 0.4)),
    _v("seat_area", _T.SEAT_FLOW, "v_S", (7e-3, 0.4, -0.4), (0.05, 0.35)),
    _v("guide_leakage", _T.LINE_PRESSURE, "c", (1.5e-15, 1.5e-13), (5e-15, 1e-13)),  # m3/(s Pa)
    _v("line_friction", _T.LINE_FLOW, "k", (6e-3, 3.0, -0.5), (0.3, 3.0)),
    (kinds.HiddenKind("seat_outflow", _T.LINE_PRESSURE, switch="seat_outflow"),),
    _v("bulk_modulus", _T.STIFFNESS, "r", (3e-4, 0.25, -0.25), (0.01, 0.12)),
    _v("line_volume", _T.STIFFNESS, "r", (3e-4, 0.25, -0.25), (0.01, 0.12)),
    _v("pressure_dependent_bulk_modulus", _T.STIFFNESS, "n", (0.015, 8.0, -6.0), (0.5, 6.0),
        fault="bulk_modulus_slope"),
    _v("entrained_air", _T.STIFFNESS, "g", (2e-5, 8e-3), (3e-4, 6e-3)),
    _v("fuel_density", _T.INERTANCE, "r", (2e-4, 0.08, -0.08), (0.005, 0.06), also=kinds.SEAT | kinds.NOZZLE),
    _v("orifice_cavitation", _T.NOZZLE_FLOW, "n_crit_excess", (0.03, 0.3), (0.05, 0.25)),
    _v("lift_dependent_seat_coefficient", _T.SEAT_FLOW, "a", (0.015, 0.7, -0.6), (0.1, 0.6),
        kinds.HiddenParameter("x_c", "seat_lift_scale", 20 * _UM, 80 * _UM), fault="seat_lift_loss"),
    _v("chamber_pressure_rise", _T.CHAMBER_PRESSURE, "dp", (0.25e6, 12e6), (2 * MPA, 12 * MPA),  # Pa
        kinds.HiddenParameter("s", "chamber_pressure_share", 0.05, 1.0), fault="chamber_pressure_step"),
    _v("lift_offset", _T.NEEDLE_LIFT, "x_0", (0.15 * _UM, 25 * _UM, -25 * _UM), (2 * _UM, 20 * _UM)),
    _v("needle_lift_sensor_lag", _T.NEEDLE_LIFT, "tau", (0.5 * _US, 60 * _US), (5 * _US, 50 * _US),
        fault="lift_sensor_lag", without_rate=kinds.SENSOR),
    _v("lift_gain", _T.NEEDLE_LIFT, "g", (7e-3, 0.2, -0.2), (0.05, 0.2)),
    _v("rail_pressure_sensor_gain", _T.RAIL_PRESSURE, "g", (2.5e-5, 0.03, -0.03), (0.002, 0.03),
        without_rate=kinds.SENSOR),
    _v("rail_pressure_sensor_offset", _T.RAIL_PRESSURE, "o", (5e3, 5e6, -5e6), (0.2 * MPA, 4 * MPA),
        without_rate=kinds.SENSOR),
    _v("line_pressure_sensor_lag", _T.LINE_PRESSURE_SENSOR, "tau", (0.3 * _US, 80 * _US), (3 * _US, 60 * _US),
        without_rate=kinds.SEAT),
    _v("line_pressure_sensor_offset", _T.LINE_PRESSURE_SENSOR, "o", (5e3, 5e6, -5e6), (0.1 * MPA, 4 * MPA),
        without_rate=kinds.MOMENTUM),
    _v("channel_skew", _T.LINE_PRESSURE_SENSOR, "d", (0.3 * _US, 50 * _US, -50 * _US), (3 * _US, 45 * _US),
        without_rate=kinds.SEAT),
)  # fmt: skip
HIDDEN = {of_tiers[0].name: of_tiers[0] for of_tiers in _EFFECTS}
"""Tier A, from below what can be detected on."""
_LATE_RAIL = kinds.HiddenKind(
    "rail_pressure_skew", _T.RAIL_PRESSURE, (kinds.HiddenParameter("d", "", 5 * _US, 80 * _US, -80 * _US),),
    without_rate=kinds.SENSOR | kinds.SEAT,
    step=lambda delay: seen_as(RAIL, lambda time, p: np.interp(time - delay, time, p)))  # fmt: skip
EFFECTS = {kind.name: kind for of_tiers in _EFFECTS for kind in of_tiers[1:]} | {_LATE_RAIL.name: _LATE_RAIL}
"""Every effect of the vocabulary that has a size, by its id; `seat_outflow` is a structure, which `fit` chooses."""
_K, _P = kinds.HiddenKind, kinds.HiddenParameter
_UNNAMED = (
    _K("tap_resonance", _T.LINE_PRESSURE_SENSOR, (_P("frequency", "", 2.5e3, 3.5e3),),  # Hz
        step=lambda frequency: resonant_line(frequency, TAP_DAMPING)),
    _K("hole_closing", _T.NOZZLE_FLOW, (_P("share", "hole_closing", 0.2, 0.3),)),
    _K("seat_hysteresis", _T.SEAT_FLOW, (_P("share", "seat_hysteresis", 0.4, 0.9),)),
    _K("laminar_line", _T.LINE_FLOW, (_P("rate", "line_laminar", 150.0, 500.0),)),  # 1/s
    _K("bent_sensor", _T.LINE_PRESSURE_SENSOR, (_P("bow", "", 1 * MPA, 4 * MPA, -4 * MPA),), step=bent_sensor),
    _K("lift_leakage", _T.LINE_PRESSURE, (_P("c", "lift_leakage", 3e-14, 1.5e-13),)),  # m3/(s Pa)
)  # fmt: skip
OUTSIDE = {kind.name: kind for kind in _UNNAMED}
"""What has no name in the vocabulary."""
ALL_EFFECTS = OUTSIDE | EFFECTS

PAIRS = (
    ("orifice_area", "guide_leakage"), ("orifice_area", "seat_area"),
    ("orifice_area", "line_pressure_sensor_offset"), ("seat_area", "line_friction"),
    ("guide_leakage", "orifice_cavitation"), ("orifice_area", "line_pressure_sensor_lag"),
    ("bulk_modulus", "guide_leakage"), ("chamber_pressure_rise", "seat_area"),
    ("orifice_area", "entrained_air"), ("guide_leakage", "lift_offset"),
    ("orifice_area", "needle_lift_sensor_lag"), ("guide_leakage", "rail_pressure_sensor_offset"),
)  # fmt: skip
"""Effects that are different in kind."""
Parts = tuple[tuple[str, tuple[float, ...]], ...]
"""Effects that are there together, each with the sizes of its parameters."""
