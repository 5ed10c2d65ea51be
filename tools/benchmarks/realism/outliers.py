"""Spikes, frozen stretches, dropouts, clipping, and what energizing couples in."""

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant import (
    HIGHEST_CODE,
    LIFT_FLOOR,
    LIFT_STEP,
    PRESSURE_FLOOR,
    PRESSURE_STEP,
    Bench,
    Measured,
)
from tools.benchmarks.realism.disturbance import (
    ALL,
    LIFT,
    LINE,
    MPA,
    RAIL,
    UM,
    Apply,
    Disturbance,
    Kind,
    Reasons,
    Wave,
    after_noise,
    changed,
    in_order,
    of_signal,
    sign,
    with_step_before,
)

OPENING_DELAY = 0.25e-3  # s, from the start of energizing to the opening
CLOSING_DELAY = 0.30e-3  # s, from the end of energizing to the closed needle, at the most 80 % of the opening
SPIKE_LENGTHS = (1, 4)  # samples, without the last
LIFT_SPIKE = 20e-6 / 3e6  # m of a spike on the lift per Pa of one on a pressure
SPIKES = 40.0  # per s, at random
HOLDS, LIFT_HOLDS = 40.0, 200.0  # per s; a lift is seldom other than at rest
DROPOUTS = 20.0  # per s
FULL_SCALE = {
    RAIL: HIGHEST_CODE * PRESSURE_STEP + PRESSURE_FLOOR,
    LIFT: HIGHEST_CODE * LIFT_STEP + LIFT_FLOOR,
    LINE: HIGHEST_CODE * PRESSURE_STEP + PRESSURE_FLOOR,
}


def energizing(bench: Bench) -> tuple[Array, Array]:
    """Starts and ends [s] of the current through the coil, of every opening."""
    shots = [
        (start + s.start, s.duration)
        for start, e in zip(bench.starts, bench.events, strict=False)
        for s in e.shots
    ]
    opening, duration = np.array(shots, np.float64).T
    return opening - OPENING_DELAY, opening + duration - np.minimum(CLOSING_DELAY, 0.8 * duration)


def edge_spikes(*roles: str) -> Apply:
    """Spikes of `size` MPa, on the lift in proportion, of 1 to 3 samples at every edge of the energizing."""

    def apply(bench: Bench, size: float, rng: Generator) -> Bench:
        moments = np.sort(np.concatenate(energizing(bench)))
        spikes = [(t, int(rng.integers(*SPIKE_LENGTHS)), sign(rng)) for t in moments]

        def step(measured: Measured) -> Measured:
            for role in roles:
                values = getattr(measured, role).copy()
                height = size * MPA * (LIFT_SPIKE if role == LIFT else 1.0)
                for moment, length, way in spikes:
                    first = int(np.searchsorted(measured.time, moment))
                    values[first : first + length] += way * height
                measured = changed(measured, role, values)
            return measured

        return with_step_before(bench, step)

    return apply


def random_spikes(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """Spikes of `size`, of 1 to 3 samples, at random."""
    found = values.copy()
    for first in _moments(time, SPIKES, rng):
        found[first : first + rng.integers(*SPIKE_LENGTHS)] += sign(rng) * size
    return found


def frozen(rate: float) -> Wave:
    """Held for `size` [s], now and then [1/s]: by a sample-and-hold ahead of the noise, or by repeated samples."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        found, length = values.copy(), round(size / (time[1] - time[0]))
        for first in _moments(time, rate, rng):
            found[first : first + length] = found[first]
        return found

    return wave


def dropouts(level: float) -> Apply:
    """A level for `size` samples, now and then."""

    def on(role: str) -> Apply:
        def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
            found = values.copy()
            for first in _moments(time, DROPOUTS, rng):
                found[first : first + round(size)] = level * FULL_SCALE[role]
            return found

        return after_noise(wave, 1.0, role)

    return in_order(*(on(role) for role in ALL))


def clipped(is_top: bool) -> Wave:
    """The amplifier's end lies `size` inside what the signal does."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        low, high = float(values.min()), float(values.max())
        return np.minimum(values, high - size) if is_top else np.maximum(values, low + size)

    return wave


def during_energizing(role: str, scale: float) -> Apply:
    """The coil's current adds `size` while it flows."""

    def apply(bench: Bench, size: float, rng: Generator) -> Bench:
        starts, ends = energizing(bench)

        def step(measured: Measured) -> Measured:
            begun, over = (np.searchsorted(np.sort(t), measured.time, "right") for t in (starts, ends))
            return changed(measured, role, getattr(measured, role) + size * scale * (begun - over))

        return with_step_before(bench, step)

    return apply


def _moments(time: Array, rate: float, rng: Generator) -> NDArray[np.int64]:
    return np.asarray(rng.integers(0, time.size, rng.poisson(rate * (time[-1] - time[0]))), np.int64)


_A = Kind.ALL
_SHORT = (0.1, 0.2, 0.5)  # ms
_O, _F, _C, _S = Reasons.OUTLIERS, Reasons.FROZEN, Reasons.CLIPPED, Reasons.SENSOR
DISTURBANCES = (
    Disturbance("spikes_at_edges", _A, "MPa", (1.0, 3.0, 10.0), edge_spikes(*ALL), _O, table=3.0),
    Disturbance("spikes_at_edges_line", Kind.LINE, "MPa", (3.0,), edge_spikes(LINE), _O),
    Disturbance("spikes_at_edges_lift", Kind.LIFT, "MPa, 20 um per 3", (3.0,), edge_spikes(LIFT), _O),
    of_signal("spikes_line", LINE, "MPa", (3.0, 10.0), random_spikes, _O),
    of_signal("spikes_rail", RAIL, "MPa", (3.0, 10.0), random_spikes, _O),
    of_signal("spikes_lift", LIFT, "um", (20.0, 60.0), random_spikes, _O),
    of_signal("frozen_line", LINE, "ms", _SHORT, frozen(HOLDS), _F, table=0.2),
    of_signal("frozen_line_samples", LINE, "ms", _SHORT, frozen(HOLDS), _F, after=True),
    of_signal("frozen_rail", RAIL, "ms", _SHORT[1:], frozen(HOLDS), _F),
    of_signal("frozen_rail_samples", RAIL, "ms", _SHORT[1:], frozen(HOLDS), _F, after=True),
    of_signal("frozen_lift", LIFT, "ms", _SHORT, frozen(LIFT_HOLDS), _F),
    of_signal("frozen_lift_samples", LIFT, "ms", _SHORT, frozen(LIFT_HOLDS), _F, after=True),
    Disturbance("dropouts_to_zero", _A, "samples", (2.0, 5.0), dropouts(0.0), Reasons.DROPOUTS),
    Disturbance("dropouts_to_full_scale", _A, "samples", (2.0, 5.0), dropouts(1.0), Reasons.DROPOUTS),
    of_signal("line_clipped_at_the_top", LINE, "MPa", (1.0, 4.0), clipped(is_top=True), _C),
    of_signal("line_clipped_at_the_bottom", LINE, "MPa", (1.0, 4.0), clipped(is_top=False), _C),
    Disturbance("energizing_on_line", Kind.LINE, "MPa", (0.1, 0.3), during_energizing(LINE, MPA), _S),
    Disturbance("energizing_on_lift", Kind.LIFT, "um", (1.0, 3.0), during_energizing(LIFT, UM), _S),
)
