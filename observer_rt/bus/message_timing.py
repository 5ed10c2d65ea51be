"""Regularity of input messages by their receive stamps: delays, drift, and how well the time of samples is known."""

import math
from typing import NamedTuple

import numpy as np

from observer_rt.bus.alignment import Timekeeping
from observer_rt.bus.mapping.bus_map import BusMap, layout_of
from observer_rt.core.frames.frames import Joining
from observer_rt.foundation.units import MICROSECOND, MILLISECOND, NANOSECOND, NANOSECONDS

LARGEST_DRIFT = 0.01  # of a clock; beyond it a recording is played at another speed


class Jitter(NamedTuple):
    """Delays of a message's frames over its shortest one: of how many frames, their scatter and the greatest [s]."""

    frames: int
    sigma: float
    greatest: float


def jitter_of(clock: np.void) -> Jitter:
    """Delays of a message's frames (row of dtype CLOCK) since its clock is known."""
    frames = int(clock["delays"])
    if frames == 0:
        return Jitter(0, math.nan, math.nan)
    mean = float(clock["delay_sum"]) / frames
    variance = max(0.0, float(clock["delay_squares"]) / frames - mean * mean)
    return Jitter(frames, math.sqrt(variance) * NANOSECOND, float(clock["delay_max"]) * NANOSECOND)


class MessageTiming(NamedTuple):
    """Timing of one input message by the receive stamps of its frames."""

    name: str
    jitter: Jitter
    drift: float
    """Of its clock against the receiver's [-]."""
    unknown: float
    """Greatest distance of its samples from their places on the grid [s]: 0 by index, inf: clocks not known yet."""
    lately: float
    """Greatest delay in the last 0.2 s [s]."""

    def as_text(self) -> str:
        """Summary for the screen in one line: delays, drift, and their effect on the samples."""
        if self.jitter.frames == 0:
            return f"{self.name}: too few frames to tell their times"
        drift = f"drift {self.drift * 1e6:+.1f} ppm"
        if abs(self.drift) >= LARGEST_DRIFT:
            drift = f"sent at {1.0 / (1.0 + self.drift):.3g} times sampling.rate_hz"
        placed = f"samples are placed by its clock to {self.unknown / MICROSECOND:.2g} us"
        if self.unknown == 0.0:
            placed = "samples are counted"
        elif math.isinf(self.unknown):
            placed = "its clock is not known yet"
        late, jitter = self.jitter.greatest / MILLISECOND, self.jitter.sigma / MICROSECOND
        return f"{self.name}: frames came late by up to {late:.3g} ms, jitter {jitter:.1f} us, {drift}; {placed}"


def timing_of(bus: BusMap, keeping: Timekeeping) -> tuple[MessageTiming, ...]:
    """Timing of each message by the receive stamps so far."""
    grid = keeping.clocks[int(keeping.memory[0]["leading"])]
    result = []
    for stream, (timing, clock) in enumerate(zip(keeping.timing, keeping.clocks, strict=True)):
        by_clock = timing["joining"] == Joining.CLOCK
        unknown = float(grid["residual"] + clock["residual"]) / NANOSECONDS if by_clock else 0.0
        drift = float(clock["drift"]) / float(clock["interval"])
        name, lately = bus.name_of(layout_of(bus, stream)), float(clock["spread"]) / NANOSECONDS
        result.append(MessageTiming(name, jitter_of(clock), drift, unknown, lately))
    return tuple(result)
