"""Hum, colour, pink noise, louder noise, bursts."""

import math

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant import LIFT_NOISE, LINE_NOISE, RAIL_NOISE
from tools.benchmarks.realism.disturbance import (
    ALL,
    LIFT,
    LINE,
    RAIL,
    Apply,
    Disturbance,
    Kind,
    Reasons,
    Wave,
    before_noise,
    in_order,
    of_signal,
)

NOISE = {RAIL: RAIL_NOISE, LIFT: LIFT_NOISE, LINE: LINE_NOISE}  # of the plant, per sample
BURST, BURSTS = 2e-3, 8.0  # s; per s


def hum(frequency: float) -> Wave:
    """A sinusoid [Hz] of the size as amplitude, its phase by chance."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        return values + size * np.sin(2.0 * math.pi * (frequency * time + rng.random()))

    return wave


def coloured(corner: float) -> Wave:
    """Noise through a first-order filter [Hz]; the size is its standard deviation."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        pole = math.exp(-2.0 * math.pi * corner * (time[1] - time[0]))
        drive = rng.normal(0.0, size * math.sqrt(1.0 - pole * pole), time.size)
        drive[0] = rng.normal(0.0, size)
        return values + np.asarray(lfilter([1.0], [1.0, -pole], drive), np.float64)

    return wave


def pink(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """Noise whose power falls with the frequency, from 2 Hz on; the size is its standard deviation."""
    frequency = np.fft.rfftfreq(time.size, float(time[1] - time[0]))
    shape = np.where(frequency >= 2.0, 1.0 / np.sqrt(np.maximum(frequency, 2.0)), 0.0)
    noise = np.fft.irfft(shape * np.fft.rfft(rng.normal(size=time.size)), time.size)
    return values + np.asarray(size * noise / np.std(noise), np.float64)


def louder(role: str, since: float = 0.0) -> Apply:
    """Noise of the plant's kind, `size` times it together with it, from a share of the recording on."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        extra = rng.normal(0.0, NOISE[role] * math.sqrt(size * size - 1.0), time.size)
        return values + np.where(np.arange(time.size) >= since * time.size, extra, 0.0)

    return before_noise(wave, 1.0, role)


def bursts(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """White noise of the size, now and then."""
    length = round(BURST / (time[1] - time[0]))
    found = values.copy()
    for first in rng.integers(0, time.size - length, rng.poisson(BURSTS * (time[-1] - time[0]))):
        found[first : first + length] += rng.normal(0.0, size, length)
    return found


_S = Reasons.SENSOR
DISTURBANCES = (
    Disturbance("none", Kind.ALL, "", (0.0,), lambda bench, size, rng: bench),
    of_signal("hum_50_hz_line", LINE, "MPa", (0.1, 0.2, 0.5), hum(50.0), _S, table=0.2),
    of_signal("hum_150_hz_line", LINE, "MPa", (0.1, 0.3), hum(150.0), _S),
    of_signal("hum_50_hz_rail", RAIL, "MPa", (0.1, 0.3), hum(50.0), _S),
    of_signal("hum_150_hz_rail", RAIL, "MPa", (0.1, 0.3), hum(150.0), _S),
    of_signal("hum_50_hz_lift", LIFT, "um", (1.0, 3.0), hum(50.0), _S),
    of_signal("coloured_300_hz_line", LINE, "MPa", (0.1, 0.2), coloured(300.0), _S),
    of_signal("coloured_3_khz_line", LINE, "MPa", (0.1, 0.2, 0.4), coloured(3e3), _S, table=0.2),
    of_signal("coloured_10_khz_line", LINE, "MPa", (0.2, 0.4), coloured(1e4), _S),
    of_signal("coloured_300_hz_rail", RAIL, "MPa", (0.1, 0.2), coloured(300.0), _S),
    of_signal("coloured_3_khz_rail", RAIL, "MPa", (0.1, 0.2), coloured(3e3), _S),
    of_signal("coloured_3_khz_lift", LIFT, "um", (0.4, 1.0), coloured(3e3), _S),
    of_signal("pink_line", LINE, "MPa", (0.1, 0.2), pink, _S),
    of_signal("pink_rail", RAIL, "MPa", (0.1, 0.2), pink, _S),
    Disturbance("noise", Kind.ALL, "times", (2.0, 3.0, 5.0), in_order(*map(louder, ALL)), table=3.0),
    Disturbance("noise_line", Kind.LINE, "times", (3.0, 6.0), louder(LINE)),
    Disturbance("noise_rail", Kind.RAIL, "times", (3.0, 6.0), louder(RAIL)),
    Disturbance("noise_lift", Kind.LIFT, "times", (3.0, 6.0), louder(LIFT), _S),
    Disturbance(
        "noise_from_half_way", Kind.ALL, "times", (2.0, 3.0), in_order(*(louder(r, 0.5) for r in ALL))
    ),
    of_signal("noise_bursts_line", LINE, "MPa", (0.5, 1.5), bursts, Reasons.OUTLIERS),
)
