"""What may be hidden in recordings of a real line: effects at sizes that matter, pairs, and what no name is for.

Imports nothing of `observer_rt`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from tools.benchmarks.discovery.hidden import (
    MICROMETRE,
    MICROSECOND,
    HiddenEffect,
    HiddenParameter,
)
from tools.benchmarks.discovery.real_line.discrepancies import resonant_line
from tools.benchmarks.plant_laws import Laws
from tools.benchmarks.plant_parameters import Faults
from tools.benchmarks.sampling import Measured, Step

MPA = 1e6
TAP_DAMPING = 0.15
BOW_ENDS = (60e6, 140e6)  # Pa, where a sensor with a bent characteristic is right


@dataclass(frozen=True)
class RealEffect:
    """A hidden effect; step: of a sensor by the first parameter, where the plant has no fault for it."""

    hidden: HiddenEffect
    step: Callable[[float], Step] | None = None

    def draw(self, rng: Generator, from_share: float = 0.0) -> tuple[float, ...]:
        """Sizes of its parameters; from_share: the lower part of the (log) range of the first that is left out."""
        first, *others = self.hidden.parameters
        lowest = math.exp((1.0 - from_share) * math.log(first.lowest) + from_share * math.log(first.highest))
        return (replace(first, lowest=lowest).draw(rng), *(p.draw(rng) for p in others))

    def changes(self, values: Sequence[float]) -> dict[str, float]:
        """Faults of the plant, and laws it follows, by name."""
        if self.step is not None:
            return {}
        return {p.fault: value for p, value in zip(self.hidden.parameters, values, strict=True)}

    def steps(self, values: Sequence[float]) -> tuple[Step, ...]:
        """What a sensor does to its signal."""
        return () if self.step is None else (self.step(values[0]),)


def late_rail(delay: float) -> Step:
    """A rail pressure recorded late, or early [s]."""

    def step(seen: Measured) -> Measured:
        return replace(seen, rail_pressure=np.interp(seen.time - delay, seen.time, seen.rail_pressure))

    return step


def bent_sensor(bow: float) -> Step:
    """A line-pressure sensor with a quadratic characteristic: right at BOW_ENDS, too low by `bow` [Pa] between."""
    low, high = BOW_ENDS

    def step(seen: Measured) -> Measured:
        p = seen.line_pressure
        return replace(seen, line_pressure=p + 4.0 * bow * (p - low) * (p - high) / (high - low) ** 2)

    return step


def _single(
    effect: str,
    name: str,
    fault: str,
    lowest: float,
    highest: float,
    *,
    both: bool = True,
    step: Callable[[float], Step] | None = None,
) -> RealEffect:
    negative = -highest if both else 0.0
    parameter = HiddenParameter(name, fault, lowest, highest, negative)
    return RealEffect(HiddenEffect(effect, (parameter,)), step)


def _two(effect: str, first: HiddenParameter, second: HiddenParameter) -> RealEffect:
    return RealEffect(HiddenEffect(effect, (first, second)))


def _by_id(*effects: RealEffect) -> dict[str, RealEffect]:
    return {effect.hidden.id: effect for effect in effects}


_US, _UM = MICROSECOND, MICROMETRE
EFFECTS = _by_id(
    _single("orifice_area", "v_H", "orifice_area", 0.02, 0.4),
    _single("seat_area", "v_S", "seat_area", 0.05, 0.35),
    _single("guide_leakage", "c", "guide_leakage", 5e-15, 1e-13, both=False),  # m3/(s Pa)
    _single("line_friction", "k", "line_friction", 0.3, 3.0, both=False),
    _single("bulk_modulus", "r", "bulk_modulus", 0.01, 0.12),
    _single("line_volume", "r", "line_volume", 0.01, 0.12),
    _single("pressure_dependent_bulk_modulus", "n", "bulk_modulus_slope", 0.5, 6.0),
    _single("entrained_air", "g", "entrained_air", 3e-4, 6e-3, both=False),
    _single("fuel_density", "r", "fuel_density", 0.005, 0.06),
    _single("orifice_cavitation", "n_crit_excess", "orifice_cavitation", 0.05, 0.25, both=False),
    _two(
        "lift_dependent_seat_coefficient",
        HiddenParameter("a", "seat_lift_loss", 0.1, 0.6, -0.6),
        HiddenParameter("x_c", "seat_lift_scale", 20 * _UM, 80 * _UM),
    ),
    _two(
        "chamber_pressure_rise",
        HiddenParameter("dp", "chamber_pressure_step", 2 * MPA, 12 * MPA),
        HiddenParameter("s", "chamber_pressure_share", 0.05, 1.0),
    ),
    _single("lift_offset", "x_0", "lift_offset", 2 * _UM, 20 * _UM),
    _single("needle_lift_sensor_lag", "tau", "lift_sensor_lag", 5 * _US, 50 * _US, both=False),
    _single("lift_gain", "g", "lift_gain", 0.05, 0.2),
    _single("rail_pressure_sensor_gain", "g", "rail_pressure_sensor_gain", 0.002, 0.03),
    _single("rail_pressure_sensor_offset", "o", "rail_pressure_sensor_offset", 0.2 * MPA, 4 * MPA),
    _single("line_pressure_sensor_lag", "tau", "line_pressure_sensor_lag", 3 * _US, 60 * _US, both=False),
    _single("line_pressure_sensor_offset", "o", "line_pressure_sensor_offset", 0.1 * MPA, 4 * MPA),
    _single("channel_skew", "d", "channel_skew", 3 * _US, 45 * _US),
    _single("rail_pressure_skew", "d", "", 5 * _US, 80 * _US, step=late_rail),
)
"""Every effect of the vocabulary that has a size, by its id; `seat_outflow` is a structure, which `fit` chooses."""

OUTSIDE = _by_id(
    _single(
        "tap_resonance",
        "frequency",
        "",
        2.5e3,
        3.5e3,  # Hz
        both=False,
        step=lambda frequency: resonant_line(frequency, TAP_DAMPING),
    ),
    _single("hole_closing", "share", "hole_closing", 0.2, 0.3, both=False),
    _single("seat_hysteresis", "share", "seat_hysteresis", 0.4, 0.9, both=False),
    _single("laminar_line", "rate", "line_laminar", 150.0, 500.0, both=False),  # 1/s
    _single("bent_sensor", "bow", "", 1 * MPA, 4 * MPA, step=bent_sensor),
    _single("lift_leakage", "c", "lift_leakage", 3e-14, 1.5e-13, both=False),  # m3/(s Pa)
)
"""What has no name in the vocabulary."""

PAIRS = (
    ("orifice_area", "guide_leakage"),
    ("orifice_area", "seat_area"),
    ("orifice_area", "line_pressure_sensor_offset"),
    ("seat_area", "line_friction"),
    ("guide_leakage", "orifice_cavitation"),
    ("orifice_area", "line_pressure_sensor_lag"),
    ("bulk_modulus", "guide_leakage"),
    ("chamber_pressure_rise", "seat_area"),
    ("orifice_area", "entrained_air"),
    ("guide_leakage", "lift_offset"),
    ("orifice_area", "needle_lift_sensor_lag"),
    ("guide_leakage", "rail_pressure_sensor_offset"),
)
"""Effects that are different in kind."""
PAIR_FROM = 0.5  # of the (log) range of sizes, in pairs


def known(name: str) -> RealEffect:
    """An effect of the vocabulary or beyond it. Raises KeyError."""
    return EFFECTS[name] if name in EFFECTS else OUTSIDE[name]


def faults_of(parts: Sequence[tuple[str, Sequence[float]]]) -> Faults:
    """The plant with effects of these sizes, together."""
    named = _named(parts)
    return Faults(**{name: value for name, value in named.items() if name in Faults._fields})


def laws_of(parts: Sequence[tuple[str, Sequence[float]]]) -> Laws:
    """What such a plant does beyond its equations."""
    named = _named(parts)
    return Laws(**{name: value for name, value in named.items() if name in Laws._fields})


def _named(parts: Sequence[tuple[str, Sequence[float]]]) -> dict[str, float]:
    """Faults and laws by name."""
    named: dict[str, float] = {}
    for name, values in parts:
        named |= known(name).changes(values)
    return named


def steps_of(parts: Sequence[tuple[str, Sequence[float]]]) -> tuple[Step, ...]:
    """What these effects do to the signals of sensors."""
    return tuple(step for name, values in parts for step in known(name).steps(values))
