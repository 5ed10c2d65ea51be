"""What a channel's electronics do: filters, resonance, delays, clocks, offsets, gains, few bits."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import butter, freqs

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant import Bench
from tools.benchmarks.plant_parameters import Faults
from tools.benchmarks.realism import reasons
from tools.benchmarks.realism.disturbance import (
    ALL,
    DELAY,
    KHZ,
    LIFT,
    LINE,
    MPA,
    RAIL,
    US,
    Apply,
    Disturbance,
    Kind,
    Stated,
    Wave,
    after_noise,
    before_noise,
    in_order,
)
from tools.benchmarks.realism.noises import hum

DAMPING = 0.05  # of a resonance
RANGES = {RAIL: 250e6, LINE: 250e6, LIFT: 500e-6}  # of the converters
Response = Callable[[Array], NDArray[np.complex128]]


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


def through(response_of: Callable[[float], Response]) -> Wave:
    """A signal through a filter, whose corner is the size [Hz]."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        return filtered(values, float(time[1] - time[0]), response_of(size))

    return wave


def anti_alias(order: int, *roles: str) -> Apply:
    """Butterworth filters of `size` kHz; the noise is that of the converters behind them."""
    return before_noise(through(lambda corner: butterworth(order, corner)), KHZ, *roles)


def with_noise_filtered(order: int, *roles: str) -> Apply:
    """The same of sensors whose noise passes the filters, too, and is coloured by them."""
    return after_noise(through(lambda corner: butterworth(order, corner)), KHZ, *roles)


def stated_anti_alias(order: int, role: str) -> Callable[[float], Stated]:
    """What the bench file says of it."""
    return lambda size: {role: {DELAY: butterworth_delay(order, size * KHZ) / US}}


def late(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """The values of `size` [s] before."""
    return np.interp(time - size, time, values)


def late_line(bench: Bench, size: float, rng: Generator) -> Bench:
    """The line pressure is recorded `size` us late, as exactly as the plant."""

    def with_skew(faults: Faults) -> Faults:
        return faults._replace(channel_skew=size * US)

    return replace(bench, events=tuple(replace(e, faults=with_skew(e.faults)) for e in bench.events))


def stated_delay(role: str) -> Callable[[float], Stated]:
    """What the bench file says of it."""
    return lambda size: {role: {DELAY: size}}


def jitter(bench: Bench, size: float, rng: Generator) -> Bench:
    """All channels are sampled at moments `size` us (one sigma) off."""
    seed = int(rng.integers(2**62))

    def wave(time: Array, values: Array, size: float, _: Generator) -> Array:
        moments = time + np.random.default_rng(seed).normal(0.0, size, time.size)
        return np.interp(moments, time, values)

    return before_noise(wave, US, *ALL)(bench, size, rng)


def gain(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """Too much or too little by `size` (share)."""
    return values * (1.0 + (size if rng.random() < 0.5 else -size))


def few_bits(role: str) -> Apply:
    """A converter of `size` bits over its range."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        step = RANGES[role] / 2.0**size
        return np.asarray(step * np.rint(values / step), np.float64)

    return after_noise(wave, 1.0, role)


_L, _R, _N, _A, _T = Kind.LINE, Kind.RAIL, Kind.LIFT, Kind.ALL, Kind.TIMING
_LATE_LINE, _LATE_LIFT = reasons.LATE_LINE, reasons.LATE_LIFT
_CORNERS = (10.0, 20.0, 40.0)
DISTURBANCES = (
    Disturbance("anti_alias_2_all", _A, "kHz", _CORNERS, anti_alias(2, *ALL)),
    Disturbance("anti_alias_4_all", _A, "kHz", _CORNERS, anti_alias(4, *ALL)),
    Disturbance("anti_alias_2_all_with_noise", _A, "kHz", _CORNERS, with_noise_filtered(2, *ALL)),
    Disturbance(
        "anti_alias_2_line_with_noise", _L, "kHz", (20.0, 40.0), with_noise_filtered(2, LINE), _LATE_LINE
    ),
    Disturbance(
        "anti_alias_2_lift_with_noise", _N, "kHz", (20.0, 40.0), with_noise_filtered(2, LIFT), _LATE_LIFT
    ),
    Disturbance(
        "anti_alias_2_line",
        _L,
        "kHz",
        _CORNERS,
        anti_alias(2, LINE),
        _LATE_LINE,
        stated=stated_anti_alias(2, LINE),
    ),
    Disturbance(
        "anti_alias_4_line",
        _L,
        "kHz",
        (20.0, 40.0),
        anti_alias(4, LINE),
        _LATE_LINE,
        stated=stated_anti_alias(4, LINE),
    ),
    Disturbance(
        "anti_alias_2_rail",
        _R,
        "kHz",
        (10.0, 20.0),
        anti_alias(2, RAIL),
        reasons.LATE,
        stated=stated_anti_alias(2, RAIL),
    ),
    Disturbance(
        "anti_alias_2_lift",
        _N,
        "kHz",
        _CORNERS,
        anti_alias(2, LIFT),
        _LATE_LIFT,
        stated=stated_anti_alias(2, LIFT),
    ),
    Disturbance(
        "resonance_line",
        _L,
        "kHz",
        (25.0, 40.0),
        before_noise(through(resonance), KHZ, LINE),
        reasons.SENSOR,
    ),
    Disturbance("late_line", _T, "us", (10.0, 20.0), late_line, _LATE_LINE, stated=stated_delay(LINE)),
    Disturbance(
        "late_lift",
        _T,
        "us",
        (10.0, 20.0),
        before_noise(late, US, LIFT),
        _LATE_LIFT,
        stated=stated_delay(LIFT),
    ),
    Disturbance(
        "late_rail",
        _T,
        "us",
        (10.0, 20.0),
        before_noise(late, US, RAIL),
        reasons.LATE,
        stated=stated_delay(RAIL),
    ),
    Disturbance("jitter", _T, "us", (0.5, 2.0), jitter, reasons.LATE),
    Disturbance(
        "offset_drift_line",
        _L,
        "MPa, 0.4 Hz",
        (0.1, 0.3, 1.0),
        before_noise(hum(0.4), MPA, LINE),
        reasons.OFFSET,
    ),
    Disturbance(
        "offset_drift_rail",
        _R,
        "MPa, 0.4 Hz",
        (0.1, 0.3, 1.0),
        before_noise(hum(0.4), MPA, RAIL),
        reasons.OFFSET,
    ),
    Disturbance("gain_line", _L, "%", (0.5, 1.0, 2.0), before_noise(gain, 0.01, LINE), reasons.OFFSET),
    Disturbance("gain_rail", _R, "%", (0.5, 1.0), before_noise(gain, 0.01, RAIL), reasons.OFFSET),
    Disturbance("few_bits", _A, "bits", (12.0, 10.0), in_order(*(few_bits(role) for role in ALL))),
)
