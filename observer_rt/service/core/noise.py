"""What the noise of the signals is like while the needle is shut."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.signals import Role
from observer_rt.estimation.gain import NoiseLevels
from observer_rt.evidence.slow_noise import SlowNoise, slow_noise
from observer_rt.foundation.continuity import Doubt
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE

SIGNALS = {
    Role.RAIL_PRESSURE: ("rail pressure", "MPa", MEGAPASCAL),
    Role.LINE_PRESSURE: ("line pressure", "MPa", MEGAPASCAL),
    Role.NEEDLE_LIFT: ("needle lift", "um", MICROMETRE),
}


def slow_noise_of(
    rows: NDArray[np.void], white: NoiseLevels, pressure_scale: float, sample_rate: float
) -> Mapping[Role, SlowNoise]:
    """Of samples, dtype `stream.state.SAMPLE`, what is not white in line pressure [Pa] and needle lift [m].

    What is slow in the rail pressure is taken for its own motion, and that of the line by its innovations.
    """
    rest = rows[rows["resting"] & ~rows["interpolated"] & (rows["doubt"] == Doubt.NONE)]
    index = rest["index"].astype(np.int64)
    found = {
        Role.LINE_PRESSURE: slow_noise(
            rest["innovation"] * pressure_scale, index, sample_rate, white.line_pressure
        ),
        Role.NEEDLE_LIFT: slow_noise(rest["needle_lift"], index, sample_rate, white.needle_lift),
    }
    return {role: noise for role, noise in found.items() if noise is not None}


def noise_text(white: NoiseLevels, slow: Mapping[Role, SlowNoise]) -> str:
    """Levels of all signals, and what is not white of them."""
    told = []
    for role, (name, unit, size) in SIGNALS.items():
        text = f"{name} {getattr(white, role.value) / size:.2g} {unit}"
        told.append(f"{text} and {slow[role].as_text(unit, size)}" if role in slow else text)
    return ", ".join(told)
