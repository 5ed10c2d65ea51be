"""What the closed needle tells: noise levels, the offset between line and rail pressure, the lift sensor."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.gain import NoiseLevels
from observer_rt.foundation.compiled import inner, inner_separate
from observer_rt.observer.stream.state import RING, Observer, Reason

ENOUGH_OPENINGS = 5
TOLERATED = 0.03  # share of the lift at the stop


@dataclass(frozen=True)
class RestingLift:
    """What the lift of a shut needle shows that is no motion.

    zero: its mean [m]; wander: how far it moves about that within some 80 us, root mean square [m]; crosstalk: of the
    line pressure [m/Pa], 0: none was found.
    """

    zero: float = 0.0
    wander: float = 0.0
    crosstalk: float = 0.0


@dataclass(frozen=True)
class LiftFigures(RestingLift):
    """at_stop: lift at which long openings stay [m], nan until five did; stop: what it should be [m]."""

    at_stop: float = math.nan
    stop: float = math.nan

    @property
    def is_to_scale(self) -> bool:
        """Whether the needle opens as far as it should, as far as is known."""
        return not abs(self.at_stop - self.stop) > TOLERATED * self.stop


def resting_lift_of(record: np.void, pressure_scale: float) -> RestingLift:
    """Read it out of an observer's memory, or a closed event's; pressure_scale p_0 [Pa]."""
    return RestingLift(
        zero=float(record["zero"]),
        wander=math.sqrt(record["quick_squares"]),
        crosstalk=float(record["crosstalk"]) / pressure_scale,
    )


def lift_figures(observer: Observer, max_lift: float) -> LiftFigures:
    """Read them out of the observer's memory; max_lift: of the injector file [m]."""
    memory = observer.memory[0]
    inputs = observer.constants.inputs
    is_known = int(memory["stop_openings"]) >= ENOUGH_OPENINGS
    return LiftFigures(
        **vars(resting_lift_of(memory, observer.constants.coefficients.pressure_scale)),
        at_stop=inputs.lift_factor * float(memory["stop"]) + inputs.lift_shift if is_known else math.nan,
        stop=max_lift,
    )


ENOUGH_SAMPLES = 256  # of standstill, before measured noise may replace the stated
MEMORY = 16_384  # squares of which the mean is formed at least; beyond twice as many the older count half
LIFT_MEMORY = 4_096  # squares the running mean of the lift remembers
CONTRADICTED = (
    5.0  # standard deviations of a measured level's logarithm, from which on it replaces the stated
)
_SPREAD = 1.3  # n times the variance of that logarithm: neighbouring differences share samples
FLOOR = NoiseLevels(rail_pressure=0.01e6, line_pressure=0.01e6, needle_lift=0.02e-6)
_ORDER = 4  # differences: order 4 leaves the ringing of the line below the noise even at 20 kHz
DIFFERENCE_GAIN = 70.0  # sum of squares of 1 4 6 4 1
_NEXT = -56.0  # sum of products of neighbours in 1 -4 6 -4 1
_NEXT_BUT_ONE = 28.0  # and of those beyond them
_TRUSTED = 200  # squares, from which on their mean tells a spike
_SPIKE = 36.0  # times the mean square: six sigma
_REPEATED = 16  # samples
_MASK = RING - 1
_NUMERICAL = int(Reason.NUMERICAL)


@inner_separate
def gather(observer: Observer, position: int) -> None:
    """Take the sample at `position` into the statistics of the standstill."""
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    if not row.resting or row.interpolated or row.bridged != 0 or memory.unsynchronised_by == _NUMERICAL:
        memory.rest_run = 0
        memory.at_highest = 0
        memory.highest_line = max(memory.highest_line, row.line_pressure)
        return
    if _is_clipped(observer, position):
        memory.rest_run = 0
        return
    memory.rest_run += 1
    memory.rest_count += 1
    memory.offset_sum += row.line_pressure - observer.constants.sensor.offset - row.rail_pressure
    if memory.rest_run > _ORDER:
        a = observer.ring[(position - 4) & _MASK]
        b = observer.ring[(position - 3) & _MASK]
        c = observer.ring[(position - 2) & _MASK]
        d = observer.ring[(position - 1) & _MASK]
        count = memory.difference_count
        undone = observer.constants.undoing.rail_fraction if observer.constants.rail_every <= 1.0 else 0.0
        memory.rail_squares += square_of_difference(
            a.rail_pressure,
            b.rail_pressure,
            c.rail_pressure,
            d.rail_pressure,
            row.rail_pressure,
            memory.rail_squares,
            count,
            smoothing(row.rail_share, undone),
        )
        memory.line_squares += square_of_difference(
            a.line_pressure,
            b.line_pressure,
            c.line_pressure,
            d.line_pressure,
            row.line_pressure,
            memory.line_squares,
            count,
        )
        memory.difference_count += 1
        if memory.difference_count == 2 * MEMORY:
            _halve(observer)


@inner
def _is_clipped(observer: Observer, position: int) -> bool:
    """Whether a rest's line pressure stays at the highest value of the run although the rail pressure does not stay.

    Where its range ends, it says nothing.
    """
    memory, row = observer.memory[0], observer.ring[position & _MASK]
    moves = row.rail_pressure != observer.ring[(position - 1) & _MASK].rail_pressure
    memory.at_highest = memory.at_highest + 1 if moves and row.line_pressure == memory.highest_line else 0
    memory.highest_line = max(memory.highest_line, row.line_pressure)
    return bool(memory.at_highest >= _REPEATED)


@inner
def _halve(observer: Observer) -> None:
    """What is long past counts for less."""
    memory = observer.memory[0]
    memory.difference_count = MEMORY
    memory.differences_before //= 2
    memory.rail_squares *= 0.5
    memory.line_squares *= 0.5
    memory.rail_squares_before *= 0.5
    memory.line_squares_before *= 0.5


@inner
def _differ(one: float, other: float, factor: float) -> bool:
    """Whether one exceeds the other by more than a factor."""
    return bool(one > factor * other or other > factor * one)


@inner
def forget_other_noise(observer: Observer) -> None:
    """An event closes: what was known before it goes where the noise has become another since."""
    memory = observer.memory[0]
    before, since = memory.differences_before, memory.difference_count - memory.differences_before
    if min(before, since) >= ENOUGH_SAMPLES:
        rail, line = memory.rail_squares_before, memory.line_squares_before
        within = math.exp(CONTRADICTED * math.sqrt(4.0 * _SPREAD * (1.0 / before + 1.0 / since)))
        share = since / before
        if _differ(memory.rail_squares - rail, share * rail, within) or _differ(
            memory.line_squares - line, share * line, within
        ):
            memory.difference_count = since
            memory.rail_squares -= rail
            memory.line_squares -= line
    memory.differences_before = memory.difference_count
    memory.rail_squares_before = memory.rail_squares
    memory.line_squares_before = memory.line_squares


@inner
def smoothing(share: float, again: float) -> float:
    """By what interpolation with this share of the later neighbour, and another one after it, reduce the square of a
    fourth difference.

    To the line, which follows slowly, an interpolated pressure is as noisy as its neighbours are.
    """
    first = (1.0 - share) * (1.0 - again)
    second = share * (1.0 - again) + (1.0 - share) * again
    third = share * again
    squares = first * first + second * second + third * third
    beside = 2.0 * (first * second + second * third)
    return squares + (beside * _NEXT + 2.0 * first * third * _NEXT_BUT_ONE) / DIFFERENCE_GAIN


@inner
def square_of_difference(
    a: float, b: float, c: float, d: float, e: float, total: float, count: int, smoothed: float = 1.0
) -> float:
    """Square of the fourth difference, a spike's limited to what the `count` squares before make plausible.

    smoothed: by what interpolation reduced it.
    """
    square = (a - 4 * (b + d) + 6 * c + e) ** 2 / smoothed
    if count < _TRUSTED:
        return float(square)
    return float(min(square, _SPIKE * total / count))


@dataclass(frozen=True)
class Standstill:
    """Statistics since the start: sample count, mean of y - o - u1 (in units of p_0), measured noise.

    o is the offset of the sensor in force: what is left is not known yet.
    """

    samples: int
    offset: float
    noise: NoiseLevels | None  # None until ENOUGH_SAMPLES, and of signals that no sensors give
    lift: LiftFigures = field(default_factory=LiftFigures)


def standstill_of(
    record: np.void, pressure_scale: float, stated: NDArray[np.float64] | None = None
) -> Standstill:
    """Read the statistics out of an observer's memory, or a closed event's; pressure_scale p_0 [Pa].

    stated: levels (3,) of rail and line pressure [p_0] and lift [m] that hold where what was measured does not
    contradict them: a short standstill tells a level within some percent only.
    """
    samples = int(record["rest_count"])
    offset = float(record["offset_sum"]) / samples if samples else 0.0
    count, lifts = int(record["difference_count"]), int(record["lift_count"])
    if count < ENOUGH_SAMPLES or lifts < ENOUGH_SAMPLES:
        return Standstill(samples, offset, None)
    squares = float(record["rail_squares"]) / count, float(record["line_squares"]) / count
    measured = [math.sqrt(square / DIFFERENCE_GAIN) for square in squares]
    measured.append(math.sqrt(float(record["lift_variance"])))
    if stated is not None:
        known = zip(measured, stated, (count, count, min(lifts, 2 * LIFT_MEMORY)), strict=True)
        measured = [_level(level, float(before), squares) for level, before, squares in known]
    noise = NoiseLevels(
        rail_pressure=max(FLOOR.rail_pressure, pressure_scale * measured[0]),
        line_pressure=max(FLOOR.line_pressure, pressure_scale * measured[1]),
        needle_lift=max(FLOOR.needle_lift, measured[2]),
    )
    return Standstill(samples, offset, None if noise.implausible else noise)


def _level(measured: float, stated: float, squares: int) -> float:
    """The stated level of a noise, unless the one measured from so many squares contradicts it."""
    within = math.exp(CONTRADICTED * math.sqrt(_SPREAD / squares))
    return stated if stated / within <= measured <= stated * within else measured
