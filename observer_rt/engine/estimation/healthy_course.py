"""Mean innovations that a fitted model leaves of a healthy injector, over an event; they go with its needle.

No model of a real line is exact. What it leaves of the healthy injector comes back in every injection: one course
after the needle leaves its seat, one after it is back on it, both changing with the rail pressure. With it taken out,
an injector is compared with the healthy one instead of with the model.
"""

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.needle import NeedleStroke
from observer_rt.engine.estimation.predictor import Setting, Window
from observer_rt.engine.estimation.scalars import NEEDLE_LAW, LearnedModel
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.baseline import HealthyShape
from observer_rt.model.effective import LAG_UNIT, Coefficients

KNOTS = 1e-6 * np.concatenate(
    [np.arange(-40.0, 400.0, 20.0), np.arange(400.0, 1200.0, 40.0), np.arange(1200.0, 4001.0, 100.0)]
)
"""Times [s] after an opening, or a closing, between which the course is straight; 0 before and after."""
CENTRE, SPAN = 100 * MEGAPASCAL, 40 * MEGAPASCAL  # of the rail pressure, with which the courses change linearly
STEP = 2.5e-6  # s, either way, by which an edge is moved for a slope
_at = partial(np.interp, xp=KNOTS, left=0.0, right=0.0)  # times, fp: course


class EventStretch(NamedTuple):
    """Consecutive samples round one event."""

    samples: int
    interval: float  # of samples [s]
    rail_pressure: float  # before the event [Pa]
    openings: tuple[tuple[float, float], ...]  # begin and end of each [samples from the first one, with fractions]

    @property
    def pressure(self) -> float:
        """Rail pressure in the unit by which courses change."""
        return (self.rail_pressure - CENTRE) / SPAN

    def times(self, at: float) -> NDArray[np.float64]:
        """Times [s] (n,) of the samples after a position."""
        return np.asarray(self.interval * (np.arange(self.samples) - at), np.float64)


def expected(shape: HealthyShape, stretch: EventStretch) -> NDArray[np.float64]:
    """Mean innovation [Pa] (n,) of a healthy injector over a stretch."""
    courses, total = _courses(shape, stretch), np.zeros(stretch.samples)
    for edges in stretch.openings:
        for course, edge in zip(courses, edges, strict=True):
            total += _at(stretch.times(edge), fp=course)
    return total


def expected_in(shape: HealthyShape, window: Window, c: Coefficients, interval: float) -> NDArray[np.float64]:
    """Mean innovation [p_0] (n,) over a window of samples of an interval [s], whose lift was recorded."""
    return expected(shape, stretch_of(window, c, interval))[: window.output.size] / c.pressure_scale


class NeedleCourse(NamedTuple):
    """Mean innovation over a window whose needle answers commands, and how it changes with the needle."""

    expected: NDArray[np.float64]  # (n,) [p_0]
    by_numbers: NDArray[np.float64]  # (n, NEEDLE_NUMBERS) by the columns of theta that are numbers of its law
    by_shots: NDArray[np.float64]  # (n, 2 shots) by both delays of each [LAG_UNIT]


def needle_course(shape: HealthyShape, window: Window, learned: LearnedModel, setting: Setting) -> NeedleCourse:
    """Mean innovation of a needle that answers the commands of a window as was learned of it."""
    n, interval, scale = window.output.size, setting.interval, setting.coefficients.pressure_scale
    stretch = EventStretch(n, interval, _rail_pressure(window, setting.coefficients), ())
    courses, total = _courses(shape, stretch) / scale, np.zeros(n)
    by_numbers, by_shots = np.zeros((n, NEEDLE_LAW.columns.size)), np.zeros((n, window.shot_columns))
    for shot, stroke in enumerate(window.strokes(learned, setting)):
        if stroke is None:
            continue
        for course, (edge, moves) in zip(courses, _edges_by_needle(stroke), strict=True):
            times = stretch.times(edge / interval)
            total += _at(times, fp=course)
            later = np.asarray(_at(times - STEP, fp=course) - _at(times + STEP, fp=course)) / (2.0 * STEP)
            by_numbers[:, : len(moves)] += later[:, None] * moves
            by_shots[:, 2 * shot : 2 * shot + 2] += later[:, None] * moves[::2]
    return NeedleCourse(total, by_numbers * NEEDLE_LAW.sizes, by_shots * LAG_UNIT)


def stretch_of(window: Window, c: Coefficients, interval: float) -> EventStretch:
    """Stretch of a window for `expected`; its edges lie where the straight flanks of the seat area reach 0."""
    area = window.inputs[:, 1]
    changes = np.flatnonzero(np.diff(np.concatenate(([False], area > 0.0, [False])).astype(np.int8)))
    edges = [
        (first - _beyond(area, first, 1), last + _beyond(area, last, -1))
        for first, last in zip(changes[::2].tolist(), (changes[1::2] - 1).tolist(), strict=True)
    ]
    return EventStretch(area.size, interval, _rail_pressure(window, c), tuple(edges))


def _rail_pressure(window: Window, c: Coefficients) -> float:
    """Before the event [Pa]."""
    before = float(window.inputs[min(window.opening, len(window.inputs) - 1), 0])
    return before * c.pressure_scale + c.chamber_pressure


def _beyond(area: NDArray[np.float64], edge: int, inwards: int) -> float:
    """Share of a sample by which a flank begins beyond the last sample on it."""
    further = edge + inwards
    if not 0 <= further < area.size or area[further] <= area[edge]:
        return 0.0
    return min(float(area[edge] / (area[further] - area[edge])), 1.0)


def _courses(shape: HealthyShape, stretch: EventStretch) -> NDArray[np.float64]:
    """Courses [Pa] (2, knots) after an opening and after a closing, at the pressure of a stretch."""
    at_centre, slope = (shape.opening, shape.closing), (shape.opening_slope, shape.closing_slope)
    return MEGAPASCAL * (np.array(at_centre) + stretch.pressure * np.array(slope))


def _edges_by_needle(stroke: NeedleStroke) -> tuple[tuple[float, NDArray[np.float64]], ...]:
    """Opening and closing of a stroke [s], and how they move with delay and speed of opening, then of closing."""
    falls = stroke.closed - stroke.closing
    if stroke.top < stroke.closing:  # it gets to its stop
        closed = np.array([0.0, 0.0, 1.0, -falls])
    else:
        slower = stroke.opening_speed / stroke.closing_speed
        closed = np.array([-slower, falls, 1.0 + slower, -falls])
    return (stroke.opening, np.array([1.0, 0.0, 0.0, 0.0])), (stroke.closed, closed)
