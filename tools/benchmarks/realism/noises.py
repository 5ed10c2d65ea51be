"""Hum, colour, pink noise, louder noise, bursts."""

import math

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from tools.benchmarks.arrays import Array
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
    before_noise,
    in_order,
)
from tools.benchmarks.sampling import LIFT_NOISE, LINE_NOISE, RAIL_NOISE

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


_L, _R, _N, _A = Kind.LINE, Kind.RAIL, Kind.LIFT, Kind.ALL
DISTURBANCES = (
    Disturbance("none", _A, "", (0.0,), lambda bench, size, rng: bench),
    Disturbance(
        "hum_50_hz_line",
        _L,
        "MPa",
        (0.1, 0.2, 0.5),
        before_noise(hum(50.0), MPA, LINE),
        reasons.SENSOR,
        table=0.2,
    ),
    Disturbance(
        "hum_150_hz_line", _L, "MPa", (0.1, 0.3), before_noise(hum(150.0), MPA, LINE), reasons.SENSOR
    ),
    Disturbance("hum_50_hz_rail", _R, "MPa", (0.1, 0.3), before_noise(hum(50.0), MPA, RAIL), reasons.SENSOR),
    Disturbance(
        "hum_150_hz_rail", _R, "MPa", (0.1, 0.3), before_noise(hum(150.0), MPA, RAIL), reasons.SENSOR
    ),
    Disturbance("hum_50_hz_lift", _N, "um", (1.0, 3.0), before_noise(hum(50.0), UM, LIFT), reasons.SENSOR),
    Disturbance(
        "coloured_300_hz_line",
        _L,
        "MPa",
        (0.1, 0.2),
        before_noise(coloured(300.0), MPA, LINE),
        reasons.SENSOR,
    ),
    Disturbance(
        "coloured_3_khz_line",
        _L,
        "MPa",
        (0.1, 0.2, 0.4),
        before_noise(coloured(3e3), MPA, LINE),
        reasons.SENSOR,
        table=0.2,
    ),
    Disturbance(
        "coloured_10_khz_line", _L, "MPa", (0.2, 0.4), before_noise(coloured(1e4), MPA, LINE), reasons.SENSOR
    ),
    Disturbance(
        "coloured_300_hz_rail",
        _R,
        "MPa",
        (0.1, 0.2),
        before_noise(coloured(300.0), MPA, RAIL),
        reasons.SENSOR,
    ),
    Disturbance(
        "coloured_3_khz_rail", _R, "MPa", (0.1, 0.2), before_noise(coloured(3e3), MPA, RAIL), reasons.SENSOR
    ),
    Disturbance(
        "coloured_3_khz_lift", _N, "um", (0.4, 1.0), before_noise(coloured(3e3), UM, LIFT), reasons.SENSOR
    ),
    Disturbance("pink_line", _L, "MPa", (0.1, 0.2), before_noise(pink, MPA, LINE), reasons.SENSOR),
    Disturbance("pink_rail", _R, "MPa", (0.1, 0.2), before_noise(pink, MPA, RAIL), reasons.SENSOR),
    Disturbance("noise", _A, "times", (2.0, 3.0, 5.0), in_order(*(louder(r) for r in ALL)), table=3.0),
    Disturbance("noise_line", _L, "times", (3.0, 6.0), louder(LINE)),
    Disturbance("noise_rail", _R, "times", (3.0, 6.0), louder(RAIL)),
    Disturbance("noise_lift", _N, "times", (3.0, 6.0), louder(LIFT), reasons.SENSOR),
    Disturbance("noise_from_half_way", _A, "times", (2.0, 3.0), in_order(*(louder(r, 0.5) for r in ALL))),
    Disturbance(
        "noise_bursts_line", _L, "MPa", (0.5, 1.5), before_noise(bursts, MPA, LINE), reasons.OUTLIERS
    ),
)
