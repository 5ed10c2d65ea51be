"""What the noise of the signals is like while the needle is shut."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.signals import Role
from observer_rt.estimation.gain import NoiseLevels
from observer_rt.evidence.slow_noise import SlowNoise, slow_noise
from observer_rt.foundation.continuity import Doubt
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.observer.stream.pair import OFFSET_FOLLOWS
from observer_rt.observer.stream.state import Observer

SIGNALS = {  # short name, unit, its size
    Role.RAIL_PRESSURE: ("rail", "MPa", MEGAPASCAL),
    Role.LINE_PRESSURE: ("line", "MPa", MEGAPASCAL),
    Role.NEEDLE_LIFT: ("lift", "um", MICROMETRE),
}


def slow_noise_of(observer: Observer, rows: NDArray[np.void], white: NoiseLevels) -> Mapping[Role, SlowNoise]:
    """Of an observer's samples, what is not white in line pressure [Pa] and needle lift [m].

    The line is judged by its innovations: what is slow in the rail pressure, and the line's answer to it, is motion.
    """
    c, rate = observer.constants.coefficients, 1.0 / observer.constants.interval
    rest = rows[rows["resting"] & ~rows["interpolated"] & (rows["doubt"] == Doubt.NONE)]
    index = rest["index"].astype(np.int64)
    sigma = float(observer.memory[0]["innovation_sigma"]) * c.pressure_scale
    line = slow_noise(rest["innovation"] * c.pressure_scale, index, rate, sigma)
    lift = slow_noise(rest["needle_lift"], index, rate, white.needle_lift)
    found = {}
    if line is not None:
        found[Role.LINE_PRESSURE] = replace(line, strength=line.strength / _passed(observer, line.frequency))
    if lift is not None:
        found[Role.NEEDLE_LIFT] = lift
    return found


def _passed(observer: Observer, frequency: float) -> float:
    """Share of a sensor's disturbance [Hz] that is in the innovations: x~ and its offset follow the rest of it."""
    line, _ = observer.constants.coefficients.line.transition(observer.constants.interval)
    gain = observer.gains[-1][[0, 1, *range(3, 1 + len(line))]]
    moved = line * cmath.exp(-2j * math.pi * frequency * observer.constants.interval)
    followed = moved @ np.linalg.solve(np.eye(len(line)) - moved, gain.astype(np.complex128))
    passed = 1.0 / (1.0 + followed[0])
    if observer.memory[0]["offset_moves"]:
        turns = 2j * math.pi * frequency * OFFSET_FOLLOWS
        passed *= turns / (1.0 + turns)
    return float(abs(passed))


def noise_text(white: NoiseLevels, slow: Mapping[Role, SlowNoise]) -> str:
    """Levels of all signals, and what is not white of them."""
    told = []
    for role, (name, unit, size) in SIGNALS.items():
        text = f"{name} {getattr(white, role.value) / size:.2g} {unit}"
        told.append(f"{text} and {slow[role].as_text(unit, size)}" if role in slow else text)
    return ", ".join(told)
