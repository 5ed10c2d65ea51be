"""The oracle: the true model with any effect on recordings, by whitened innovations: which effects could be seen?

It also judges whether two, each at its best, can be distinguished. Imports nothing of `observer_rt`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are
from scipy.optimize import least_squares

from tests.plants import equations, plant
from tests.plants.arrays import Array
from tests.plants.parameters import Faults, Injector, with_faults
from tools.benchmarks.discovery.kinds import HiddenKind
from tools.benchmarks.discovery.rigs import RATE_GAIN, RATE_NOISE, measured_rate
from tools.benchmarks.discovery.vocabulary import HIDDEN

INTERVAL = 1.0 / plant.SAMPLE_RATE  # s
LEAD, TAIL = 1e-3, 12e-3  # s before an opening and after its end that are judged
LOST_LIFT = 1.5e-6  # m, recorded, below which the flank is extended from beyond it
ANCHOR = 3  # samples that carry the extended flank
LIFT_STEP = 1e-7  # m, of the rate's slope
STARTS = 6  # of either sign, from below detection to large
WIDER, WIDER_SHAPE = 1.5, 2.5  # than what is drawn, the size of a rival and its other parameters may be
REFINED = 2  # of the starts
SHAPE_STARTS = 3  # of a further parameter


class Inputs(NamedTuple):
    """What the plant follows, at the samples (n,): rail pressure [Pa], lift [m], line pressure [Pa]."""

    rail: Array
    lift: Array
    line: Array


@njit(cache=True, nogil=True)
def follow(
    part: Injector, faults: Faults, sampled: Inputs, gain: Array, interval: float, errors: Array, rate: Array
) -> None:
    """Errors [Pa] and injection rate [m3/s] (n,) of a plant of one cell, its inputs linear between samples.

    gain (3,) on p_L, Q_L and the lagged p_L, after every sample; all 0 is open
    loop. Parts of a sample by which the line is recorded late are kept; whole samples are the caller's.
    """
    rail, lift, line = sampled
    q, p = np.zeros(1), np.full(1, rail[0])
    p_s, seen, recorded = part.chamber_pressure, rail[0], rail[0]
    late = interval - faults.channel_skew % interval
    errors[0], rate[0] = line[0] - recorded, 0.0
    for k in range(1, rail.shape[0]):
        shut = lift[k - 1] <= 0.0 and lift[k] <= 0.0 and p_s == part.chamber_pressure
        steps = equations.STEPS_SHUT if shut else equations.STEPS_FLOWING
        step = interval / steps
        lift1, rail1 = lift[k - 1], rail[k - 1]
        for j in range(steps):
            lift0, rail0, p_l0, seen0 = lift1, rail1, p[0], seen
            lift1 = lift[k - 1] + (lift[k] - lift[k - 1]) * (j + 1) / steps
            rail1 = rail[k - 1] + (rail[k] - rail[k - 1]) * (j + 1) / steps
            equations.kick(q, p, rail0, 0.5 * step, part, faults)
            p_s = equations.drift(q, p, p_s, lift0, lift1, step, part, faults)
            equations.kick(q, p, rail1, 0.5 * step, part, faults)
            seen = equations.lagged(seen0, p_l0, p[0], step, faults.line_pressure_sensor_lag)
            if j * step < late <= (j + 1) * step * (1.0 + 1e-12):
                recorded = seen0 + (seen - seen0) * (late / step - j)
        p_c = equations.chamber_pressure(lift1, part, faults)
        rate[k] = equations.nozzle_factor(p_s, p_c, lift1, part, faults) * equations.square_root(p_s - p_c)
        errors[k] = line[k] - recorded
        p[0] += gain[0] * errors[k]
        q[0] += gain[1] * errors[k]
        seen += gain[2] * errors[k]


@dataclass(frozen=True, eq=False)
class OracleRecording:
    """One recording as the oracle takes it: measured signals, SI (n,), and what it knows of the needle's motion.

    openings (m, 2): first and last sample of a true lift above 0; speeds (m, 2): of opening and closing [m/s];
    counted (n,): samples that are judged.
    """

    bench: plant.Bench
    rail: Array
    lift: Array
    line: Array
    rate: Array | None
    openings: NDArray[np.int64]
    speeds: Array
    counted: NDArray[np.bool_]


def recorded(bench: plant.Bench, outcome: plant.Outcome, with_rate: bool) -> OracleRecording:
    measured = outcome.measured
    openings = plant.openings_of(outcome.truth.needle_lift, 0.0)
    starts = (plant.event_start(number) for number in range(len(bench.events)))
    lift = bench.injector.max_lift
    strokes = [plant.strokes_of(*event, bench.needle, lift) for event in zip(bench.events, starts, strict=True)]
    counted = np.zeros(measured.time.size, np.bool_)
    for first, last in openings:
        counted[first - round(LEAD / INTERVAL) : last + round(TAIL / INTERVAL)] = True
    rate, speeds = measured_rate(bench, outcome) if with_rate else None, np.concatenate(strokes)[:, 4:6]
    seen = (measured.rail_pressure, measured.needle_lift, measured.line_pressure)
    return OracleRecording(bench, *seen, rate, openings, speeds, counted)


def record_all(benches: Sequence[plant.Bench], with_rate: bool) -> tuple[tuple[OracleRecording, plant.Outcome], ...]:
    return tuple((recorded(b, outcome, with_rate), outcome) for b in benches for outcome in [plant.record(b)])


def true_lift(r: OracleRecording, faults: Faults) -> Array:
    """Lift [m] (n,) if the sensor has these faults; what an offset cut off is extended with the needle's speeds."""
    lift = np.zeros(r.lift.size)
    recorded_lift = r.lift + faults.lift_sensor_lag / INTERVAL * np.gradient(r.lift)
    for (first, last), (up, down) in zip(r.openings, r.speeds, strict=True):
        part = slice(int(first), int(last) + 1)
        seen = recorded_lift[part]
        corrected = (np.maximum(seen, 0.0) + faults.lift_offset) * (1.0 + faults.lift_gain)
        if faults.lift_offset > 0.0:
            _extend(corrected, seen, up * INTERVAL)
            _extend(corrected[::-1], seen[::-1], down * INTERVAL)
        lift[part] = np.maximum(corrected, 0.0)
    return lift


def _extend(lift: Array, seen: Array, rise: float) -> None:
    """Replace the beginning of a flank, where nothing was seen, by a ramp of `rise` a sample; in place."""
    visible = np.flatnonzero(seen > LOST_LIFT)
    if visible.size == 0:
        return
    first = int(visible[0])
    anchor = lift[first : first + ANCHOR]
    level = float(np.mean(anchor - rise * np.arange(anchor.size)))
    lift[:first] = np.minimum(lift[:first], np.maximum(level + rise * np.arange(-first, 0), 0.0))


def gain_of(part: Injector, faults: Faults, pressure: float) -> tuple[Array, float]:
    """Kalman gain (3,) on [p_L, Q_L, p_L behind the lag] at a line pressure [Pa], and the innovation's sigma [Pa].

    angle: of the line's mode in one sample; impedance: pressure over flow of the mode; late: lag in samples.
    """
    stiffness = equations.line_stiffness(pressure, part, faults) / part.line_volume
    inertance = part.density * part.line_length / part.line_area
    late = faults.line_pressure_sensor_lag / INTERVAL
    angle, impedance = math.sqrt(stiffness / inertance) * INTERVAL, math.sqrt(stiffness * inertance)
    cosine, sine = math.cos(angle), math.sin(angle)
    decay = math.exp(-1.0 / late) if late > 0.0 else 0.0
    now, before = 1.0 - late * (1.0 - decay), late * (1.0 - decay) - decay
    row = np.array([cosine, impedance * sine, 0.0])
    transition = np.array([row, [-sine / impedance, cosine, 0.0], now * row + [before, 0.0, decay]])
    drive = np.array([1.0 - cosine, sine / impedance, now * (1.0 - cosine)])
    process, measurement = np.outer(drive, drive) * plant.RAIL_NOISE**2, np.array([[plant.LINE_NOISE**2]])
    covariance = solve_discrete_are(transition.T, np.eye(3)[:, 2:], process, measurement)
    variance = covariance[2, 2] + measurement[0, 0]
    return covariance[:, 2] / variance, math.sqrt(variance)


def simulated(r: OracleRecording, faults: Faults, closed_loop: bool) -> tuple[Array, Array, float]:
    """Errors [Pa] and rate [m3/s] (n,) with these faults, whitened or open loop, and the innovation's sigma [Pa]."""
    part = with_faults(r.bench.injector, faults)
    rail = (r.rail - faults.rail_pressure_sensor_offset) / (1.0 + faults.rail_pressure_sensor_gain)
    line = (r.line - faults.line_pressure_sensor_offset) / (1.0 + faults.line_pressure_sensor_gain)
    whole_samples = math.floor(faults.channel_skew / INTERVAL)
    line = _shifted(line, whole_samples)
    gain, sigma = gain_of(part, faults, float(np.median(rail)))
    errors, rate = np.empty((2, rail.size))
    steady = gain if closed_loop else np.zeros(3)
    follow(part, faults, Inputs(rail, true_lift(r, faults), line), steady, INTERVAL, errors, rate)
    return _shifted(errors, -whole_samples), rate, sigma


def _shifted(values: Array, samples: int) -> Array:
    """Values (n,) moved to the front; the end stands still."""
    return values[np.clip(np.arange(values.size) + samples, 0, values.size - 1)]


def rate_sigma(r: OracleRecording) -> Array:
    """Standard deviation of measured minus modelled rate [m3/s] (n,): the instrument's, and what lift noise does."""
    part = r.bench.injector
    lift = true_lift(r, Faults())
    drop = max(float(np.median(r.rail)) - part.chamber_pressure, 0.0)
    nozzle = part.nozzle_area * math.sqrt(2.0 / part.density)

    def quasi_static(x: float) -> float:
        seat = equations.seat_factor(x, part.chamber_pressure, part, Faults())
        return float(seat * nozzle / math.hypot(seat, nozzle) * math.sqrt(drop))

    slope = [(quasi_static(x + LIFT_STEP) - quasi_static(x)) / LIFT_STEP if x > 0.0 else 0.0 for x in lift]
    return np.asarray(np.hypot(RATE_NOISE, plant.LIFT_NOISE * np.array(slope)), np.float64)


def residuals(recordings: Sequence[OracleRecording], faults: Faults) -> Array:
    """Whitened innovations of all recordings (n,); with measured rate its residuals, each recording's gain free."""
    parts = []
    for r in recordings:
        errors, rate, sigma = simulated(r, faults, closed_loop=True)
        parts.append(errors[r.counted] / sigma)
        if r.rate is not None:
            weight = 1.0 / rate_sigma(r)[r.counted]
            off, shape = (r.rate - rate)[r.counted] * weight, rate[r.counted] * weight
            gain = float(shape @ off) / (float(shape @ shape) + RATE_GAIN**-2)
            parts += [off - gain * shape, np.array([gain / RATE_GAIN])]
    return np.concatenate(parts)


def statistic(recordings: Sequence[OracleRecording], faults: Faults) -> float:
    """-2 log L, constants left out; a lag changes the innovation's variance, which counts."""
    values = residuals(recordings, faults)
    total = float(values @ values)
    for r in recordings:
        part = with_faults(r.bench.injector, faults)
        _, sigma = gain_of(part, faults, float(np.median(r.rail)))
        total += 2.0 * int(np.sum(r.counted)) * math.log(sigma / plant.LINE_NOISE)
    return total


def best_statistic(recordings: Sequence[OracleRecording], effect_id: str) -> float:
    """Smallest -2 log L of a model with this effect, its parameters free."""
    effect = HIDDEN[effect_id]
    if not effect.parameters:
        return statistic(recordings, effect.faults(()))
    starts = sorted(_starts(effect), key=lambda values: statistic(recordings, effect.faults(values)))
    return min(_refined(recordings, effect, start) for start in starts[:REFINED])


def _starts(effect: HiddenKind) -> list[tuple[float, ...]]:
    size, *shapes = effect.parameters
    sizes = list(np.geomspace(size.lowest, size.highest, STARTS))
    if size.most_negative < 0.0:
        sizes += [-value for value in np.geomspace(size.lowest, -size.most_negative, STARTS)]
    return list(product(sizes, *(np.geomspace(p.lowest, WIDER_SHAPE * p.highest, SHAPE_STARTS) for p in shapes)))


def _refined(recordings: Sequence[OracleRecording], effect: HiddenKind, start: tuple[float, ...]) -> float:
    scale = np.array([math.sqrt(p.lowest * p.highest) for p in effect.parameters])
    size, *shapes = effect.parameters
    lowest = [WIDER * size.most_negative, *(p.lowest / WIDER_SHAPE for p in shapes)]
    highest = [WIDER * size.highest, *(p.highest * WIDER_SHAPE for p in shapes)]

    def values_at(x: Array) -> tuple[float, ...]:
        return tuple(float(value) for value in x * scale)

    fit = least_squares(
        lambda x: residuals(recordings, effect.faults(values_at(x))),
        np.clip(np.array(start), lowest, highest) / scale,
        bounds=(np.array(lowest) / scale - 1e-12, np.array(highest) / scale),
        diff_step=1e-4,
        xtol=1e-6,
        ftol=1e-9,
    )
    return statistic(recordings, effect.faults(values_at(fit.x)))
