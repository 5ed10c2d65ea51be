"""How regularly the input messages come, and how well the time of their samples is known."""

import math
from dataclasses import dataclass

from observer_rt.bus.alignment.clock import Jitter, jitter_of
from observer_rt.bus.alignment.timekeeping import Timekeeping
from observer_rt.bus.mapping.bus_map import BusMap, layout_of
from observer_rt.bus.mapping.timing import Joining
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND

LINE_SLOPE = 0.125 * MEGAPASCAL / MICROSECOND  # Pa/s, steepest of the line pressure when the needle opens
SECOND = 1e9  # ns
LARGEST_DRIFT = 0.01  # of a clock; beyond it a recording is played at another speed


@dataclass(frozen=True)
class MessageTiming:
    """One input message: delays of its frames, drift of its clock against the receiver's [-].

    unknown [s]: what its samples may lie beside their place on the grid; 0 where an index joins them, infinite
    while the clocks are not known.
    """

    name: str
    jitter: Jitter
    drift: float
    unknown: float
    lately: float
    """Greatest delay in the last 0.2 s [s]."""

    @property
    def pressure_error(self) -> float:
        """Line pressure [Pa] that `unknown` is worth."""
        return self.unknown * LINE_SLOPE

    def as_text(self) -> str:
        """One line for the screen: delays, drift, and what they do to the samples."""
        if self.jitter.frames == 0:
            return f"{self.name}: times not known yet"
        return (
            f"{self.name}: frames came late by up to {self.jitter.greatest / MICROSECOND:.0f} us, their jitter is "
            f"{self.jitter.sigma / MICROSECOND:.1f} us, {self._drift_as_text()}; {self._placed_as_text()}"
        )

    def _placed_as_text(self) -> str:
        """What that means for the samples."""
        if self.unknown == 0.0:
            return "no sample is displaced by that: they are counted"
        if math.isinf(self.unknown):
            return "its samples cannot be placed: its clock is not known yet"
        return f"by its clock, its samples are placed to {self.unknown / MICROSECOND:.2g} us"

    def _drift_as_text(self) -> str:
        if abs(self.drift) < LARGEST_DRIFT:
            return f"drift {self.drift * 1e6:+.1f} ppm"
        return f"sent at {1.0 / (1.0 + self.drift):.3g} times its rate"


def timing_of(bus: BusMap, keeping: Timekeeping) -> tuple[MessageTiming, ...]:
    """What the stamps have shown so far, message by message."""
    grid = keeping.clocks[int(keeping.memory[0]["leading"])]
    result = []
    for stream, (timing, clock) in enumerate(zip(keeping.timing, keeping.clocks, strict=True)):
        unknown = 0.0
        if timing["joining"] == Joining.CLOCK:
            unknown = float(grid["residual"] + clock["residual"]) / SECOND
        drift = float(clock["drift"]) / float(clock["interval"])
        name, lately = bus.name_of(layout_of(bus, stream)), float(clock["spread"]) / SECOND
        result.append(MessageTiming(name, jitter_of(clock), drift, unknown, lately))
    return tuple(result)
