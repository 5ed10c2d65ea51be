"""What cables and electronics of a channel do: spikes, frozen stretches, dropouts, clipping, energizing that couples;
filters, resonance, delays, clocks, offsets, gains, few bits.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import butter, freqs

from tests.plants import plant
from tests.plants.arrays import Array
from tests.plants.plant import LIFT, LINE, RAIL, Bench, Measured
from tools.benchmarks.realism import disturbance as of
from tools.benchmarks.realism.disturbance import ALL, US, Disturbance, Kind, Reasons, of_signal
from tools.benchmarks.realism.sensors import coarse, hum

OPENING_DELAY = 0.25e-3  # s, from the start of energizing to the opening
CLOSING_DELAY = 0.30e-3  # s, from the end of energizing to the closed needle, at the most 80 % of the opening
SPIKE_LENGTHS = (1, 4)  # samples, without the last
LIFT_SPIKE = 20e-6 / 3e6  # m of a spike on the lift per Pa of one on a pressure
SPIKES = 40.0  # per s, at random
HOLDS, LIFT_HOLDS = 40.0, 200.0  # per s; a lift is seldom other than at rest
DROPOUTS = 20.0  # per s
HIGHEST_PRESSURE = plant.HIGHEST_CODE * plant.PRESSURE_STEP + plant.PRESSURE_FLOOR
HIGHEST_LIFT = plant.HIGHEST_CODE * plant.LIFT_STEP + plant.LIFT_FLOOR
FULL_SCALE = {RAIL: HIGHEST_PRESSURE, LIFT: HIGHEST_LIFT, LINE: HIGHEST_PRESSURE}
DAMPING = 0.05  # of a resonance
RANGES = {RAIL: 250e6, LINE: 250e6, LIFT: 500e-6}  # of the converters
Response = Callable[[Array], NDArray[np.complex128]]


def energizing(bench: Bench) -> tuple[Array, Array]:
    """Starts and ends [s] of the current through the coil, of every opening."""
    events = zip(bench.starts, bench.events, strict=False)
    shots = [(start + s.start, s.duration) for start, e in events for s in e.shots]
    opening, duration = np.array(shots, np.float64).T
    return opening - OPENING_DELAY, opening + duration - np.minimum(CLOSING_DELAY, 0.8 * duration)


def edge_spikes(*roles: str) -> of.Apply:
    """Spikes of `size` MPa, on the lift in proportion, of 1 to 3 samples at every edge of the energizing."""

    def apply(bench: Bench, size: float, rng: Generator) -> Bench:
        moments = np.sort(np.concatenate(energizing(bench)))
        spikes = [(t, int(rng.integers(*SPIKE_LENGTHS)), of.sign(rng)) for t in moments]

        def step(measured: Measured) -> Measured:
            for role in roles:
                values = getattr(measured, role).copy()
                height = size * of.MPA * (LIFT_SPIKE if role == LIFT else 1.0)
                for moment, length, way in spikes:
                    first = int(np.searchsorted(measured.time, moment))
                    values[first : first + length] += way * height
                measured = of.changed(measured, role, values)
            return measured

        return of.with_step_before(bench, step)

    return apply


def random_spikes(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """Spikes of `size`, of 1 to 3 samples, at random."""
    found = values.copy()
    for first in _moments(time, SPIKES, rng):
        found[first : first + rng.integers(*SPIKE_LENGTHS)] += of.sign(rng) * size
    return found


def frozen(rate: float) -> of.Wave:
    """Held for `size` [s], now and then [1/s]: by a sample-and-hold ahead of the noise, or by repeated samples."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        found, length = values.copy(), round(size / (time[1] - time[0]))
        for first in _moments(time, rate, rng):
            found[first : first + length] = found[first]
        return found

    return wave


def dropouts(level: float) -> of.Apply:
    """A level for `size` samples, now and then."""

    def on(role: str) -> of.Apply:
        def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
            found = values.copy()
            for first in _moments(time, DROPOUTS, rng):
                found[first : first + round(size)] = level * FULL_SCALE[role]
            return found

        return of.after_noise(wave, 1.0, role)

    return of.in_order(*(on(role) for role in ALL))


def _moments(time: Array, rate: float, rng: Generator) -> NDArray[np.int64]:
    return np.asarray(rng.integers(0, time.size, rng.poisson(rate * (time[-1] - time[0]))), np.int64)


def clipped_high(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """The amplifier's end lies `size` inside what the signal does."""
    return np.minimum(values, float(values.max()) - size)


def clipped_low(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """The same of its other end."""
    return np.maximum(values, float(values.min()) + size)


def during_energizing(role: str, scale: float) -> of.Apply:
    """The coil's current adds `size` while it flows."""

    def current(bench: Bench, size: float, rng: Generator) -> Callable[[Measured], Array]:
        starts, ends = (np.sort(moments) for moments in energizing(bench))

        def added(measured: Measured) -> Array:
            begun, over = (np.searchsorted(t, measured.time, "right") for t in (starts, ends))
            return np.asarray(size * scale * (begun - over), np.float64)

        return added

    return of.adding(role, current)


def filtered(values: Array, interval: float, response: Response) -> Array:
    """A signal through an analog filter by its response at frequencies [Hz]; it was at rest before and after."""
    tail = np.linspace(values[-1], values[0], values.size)  # back to the start, so that nothing jumps
    whole = np.concatenate((values, tail))
    frequencies = np.asarray(np.fft.rfftfreq(whole.size, interval), np.float64)
    spectrum: NDArray[np.complex128] = np.fft.rfft(whole)
    spectrum *= response(frequencies)
    return np.asarray(np.fft.irfft(spectrum, whole.size)[: values.size], np.float64)


def butterworth(order: int, corner: float) -> Response:
    """Of this order and corner [Hz]."""
    b, a = butter(order, 2.0 * math.pi * corner, analog=True)
    return lambda frequency: freqs(b, a, 2.0 * math.pi * frequency)[1]


def butterworth_delay(order: int, corner: float) -> float:
    """Its delay of slow signals [s]: the sum of 1/Q over its corner."""
    angles = math.pi * (2.0 * np.arange(order) + 1.0) / (2.0 * order)
    return float(np.sum(np.sin(angles)) / (2.0 * math.pi * corner))


def resonance(frequency: float, damping: float = DAMPING) -> Response:
    """A weakly damped sensor [Hz]."""

    def response(f: Array) -> NDArray[np.complex128]:
        s = 1j * f / frequency
        return np.asarray(1.0 / (1.0 + 2.0 * damping * s + s * s), np.complex128)

    return response


def through(response_of: Callable[[float], Response]) -> of.Wave:
    """A signal through a filter, whose corner is the size [Hz]."""
    return lambda time, values, size, rng: filtered(values, float(time[1] - time[0]), response_of(size))


def low_pass(order: int) -> of.Wave:
    """A Butterworth filter: ahead of the noise, which is then the converter's, or after it, which it colours."""
    return through(lambda corner: butterworth(order, corner))


def stated_low_pass(order: int, role: str) -> Callable[[float], of.Stated]:
    """What the bench file says of it, its corner in kHz."""
    return lambda size: {role: {of.DELAY: butterworth_delay(order, size * of.KHZ) / US}}


def late(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """The values of `size` [s] before."""
    return np.interp(time - size, time, values)


def late_line(bench: Bench, size: float, rng: Generator) -> Bench:
    """The line pressure is recorded `size` us late, as exactly as the plant."""
    return of.with_faults_set(bench, channel_skew=size * US)


def stated_delay(role: str) -> Callable[[float], of.Stated]:
    """What the bench file says of it."""
    return lambda size: {role: {of.DELAY: size}}


def jitter(bench: Bench, size: float, rng: Generator) -> Bench:
    """All channels are sampled at moments `size` us (one sigma) off."""
    seed = int(rng.integers(2**62))

    def wave(time: Array, values: Array, size: float, _: Generator) -> Array:
        moments = time + np.random.default_rng(seed).normal(0.0, size, time.size)
        return np.interp(moments, time, values)

    return of.before_noise(wave, US, *ALL)(bench, size, rng)


def gain(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """Too much or too little by `size` (share)."""
    return values * (1.0 + of.sign(rng) * size)


def few_bits(role: str) -> of.Apply:
    """A converter of `size` bits over its range."""
    return of.after_noise(
        lambda time, values, size, rng: coarse(time, values, RANGES[role] / 2.0**size, rng), 1.0, role
    )


_A, _T, _CORNERS, _SHORT = Kind.ALL, Kind.TIMING, (10.0, 20.0, 40.0), (0.1, 0.2, 0.5)  # kHz, ms
_O, _F, _C, _S = Reasons.OUTLIERS, Reasons.FROZEN, Reasons.CLIPPED, Reasons.SENSOR
_LATE, _LATE_LINE, _LATE_LIFT = Reasons.LATE, Reasons.LATE_LINE, Reasons.LATE_LIFT
_LP2, _LP4 = low_pass(2), low_pass(4)
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
    of_signal("line_clipped_at_the_top", LINE, "MPa", (1.0, 4.0), clipped_high, _C),
    of_signal("line_clipped_at_the_bottom", LINE, "MPa", (1.0, 4.0), clipped_low, _C),
    Disturbance("energizing_on_line", Kind.LINE, "MPa", (0.1, 0.3), during_energizing(LINE, of.MPA), _S),
    Disturbance("energizing_on_lift", Kind.LIFT, "um", (1.0, 3.0), during_energizing(LIFT, of.UM), _S),
    Disturbance("anti_alias_2_all", _A, "kHz", _CORNERS, of.before_noise(_LP2, of.KHZ, *ALL)),
    Disturbance("anti_alias_4_all", _A, "kHz", _CORNERS, of.before_noise(_LP4, of.KHZ, *ALL)),
    Disturbance("anti_alias_2_all_with_noise", _A, "kHz", _CORNERS, of.after_noise(_LP2, of.KHZ, *ALL)),
    of_signal("anti_alias_2_line_with_noise", LINE, "kHz", (20.0, 40.0), _LP2, _LATE_LINE, after=True),
    of_signal("anti_alias_2_lift_with_noise", LIFT, "kHz", (20.0, 40.0), _LP2, _LATE_LIFT, after=True),
    of_signal("anti_alias_2_line", LINE, "kHz", _CORNERS, _LP2, _LATE_LINE, stated=stated_low_pass(2, LINE)),
    of_signal(
        "anti_alias_4_line", LINE, "kHz", (20.0, 40.0), _LP4, _LATE_LINE, stated=stated_low_pass(4, LINE)
    ),
    of_signal("anti_alias_2_rail", RAIL, "kHz", (10.0, 20.0), _LP2, _LATE, stated=stated_low_pass(2, RAIL)),
    of_signal("anti_alias_2_lift", LIFT, "kHz", _CORNERS, _LP2, _LATE_LIFT, stated=stated_low_pass(2, LIFT)),
    of_signal("resonance_line", LINE, "kHz", (25.0, 40.0), through(resonance), _S),
    Disturbance("late_line", _T, "us", (10.0, 20.0), late_line, _LATE_LINE, stated=stated_delay(LINE)),
    of_signal("late_lift", LIFT, "us", (10.0, 20.0), late, _LATE_LIFT, kind=_T, stated=stated_delay(LIFT)),
    of_signal("late_rail", RAIL, "us", (10.0, 20.0), late, _LATE, kind=_T, stated=stated_delay(RAIL)),
    Disturbance("jitter", _T, "us", (0.5, 2.0), jitter, _LATE),
    of_signal("offset_drift_line", LINE, "MPa, 0.4 Hz", (0.1, 0.3, 1.0), hum(0.4), Reasons.OFFSET),
    of_signal("offset_drift_rail", RAIL, "MPa, 0.4 Hz", (0.1, 0.3, 1.0), hum(0.4), Reasons.OFFSET),
    of_signal("gain_line", LINE, "%", (0.5, 1.0, 2.0), gain, Reasons.OFFSET),
    of_signal("gain_rail", RAIL, "%", (0.5, 1.0), gain, Reasons.OFFSET),
    Disturbance("few_bits", _A, "bits", (12.0, 10.0), of.in_order(*map(few_bits, ALL))),
)
