"""Hum, colour, louder noise, bursts on signals; and what lift sensors do: drift, creep, lag, crosstalk."""

import math

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from tests.plants.arrays import Array
from tests.plants.plant import LIFT, LIFT_NOISE, LINE, LINE_NOISE, RAIL, RAIL_NOISE, Bench
from tools.benchmarks.realism import disturbance as of
from tools.benchmarks.realism.disturbance import ALL, Disturbance, Kind, Reasons, of_signal, sign

NOISE = {RAIL: RAIL_NOISE, LIFT: LIFT_NOISE, LINE: LINE_NOISE}  # of the plant, per sample
BURST, BURSTS = 2e-3, 8.0  # s; per s
REFERENCE = 100e6  # Pa, at which a lift with crosstalk of the whole pressure was set to 0
CREEP, CREEP_TIME = 3e-3, 15e-3  # s: how fast it comes while open, and goes
FULL_LIFT = 300e-6  # m
STEP_AT = 10  # event (from 0) before which the zero steps


def hum(frequency: float) -> of.Wave:
    """A sinusoid [Hz] of the size as amplitude, its phase by chance."""
    return lambda time, values, size, rng: (
        values + size * np.sin(2.0 * math.pi * (frequency * time + rng.random()))
    )


def coloured(corner: float) -> of.Wave:
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


def louder(role: str, since: float = 0.0) -> of.Apply:
    """Noise of the plant's kind, `size` times it together with it, from a share of the recording on."""

    def wave(time: Array, values: Array, size: float, rng: Generator) -> Array:
        extra = rng.normal(0.0, NOISE[role] * math.sqrt(size * size - 1.0), time.size)
        return values + np.where(np.arange(time.size) >= since * time.size, extra, 0.0)

    return of.before_noise(wave, 1.0, role)


def bursts(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """White noise of the size, now and then."""
    length = round(BURST / (time[1] - time[0]))
    found = values.copy()
    for first in rng.integers(0, time.size - length, rng.poisson(BURSTS * (time[-1] - time[0]))):
        found[first : first + length] += rng.normal(0.0, size, length)
    return found


def drift(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """The zero moves on, `size` a second, either way."""
    moved: Array = values + sign(rng) * size * time
    return moved


def gain_drift(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """The scale moves by `size` (share) over the recording."""
    moved: Array = values * (1.0 + sign(rng) * size * time / time[-1])
    return moved


def curved(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """Not straight between 0 and the stop: `size` (share of the full lift) too much or too little in the middle."""
    share = values / FULL_LIFT
    return values + sign(rng) * size * FULL_LIFT * 4.0 * share * (1.0 - share)


def creep(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """After an opening the zero is off by up to `size`, and comes back slowly."""
    interval = float(time[1] - time[0])
    rise, decay = 1.0 - math.exp(-interval / CREEP), math.exp(-interval / CREEP_TIME)
    seen = np.asarray(lfilter([rise], [1.0, -decay], values / FULL_LIFT), np.float64)
    return values + sign(rng) * size * np.minimum(seen, 1.0)


def coarse(time: Array, values: Array, size: float, rng: Generator) -> Array:
    """In steps of `size`."""
    return np.asarray(size * np.rint(values / size), np.float64)


def zero_steps(bench: Bench, size: float, rng: Generator) -> Bench:
    """The zero is another one from the middle of the recording on."""
    moment, offset = bench.starts[STEP_AT] - 2e-3, sign(rng) * size * of.UM
    step = of.adding(LIFT, lambda *_: lambda m: np.where(m.time >= moment, offset, 0.0))
    return step(bench, size, rng)


def time_constant(corner: float) -> float:
    """Of a first-order filter [s] by its corner [kHz]."""
    return 1.0 / (2.0 * math.pi * corner * of.KHZ)


def lag(bench: Bench, size: float, rng: Generator) -> Bench:
    """A first-order filter [kHz], as exact as the plant."""
    return of.with_faults_set(bench, lift_sensor_lag=time_constant(size))


# um per 10 MPa: by which the line pressure differs from the rail's; of itself, the zero moves with the rail's
crosstalk = of.adding(
    LIFT, lambda _, size, __: lambda m: size * of.UM / 10e6 * (m.line_pressure - m.rail_pressure)
)
whole_crosstalk = of.adding(
    LIFT, lambda _, size, __: lambda m: size * of.UM / 10e6 * (m.line_pressure - REFERENCE)
)

_S, _ZERO = Reasons.SENSOR, Reasons.LIFT_ZERO
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
    Disturbance("noise", Kind.ALL, "times", (2.0, 3.0, 5.0), of.in_order(*map(louder, ALL)), table=3.0),
    Disturbance("noise_line", Kind.LINE, "times", (3.0, 6.0), louder(LINE)),
    Disturbance("noise_rail", Kind.RAIL, "times", (3.0, 6.0), louder(RAIL)),
    Disturbance("noise_lift", Kind.LIFT, "times", (3.0, 6.0), louder(LIFT), _S),
    Disturbance(
        "noise_from_half_way", Kind.ALL, "times", (2.0, 3.0), of.in_order(*(louder(r, 0.5) for r in ALL))
    ),
    of_signal("noise_bursts_line", LINE, "MPa", (0.5, 1.5), bursts, Reasons.OUTLIERS),
    of_signal("lift_zero_sine", LIFT, "um, 1.5 Hz", (1.0, 3.0, 8.0), hum(1.5), _ZERO, table=3.0),
    of_signal("lift_zero_ramp", LIFT, "um/s", (2.0, 10.0), drift, _ZERO),
    Disturbance("lift_zero_step", Kind.LIFT, "um", (2.0, 6.0), zero_steps, _ZERO | Reasons.CHANGE),
    of_signal("lift_creep", LIFT, "um", (1.0, 3.0), creep, _ZERO),
    Disturbance(
        "lift_filter",
        Kind.LIFT,
        "kHz",
        (20.0, 10.0, 5.0, 3.0),
        lag,
        Reasons.LATE_LIFT,
        table=10.0,
        stated=lambda size: {LIFT: {of.LAG: time_constant(size) / of.US}},
    ),
    of_signal("lift_gain_drift", LIFT, "%", (1.0, 3.0), gain_drift, _S),
    of_signal("lift_curved", LIFT, "%", (1.0, 3.0), curved, _S),
    Disturbance("lift_crosstalk", Kind.LIFT, "um per 10 MPa", (0.5, 1.5, 3.0), crosstalk, _ZERO, table=1.5),
    Disturbance("lift_crosstalk_whole", Kind.LIFT, "um per 10 MPa", (0.5, 1.5), whole_crosstalk, _ZERO),
    of_signal("lift_coarse", LIFT, "um", (1.0, 3.0), coarse, _S, after=True),
)
