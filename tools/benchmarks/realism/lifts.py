"""What lift sensors do: drift, creep, lag, crosstalk, coarse steps."""

import math

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant import Bench, Measured
from tools.benchmarks.realism.disturbance import (
    KHZ,
    LAG,
    LIFT,
    UM,
    US,
    Disturbance,
    Kind,
    Reasons,
    Stated,
    changed,
    of_signal,
    sign,
    with_faults_set,
    with_step_before,
)
from tools.benchmarks.realism.noises import hum

REFERENCE = 100e6  # Pa, at which a lift with crosstalk of the whole pressure was set to 0
CREEP, CREEP_TIME = 3e-3, 15e-3  # s: how fast it comes while open, and goes
FULL_LIFT = 300e-6  # m
STEP_AT = 10  # event (from 0) before which the zero steps


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
    moment, offset = bench.starts[STEP_AT] - 2e-3, sign(rng) * size * UM

    def step(measured: Measured) -> Measured:
        return changed(measured, LIFT, measured.needle_lift + np.where(measured.time >= moment, offset, 0.0))

    return with_step_before(bench, step)


def lag(bench: Bench, size: float, rng: Generator) -> Bench:
    """A first-order filter [kHz], as exact as the plant."""
    return with_faults_set(bench, lift_sensor_lag=1.0 / (2.0 * math.pi * size * KHZ))


def stated_lag(size: float) -> Stated:
    """What the bench file says of it."""
    return {LIFT: {LAG: 1.0 / (2.0 * math.pi * size * KHZ) / US}}


def crosstalk(bench: Bench, size: float, rng: Generator) -> Bench:
    """`size` um per 10 MPa by which the line pressure differs from the rail pressure."""

    def step(measured: Measured) -> Measured:
        swing = measured.line_pressure - measured.rail_pressure
        return changed(measured, LIFT, measured.needle_lift + size * UM / 10e6 * swing)

    return with_step_before(bench, step)


def whole_crosstalk(bench: Bench, size: float, rng: Generator) -> Bench:
    """`size` um per 10 MPa of the line pressure itself: with the rail pressure the zero moves."""

    def step(measured: Measured) -> Measured:
        whole = measured.line_pressure - REFERENCE
        return changed(measured, LIFT, measured.needle_lift + size * UM / 10e6 * whole)

    return with_step_before(bench, step)


_N, _S, _ZERO = Kind.LIFT, Reasons.SENSOR, Reasons.LIFT_ZERO
DISTURBANCES = (
    of_signal("lift_zero_sine", LIFT, "um, 1.5 Hz", (1.0, 3.0, 8.0), hum(1.5), _ZERO, table=3.0),
    of_signal("lift_zero_ramp", LIFT, "um/s", (2.0, 10.0), drift, _ZERO),
    Disturbance("lift_zero_step", _N, "um", (2.0, 6.0), zero_steps, _ZERO | Reasons.CHANGE),
    of_signal("lift_creep", LIFT, "um", (1.0, 3.0), creep, _ZERO),
    Disturbance(
        "lift_filter",
        _N,
        "kHz",
        (20.0, 10.0, 5.0, 3.0),
        lag,
        Reasons.LATE_LIFT,
        table=10.0,
        stated=stated_lag,
    ),
    of_signal("lift_gain_drift", LIFT, "%", (1.0, 3.0), gain_drift, _S),
    of_signal("lift_curved", LIFT, "%", (1.0, 3.0), curved, _S),
    Disturbance("lift_crosstalk", _N, "um per 10 MPa", (0.5, 1.5, 3.0), crosstalk, _ZERO, table=1.5),
    Disturbance("lift_crosstalk_whole", _N, "um per 10 MPa", (0.5, 1.5), whole_crosstalk, _ZERO),
    of_signal("lift_coarse", LIFT, "um", (1.0, 3.0), coarse, _S, after=True),
)
