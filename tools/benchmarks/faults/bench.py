"""What really happens on a bench: pump ripple, transients, rhythm, and needles that bounce."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from tests.plants.arrays import Array
from tests.plants.plant import FIRST_EVENT, PERIOD, Bench, Event, Motion, Needle, Shot, shots_in_turn, strokes_of
from tools.benchmarks.faults import reasons as of
from tools.benchmarks.faults.fault import MPA, UM, BenchFault, Where

QUICK = 26  # events of a quick rhythm: the last ones wait for a pause that does not come
QUICK_DURATIONS = (0.4e-3, 1.2e-3)  # s
TRANSIENT, TRANSIENT_AT, TRANSIENT_BACK = 20e-3, 9, 14  # s; events (from 0) within which it begins
BALLISTIC_SPREAD = 0.05e-3  # s
SHOT_GAPS, PILOT_DURATIONS, MAIN_DURATIONS = (0.3e-3, 0.8e-3), (0.25e-3, 0.5e-3), (0.5e-3, 1.5e-3)  # s
BOUNCE, BOUNCE_DELAY, OVERSHOOT = 60e-6, 40e-6, 120e-6  # s: bounce, its distance from the closing, overshoot
Change = Callable[[Bench, float, Generator], Bench]


def ripple(frequency: float) -> Change:
    """The pump moves the true rail pressure [Hz] by `size` MPa."""

    def apply(bench: Bench, size: float, rng: Generator) -> Bench:
        phase = rng.random()
        return _supplied(bench, lambda t: size * MPA * np.sin(2.0 * math.pi * (frequency * t + phase)))

    return apply


def transient(bench: Bench, size: float, rng: Generator) -> Bench:
    """The true rail pressure rises by `size` MPa within an event, and falls again within another one."""
    begin, back = (bench.starts[event] - 2e-3 for event in (TRANSIENT_AT, TRANSIENT_BACK))

    def added(time: Array) -> Array:
        up, down = (np.clip((time - moment) / TRANSIENT, 0.0, 1.0) for moment in (begin, back))
        return np.asarray(size * MPA * (up - down), np.float64)

    return _supplied(bench, added)


def every(bench: Bench, size: float, rng: Generator) -> Bench:
    """An opening every `size` ms without end, at one operating point."""
    return _at_one_point(bench, FIRST_EVENT + size * 1e-3 * np.arange(QUICK, dtype=np.float64), rng)


def irregular(bench: Bench, size: float, rng: Generator) -> Bench:
    """Openings at least `size` ms apart, by chance up to 2.5 times the usual distance, at one operating point."""
    gaps = rng.uniform(size * 1e-3, 2.5 * PERIOD, len(bench.events) - 1)
    return _at_one_point(bench, FIRST_EVENT + np.append(0.0, np.cumsum(gaps)), rng)


def several(bench: Bench, size: float, rng: Generator) -> Bench:
    """`size` openings an event, the next to last the main one."""
    count = round(size)
    durations = [rng.uniform(*(MAIN_DURATIONS if n == count - 2 else PILOT_DURATIONS)) for n in range(count)]
    shots = shots_in_turn(durations, rng.uniform(*SHOT_GAPS, count).tolist())
    return _with_shots(bench, lambda event: shots)


def ballistic(bench: Bench, size: float, rng: Generator) -> Bench:
    """One opening of about `size` ms an event: the needle never gets to its stop."""
    return _with_shots(
        bench, lambda event: (Shot(event.shots[0].start, size * 1e-3 + rng.uniform(0.0, BALLISTIC_SPREAD)),)
    )


def bouncing(bench: Bench, size: float, rng: Generator) -> Bench:
    """After closing the needle opens again, by `size` um."""
    return _moved(bench, lambda s: np.concatenate((s, _hops(s[:, 3] + BOUNCE_DELAY, BOUNCE, size * UM))))


def overshooting(bench: Bench, size: float, rng: Generator) -> Bench:
    """At its stop the needle goes `size` um too far, and comes back."""

    def more(strokes: Array) -> Array:
        at_stop = strokes[strokes[:, 2] - strokes[:, 1] > OVERSHOOT]
        return np.concatenate((strokes, _hops(at_stop[:, 1], OVERSHOOT, size * UM)))

    return _moved(bench, more)


def smooth(bench: Bench, size: float, rng: Generator) -> Bench:
    """The needle is slow near its seat: on the lowest `size` % of its way, up and down, at a third of the speed."""
    low = 0.01 * size * bench.injector.max_lift
    return _moved(bench, lambda strokes: np.concatenate([_slow_below(low, row) for row in strokes]))


def _hops(begins: Array, length: float, height: float) -> Array:
    """Strokes that go up by a height, and down at once."""
    tops, speeds = begins + 0.5 * length, np.full((2, begins.size), 2.0 * height / length)
    return np.stack((begins, tops, tops, begins + length, *speeds), axis=1)


def _slow_below(low: float, stroke: Array) -> Array:
    """A stroke in two: at a third of its speeds up to a lift [m], and above it; commands are answered as before."""
    opening, top, closing, _, up, down = stroke
    leaves = min(opening + 3.0 * low / up, closing)
    peak = min(up * (top - opening), up / 3.0 * (leaves - opening) + up * (closing - leaves))
    slow = min(low, peak)
    nears = closing + (peak - slow) / down
    below = (opening, opening + 3.0 * slow / up, nears, nears + 3.0 * slow / down, up / 3.0, down / 3.0)
    return np.array([below, (leaves, leaves + (peak - slow) / up, closing, nears, up, down)])


def _moved(bench: Bench, change: Callable[[Array], Array]) -> Bench:
    before: Motion = bench.around.motion or strokes_of

    def motion(event: Event, start: float, needle: Needle, max_lift: float) -> Array:
        return change(before(event, start, needle, max_lift))

    return replace(bench, around=replace(bench.around, motion=motion))


def _supplied(bench: Bench, added: Callable[[Array], Array]) -> Bench:
    return replace(bench, around=replace(bench.around, supply=(*bench.around.supply, added)))


def _with_shots(bench: Bench, shots_of: Callable[[Event], tuple[Shot, ...]]) -> Bench:
    return replace(bench, events=tuple(replace(event, shots=shots_of(event)) for event in bench.events))


def _at_one_point(bench: Bench, starts: Array, rng: Generator) -> Bench:
    """Single openings of one duration and rail pressure at these moments."""
    shot, first = Shot(0.0, rng.uniform(*QUICK_DURATIONS)), bench.events[0]
    phases = rng.uniform(0.0, 50e-6, starts.size)
    events = tuple(replace(first, shots=(replace(shot, start=float(p)),)) for p in phases)
    return replace(bench, events=events, around=replace(bench.around, starts=tuple(map(float, starts))))


_B, _R = Where.BENCH, Where.RHYTHM
ROWS = (
    BenchFault("pump_ripple_620_hz", _B, of.HARMLESS, "MPa", (0.5, 1.5), True, change=ripple(620.0)),
    BenchFault("pump_ripple_200_hz", _B, of.HARMLESS, "MPa", (1.0, 3.0), True, change=ripple(200.0)),
    BenchFault("engine_transient", _B, of.CHANGE, "MPa", (10.0, 20.0), True, change=transient),
    BenchFault("openings_every", _R, of.CROWDED, "ms", (30.0, 10.5, 8.0, 4.2), True, change=every),
    BenchFault("irregular_openings", _R, of.HARMLESS, "ms", (25.0, 9.0), True, change=irregular),
    BenchFault("openings_an_event", _R, of.HARMLESS, "openings", (3.0, 5.0), True, change=several),
    BenchFault("ballistic", _R, of.HARMLESS, "ms", (0.25, 0.2), True, change=ballistic),
    BenchFault("needle_bounce", _B, of.HARMLESS, "um", (10.0, 30.0), True, change=bouncing),
    BenchFault("needle_overshoot", _B, of.HARMLESS, "um", (10.0, 20.0), True, change=overshooting),
    BenchFault("smooth_needle_flanks", _B, of.HARMLESS, "%", (10.0, 20.0), True, change=smooth),
)
