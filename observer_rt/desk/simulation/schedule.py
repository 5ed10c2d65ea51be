"""Schedules of injections: events of shots, the rail pressure, and how the needle lifts upon energizing.

A stroke is piecewise linear, with corners rounded by the mean over `CORNER_ROUNDING`, in closed form.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from observer_rt.core.model.needle import CORNER_ROUNDING, NeedleStroke, stroke_of
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND, Floats
from observer_rt.model.parameters import InjectorParameters

FIRST_EVENT = 0.15  # s, standstill in which a reader learns noise and offsets
LAST_TAIL = 0.05  # s, at least, after the last event: it must be seen to close and to ring down
MAX_RAIL_PRESSURE = 300e6  # Pa, beyond any rail and near the end of the bus's range
MAX_ENERGIZING_TIME = 0.1  # s
RAMP_SHARE = 0.5  # of the gap between two events, in its middle

INJECTIONS_OPTION = "--injections"
RAIL_PRESSURE_OPTION = "--rail-pressure"
ENERGIZING_TIME_OPTION = "--energizing-time"
SHOTS_OPTION = "--shots"
PERIOD_OPTION = "--period"
REFERENCE_PRESSURE = 100e6  # Pa, at which the needle's speeds are given


@dataclass(frozen=True)
class Shot:
    """One energizing of the injector."""

    duration: float
    """Energizing time [s]."""
    offset: float = 0.0
    """Start relative to the event [s]: negative for a pilot."""


@dataclass(frozen=True)
class Event:
    """Shots that belong together (pilot, main, post), at one rail pressure [Pa], from a start [s]."""

    start: float
    rail_pressure: float
    shots: tuple[Shot, ...]

    @property
    def first_energizing(self) -> float:
        """Start of the first shot [s]."""
        return self.start + self.shots[0].offset

    @property
    def last_energizing(self) -> float:
        """End of the last shot [s]."""
        return self.start + self.shots[-1].offset + self.shots[-1].duration


@dataclass(frozen=True)
class Schedule:
    """Events in order, and how long the recording lasts [s]."""

    events: tuple[Event, ...]
    duration: float

    def rail_pressure(self, time: Floats) -> Floats:
        """Rail pressure [Pa] at `time` [s] (n,), smooth in the middle half of a gap: the line stays at rest."""
        pressure = np.full(time.shape, self.events[0].rail_pressure)
        for before, after in pairwise(self.events):
            change = after.rail_pressure - before.rail_pressure
            if change == 0.0:
                continue
            gap = after.first_energizing - before.last_energizing
            share = np.clip((time - (before.last_energizing + 0.5 * gap)) / (RAMP_SHARE * gap) + 0.5, 0.0, 1.0)
            pressure += change * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        return pressure


def make_schedule(
    rail_pressures: Sequence[float],
    injections: int,
    period: float,
    energizing_times: Sequence[float] = (),
    shots: Sequence[Shot] = (),
) -> Schedule:
    """Schedule of `injections` events, one every `period` [s]; event 1 starts 0.15 s in.

    Event i (from 0) has rail pressure [Pa] i mod n and energizing time [s] i mod m, or all have `shots`. Raises
    `UserError` when shots or events overlap or there is nothing to inject.
    """
    if injections < 1:
        raise UserError(INJECTIONS_OPTION, f"{injections} is not a number of injections", "give 1 or more")
    if not (math.isfinite(period) and period > 0.0):
        raise UserError(PERIOD_OPTION, f"{period / MILLISECOND:g} ms is not a period", "give ms above 0")
    if not rail_pressures:
        raise UserError(RAIL_PRESSURE_OPTION, "no rail pressure", "give at least one, in MPa")
    patterns = [tuple(sorted(shots, key=lambda shot: shot.offset))] if shots else []
    patterns = patterns or [(Shot(duration),) for duration in energizing_times]
    if not patterns:
        raise UserError(ENERGIZING_TIME_OPTION, "no energizing time and no shots", "give one, in ms")
    events = tuple(
        Event(FIRST_EVENT + i * period, rail_pressures[i % len(rail_pressures)], patterns[i % len(patterns)])
        for i in range(injections)
    )
    _refuse_overlaps(events)
    return Schedule(events, events[-1].start + max(period, LAST_TAIL))


def _refuse_overlaps(events: tuple[Event, ...]) -> None:
    for earlier, later in pairwise(events[0].shots):
        if earlier.offset + earlier.duration >= later.offset:
            first, second = (f"{shot.offset / MILLISECOND:g} ms" for shot in (earlier, later))
            problem = f"the shot at {first} lasts into the one at {second}"
            raise UserError(SHOTS_OPTION, problem, "shorten the first or start the second later")
    if events[0].first_energizing < 0.0:
        early = -events[0].first_energizing / MILLISECOND
        problem = f"the first shot would start {early:g} ms before the recording"
        raise UserError(SHOTS_OPTION, problem, f"offsets go down to {-FIRST_EVENT / MILLISECOND:g} ms")
    for number, (before, after) in enumerate(pairwise(events), start=1):
        if before.last_energizing >= after.first_energizing:
            overlap = before.last_energizing - after.first_energizing
            problem = f"event {number} lasts {overlap / MILLISECOND:g} ms into event {number + 1}"
            raise UserError(PERIOD_OPTION, problem, "give a longer period")


def parse_rail_pressures(text: str) -> tuple[float, ...]:
    """Rail pressures [Pa] from MPa separated by commas, `60,100`. Raises `UserError`."""
    values = tuple(_number(part, RAIL_PRESSURE_OPTION, "60,100 (MPa)") for part in text.split(","))
    for value in values:
        if not 0.0 < value * MEGAPASCAL <= MAX_RAIL_PRESSURE:
            limit = MAX_RAIL_PRESSURE / MEGAPASCAL
            remedy = f"give above 0 and up to {limit:g} MPa"
            if limit < value <= 10.0 * limit:
                remedy += f"; if it is in bar, {value / 10.0:g}"
            raise UserError(RAIL_PRESSURE_OPTION, f"{value:g} MPa is out of range", remedy)
    return tuple(value * MEGAPASCAL for value in values)


def parse_energizing_times(text: str) -> tuple[float, ...]:
    """Energizing times [s] from ms separated by commas, `0.6,1.9`. Raises `UserError`."""
    return tuple(_duration(part, ENERGIZING_TIME_OPTION, "0.6,1.9 (ms)") for part in text.split(","))


def parse_shots(text: str) -> tuple[Shot, ...]:
    """Shots of every event from `duration@offset` in ms, by commas: `0.3@-1.5,1.0@0`. Raises `UserError`."""
    example = "0.3@-1.5,1.0@0 (duration@offset, ms)"
    shots = []
    for part in text.split(","):
        duration, separator, offset = part.partition("@")
        if not separator:
            raise UserError(SHOTS_OPTION, f"'{part.strip()}' has no '@offset'", f"write it as {example}")
        lasts = _duration(duration, SHOTS_OPTION, example)
        shots.append(Shot(lasts, _number(offset, SHOTS_OPTION, example) * MILLISECOND))
    return tuple(shots)


def _duration(text: str, option: str, example: str) -> float:
    duration = _number(text, option, example) * MILLISECOND
    if not 0.0 < duration <= MAX_ENERGIZING_TIME:
        limit = MAX_ENERGIZING_TIME / MILLISECOND
        raise UserError(option, f"{text.strip()} ms is out of range", f"give above 0 and up to {limit:g} ms")
    return duration


def _number(text: str, option: str, example: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UserError(option, f"'{text.strip()}' is not a number", f"write it as {example}")
    return value


def stroke(shot: Shot, start: float, rail_pressure: float, parameters: InjectorParameters) -> NeedleStroke | None:
    """Needle stroke of a shot of an event at `start` [s]; None if it is too short to lift the needle."""
    begun, pressure = start + shot.offset, rail_pressure / REFERENCE_PRESSURE
    answer = stroke_of(begun, shot.duration, pressure, parameters.needle_law)
    return None if answer is None else NeedleStroke(**answer)


def energized(schedule: Schedule, time: Floats, jitter: float = 0.0, seed: int = 0) -> Floats:
    """1 at times (n,) [s] at which the injector is energized, else 0; jitter [s]: sigma of the needle's answers."""
    shots = [(event.start + shot.offset, shot.duration) for event in schedule.events for shot in event.shots]
    starts, durations = np.array(shots, np.float64).reshape(-1, 2).T
    late: Floats = np.random.default_rng(seed).normal(0.0, jitter, (2, starts.size))
    ends, starts = starts + durations - late[1], starts - late[0]
    last = np.maximum(np.searchsorted(starts, time, side="right") - 1, 0)
    return np.asarray((starts[last] <= time) & (time < ends[last]), np.float64)


def strokes(schedule: Schedule, parameters: InjectorParameters) -> tuple[NeedleStroke, ...]:
    """All needle strokes of a schedule, in order. Raises `UserError` for a needle still open when it has to open."""
    placed = [
        (event, found)
        for event in schedule.events
        for shot in event.shots
        if (found := stroke(shot, event.start, event.rail_pressure, parameters)) is not None
    ]
    for (event, before), (next_event, after) in pairwise(placed):
        if before.closed + CORNER_ROUNDING > after.opening:
            late = before.closed + CORNER_ROUNDING - after.opening
            problem = f"the needle has not closed when the next shot opens it, {after.opening:.6g} s in"
            remedy = f"start that shot at least {late / MILLISECOND:.3g} ms later"
            raise UserError(SHOTS_OPTION if event is next_event else PERIOD_OPTION, problem, remedy)
    return tuple(found for _, found in placed)
