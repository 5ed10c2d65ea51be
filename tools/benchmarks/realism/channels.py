"""What a channel's electronics do: filters, resonance, delays, clocks, offsets, gains, few bits."""

import math
from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import butter, freqs

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant import Bench
from tools.benchmarks.realism.disturbance import (
    ALL,
    DELAY,
    KHZ,
    LIFT,
    LINE,
    RAIL,
    US,
    Apply,
    Disturbance,
    Kind,
    Reasons,
    Stated,
    Wave,
    after_noise,
    before_noise,
    in_order,
    of_signal,
    with_faults_set,
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


def low_pass(order: int) -> Wave:
    """A Butterworth filter: ahead of the noise, which is then the converter's, or after it, which it colours."""
    return through(lambda corner: butterworth(order, corner))


def stated_low_pass(order: int, role: str) -> Callable[[float], Stated]:
    """What the bench file says of it, its corner in kHz."""
    return lambda size: {role: {DELAY: butterworth_delay(order, size * KHZ) / US}}


def late(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """The values of `size` [s] before."""
    return np.interp(time - size, time, values)


def late_line(bench: Bench, size: float, rng: Generator) -> Bench:
    """The line pressure is recorded `size` us late, as exactly as the plant."""
    return with_faults_set(bench, channel_skew=size * US)


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


_A, _T, _CORNERS, _S, _O = Kind.ALL, Kind.TIMING, (10.0, 20.0, 40.0), Reasons.SENSOR, Reasons.OFFSET
_LATE, _LATE_LINE, _LATE_LIFT = Reasons.LATE, Reasons.LATE_LINE, Reasons.LATE_LIFT
_LP2, _LP4 = low_pass(2), low_pass(4)
DISTURBANCES = (
    Disturbance("anti_alias_2_all", _A, "kHz", _CORNERS, before_noise(_LP2, KHZ, *ALL)),
    Disturbance("anti_alias_4_all", _A, "kHz", _CORNERS, before_noise(_LP4, KHZ, *ALL)),
    Disturbance("anti_alias_2_all_with_noise", _A, "kHz", _CORNERS, after_noise(_LP2, KHZ, *ALL)),
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
    of_signal("offset_drift_line", LINE, "MPa, 0.4 Hz", (0.1, 0.3, 1.0), hum(0.4), _O),
    of_signal("offset_drift_rail", RAIL, "MPa, 0.4 Hz", (0.1, 0.3, 1.0), hum(0.4), _O),
    of_signal("gain_line", LINE, "%", (0.5, 1.0, 2.0), gain, _O),
    of_signal("gain_rail", RAIL, "%", (0.5, 1.0), gain, _O),
    Disturbance("few_bits", _A, "bits", (12.0, 10.0), in_order(*map(few_bits, ALL))),
)
