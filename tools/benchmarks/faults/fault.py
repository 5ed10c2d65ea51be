"""A row of the table of faults: what goes wrong, where, in which sizes, and which reasons are then true."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial

import numpy as np
from numpy.random import Generator

from observer_rt.bus.mapping.bus_map import BusMap
from tests.plants.arrays import Array
from tests.plants.plant import Bench, Signals

MPA, UM, US, KHZ = 1e6, 1e-6, 1e-6, 1e3
SCALES = {"MPa": MPA, "um": UM, "us": US, "ms": 1e-3, "kHz": KHZ, "%": 0.01}  # by the first word of a unit
OPENING_DELAY = 0.25e-3  # s, from the start of energizing to the opening
CLOSING_DELAY = 0.30e-3  # s, from the end of energizing to the closed needle, at the most 80 % of the opening
Stated = Mapping[str, Mapping[str, float]]
"""Keys of the bench file, by role, of `[signals.<role>]`."""


class Where(StrEnum):
    """The part at fault, in the order in which the faults of a scenario are put into its recording."""

    RHYTHM = "rhythm"  # when what is opened
    BENCH = "bench"  # what needle and supply really do
    SENSOR = "sensor"
    BUS = "bus"
    CLOCK = "clock"
    PROCESS = "process"


@dataclass(frozen=True)
class Fault:
    """A row. sizes: in `unit`; reasons: names of those that are true of it; lasting: it is there throughout.

    late: s after the next opening until it is found, as docs/validity.md states; shortest: s that it lasts at least;
    stated: what a bench file would say of a size of it.
    """

    name: str
    where: Where
    reasons: frozenset[str]
    unit: str = ""
    sizes: tuple[float, ...] = (0.0,)
    lasting: bool = False
    late: float = 0.0
    shortest: float = 0.0
    stated: Callable[[float], Stated] | None = None

    @property
    def scale(self) -> float:
        return SCALES.get(re.split("[, /]", self.unit)[0], 1.0)


@dataclass(frozen=True)
class BenchFault(Fault):
    """Changes what happens on the bench; size in `unit`."""

    change: Callable[[Bench, float, Generator], Bench] = lambda bench, size, rng: bench


@dataclass(frozen=True, eq=False)
class Part:
    """The samples (n,) in which a fault of a sensor is there; current: the coil's, 0 or 1; size in SI."""

    seen: Signals
    current: Array
    size: float
    chance: Generator


@dataclass(frozen=True)
class SensorFault(Fault):
    """Changes signals while it is there, ahead of the noise or after it."""

    change: Callable[[Part], Signals] = lambda part: part.seen
    after_noise: bool = False


@dataclass(frozen=True)
class Sent:
    """A frame; message: its number among the inputs; moved: sample index it bears beyond the recording's own."""

    time: float
    stamp: float
    message: int
    payload: bytes
    moved: int = 0
    is_foreign: bool = False


Frames = list[Sent]


@dataclass(frozen=True)
class FrameFault(Fault):
    """Changes frames on their way; stays: to the end of the recording."""

    change: Callable[[Frames, Generator, BusMap], Frames] = lambda frames, rng, bus: frames
    stays: bool = False


@dataclass(frozen=True)
class PlacedFault:
    """A fault of one size between two times [s] of the recording; seed: of all else about it."""

    fault: Fault
    size: float
    begin: float
    end: float
    seed: int
    is_stated: bool = False

    @property
    def chance(self) -> Generator:
        return np.random.default_rng(self.seed)

    @property
    def stated(self) -> Stated:
        return self.fault.stated(self.size) if self.is_stated and self.fault.stated else {}

    def on(self, bench: Bench) -> Bench:
        """The bench with it; of a fault of frames or process the same."""
        if isinstance(self.fault, BenchFault):
            return self.fault.change(bench, self.size, self.chance)
        if not isinstance(self.fault, SensorFault):
            return bench
        step, around = partial(self._seen, energizing(bench)), bench.around
        if self.fault.after_noise:
            return replace(bench, around=replace(around, after_noise=(*around.after_noise, step)))
        return replace(bench, around=replace(around, before_noise=(*around.before_noise, step)))

    def _seen(self, moments: tuple[Array, Array], seen: Signals) -> Signals:
        assert isinstance(self.fault, SensorFault)
        during = (seen.time >= self.begin) & (seen.time < self.end)
        time = seen.time[during]
        if time.size < 2:
            return seen
        begun, over = (np.searchsorted(t, time, "right") for t in moments)
        inside = Signals(*(values[during] for values in vars(seen).values()))
        part = Part(inside, (begun - over).astype(np.float64), self.size * self.fault.scale, self.chance)
        signals = {name: values.copy() for name, values in vars(seen).items()}
        for name, values in vars(self.fault.change(part)).items():
            signals[name][during] = values
        return Signals(**signals)


def energizing(bench: Bench) -> tuple[Array, Array]:
    """Starts and ends [s] of the current through the coil, of every opening, each in order."""
    events = zip(bench.starts, bench.events, strict=False)
    shots = [(start + s.start, s.duration) for start, e in events for s in e.shots]
    opening, duration = np.array(shots, np.float64).reshape(-1, 2).T
    ends = opening + duration - np.minimum(CLOSING_DELAY, 0.8 * duration)
    return np.sort(opening - OPENING_DELAY), np.sort(ends)
