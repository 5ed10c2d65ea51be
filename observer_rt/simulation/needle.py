"""Needle lift from energizing: delays, speeds that grow with rail pressure, ballistic short shots.

A stroke is piecewise linear: up at the opening speed, at the stop (if it gets there), down at the closing
speed. Its corners are rounded by the mean over a window of `CORNER_ROUNDING`, in closed form.
"""

from itertools import pairwise
from typing import NamedTuple

from observer_rt.foundation.compiled import compiled, inner
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLISECOND
from observer_rt.model.parameters import InjectorParameters
from observer_rt.simulation.schedule import PERIOD_OPTION, SHOTS_OPTION, Schedule, Shot

REFERENCE_PRESSURE = 100e6  # Pa, at which the needle's speeds are given
OPENING_EXPONENT = 0.4
CLOSING_EXPONENT = 0.3
CORNER_ROUNDING = 0.03e-3  # s


class Stroke(NamedTuple):
    """One opening of the needle, before its corners are rounded; times in s, speeds in m/s."""

    opening: float
    """The needle leaves its seat."""
    top: float
    """It reaches the stop, or, ballistic, turns."""
    closing: float
    """It leaves the stop; equal to `top` when ballistic."""
    closed: float
    """It is back on its seat."""
    opening_speed: float
    closing_speed: float

    @property
    def peak_lift(self) -> float:
        """Highest lift before rounding [m]."""
        return self.opening_speed * (self.top - self.opening)


def stroke(shot: Shot, start: float, rail_pressure: float, parameters: InjectorParameters) -> Stroke | None:
    """Needle stroke of a shot of an event at `start` [s]; None if it is too short to lift the needle."""
    needle = parameters.needle
    energized = start + shot.offset
    opening = energized + needle.opening_delay
    closing = energized + shot.duration + needle.closing_delay
    if closing <= opening:
        return None
    relative_pressure = rail_pressure / REFERENCE_PRESSURE
    opening_speed = needle.opening_speed * relative_pressure**OPENING_EXPONENT
    closing_speed = needle.closing_speed * relative_pressure**CLOSING_EXPONENT
    top = min(closing, opening + parameters.seat.max_lift / opening_speed)
    peak_lift = opening_speed * (top - opening)
    return Stroke(opening, top, closing, closing + peak_lift / closing_speed, opening_speed, closing_speed)


def strokes(schedule: Schedule, parameters: InjectorParameters) -> tuple[Stroke, ...]:
    """All needle strokes of a schedule, in order.

    Raises `UserError` when a needle would have to open again before it has closed.
    """
    placed = [
        (event, found)
        for event in schedule.events
        for shot in event.shots
        if (found := stroke(shot, event.start, event.rail_pressure, parameters)) is not None
    ]
    for (event, before), (next_event, after) in pairwise(placed):
        if before.closed + CORNER_ROUNDING > after.opening:
            late = before.closed + CORNER_ROUNDING - after.opening
            raise UserError(
                SHOTS_OPTION if event is next_event else PERIOD_OPTION,
                f"the needle has not closed when the next shot opens it, {after.opening:.6g} s in",
                f"start that shot at least {late / MILLISECOND:.3g} ms later",
            )
    return tuple(found for _, found in placed)


@inner
def _area_under_ramp(time: float) -> float:
    return 0.5 * time * time if time > 0.0 else 0.0


@inner
def _area_under_stroke(time: float, s: Stroke) -> float:
    """Integral of the unrounded lift up to `time`: four ramps [m s]."""
    rise: float = _area_under_ramp(time - s.opening) - _area_under_ramp(time - s.top)
    fall: float = _area_under_ramp(time - s.closing) - _area_under_ramp(time - s.closed)
    return s.opening_speed * rise - s.closing_speed * fall


@compiled
def lift_of_stroke(time: float, s: Stroke) -> float:
    """Lift [m] at `time` [s] with rounded corners; exactly 0 outside the stroke."""
    half = 0.5 * CORNER_ROUNDING
    if time <= s.opening - half or time >= s.closed + half:
        return 0.0
    area: float = _area_under_stroke(time + half, s) - _area_under_stroke(time - half, s)
    return max(area / CORNER_ROUNDING, 0.0)
