"""Findings while the needle is closed: noise levels, offset between line and rail pressure, lift, a rail held.

A held rail pressure is a set value, or a dead sensor's. A channel that repeats its values shows it at no sample, but
no rail keeps its pressure through injections and the noise that the line shows.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import CONTRADICTED, DIFFERENCE_GAIN, ENOUGH_SAMPLES, LIFT_MEMORY, SPREAD
from observer_rt.engine.estimation.predictor import NoiseLevels, Window
from observer_rt.engine.stream.state import Observer
from observer_rt.foundation.units import MEGAPASCAL, Z_95

ENOUGH_OPENINGS = 5
TOLERATED = 0.03  # share of the lift at the stop
FLOOR = NoiseLevels(rail_pressure=0.01e6, line_pressure=0.01e6, needle_lift=0.02e-6)
HELD_FOR = 2  # events in a row with one rail pressure
APART, FAR_APART = 10 * MEGAPASCAL, 20 * MEGAPASCAL  # rail pressures that tell a slope at all, and half of it
POINTS = 8  # rail pressures that are remembered
WALK = 0.02 * MEGAPASCAL  # by which what the sensors differ by moves from event to event
STEEPER = 3.0  # times the slope between two rail pressures, of a bend that lies between them


@dataclass(frozen=True)
class RestingLift:
    """Lift of a shut needle that is no motion."""

    zero: float = 0.0  # mean [m]
    wander: float = 0.0  # how far it moves about that within some 80 us, root mean square [m]
    crosstalk: float = 0.0  # of the line pressure [m/Pa]; 0: none was seen


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
    resting = record["resting_lift"]
    return RestingLift(
        zero=float(resting["zero"]),
        wander=math.sqrt(resting["quick_squares"]),
        crosstalk=float(resting["crosstalk"]) / pressure_scale,
    )


def lift_figures(observer: Observer, max_lift: float) -> LiftFigures:
    """Read them out of the observer's memory; max_lift: of the injector file [m]."""
    memory = observer.memory[0]
    inputs = observer.constants.inputs
    stop = memory["stop"]
    is_known = int(stop["openings"]) >= ENOUGH_OPENINGS
    return LiftFigures(
        **vars(resting_lift_of(memory, observer.constants.coefficients.pressure_scale)),
        at_stop=inputs.lift_factor * float(stop["lift"]) + inputs.lift_shift if is_known else math.nan,
        stop=max_lift,
    )


@dataclass(frozen=True)
class Standstill:
    """Statistics since the start: samples, mean of y - o - u1 [p_0], noise; o: offset of the sensor in force."""

    samples: int
    offset: float
    noise: NoiseLevels | None  # None until ENOUGH_SAMPLES, and of signals that no sensors give
    lift: LiftFigures = field(default_factory=LiftFigures)


def offset_between(before: Standstill | None, after: Standstill) -> float | None:
    """Mean of line over rail pressure at rest [p_0] from one event's end to the next's; None: no sample."""
    samples, total = after.samples, after.samples * after.offset
    if before is not None:
        samples, total = samples - before.samples, total - before.samples * before.offset
    return total / samples if samples > 0 else None


def standstill_of(record: np.void, pressure_scale: float, stated: NDArray[np.float64] | None = None) -> Standstill:
    """Statistics of an observer's memory or a closed event; pressure_scale p_0 [Pa].

    stated (3,): levels of rail, line [p_0] and lift [m] that hold unless a standstill, vague if short, differs.
    """
    record_of, resting = record["standstill"], record["resting_lift"]
    samples = int(record_of["rest_count"])
    offset = float(record_of["offset_sum"]) / samples if samples else 0.0
    differences = record_of["differences"]
    count, lifts = int(differences["count"]), int(resting["lift_count"])
    if count < ENOUGH_SAMPLES or lifts < ENOUGH_SAMPLES:
        return Standstill(samples, offset, None)
    squares = float(differences["rail_squares"]) / count, float(differences["line_squares"]) / count
    measured = [math.sqrt(square / DIFFERENCE_GAIN) for square in squares]
    measured.append(math.sqrt(float(resting["lift_variance"])))
    if stated is not None:
        pairs = zip(measured, stated, (count, count, min(lifts, 2 * LIFT_MEMORY)), strict=True)
        measured = [_level(level, float(before), squares) for level, before, squares in pairs]
    noise = NoiseLevels(
        rail_pressure=max(FLOOR.rail_pressure, pressure_scale * measured[0]),
        line_pressure=max(FLOOR.line_pressure, pressure_scale * measured[1]),
        needle_lift=max(FLOOR.needle_lift, measured[2]),
    )
    return Standstill(samples, offset, None if noise.implausible else noise)


def _level(measured: float, stated: float, squares: int) -> float:
    """The stated level of a noise, unless the one measured from so many squares contradicts it."""
    within = math.exp(CONTRADICTED * math.sqrt(SPREAD / squares))
    return stated if stated / within <= measured <= stated * within else measured


@dataclass(frozen=True)
class HeldRail:
    """The one rail pressure [p_0] that the last so many events had; None: it moved in the last one."""

    value: float | None = None
    events: int = 0

    @property
    def is_held(self) -> bool:
        """Whether enough events in a row had one."""
        return self.events >= HELD_FOR

    def after(self, window: Window, standstill: Standstill, rail_every: float) -> "HeldRail":
        """Adds an event; a slow rail's repeated value, or one of a computed recording, is not held."""
        rail = window.inputs[:, 0]
        is_noisy = standstill.noise is not None and standstill.noise.line_pressure > FLOOR.line_pressure
        value = float(rail[0])
        if rail_every > 1.0 or not is_noisy or np.ptp(rail) > 0.0:
            return HeldRail()
        return HeldRail(value, self.events + 1 if value == self.value else 1)


class RestPoint(NamedTuple):
    """Line over rail pressure at rest before an event, in Pa."""

    rail_pressure: float
    difference: float
    variance: float  # of the difference


@dataclass(frozen=True)
class SensorSlope:
    """Error of one pressure sensor's slope against the other's, by their difference at rest.

    A bent sensor differs at other rail pressures whatever its gain; one that drifts or moved once, as it lately did.
    """

    points: tuple[RestPoint, ...] = ()  # of the last events, at rail pressures that are apart
    share: float = 0.0  # by which the last event's flow may be off (one sigma)

    def after(self, point: RestPoint, gain: float) -> "SensorSlope":
        """Adds an event, its variance inf if it had no rest; gain: of one sensor over the other's, as learned."""
        if math.isinf(point.variance):
            return self
        others = [each for each in self.points if abs(each.rail_pressure - point.rail_pressure) > APART]
        others = [each._replace(variance=each.variance + WALK**2) for each in others]
        slopes = (_slope(point, other, gain) for other in others)
        return SensorSlope((*others, point)[-POINTS:], STEEPER * min(slopes, default=0.0))


def _slope(first: RestPoint, second: RestPoint, gain: float) -> float:
    """Slope beyond a gain that is there at least between two points, as a share; little for near ones."""
    apart = first.rail_pressure - second.rail_pressure
    moved = abs(first.difference - second.difference - gain * apart)
    moved = max(moved - Z_95 * math.sqrt(first.variance + second.variance), 0.0)
    return moved * abs(apart) / (apart**2 + FAR_APART**2)
