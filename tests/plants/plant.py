"""The plant: injections, physics, sensors and bus. Imports nothing of `observer_rt`."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from tests.plants.arrays import Array
from tests.plants.equations import Rail, State, run
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector, with_faults
from tests.plants.wave import WaveLine, WavePlant

PRESSURE_STEP, PRESSURE_FLOOR = 0.005e6, -10e6  # Pa, of the 16-bit code on the bus
LIFT_STEP, LIFT_FLOOR = 0.01e-6, -50e-6  # m
HIGHEST_CODE = 0xFFFD
RAIL_NOISE, LINE_NOISE, LIFT_NOISE = 0.1e6, 0.15e6, 0.4e-6  # Pa, Pa, m: white, per sample
SAMPLE_RATE = 100e3  # Hz of the plant; slower recordings are decimated
FIRST_EVENT = 0.15  # s
PERIOD = 0.06  # s between events
LEAD = 0.005  # s before an event, at the most, from which its faults are in force
RAIL_MOVES = (0.022, 0.050)  # s after an event starts: the rail goes to the next event's pressure
REFERENCE_PRESSURE = 100e6  # Pa, at which the needle's speeds are given
WAVE_CELLS = 40
WAVE_DAMPING = 1.0  # m2/s


@dataclass(frozen=True, eq=False)
class Signals:
    """Signals of the three sensors, at the end what the observer gets; SI, all (n,)."""

    time: Array
    rail_pressure: Array
    needle_lift: Array
    line_pressure: Array


Step = Callable[[Signals], Signals]
"""What becomes of the signals on their way to the bus."""
RAIL, LIFT, LINE = SIGNALS = ("rail_pressure", "needle_lift", "line_pressure")


def seen_as(role: str, change: Callable[[Array, Array], Array]) -> Step:
    """A sensor whose signal (n,) becomes another one, of its times [s] and values."""
    return lambda seen: replace(seen, **{role: change(seen.time, getattr(seen, role))})


def sampled(seen: Signals, noise: Array, every: int, averaged: bool, after_noise: Sequence[Step] = ()) -> Signals:
    """Every `every`-th sample, or means up to it, on the bus; noise: (3, n) of rail, lift, line in usual ones."""

    def slowed(values: Array, noise: Array) -> Array:
        if not averaged:
            return (values + noise)[::every]
        between = np.append(values[:1], 0.5 * (values[1:] + values[:-1]))  # straight lines join the values
        return _block_means(between, every) + _block_means(noise, every)

    measured = Signals(
        seen.time[::every],
        slowed(seen.rail_pressure, RAIL_NOISE * noise[0]),
        slowed(seen.needle_lift, LIFT_NOISE * noise[1]),
        slowed(seen.line_pressure, LINE_NOISE * noise[2]),
    )
    for step in after_noise:
        measured = step(measured)
    return Signals(
        measured.time,
        _coded(measured.rail_pressure, PRESSURE_STEP, PRESSURE_FLOOR),
        _coded(measured.needle_lift, LIFT_STEP, LIFT_FLOOR),
        _coded(measured.line_pressure, PRESSURE_STEP, PRESSURE_FLOOR),
    )


def _block_means(values: Array, every: int) -> Array:
    """Mean over the block that ends at every `every`-th value, the first block made up of the first value."""
    complete = values[: (values.size - 1) // every * every + 1]
    blocks = np.concatenate((np.full(every - 1, values[0]), complete)).reshape(-1, every)
    return np.asarray(blocks.mean(axis=1), np.float64)


def _coded(values: Array, step: float, floor: float) -> Array:
    return np.clip(np.rint((values - floor) / step), 0, HIGHEST_CODE) * step + floor


@dataclass(frozen=True)
class Needle:
    """Speeds [m/s] at 100 MPa; they grow with powers of the rail pressure."""

    opening_speed: float = 0.80
    closing_speed: float = 0.90


@dataclass(frozen=True)
class Shot:
    """One opening of the needle: start after the event's start, and duration [s]."""

    start: float
    duration: float


@dataclass(frozen=True)
class Event:
    rail_pressure: float
    shots: tuple[Shot, ...]
    faults: Faults


Motion = Callable[[Event, float, Needle, float], Array]
"""Strokes of an event from its start [s] on, as `strokes_of`."""


@dataclass(frozen=True)
class Surroundings:
    """Additions of a real bench; starts: of events [s]; supply: added rail pressure [Pa] at times [s]."""

    starts: tuple[float, ...] = ()
    motion: Motion | None = None
    supply: tuple[Callable[[Array], Array], ...] = ()
    before_noise: tuple[Step, ...] = ()
    after_noise: tuple[Step, ...] = ()


@dataclass(frozen=True)
class Bench:
    """A bench to be recorded: injector, needle, events, sample rate [Hz], noise as a multiple of the usual, seed.

    averaged: samples are means over the period that ends there; line: of the richer plant, None: the injector's own.
    """

    injector: Injector
    needle: Needle
    events: tuple[Event, ...]
    sample_rate: float = SAMPLE_RATE
    noise: float = 1.0
    seed: int = 0
    averaged: bool = False
    line: WaveLine | None = None
    around: Surroundings = Surroundings()
    laws: Laws = NO_LAWS

    @property
    def starts(self) -> tuple[float, ...]:
        """Start of every event, and of the one that would follow the last [s]."""
        stated = self.around.starts
        if not stated:
            return tuple(event_start(i) for i in range(len(self.events) + 1))
        return (*stated, stated[-1] + (stated[-1] - stated[-2]))


@dataclass(frozen=True, eq=False)
class Truth:
    """What really happened at the samples; SI, all (n,)."""

    injection_rate: Array
    sac_pressure: Array
    needle_lift: Array
    line_pressure: Array
    rail_pressure: Array


@dataclass(frozen=True, eq=False)
class Outcome:
    """One recording and its truth; `openings` (m, 2): samples with true lift > 1 um; `event_of` (m,): from 0."""

    measured: Signals
    truth: Truth
    openings: NDArray[np.int64]
    event_of: NDArray[np.int64]


def shots_in_turn(durations: Sequence[float], gaps: Sequence[float], begin: float = 0.0) -> tuple[Shot, ...]:
    """Openings one after the other, each with a gap behind it, the first at `begin` [s]."""
    shots = []
    for duration, gap in zip(durations, gaps, strict=True):
        shots.append(Shot(begin, duration))
        begin += duration + gap
    return tuple(shots)


def drawn_needle(rng: Generator) -> Needle:
    return Needle(0.80 * rng.uniform(0.85, 1.15), 0.90 * rng.uniform(0.85, 1.15))


def event_start(number: int) -> float:
    return FIRST_EVENT + number * PERIOD


def wave_injector(sac_volume: float = 3e-9) -> Injector:
    """An injector whose line carries travelling waves, drained by the seat flow, with a small sac [m3]."""
    return Injector(line_cells=WAVE_CELLS, line_damping=WAVE_DAMPING, sac_volume=sac_volume, drained_by_seat=1)


def strokes_of(event: Event, start: float, needle: Needle, max_lift: float) -> Array:
    """Needle strokes (m, 6) of an event: opening, top, closing, closed [s], opening and closing speed [m/s]."""
    relative = event.rail_pressure / REFERENCE_PRESSURE
    up, down = needle.opening_speed * relative**0.4, needle.closing_speed * relative**0.3
    rows = []
    for shot in event.shots:
        rise = min(max_lift / up, shot.duration / (1.0 + up / down))
        opening = start + shot.start
        closed = opening + shot.duration
        rows.append((opening, opening + rise, closed - rise * up / down, closed, up, down))
    return np.array(rows, np.float64).reshape(-1, 6)


def record(bench: Bench) -> Outcome:
    """Run the plant through all events and measure it; the same bench gives the same recording."""
    count = round((bench.starts[-1] + 0.01) * SAMPLE_RATE)
    time = np.arange(count) / SAMPLE_RATE
    rail = _rail(bench, time)
    result, lateness = _integrate(bench, time, rail)
    truth = Truth(result[:, 0], result[:, 1], result[:, 2], result[:, 3], rail)
    every = round(SAMPLE_RATE / bench.sample_rate)
    measured = _measure(bench, time, rail, result, lateness)
    truth = Truth(*(v[::every] for v in vars(truth).values()))
    openings = openings_of(truth.needle_lift)
    event_of = np.searchsorted(bench.starts[:-1], measured.time[openings[:, 0]] + 1e-4, side="right") - 1
    return Outcome(measured, truth, openings, event_of)


class _CellPlant:
    """An injector on a line of cells, at rest at first."""

    def __init__(self, part: Injector, rail_pressure: float, laws: Laws) -> None:
        flows, pressures = np.zeros(part.line_cells), np.full(part.line_cells, rail_pressure)
        sac_and_sensor = np.array([part.chamber_pressure, rail_pressure, 0.0])
        self._part, self._laws = part, laws
        self._state = State(flows, pressures, sac_and_sensor, np.array([*flows, rail_pressure, 0.0]))

    def advance(self, faults: Faults, strokes: Array, drive: Rail, result: Array) -> None:
        """Signals (n, 6) of `equations.run` at the samples after the first of `drive`."""
        part, beyond = with_faults(self._part, faults), self._laws != NO_LAWS
        run(part, faults, self._laws, beyond, strokes, drive, self._state, result)


def _first_samples(starts: tuple[float, ...]) -> tuple[int, ...]:
    """First sample of every event's period: a while before its start, when the rail is at rest."""
    leads = (min(LEAD, 0.5 * (after - before)) for before, after in pairwise(starts[:-1]))
    return (0, *(round((t - lead) * SAMPLE_RATE) for t, lead in zip(starts[1:-1], leads, strict=True)))


def _rail(bench: Bench, time: Array) -> Array:
    """True rail pressure (n,): constant round the events, smooth steps between, and what the supply adds."""
    events, starts = bench.events, bench.starts
    rail = np.full(time.size, events[0].rail_pressure)
    for number in range(1, len(events)):
        begin, end = (starts[number - 1] + move for move in RAIL_MOVES)
        share = np.clip((time - begin) / (end - begin), 0.0, 1.0)
        change = events[number].rail_pressure - events[number - 1].rail_pressure
        rail += change * 0.5 * (1.0 - np.cos(math.pi * share))
    for added in bench.around.supply:
        rail += added(time)
    return rail


def _integrate(bench: Bench, time: Array, rail: Array) -> tuple[Array, NDArray[np.int64]]:
    """Signals (n, 6) of `equations.run` at all samples, and how many samples late the line is recorded."""
    part = bench.injector
    start = float(rail[0])
    plant = (
        _CellPlant(part, start, bench.laws)
        if bench.line is None
        else WavePlant(part, bench.line, start, laws=bench.laws)
    )
    result = np.empty((time.size, 6))
    result[0] = (0.0, part.chamber_pressure, 0.0, rail[0], rail[0], 0.0)
    lateness = np.zeros(time.size, np.int64)
    firsts = (*_first_samples(bench.starts), time.size - 1)
    motion = bench.around.motion or strokes_of
    for number, event in enumerate(bench.events):
        first, end = firsts[number : number + 2]
        strokes = motion(event, bench.starts[number], bench.needle, part.max_lift)
        drive = Rail(float(time[first]), 1.0 / SAMPLE_RATE, rail[first : end + 1])
        plant.advance(event.faults, strokes, drive, result[first + 1 : end + 1])
        lateness[first + 1 : end + 1] = math.floor(event.faults.channel_skew * SAMPLE_RATE)
    return result, lateness


def _measure(bench: Bench, time: Array, rail: Array, result: Array, lateness: NDArray[np.int64]) -> Signals:
    number = np.searchsorted(_first_samples(bench.starts), np.arange(time.size), "right")
    faults = [event.faults for event in bench.events]

    def fault(name: str) -> Array:
        return np.array([getattr(f, name) for f in faults])[number - 1]

    line = result[np.clip(np.arange(time.size) - lateness, 0, time.size - 1), 4]
    line = line * (1.0 + fault("line_pressure_sensor_gain")) + fault("line_pressure_sensor_offset")
    rail = rail * (1.0 + fault("rail_pressure_sensor_gain")) + fault("rail_pressure_sensor_offset")
    lift = result[:, 5] / (1.0 + fault("lift_gain"))
    lift = np.where(lift > 0.0, np.maximum(lift - fault("lift_offset"), 0.0), 0.0)
    noise = np.random.default_rng(bench.seed).normal(size=(3, time.size)) * bench.noise
    seen = Signals(time, rail, lift, line)
    for step in bench.around.before_noise:
        seen = step(seen)
    every = round(SAMPLE_RATE / bench.sample_rate)
    return sampled(seen, noise, every, bench.averaged, bench.around.after_noise)


def openings_of(lift: Array, above: float = 1e-6) -> NDArray[np.int64]:
    """Sample ranges (m, 2), ends included, with lift above a limit [m]."""
    is_open = np.concatenate(([False], lift > above, [False]))
    changes = np.flatnonzero(is_open[1:] != is_open[:-1])
    return np.stack((changes[::2], changes[1::2] - 1), axis=1)
