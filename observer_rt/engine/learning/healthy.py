"""What a fitted model leaves of a healthy injector, and its shape: observer and `discover` do not object to it.

No model of a real line is exact: after the needle leaves its seat, and after it is back, it leaves a course that
comes back in every injection and changes with the rail pressure. Without it, an injector is compared with the healthy
one.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from observer_rt.core.model.needle import NeedleStroke
from observer_rt.engine.estimation.parameters import NEEDLE_LAW, LearnedModel
from observer_rt.engine.estimation.phases import BLOCKS, PHASES, Phase, PhaseStatistics
from observer_rt.engine.estimation.predictor import Setting, Window
from observer_rt.foundation.units import MEGAPASCAL, Floats
from observer_rt.model.baseline import Appearance, Baseline, HealthyRemainder, HealthyShape, PhaseFigures, Remainder
from observer_rt.model.effective import LAG_UNIT, Coefficients

KNOTS = 1e-6 * np.concatenate(
    [np.arange(-40.0, 400.0, 20.0), np.arange(400.0, 1200.0, 40.0), np.arange(1200.0, 4001.0, 100.0)]
)
"""Times [s] after an opening, or a closing, between which the course is straight; 0 before and after."""
CENTRE, SPAN = 100 * MEGAPASCAL, 40 * MEGAPASCAL  # of the rail pressure, with which the courses change linearly
STEP = 2.5e-6  # s, either way, by which an edge is moved for a slope
_at = partial(np.interp, xp=KNOTS, left=0.0, right=0.0)  # times, fp: course
SPREAD = 0.6  # standard deviation of a knot before anything was measured, in sigma of an innovation
_DIGITS = 5  # of MPa: 10 Pa
EDGES = (Phase.OPENING, Phase.CLOSING)
# Mean square of single samples at an edge that a fitted model may leave: the flow scatters where the lift has a
# corner, and more in injections not fitted. A biased mass shows in means of blocks.
SCATTER = 2.0
_FOR_NAMING = ("shape", "appears", "line_pressure_offset_MPa")
SAME_RATE = 0.01  # share by which sample rates may differ and a baseline still holds: blocks count samples


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

    def times(self, at: float) -> Floats:
        """Times [s] (n,) of the samples after a position."""
        return np.asarray(self.interval * (np.arange(self.samples) - at), np.float64)


def expected(shape: HealthyShape, stretch: EventStretch) -> Floats:
    """Mean innovation [Pa] (n,) of a healthy injector over a stretch."""
    courses, total = _courses(shape, stretch), np.zeros(stretch.samples)
    for edges in stretch.openings:
        for course, edge in zip(courses, edges, strict=True):
            total += _at(stretch.times(edge), fp=course)
    return total


def expected_in(shape: HealthyShape, window: Window, c: Coefficients, interval: float) -> Floats:
    """Mean innovation [p_0] (n,) over a window of samples of an interval [s], whose lift was recorded."""
    return expected(shape, stretch_of(window, c, interval))[: window.output.size] / c.pressure_scale


class NeedleCourse(NamedTuple):
    """Mean innovation over a window whose needle answers commands, and how it changes with the needle."""

    expected: Floats  # (n,) [p_0]
    by_numbers: Floats  # (n, NEEDLE_NUMBERS) by the columns of theta that are numbers of its law
    by_shots: Floats  # (n, 2 shots) by both delays of each [LAG_UNIT]


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
    before = float(window.inputs[min(window.opening, len(window.inputs) - 1), 0])
    return before * c.pressure_scale + c.chamber_pressure


def _beyond(area: Floats, edge: int, inwards: int) -> float:
    """Share of a sample by which a flank begins beyond the last sample on it."""
    further = edge + inwards
    if not 0 <= further < area.size or area[further] <= area[edge]:
        return 0.0
    return min(float(area[edge] / (area[further] - area[edge])), 1.0)


def _courses(shape: HealthyShape, stretch: EventStretch) -> Floats:
    """Courses [Pa] (2, knots) after an opening and after a closing, at the pressure of a stretch."""
    at_centre, slope = (shape.opening, shape.closing), (shape.opening_slope, shape.closing_slope)
    return MEGAPASCAL * (np.array(at_centre) + stretch.pressure * np.array(slope))


def _edges_by_needle(stroke: NeedleStroke) -> tuple[tuple[float, Floats], ...]:
    """Opening and closing of a stroke [s], and how they move with delay and speed of opening, then of closing."""
    falls = stroke.closed - stroke.closing
    if stroke.top < stroke.closing:  # it gets to its stop
        closed = np.array([0.0, 0.0, 1.0, -falls])
    else:
        slower = stroke.opening_speed / stroke.closing_speed
        closed = np.array([-slower, falls, 1.0 + slower, -falls])
    return (stroke.opening, np.array([1.0, 0.0, 0.0, 0.0])), (stroke.closed, closed)


def together(first: HealthyShape, second: HealthyShape) -> HealthyShape:
    """Both courses added up."""
    added = {
        name: tuple(round(a + b, _DIGITS) for a, b in zip(getattr(first, name), getattr(second, name), strict=True))
        for name in HealthyShape.model_fields
    }
    return HealthyShape(**added)


Seen = Sequence[tuple[EventStretch, Floats]]
"""Events with their normalised innovations (n,)."""


class ShapeFit:
    """The shape that explains innovations of healthy recordings best: least squares with a prior on every knot."""

    def __init__(self, recordings: Sequence[Seen], sigma: float) -> None:
        """recordings: events of each; sigma: standard deviation of an innovation [Pa]."""
        self._parts = [_normal_equations(seen) for seen in recordings]
        self._sigma = sigma

    def shape(self, left_out: int | None = None) -> HealthyShape:
        """Fits the shape to all recordings, or to all but the one with this number."""
        kept = [part for number, part in enumerate(self._parts) if number != left_out]
        information = np.sum([part[0] for part in kept], axis=0)
        gradient = np.sum([part[1] for part in kept], axis=0)
        solution = np.linalg.solve(information + np.eye(gradient.size) / SPREAD**2, gradient)
        courses = np.round(solution.reshape(4, KNOTS.size) * self._sigma / MEGAPASCAL, _DIGITS).tolist()
        return HealthyShape(**dict(zip(HealthyShape.model_fields, courses, strict=True)))


def _normal_equations(seen: Seen) -> tuple[Floats, Floats]:
    """Information (p, p) and gradient (p,) of the knots, opening and closing, each constant and with pressure."""
    size = KNOTS.size
    information, gradient = np.zeros((4 * size, 4 * size)), np.zeros(4 * size)
    for stretch, z in seen:
        design = np.zeros((stretch.samples, 4 * size))
        for edges in stretch.openings:
            for number, edge in enumerate(edges):
                hats = _hats(stretch.times(edge))
                design[:, 2 * number * size : (2 * number + 1) * size] += hats
                design[:, (2 * number + 1) * size : (2 * number + 2) * size] += stretch.pressure * hats
        information += design.T @ design
        gradient += design.T @ z
    return information, gradient


def _hats(after: Floats) -> Floats:
    """Weights (n, knots) of a course that is straight between its knots, at times (n,) [s]."""
    result = np.zeros((after.size, KNOTS.size))
    rows = np.flatnonzero((after >= KNOTS[0]) & (after < KNOTS[-1]))
    before = np.searchsorted(KNOTS, after[rows], "right") - 1
    share = (after[rows] - KNOTS[before]) / (KNOTS[before + 1] - KNOTS[before])
    result[rows, before] = 1.0 - share
    result[rows, before + 1] = share
    return result


@dataclass(frozen=True, eq=False)
class Healthy:
    """Innovations of the healthy injector; by default those of an exact model: white, and no event scatters more."""

    variance: Floats = field(default_factory=lambda: np.ones(PHASES))  # at least 1, without the shape
    colour: Floats = field(default_factory=lambda: np.ones((PHASES, len(BLOCKS))))  # the same, of blocks
    mass_share: float = 0.0  # standard deviation of a mass, as a share, by the model
    adequate: bool = True  # whether the fitted model may be learned, or named, with at all
    live_variance: float = 1.0  # largest variance of a phase with the shape in it
    shape: HealthyShape | None = None  # mean course; None: 0
    overdispersion: float = 1.0  # factor by which events scatter beyond noise
    appears: Mapping[str, Appearance] = field(default_factory=dict)  # effects it seems to have; for `discover`
    line_pressure_offset_MPa: float = 0.0  # noqa: N815 - as in [baseline]; for `discover`
    rate: PhaseStatistics | None = None  # innovations of a measured injection rate; for `discover`
    seen: tuple[float, float] = (-math.inf, math.inf)  # line pressures [Pa] at which laws in force were seen

    def relative(self, statistics: PhaseStatistics) -> PhaseStatistics:
        """Statistics of an event relative to those of the healthy injector."""
        return statistics.relative_to(self.variance, self.colour)


NOT_FITTED = Healthy()
"""Remainder of a model that was not fitted to recordings."""


def healthy_of(baseline: Baseline | None, sample_rate: float, trusted: bool = False) -> Healthy:
    """Healthy injector of a fitted file at a sample rate [Hz]; trusted: learn even if its model is inadequate."""
    if baseline is None:
        return NOT_FITTED
    share, adequate = baseline.mass_share, baseline.adequate or trusted
    if not is_same_rate(baseline.sample_rate_Hz, sample_rate):
        return Healthy(mass_share=share, adequate=adequate)
    observer, live_variance = baseline.observer, float(_with_scatter(baseline.variance).max())
    if observer is None:
        colour = at_least_noise(baseline.chi2, baseline.colour)
        return Healthy(_with_scatter(baseline.variance), colour, share, adequate, live_variance)
    return Healthy(
        _with_scatter(observer.variance),
        at_least_noise(observer.colour, observer.colour),
        share,
        adequate,
        live_variance,
        observer.shape,
        observer.overdispersion,
    )


def with_remainder(healthy: Healthy, remainder: Remainder | None, sample_rate: float) -> Healthy:
    """Healthy injector whose accepted terms leave a remainder, too; None: they leave none. sample_rate: [Hz].

    Uncertainties of masses add in quadrature; of innovations the larger limit of the two holds.
    """
    if remainder is None:
        return healthy
    widened = replace(healthy, mass_share=math.hypot(healthy.mass_share, remainder.mass_share))
    left = remainder.observer
    if left is None or not is_same_rate(remainder.sample_rate_Hz, sample_rate):
        return widened
    live_variance = float(_with_scatter(remainder.variance).max())
    return replace(
        widened,
        variance=np.maximum(healthy.variance, _with_scatter(left.variance)),
        colour=np.maximum(healthy.colour, at_least_noise(left.colour, left.colour)),
        live_variance=max(healthy.live_variance, live_variance),
        shape=left.shape,  # of all that the model leaves
        overdispersion=max(healthy.overdispersion, left.overdispersion),
    )


def healthy_for_naming(
    left: Baseline | HealthyRemainder, adequate: bool, rate: PhaseStatistics | None = None
) -> Healthy:
    """Healthy injector for `discover`; a `Baseline` gives only variance and colour; rate: innovations of its rate."""
    kept_fields = {} if isinstance(left, Baseline) else {name: getattr(left, name) for name in _FOR_NAMING}
    variance, colour = at_least_noise(left.variance)[:, 0], at_least_noise(left.colour, left.colour)
    return Healthy(variance, colour, adequate=adequate, rate=rate, **kept_fields)


def at_least_noise(*figures: PhaseFigures) -> Floats:
    """Mean squares (PHASES, len(figures)), none below that of noise alone."""
    return np.maximum([[each.at(phase.name) for each in figures] for phase in Phase], 1.0)


def _with_scatter(left: PhaseFigures) -> Floats:
    variance = at_least_noise(left)[:, 0]
    variance[list(EDGES)] = np.maximum(variance[list(EDGES)], SCATTER)
    return variance


def is_same_rate(first: float, second: float) -> bool:
    """Whether blocks of innovations at two sample rates [Hz] span the same time."""
    return math.isclose(first, second, rel_tol=SAME_RATE)
