"""Spikes, frozen stretches, dropouts, clipping, and what energizing couples in."""

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant import Bench
from tools.benchmarks.realism import reasons
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
    Wave,
    after_noise,
    before_noise,
    changed,
    in_order,
    with_step_before,
)
from tools.benchmarks.sampling import (
    HIGHEST_CODE,
    LIFT_FLOOR,
    LIFT_STEP,
    PRESSURE_FLOOR,
    PRESSURE_STEP,
    Measured,
)

OPENING_DELAY = 0.25e-3  # s, from the start of energizing to the opening
CLOSING_DELAY = 0.30e-3  # s, from the end of energizing to the closed needle, at the most 80 % of the opening
SPIKE_LENGTHS = (1, 3)  # samples, both included
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
        spikes = [(t, int(rng.integers(*_through(SPIKE_LENGTHS))), _sign(rng)) for t in moments]

        def step(measured: Measured) -> Measured:
            for role in roles:
                values = getattr(measured, role).copy()
                height = size * MPA * (LIFT_SPIKE if role == LIFT else 1.0)
                for moment, length, sign in spikes:
                    first = int(np.searchsorted(measured.time, moment))
                    values[first : first + length] += sign * height
                measured = changed(measured, role, values)
            return measured

        return with_step_before(bench, step)

    return apply


def random_spikes(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """Spikes of `size`, of 1 to 3 samples, at random."""
    found = values.copy()
    for first in _moments(time, SPIKES, rng):
        found[first : first + rng.integers(*_through(SPIKE_LENGTHS))] += _sign(rng) * size
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


def clipped(is_top: bool) -> Apply:
    """The amplifier's end lies `size` MPa inside what the signal does."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        low, high = float(values.min()), float(values.max())
        return np.minimum(values, high - size) if is_top else np.maximum(values, low + size)

    return before_noise(wave, MPA, LINE)


def during_energizing(role: str, scale: float) -> Apply:
    """The coil's current adds `size` while it flows."""

    def apply(bench: Bench, size: float, rng: Generator) -> Bench:
        starts, ends = energizing(bench)

        def step(measured: Measured) -> Measured:
            begun, over = (np.searchsorted(np.sort(t), measured.time, "right") for t in (starts, ends))
            return changed(measured, role, getattr(measured, role) + size * scale * (begun - over))

        return with_step_before(bench, step)

    return apply


def _through(lengths: tuple[int, int]) -> tuple[int, int]:
    return lengths[0], lengths[1] + 1


def _moments(time: Array, rate: float, rng: Generator) -> NDArray[np.int64]:
    return np.asarray(rng.integers(0, time.size, rng.poisson(rate * (time[-1] - time[0]))), np.int64)


def _sign(rng: Generator) -> float:
    return 1.0 if rng.random() < 0.5 else -1.0


_L, _R, _N, _A = Kind.LINE, Kind.RAIL, Kind.LIFT, Kind.ALL
_SHORT = (0.1, 0.2, 0.5)  # ms
_O, _F, _C = reasons.OUTLIERS, reasons.FROZEN, reasons.CLIPPED
DISTURBANCES = (
    Disturbance("spikes_at_edges", _A, "MPa", (1.0, 3.0, 10.0), edge_spikes(*ALL), _O, table=3.0),
    Disturbance("spikes_at_edges_line", _L, "MPa", (3.0,), edge_spikes(LINE), _O),
    Disturbance("spikes_at_edges_lift", _N, "MPa, 20 um per 3", (3.0,), edge_spikes(LIFT), _O),
    Disturbance("spikes_line", _L, "MPa", (3.0, 10.0), before_noise(random_spikes, MPA, LINE), _O),
    Disturbance("spikes_rail", _R, "MPa", (3.0, 10.0), before_noise(random_spikes, MPA, RAIL), _O),
    Disturbance("spikes_lift", _N, "um", (20.0, 60.0), before_noise(random_spikes, UM, LIFT), _O),
    Disturbance("frozen_line", _L, "ms", _SHORT, before_noise(frozen(HOLDS), 1e-3, LINE), _F, table=0.2),
    Disturbance("frozen_line_samples", _L, "ms", _SHORT, after_noise(frozen(HOLDS), 1e-3, LINE), _F),
    Disturbance("frozen_rail", _R, "ms", _SHORT[1:], before_noise(frozen(HOLDS), 1e-3, RAIL), _F),
    Disturbance("frozen_rail_samples", _R, "ms", _SHORT[1:], after_noise(frozen(HOLDS), 1e-3, RAIL), _F),
    Disturbance("frozen_lift", _N, "ms", _SHORT, before_noise(frozen(LIFT_HOLDS), 1e-3, LIFT), _F),
    Disturbance(
        "frozen_lift_samples",
        _N,
        "ms",
        _SHORT,
        after_noise(frozen(LIFT_HOLDS), 1e-3, LIFT),
        _F,
    ),
    Disturbance("dropouts_to_zero", _A, "samples", (2.0, 5.0), dropouts(0.0), reasons.DROPOUTS),
    Disturbance("dropouts_to_full_scale", _A, "samples", (2.0, 5.0), dropouts(1.0), reasons.DROPOUTS),
    Disturbance("line_clipped_at_the_top", _L, "MPa", (1.0, 4.0), clipped(is_top=True), _C),
    Disturbance("line_clipped_at_the_bottom", _L, "MPa", (1.0, 4.0), clipped(is_top=False), _C),
    Disturbance("energizing_on_line", _L, "MPa", (0.1, 0.3), during_energizing(LINE, MPA), reasons.SENSOR),
    Disturbance("energizing_on_lift", _N, "um", (1.0, 3.0), during_energizing(LIFT, UM), reasons.SENSOR),
)
