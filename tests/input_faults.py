"""Faults of an input of any shape: what a cable that is off, an amplifier or a sensor makes of it for a while."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from observer_rt.config.signals import Role
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE

Values = NDArray[np.float64]

RANGES = {
    Role.RAIL_PRESSURE: (-9 * MEGAPASCAL, 300 * MEGAPASCAL),
    Role.NEEDLE_LIFT: (-45 * MICROMETRE, 500 * MICROMETRE),
    Role.LINE_PRESSURE: (-9 * MEGAPASCAL, 300 * MEGAPASCAL),
}
"""What the bus can carry, within narrow margins."""


@dataclass(frozen=True)
class Part:
    """The part of a signal that is at fault: times [s] and values (n,), its lowest and highest value, chance.

    size: share (0..1) of that range; pace: 1/s.
    """

    time: Values
    values: Values
    lowest: float
    highest: float
    size: float
    pace: float
    chance: Generator

    @property
    def noise(self) -> Values:
        """White, of standard deviation 1."""
        return self.chance.normal(size=self.time.size)

    @property
    def wave(self) -> Values:
        """Of the mains or quicker, from -1 to 1."""
        return np.sin(2 * np.pi * self.pace * self.time + self.chance.uniform(0.0, 6.0))

    @property
    def reach(self) -> float:
        """In the signal's unit."""
        return self.size * (self.highest - self.lowest)


def _walk(part: Part) -> Values:
    """From wall to wall."""
    steps = np.cumsum(0.02 * part.reach * part.noise)
    return part.lowest + np.abs((steps + part.reach) % (2 * part.reach) - part.reach)


def _floating(part: Part) -> Values:
    """A cable that is off hears the mains."""
    return part.lowest + 0.5 * part.reach * (1.0 + part.wave) + 1e-3 * part.reach * part.noise


def _ramp(part: Part) -> Values:
    return part.values + part.reach * np.linspace(0.0, part.chance.choice([-1.0, 1.0]), part.time.size)


SHAPES: dict[str, Callable[[Part], Values]] = {
    "walk": _walk,
    "floating": _floating,
    "hum": lambda part: part.values + part.reach * part.wave,
    "noise": lambda part: part.lowest + part.reach * (1.0 + part.noise),
    "noisy": lambda part: part.values + 0.3 * part.reach * part.noise,
    "dead": lambda part: part.reach * part.noise,
    "step": lambda part: part.values + part.reach * part.chance.choice([-1.0, 1.0]),
    "ramp": _ramp,
    "square": lambda part: np.where(part.wave > 0.0, part.lowest + part.reach, part.lowest),
    "bursts": lambda part: np.where(part.wave > 0.5, part.values + part.reach * part.noise, part.values),
    "gone now and then": lambda part: np.where(part.wave > 0.5, np.nan, part.values).astype(np.float64),
}


@dataclass(frozen=True)
class InputFault:
    """A fault of a signal between two times [s]; size, pace: as of `Part`."""

    role: Role
    shape: str
    begin: float
    end: float
    size: float
    pace: float
    seed: int

    def of(self, recording: Recording) -> Recording:
        """The recording with the fault in it, as the bus can carry it."""
        during = (recording.time >= self.begin) & (recording.time < self.end)
        values = getattr(recording, self.role.value).copy()
        low, high = RANGES[self.role]
        part = Part(
            recording.time[during],
            values[during],
            low,
            high,
            self.size,
            self.pace,
            np.random.default_rng(self.seed),
        )
        values[during] = np.clip(SHAPES[self.shape](part), low, high)
        return replace(recording, **{self.role.value: values})
