"""Noise of an injector's signals: as the bench file states it, its slow part at rest, and both in words."""

import cmath
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role
from observer_rt.core.stream.stream import OFFSET_FOLLOWS
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.stream.state import Doubt, Observer
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE

if TYPE_CHECKING:
    from observer_rt.engine.estimation.signal_noise import SlowNoise

SIGNALS = {  # short name, unit, its size
    Role.RAIL_PRESSURE: ("rail", "MPa", MEGAPASCAL),
    Role.LINE_PRESSURE: ("line", "MPa", MEGAPASCAL),
    Role.NEEDLE_LIFT: ("lift", "um", MICROMETRE),
}


def configured_noise(injector: BenchInjector) -> NoiseLevels:
    """Noise levels of the bench file, SI."""
    noise = injector.config.noise
    return NoiseLevels(
        rail_pressure=noise.rail_pressure_MPa * MEGAPASCAL,
        line_pressure=noise.line_pressure_MPa * MEGAPASCAL,
        needle_lift=noise.needle_lift_um * MICROMETRE,
    )


def slow_noise_of(observer: Observer, rows: NDArray[np.void], white: NoiseLevels) -> "Mapping[Role, SlowNoise]":
    """Slow noise of line pressure [Pa] and needle lift [m] in processed samples `rows` (n,).

    For the line, innovations are used: slow changes of the rail pressure, which the line follows, are no noise.
    """
    from observer_rt.engine.estimation.signal_noise import slow_noise  # only for who looks at a daemon, or at a log

    c, rate = observer.constants.coefficients, 1.0 / observer.constants.interval
    resting = rows[rows["resting"] & ~rows["interpolated"] & (rows["doubt"] == Doubt.NONE)]
    index = resting["index"].astype(np.int64)
    sigma = float(observer.memory[0]["innovation_noise"]["sigma"]) * c.pressure_scale
    line = slow_noise(resting["innovation"] * c.pressure_scale, index, rate, sigma)
    lift = slow_noise(resting["needle_lift"], index, rate, white.needle_lift)
    levels = {}
    if line is not None:
        passed = 1.0 if line.frequency is None else _passed(observer, line.frequency)
        levels[Role.LINE_PRESSURE] = replace(line, strength=line.strength / passed)
    if lift is not None:
        levels[Role.NEEDLE_LIFT] = lift
    return levels


def _passed(observer: Observer, frequency: float) -> float:
    """Gain from a disturbance of the line sensor to the innovations at a frequency [Hz]: x~ follows the rest."""
    line, _ = observer.constants.coefficients.line.transition(observer.constants.interval)
    gain = observer.gains[-1][[0, 1, *range(3, 1 + len(line))]]
    moved = line * cmath.exp(-2j * math.pi * frequency * observer.constants.interval)
    followed = moved @ np.linalg.solve(np.eye(len(line)) - moved, gain.astype(np.complex128))
    passed = 1.0 / (1.0 + followed[0])
    if observer.memory[0]["judgement"]["offset_moves"]:
        turns = 2j * math.pi * frequency * OFFSET_FOLLOWS
        passed *= turns / (1.0 + turns)
    return float(abs(passed))


def noise_text(white: NoiseLevels, slow: "Mapping[Role, SlowNoise]") -> str:
    """Sentence with the noise levels of all signals, and their slow parts."""
    noises = []
    for role, (name, unit, size) in SIGNALS.items():
        text = f"{name} {getattr(white, role.value) / size:.2g} {unit}"
        noises.append(f"{text} and {slow[role].as_text(unit, size)}" if role in slow else text)
    return ", ".join(noises)
